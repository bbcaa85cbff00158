//! A raw recording as a stream of samples: one row in memory; faulty rows are reported and do not end the
//! stream.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use crate::error::{DataError, DataProblem};
use crate::rows::{RowReader, number, open_text};
use crate::sampling::tidy;
use crate::thresholds::RULES;

/// Longest gap in samples that is resolved; a longer gap counts as one of this length.
const FARTHEST: f64 = 1e15;

/// Destination of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slot {
    Time,
    Command,
    Value(usize),
}

/// Position of a row relative to the previous one on the sampling grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// This many samples after the preceding row (1 = the next sample; more = samples are missing in between).
    Forward(u64),
    /// Time decreased or did not change: the recording was restarted.
    Restart,
    /// Off the grid, or without a readable time: treated as the next sample, excluded from averaging.
    OffGrid,
}

/// One row; its values are in the caller's buffer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RawRow {
    pub(crate) line: u64,
    pub(crate) step: Step,
    /// Whether the command is on; `None` if it is not on/off or unreadable.
    pub(crate) on: Option<bool>,
    /// Whether all values are finite numbers.
    pub(crate) readable: bool,
}

/// Reads rows of `t,u,y` and further channels in order.
pub(crate) struct RawReader<R> {
    rows: RowReader<R>,
    slots: Vec<Slot>,
    names: Vec<String>,
    sample_period_s: f64,
    last_time: Option<f64>,
}

impl RawReader<BufReader<File>> {
    /// Opens a file; its sampling period is taken from its first rows.
    pub(crate) fn open(path: &Path) -> Result<Self, DataError> {
        let open = || open_text(path, 1 << 18);
        let sample_period_s = head_period(open()?, path)?;
        Self::new(open()?, path, sample_period_s)
    }
}

impl<R: BufRead> RawReader<R> {
    fn new(source: R, path: &Path, sample_period_s: f64) -> Result<Self, DataError> {
        let rows = RowReader::new(source, path)?;
        let (time, command) = (rows.required("t")?, rows.required("u")?);
        rows.required("y")?;
        if let Some(name) = rows
            .names()
            .iter()
            .find(|n| matches!(n.as_str(), "y_sd" | "y_min" | "y_max"))
        {
            return Err(rows
                .here()
                .in_column(name)
                .error(DataProblem::ReservedChannel));
        }
        let mut names = vec!["y".to_owned()];
        let mut slots = Vec::with_capacity(rows.names().len());
        for (i, name) in rows.names().iter().enumerate() {
            slots.push(if i == time {
                Slot::Time
            } else if i == command {
                Slot::Command
            } else if name == "y" {
                Slot::Value(0)
            } else {
                names.push(name.clone());
                Slot::Value(names.len() - 1)
            });
        }
        Ok(Self {
            rows,
            slots,
            names,
            sample_period_s,
            last_time: None,
        })
    }

    /// Names of the values of a row, `y` first.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// Sampling period, s.
    pub(crate) fn sample_period_s(&self) -> f64 {
        self.sample_period_s
    }

    /// Bytes read so far.
    pub(crate) fn bytes(&self) -> u64 {
        self.rows.bytes()
    }

