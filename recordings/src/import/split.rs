//! Several records in one file: runs that a column numbers, a clock that starts again, pauses of the logger.

use std::ops::Range;

use super::mapping::Mapping;
use super::names::find;
use super::source::{Exactness, Source, Variable};
use super::stamp::Stamped;
use crate::error::{DataError, FilePlace};
use crate::sampling::PrintedTimes;
use crate::thresholds::RULES;

/// The rows of a record in its file, and the number of its run if a column has it.
pub(super) struct Part {
    pub(super) rows: Range<usize>,
    pub(super) run: Option<u64>,
}

impl Mapping {
    /// The records of a file, which begin where the variable `split_by` changes; none without that variable. If it is the
    /// time, a record begins where the time starts again and after a pause.
    ///
    /// # Errors
    /// [`DataError`] if the file has no such variable.
    pub(super) fn parts(&self, source: &Source) -> Result<Vec<Part>, DataError> {
        let Some(by) = &self.split_by else {
            return Ok(Vec::new());
        };
        let file = FilePlace::file(source.path());
        let variable = find(source, by, &file)?;
        let n = variable.values.len();
        let place = |variable: &Variable, row: usize| {
            let here = file.clone().in_column(&variable.name);
            match source.lines.get(row) {
                Some(line) => here.at_line(*line),
                None => here,
            }
        };
        let time = self.times(source, n, &place)?;
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
            rows: from..to,
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
    /// The file with only these of the `n` rows that it is split by; variables of another length stay whole.
    pub(super) fn part(&self, rows: &Range<usize>, n: usize) -> Self {
        let own = |variable: &Variable| match variable.values.len() == n {
            true => variable.part(rows),
            false => variable.clone(),
        };
        let mut part = Self {
            path: self.path.clone(),
            variables: self.variables.iter().map(own).collect(),
            skipped: self.skipped.clone(),
            unread: self.unread.clone(),
            remarks: self.remarks.clone(),
            lines: Vec::new(),
            dialect: self.dialect.clone(),
        };
        for variable in &mut part.variables {
            if let (Some(stamped), Some(line)) = (&mut variable.stamped, self.lines.get(rows.start))
                && rows.start > 0
            {
                stamped.first = format!("line {line}");
            }
        }
        if self.lines.len() == n {
            part.lines = self.lines[rows.clone()].to_vec();
        }
        part
    }
}

impl Variable {
    fn part(&self, rows: &Range<usize>) -> Self {
        let cut = |all: &[f64]| all.get(rows.clone()).unwrap_or_default().to_vec();
        let stamped = self.stamped.as_ref().map(|stamped| {
            let start = stamped.seconds.get(rows.start).copied().unwrap_or(0.0);
            let mut seconds = cut(&stamped.seconds);
            seconds.iter_mut().for_each(|s| *s -= start);
            Stamped {
                kind: stamped.kind,
                first: stamped.first.clone(),
                seconds,
                of_day: cut(&stamped.of_day),
                unit: cut(&stamped.unit),
                midnights: stamped.midnights,
            }
        });
        let inside = self.blanks.partition_point(|row| *row < rows.start);
        let blanks = self.blanks.iter().skip(inside);
        let blanks = blanks.take_while(|row| **row < rows.end);
        Self {
            name: self.name.clone(),
            unit: self.unit.clone(),
            values: cut(&self.values),
            exactness: match &self.exactness {
                Exactness::Printed(units) => Exactness::Printed(cut(units)),
                relative => relative.clone(),
            },
            blanks: blanks.map(|row| row - rows.start).collect(),
            stamped,
            notes: self.notes.clone(),
        }
    }
}
