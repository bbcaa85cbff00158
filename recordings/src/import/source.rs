//! The variables of a file, whatever its format.

use std::path::{Path, PathBuf};

use super::cell::name_and_unit;
use super::problem::ImportProblem;
use super::stamp::Stamped;
use crate::error::{DataError, FilePlace, printable};
use crate::memory;

/// Bytes of memory per value of a column, including its copy in a record.
pub(super) const VALUE: u64 = 16;

/// Memory used by reading so far.
#[derive(Debug)]
pub(super) struct Budget {
    taken: u64,
}

impl Budget {
    /// A budget with this many bytes already used.
    pub(super) fn with(taken: u64) -> Self {
        Self { taken }
    }

    /// Reserves memory before it is allocated.
    pub(super) fn take(&mut self, bytes: u64, what: impl Fn() -> String) -> Result<(), DataError> {
        const REMEDY: &str = "save fewer variables, or phase-average with `host-fit average`";
        let taken = self.taken.saturating_add(bytes);
        // The message is built only if needed.
        if taken > memory::limit() {
            memory::allow(taken, &what(), REMEDY).map_err(|error| fault(error.into()))?;
        }
        self.taken = taken;
        Ok(())
    }

    /// Reserves the memory of an array with this many values.
    pub(super) fn take_array(&mut self, name: &str, count: usize) -> Result<(), DataError> {
        let bytes = (count as u64).saturating_mul(VALUE);
        self.take(bytes, || format!("the array `{}`", printable(name)))
    }

    /// Releases memory.
    pub(super) fn give(&mut self, bytes: u64) {
        self.taken = self.taken.saturating_sub(bytes);
    }
}

/// Precision of the values in the file, which limits that of times.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Exactness {
    /// One unit in the last printed place of each value.
    Printed(Vec<f64>),
    /// Relative, for binary numbers.
    Relative(f64),
}

/// One column of numbers.
#[derive(Debug, Clone)]
pub struct Variable {
    /// Name in the notation of its program: `u`, `run.u`, `data(:,2)`, `data[:,1]`.
    pub name: String,
    /// Unit in the header, if any.
    pub unit: Option<String>,
    /// Values of the variable.
    pub values: Vec<f64>,
    pub(super) exactness: Exactness,
    /// Rows with an empty cell of this variable; their values are NaN.
    pub(super) blanks: Vec<usize>,
    /// The dates or clock times of the cells, if they are stamps.
    pub(super) stamped: Option<Stamped>,
    /// Remarks on the interpretation of the cells.
    pub(super) notes: Vec<String>,
}

impl Variable {
    /// The lowest and the highest value; `None` without a value.
    pub(super) fn range(&self) -> Option<(f64, f64)> {
        let mut present = self.values.iter().copied().filter(|value| !value.is_nan());
        let first = present.next()?;
        Some(present.fold((first, first), |(low, high), v| (low.min(v), high.max(v))))
    }

    /// Whether all values are equal.
    pub(super) fn is_constant(&self) -> bool {
        self.range().is_none_or(|(low, high)| low == high)
    }
}

/// A column of a text table with a cell that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Unread {
    pub(super) name: String,
    /// Line of the first unreadable cell.
    pub(super) line: u64,
    /// Contents of that cell.
    pub(super) text: String,
}

impl Unread {
    /// The remark for an optional column.
    pub(super) fn words(&self) -> String {
        match self.text.is_empty() {
            true => format!("its cell in line {} is empty", self.line),
            false => format!("its cell in line {} reads `{}`", self.line, self.text),
        }
    }

    /// The error for a required column of `file`.
    pub(super) fn error(&self, file: &FilePlace) -> DataError {
        let here = file.clone().at_line(self.line).in_column(&self.name);
        here.error(ImportProblem::Unread(self.text.clone()).into())
    }
}

/// A file's variables.
#[derive(Debug, Clone)]
pub struct Source {
    pub(super) path: PathBuf,
    /// The variables that were read, in the order of the file.
    pub variables: Vec<Variable>,
    /// Variables without a column of numbers: name and reason.
    pub skipped: Vec<(String, String)>,
    /// Columns of a text table that cannot be read.
    pub(super) unread: Vec<Unread>,
    /// Description of the file's format.
    pub dialect: String,
    /// Remarks: skipped lines and ambiguous notations.
    pub(super) remarks: Vec<String>,
    /// The line of each sample; none for binary files.
    pub(super) lines: Vec<u64>,
}

