//! The variables of a file, whatever its format.

use std::path::{Path, PathBuf};

use super::problem::ImportProblem;
use crate::error::{DataError, FilePlace, printable};

/// The most that is read of one file, also of what is packed inside it, bytes.
pub(super) const LARGEST: u64 = 2 << 30;

/// How exactly the values of a variable stand in the file: what a time may be wrong by.
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
    /// As the file or its program would write it: `u`, `run.u`, `data(:,2)`, `data[:,1]`.
    pub name: String,
    /// As the header states it; none where it does not.
    pub unit: Option<String>,
    /// Its values.
    pub values: Vec<f64>,
    pub(super) exactness: Exactness,
}

/// A file's variables.
#[derive(Debug, Clone)]
pub struct Source {
    pub(super) path: PathBuf,
    /// What was read, in the order of the file.
    pub variables: Vec<Variable>,
    /// Variables that hold no column of numbers: name and why.
    pub skipped: Vec<(String, String)>,
    /// How the file was understood, in words.
    pub dialect: String,
    /// The line of each sample; none for binary files.
    pub(super) lines: Vec<u64>,
}

impl Source {
    pub(super) fn new(dialect: impl Into<String>) -> Self {
        Self {
            path: PathBuf::new(),
            variables: Vec::new(),
            skipped: Vec::new(),
            dialect: dialect.into(),
            lines: Vec::new(),
        }
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn get(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|v| v.name == name)
    }

    /// The names with their lengths, for messages.
    pub(super) fn listed(&self) -> String {
        const MOST: usize = 24;
        let each = |v: &Variable| {
            let name = printable(&v.name);
            match v.values.as_slice() {
                [one] => format!("`{name}` = {one}"),
                many => format!("`{name}` ({})", many.len()),
            }
        };
        let mut list: Vec<String> = self.variables.iter().map(each).take(MOST).collect();
        if self.variables.len() > MOST {
            list.push(format!("{} more", self.variables.len() - MOST));
        }
        let skipped = self.skipped.iter().take(MOST);
        list.extend(skipped.map(|(name, why)| format!("`{}` (unusable: {why})", printable(name))));
        match list.is_empty() {
            true => "no variable at all".to_owned(),
            false => list.join(", "),
        }
    }

    /// An array as columns: a vector as itself, a matrix column by column, or row by row where it lies on its side. `at` gives
    /// the element in a row and column.
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
            });
        };
        match (long.as_slice(), shape) {
            ([], _) => push(name.to_owned(), vec![at(0, 0)]),
            ([n], _) => {
                // Length in whichever place, read along it.
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

/// How a program writes a part of an array.
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

/// A fault of a file whose path the reader does not know: [`Source::open`] adds it.
pub(super) fn fault(problem: ImportProblem) -> DataError {
    FilePlace::default().error(problem.into())
}

pub(super) fn damaged(what: &'static str) -> DataError {
    fault(ImportProblem::Damaged(what))
}