    /// The next row; its values are written to `values` (as long as [`Self::names`]).
    pub(crate) fn next_row(&mut self, values: &mut [f64]) -> Result<Option<RawRow>, DataError> {
        if !self.rows.advance()? {
            return Ok(None);
        }
        let mut time = None;
        let mut on = None;
        let mut readable = true;
        let mut count = 0;
        for (i, cell) in self.rows.cells().enumerate() {
            count = i + 1;
            let Some(slot) = self.slots.get(i) else { break };
            let value = number(cell).ok().filter(|v| v.is_finite());
            match *slot {
                Slot::Time => time = value,
                Slot::Command => {
                    readable &= value.is_some();
                    on = match value {
                        Some(0.0) => Some(false),
                        Some(1.0) => Some(true),
                        _ => None,
                    };
                }
                Slot::Value(i) => match (value, values.get_mut(i)) {
                    (Some(value), Some(target)) => *target = value,
                    _ => readable = false,
                },
            }
        }
        readable &= count == self.slots.len();
        let step = match (self.last_time, time) {
            (_, None) => Step::OffGrid,
            (None, Some(_)) => Step::Forward(1),
            (Some(before), Some(now)) => {
                let steps = (now - before) / self.sample_period_s;
                if steps <= RULES.off_grid {
                    Step::Restart
                } else if (steps - steps.round()).abs() <= RULES.off_grid && steps >= 0.5 {
                    Step::Forward(steps.round().min(FARTHEST) as u64)
                } else {
                    Step::OffGrid
                }
            }
        };
        self.last_time = match (time, self.last_time) {
            (Some(now), _) => Some(now),
            // An unreadable time counts as the next sample.
            (None, before) => before.map(|t| t + self.sample_period_s),
        };
        Ok(Some(RawRow {
            line: self.rows.line(),
            step,
            on,
            readable,
        }))
    }
}

/// The sampling period from the first rows, robust to gaps and bad rows.
fn head_period(source: impl BufRead, path: &Path) -> Result<f64, DataError> {
    let mut rows = RowReader::new(source, path)?;
    let column = rows.required("t")?;
    let mut times = Vec::new();
    while times.len() < RULES.head && rows.advance()? {
        let time = rows.cells().nth(column).and_then(|cell| number(cell).ok());
        times.extend(time.filter(|t| t.is_finite()));
    }
    let mut steps: Vec<f64> = times
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|&s| s > 0.0)
        .collect();
    if steps.is_empty() {
        return Err(rows.place().error(DataProblem::TooFewRows(times.len())));
    }
    let middle = steps.len() / 2;
    let median = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    steps.retain(|s| (s / median - 1.0).abs() <= RULES.most_uneven);
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    let spread = steps.iter().fold(0.0, |m: f64, s| m.max((s - mean).abs()));
    Ok(tidy(
        mean,
        (spread / mean / steps.len() as f64).clamp(1e-9, 1e-3),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_placed_on_the_grid_and_faults_are_marked() {
        let text = "t,u,temp,y\n0.000,0,20,1\n0.001,1,20,2\n0.004,1,20,3\n0.005,2,20,4\nx,1,20,5\n0.007,1,20,nan\n0.000,0,20,7\n0.0014,0,20\n";
        let mut raw = RawReader::new(text.as_bytes(), Path::new("r.csv"), 0.001).unwrap();
        assert_eq!(raw.names(), ["y", "temp"]);
        let mut values = [0.0; 2];
        let mut seen = Vec::new();
        while let Some(row) = raw.next_row(&mut values).unwrap() {
            seen.push((row.line, row.step, row.on, row.readable));
        }
        use Step::{Forward, OffGrid, Restart};
        assert_eq!(
            seen,
            [
                (2, Forward(1), Some(false), true),
                (3, Forward(1), Some(true), true),
                (4, Forward(3), Some(true), true),
                (5, Forward(1), None, true),
                (6, OffGrid, Some(true), true),
                (7, Forward(1), Some(true), false),
                (8, Restart, Some(false), true),
                (9, OffGrid, Some(false), false),
            ]
        );
    }

    #[test]
    fn period_is_found_past_bad_rows_and_rounding() {
        let mut text = String::from("t,u,y\n");
        for k in 0..1000 {
            match k {
                17 => text.push_str("bad,0,0\n"),
                400..450 => {}
                _ => text.push_str(&format!("{:.3},0,0\n", f64::from(k) * 0.0016384)),
            }
        }
        let period = head_period(text.as_bytes(), Path::new("r.csv")).unwrap();
        assert!((period / 0.0016384 - 1.0).abs() < 2e-3, "{period}");
        assert!(head_period("t,u,y\n0,0,0\n".as_bytes(), Path::new("r.csv")).is_err());
    }
}