impl Source {
    pub(super) fn new(dialect: impl Into<String>) -> Self {
        Self {
            path: PathBuf::new(),
            variables: Vec::new(),
            skipped: Vec::new(),
            unread: Vec::new(),
            remarks: Vec::new(),
            dialect: dialect.into(),
            lines: Vec::new(),
        }
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The variable of this name, or of this heading: the name with its unit as in the file, `Time (ms)`.
    pub(super) fn get(&self, name: &str) -> Option<&Variable> {
        let by = |test: &dyn Fn(&Variable) -> bool| self.variables.iter().find(|v| test(v));
        let (bare, unit) = name_and_unit(name);
        by(&|v| v.name == name)
            .or_else(|| by(&|v| unit.is_some() && v.name == bare && v.unit == unit))
    }

    /// The names with their ranges, and with their lengths if these differ, for messages.
    pub(super) fn listed(&self) -> String {
        const MOST: usize = 24;
        let all = self.variables.iter().map(|v| v.values.len());
        let mut lengths = all.filter(|length| *length > 1);
        let first = lengths.next();
        let differ = lengths.any(|length| Some(length) != first);
        let each = |v: &Variable| {
            let name = printable(&v.name);
            let count = match differ {
                true => format!("{} values, ", v.values.len()),
                false => String::new(),
            };
            match (v.values.as_slice(), v.range()) {
                ([one], _) => format!("`{name}` = {one}"),
                (_, None) => format!("`{name}` ({count}no number)"),
                (_, Some((low, high))) if low == high => format!("`{name}` ({count}always {low})"),
                (_, Some((low, high))) => format!("`{name}` ({count}{low} to {high})"),
            }
        };
        let mut list: Vec<String> = self.variables.iter().map(each).take(MOST).collect();
        if self.variables.len() > MOST {
            list.push(format!("{} more", self.variables.len() - MOST));
        }
        let skipped = self.skipped.iter().take(MOST);
        list.extend(skipped.map(|(name, why)| format!("`{}` (unusable: {why})", printable(name))));
        let unread = self.unread.iter().take(MOST);
        list.extend(unread.map(|u| format!("`{}` (unusable: {})", printable(&u.name), u.words())));
        match list.is_empty() {
            true => "no variable at all".to_owned(),
            false => list.join(", "),
        }
    }

    /// An array as columns: a vector as one column, a matrix column by column, or row by row if it has more
    /// columns than rows. `at` gives the element in a row and column.
    pub(super) fn add(
        &mut self,
        name: &str,
        shape: &[usize],
        exactness: f64,
        notation: Notation,
        at: &dyn Fn(usize, usize) -> f64,
    ) {
        const MOST_COLUMNS: usize = 256;
        let long: Vec<usize> = shape.iter().copied().filter(|&n| n != 1).collect();
        let mut push = |name: String, values: Vec<f64>| {
            self.variables.push(Variable {
                name,
                unit: None,
                values,
                exactness: Exactness::Relative(exactness),
                blanks: Vec::new(),
                stamped: None,
                notes: Vec::new(),
            });
        };
        match (long.as_slice(), shape) {
            ([], _) => push(name.to_owned(), vec![at(0, 0)]),
            ([n], _) => {
                // The array is read along its only long direction.
                let along_rows = shape.first() == Some(n) || shape.len() == 1;
                let value = |k| if along_rows { at(k, 0) } else { at(0, k) };
                push(name.to_owned(), (0..*n).map(value).collect());
            }
            (&[rows, columns], [_, _]) if rows.min(columns) <= MOST_COLUMNS => {
                if rows >= columns {
                    for c in 0..columns {
                        let values = (0..rows).map(|r| at(r, c)).collect();
                        push(notation.column(name, c), values);
                    }
                } else {
                    for r in 0..rows {
                        let values = (0..columns).map(|c| at(r, c)).collect();
                        push(notation.row(name, r), values);
                    }
                }
            }
            _ => {
                let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
                let why = format!("an array of {}; save its columns", shape.join(" × "));
                self.skipped.push((name.to_owned(), why));
            }
        }
    }
}

/// Notation for a part of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Notation {
    Matlab,
    Numpy,
}

impl Notation {
    fn column(self, name: &str, index: usize) -> String {
        match self {
            Self::Matlab => format!("{name}(:,{})", index + 1),
            Self::Numpy => format!("{name}[:,{index}]"),
        }
    }

    fn row(self, name: &str, index: usize) -> String {
        match self {
            Self::Matlab => format!("{name}({},:)", index + 1),
            Self::Numpy => format!("{name}[{index},:]"),
        }
    }
}

/// An error without the file's path, which [`Source::open`] adds.
pub(super) fn fault(problem: ImportProblem) -> DataError {
    FilePlace::default().error(problem.into())
}

pub(super) fn damaged(what: &'static str) -> DataError {
    fault(ImportProblem::Damaged(what))
}
