//! Gaps of a file, which are filled if they are short: missing values, and rows that the logger lost.

use super::problem::ImportProblem;
use super::source::Variable;
use crate::error::{DataError, DataProblem, FilePlace};
use crate::sampling::{PrintedTimes, Stated, TimeFault, tidy};
use crate::thresholds::RULES;

/// The place of a variable's value in a row of the file.
type Place<'a> = &'a dyn Fn(&Variable, usize) -> FilePlace;

/// The samples of a file, and the gaps that are filled.
pub(super) struct Gaps {
    /// Longest gap that is filled, s, from the value before it to the value after it; `None`: no gap is filled.
    pub(super) most_s: Option<f64>,
    /// Sampling period, s.
    pub(super) period_s: f64,
    /// The row of each sample in the file; a sample of a lost row has the next row.
    pub(super) rows: Vec<usize>,
}

/// How the missing values of a gap are filled.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Filling {
    /// Linear.
    Interpolated,
    /// The value before the gap.
    Held,
}

/// The times, including those of lost rows, and the row of each in the file; `None` if no row is lost.
pub(super) fn completed(
    times: &PrintedTimes,
    stated: Option<Stated>,
    most_s: f64,
) -> Result<Option<(PrintedTimes, Vec<usize>)>, TimeFault> {
    let Some(lost) = times.lost_rows(stated) else {
        return Ok(None);
    };
    let n = times.time.len();
    let fault = |row: usize, problem: ImportProblem| TimeFault {
        row,
        problem: problem.into(),
    };
    let (mut all, mut rows) = (PrintedTimes::default(), Vec::with_capacity(n));
    let mut before = f64::NAN;
    for (row, ((&time, &unit), &lost)) in times.time.iter().zip(&times.unit).zip(&lost).enumerate()
    {
        let step = time - before;
        if lost > 0.0 && is_longer(step, most_s) {
            return Err(fault(row, long(step, most_s)));
        }
        if rows.len() as f64 + lost > row as f64 + RULES.lost * n as f64 {
            let problem = ImportProblem::ManyLost {
                lost: (rows.len() - row) as f64 + lost,
                share: 100.0 * RULES.lost,
                rows: n,
            };
            return Err(fault(row, problem));
        }
        let parts = lost as usize + 1;
        for part in 1..=parts {
            all.time.push(match part == parts {
                true => time,
                false => before + step * part as f64 / parts as f64,
            });
            all.unit.push(unit);
            rows.push(row);
        }
        before = time;
    }
    Ok(Some((all, rows)))
}

impl Gaps {
    /// Converts `values` from one per row of the file to one per sample. Missing values are NaN and are
    /// filled.
    ///
    /// # Errors
    /// [`DataError`] at a value that is infinite, or missing and not filled.
    pub(super) fn filled(
        &self,
        variable: &Variable,
        values: &[f64],
        filling: Filling,
        place: Place,
        remarks: &mut Vec<String>,
    ) -> Result<Vec<f64>, DataError> {
        let is_fault = |v: &f64| v.is_infinite() || v.is_nan() && self.most_s.is_none();
        if let Some((row, &value)) = (0..).zip(values).find(|(_, v)| is_fault(v)) {
            let problem = match value.is_nan() {
                true if variable.blanks.contains(&row) => ImportProblem::Missing("cell is empty"),
                true => ImportProblem::Missing("value is missing (NaN)"),
                false => return Err(place(variable, row).error(DataProblem::NotFinite(value))),
            };
            return Err(place(variable, row).error(problem.into()));
        }
        let Some(most_s) = self.most_s else {
            return Ok(values.to_vec());
        };
        let is_lost = |k: usize| self.rows.get(k) == self.rows.get(k + 1);
        let of_row = |row: &usize| values.get(*row).copied().unwrap_or(f64::NAN);
        let mut samples: Vec<f64> = self.rows.iter().map(of_row).collect();
        let n = samples.len();
        for k in (0..n).filter(|&k| is_lost(k)) {
            samples[k] = f64::NAN;
        }
        let fault = |k: usize, problem: ImportProblem| {
            let row = self.rows.get(k).copied().unwrap_or(0);
            Err(place(variable, row).error(problem.into()))
        };
        let present: Vec<usize> = (0..n).filter(|&k| !samples[k].is_nan()).collect();
        match (present.first(), present.last()) {
            (Some(0), Some(&last)) if last + 1 == n => {}
            (Some(0), Some(&last)) => return fault(last + 1, ImportProblem::MissingAtEnd("end")),
            _ => return fault(0, ImportProblem::MissingAtEnd("start")),
        }
        for ends in present.windows(2) {
            let (from, to) = (ends[0], ends[1]);
            let length_s = (to - from) as f64 * self.period_s;
            if to - from > 1 && is_longer(length_s, most_s) {
                return fault(from + 1, long(length_s, most_s));
            }
            for k in from + 1..to {
                let share = (k - from) as f64 / (to - from) as f64;
                samples[k] = match filling {
                    Filling::Interpolated => samples[from] + share * (samples[to] - samples[from]),
                    Filling::Held => samples[from],
                };
            }
        }
        let missing = (0..values.len()).filter(|&row| values[row].is_nan());
        let missing: Vec<usize> = missing.collect();
        if !missing.is_empty() {
            let how = match filling {
                Filling::Interpolated => "interpolated",
                Filling::Held => "repeated",
            };
            remarks.push(format!(
                "`{}`: {} of {} values are {how} ({})",
                variable.name,
                missing.len(),
                values.len(),
                listed(&missing, variable, place)
            ));
        }
        Ok(samples)
    }
}

/// The remark on lost rows; none if every row of the file is one sample.
pub(super) fn inserted(rows: &[usize], time: &Variable, place: Place) -> Option<String> {
    let lost = rows.windows(2).filter(|pair| pair[0] == pair[1]);
    let mut before: Vec<usize> = lost.map(|pair| pair[0]).collect();
    let count = before.len();
    before.dedup();
    (count > 0).then(|| {
        format!(
            "{count} missing row(s) are inserted (before {}): u keeps its last value, the others are interpolated",
            listed(&before, time, place)
        )
    })
}

/// Line numbers of the first of these rows; sample numbers for files without lines.
fn listed(rows: &[usize], variable: &Variable, place: Place) -> String {
    const MOST: usize = 5;
    let places = || rows.iter().take(MOST).map(|&row| place(variable, row));
    let kind = match places().all(|at| at.line.is_some()) {
        true => "line",
        false => "sample",
    };
    let number = |at: FilePlace| at.line.or(at.sample.map(|k| k as u64)).unwrap_or(0);
    let numbers: Vec<String> = places().map(|at| number(at).to_string()).collect();
    let plural = if rows.len() > 1 { "s" } else { "" };
    let more = match rows.len().saturating_sub(MOST) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{kind}{plural} {}{more}", numbers.join(", "))
}

/// Whether a gap is longer than the longest that is filled; rounding errors do not count.
fn is_longer(length_s: f64, most_s: f64) -> bool {
    length_s > most_s * (1.0 + 1e-6)
}

fn long(length_s: f64, most_s: f64) -> ImportProblem {
    ImportProblem::LongGap {
        length_s: tidy(length_s, 1e-7),
        most_s,
    }
}
