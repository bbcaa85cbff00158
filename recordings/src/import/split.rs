//! Several records in one file: runs that a column numbers, a clock that starts again, pauses of the logger.

use std::ops::Range;

use super::mapping::Mapping;
use super::names::find;
use super::source::{Exactness, Source, Variable};
use crate::error::{DataError, FilePlace};
use crate::sampling::PrintedTimes;
use crate::thresholds::RULES;

/// A part of a file, and the number of its run if a column has it.
pub(super) struct Part {
    pub(super) source: Source,
    pub(super) run: Option<u64>,
}

impl Mapping {
    /// The records of a file: one, or those that begin where the variable `split_by` changes. If that is the time, a
    /// record begins where the time starts again and after a pause.
    ///
    /// # Errors
    /// [`DataError`] if the file has no such variable.
    pub(super) fn parts(&self, source: Source) -> Result<Vec<Part>, DataError> {
        let Some(by) = &self.split_by else {
            return Ok(vec![Part { source, run: None }]);
        };
        let file = FilePlace::file(source.path());
        let variable = find(&source, by, &file)?;
        let n = variable.values.len();
        let place = |variable: &Variable, row: usize| {
            let here = file.clone().in_column(&variable.name);
            match source.lines.get(row) {
                Some(line) => here.at_line(*line),
                None => here,
            }
        };
        let time = self.times(&source, n, &place)?;
        let time = time.filter(|time| time.is_from(variable));
        let mut runs = None;
        let begins = match time {
            Some(time) => starts_of(&time.printed),
            None => {
                let values = &variable.values;
                let is_number = |v: &f64| v.fract() == 0.0 && (0.0..1e6).contains(v);
                runs = values.iter().all(is_number).then(|| values.clone());
                let changes = |k: &usize| values[*k].total_cmp(&values[k - 1]).is_ne();
                (1..n).filter(changes).collect()
            }
        };
        let ends = begins.iter().copied().chain([n]);
        let starts = std::iter::once(0).chain(begins.iter().copied());
        let part = |(from, to): (usize, usize)| Part {
            source: source.part(from..to, n),
            run: runs.as_ref().map(|runs| runs[from] as u64),
        };
        Ok(starts.zip(ends).map(part).collect())
    }
}

/// The rows at which the time starts again, and those after a pause.
fn starts_of(times: &PrintedTimes) -> Vec<usize> {
    let (time, unit) = (&times.time, &times.unit);
    let step = |k: usize| time[k] - time[k - 1];
    let mut sorted: Vec<f64> = (1..time.len()).map(step).collect();
    if sorted.is_empty() {
        return Vec::new();
    }
    let middle = sorted.len() / 2;
    let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    let is_start = |k: &usize| {
        let rounding = unit[*k].max(unit[k - 1]);
        step(*k) < 0.0 || step(*k) > (1.0 + RULES.most_uneven) * median + rounding
    };
    (1..time.len()).filter(is_start).collect()
}

impl Source {
    /// The file with only these of its `n` rows; variables of another length stay whole.
    fn part(&self, rows: Range<usize>, n: usize) -> Self {
        let mut part = self.clone();
        for variable in &mut part.variables {
            if variable.values.len() == n {
                variable.keep(&rows);
            }
            if let (Some(stamped), Some(line)) = (&mut variable.stamped, self.lines.get(rows.start))
                && rows.start > 0
            {
                stamped.first = format!("line {line}");
            }
        }
        if part.lines.len() == n {
            part.lines = self.lines[rows].to_vec();
        }
        part
    }
}

impl Variable {
    fn keep(&mut self, rows: &Range<usize>) {
        self.values = self.values[rows.clone()].to_vec();
        if let Exactness::Printed(units) = &mut self.exactness {
            *units = units.get(rows.clone()).unwrap_or_default().to_vec();
        }
        self.blanks.retain(|row| rows.contains(row));
        for row in &mut self.blanks {
            *row -= rows.start;
        }
        if let Some(stamped) = &mut self.stamped {
            for all in [&mut stamped.seconds, &mut stamped.of_day, &mut stamped.unit] {
                *all = all[rows.clone()].to_vec();
            }
            let start = stamped.seconds.first().copied().unwrap_or(0.0);
            stamped.seconds.iter_mut().for_each(|s| *s -= start);
        }
    }
}
