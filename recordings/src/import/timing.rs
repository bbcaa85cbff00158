//! Sampling times of a file: from a time column, from dates and clock times, or from a stated period.

use super::gaps::{completed, inserted};
use super::mapping::Mapping;
use super::names::{TIMES, find, known_as, seconds, seconds_by_name};
use super::problem::ImportProblem;
use super::source::{Exactness, Source, Variable};
use super::stamp::Kind;
use crate::error::{DataError, DataProblem, FilePlace};
use crate::sampling::{Clock, PrintedTimes, Rounded, Stated, TimeFault, tidy};

/// A time above this, s, is counted from 1970.
const SINCE_1970: f64 = 1e9;

/// The samples' times.
pub(super) struct Timing<'a> {
    /// The variables that contain the time; they are not imported as channels.
    pub(super) variables: Vec<&'a Variable>,
    /// Time of the first sample, s.
    pub(super) t0: f64,
    /// Sampling period, s.
    pub(super) period_s: f64,
    /// The row of each sample in the file; a sample of a lost row has the next row.
    pub(super) rows: Vec<usize>,
}

/// The times of a file's rows as printed.
pub(super) struct Times<'a> {
    time: &'a Variable,
    /// The dates of a time that is a clock time.
    date: Option<&'a Variable>,
    pub(super) printed: PrintedTimes,
    /// Seconds per unit, if not 1.
    scale: Option<f64>,
    remarks: Vec<String>,
}

impl Times<'_> {
    /// Whether the variable is the time, or the dates of it.
    pub(super) fn is_from(&self, variable: &Variable) -> bool {
        let names = [Some(self.time), self.date];
        names.into_iter().flatten().any(|v| v.name == variable.name)
    }
}

/// Conversion of a time's numbers to seconds.
struct Scale {
    seconds: f64,
    /// The unit, if the size of the numbers shows a Unix time.
    epoch: Option<&'static str>,
}

impl Mapping {
    /// The times of the `n` samples of a file. The interpretation is added to `found`, remarks to `remarks`.
    ///
    /// # Errors
    /// [`DataError`] naming the cell, or the missing column.
    pub(super) fn timing<'a>(
        &self,
        source: &'a Source,
        n: usize,
        place: &dyn Fn(&Variable, usize) -> FilePlace,
        found: &mut Self,
        remarks: &mut Vec<String>,
    ) -> Result<Timing<'a>, DataError> {
        let file = FilePlace::file(source.path());
        let stated = self.period_s.map(|period_s| Stated {
            period_s,
            by: "--period is",
        });
        let Some(times) = self.times(source, n, place)? else {
            let period_s = match self.period_s.or_else(|| stated_period(source)) {
                Some(period_s) => period_s,
                None => {
                    let problem = ImportProblem::NoTime(source.listed());
                    return Err(file.error(problem.into()));
                }
            };
            found.period_s = Some(period_s);
            let variables = source.variables.iter().filter(|v| self.is_ignored(v));
            return Ok(Timing {
                variables: variables.collect(),
                t0: 0.0,
                period_s,
                rows: (0..n).collect(),
            });
        };
        found.period_s = None;
        found.t = Some(times.time.name.clone());
        found.t_scale = times.scale.or(found.t_scale);
        remarks.extend(times.remarks);
        let Times {
            time,
            date,
            printed: times,
            ..
        } = times;
        let t0 = times.time.first().copied().unwrap_or(0.0);
        let fault = |f: TimeFault| place(time, f.row).error(f.problem);
        let filled = match self.fill_gaps_s {
            Some(most_s) => completed(&times, stated, most_s).map_err(fault)?,
            None => None,
        };
        let (times, rows) = filled.unwrap_or_else(|| (times, (0..n).collect()));
        remarks.extend(inserted(&rows, time, place));
        let clock = times.clock(stated).map_err(|f| {
            let row = rows.get(f.row).copied().unwrap_or(f.row);
            let problem = match f.problem {
                // The gap was not filled, and its length is not a multiple of the period.
                DataProblem::TimeGap { step, period, .. } if self.fill_gaps_s.is_some() => {
                    DataProblem::TimeUneven { step, period }
                }
                other => other,
            };
            fault(TimeFault { row, problem })
        })?;
        if let Some(rounded) = clock.rounded {
            let line = rows.get(rounded.row).and_then(|&row| source.lines.get(row));
            remarks.push(explained(&clock, &rounded, &times, line));
        }
        Ok(Timing {
            variables: [Some(time), date].into_iter().flatten().collect(),
            t0,
            period_s: clock.period_s,
            rows,
        })
    }

    /// The times as the file prints them, in seconds; `None` if the file has none or they are ignored.
    ///
    /// # Errors
    /// [`DataError`] naming the cell, or the missing column.
    pub(super) fn times<'a>(
        &self,
        source: &'a Source,
        n: usize,
        place: &dyn Fn(&Variable, usize) -> FilePlace,
    ) -> Result<Option<Times<'a>>, DataError> {
        let file = FilePlace::file(source.path());
        let Some(time) = self.time(source, n, &file)? else {
            return Ok(None);
        };
        let (time, date) = with_date(source, time, n);
        crate::import::mapping::same_length(time, n, place)?;
        crate::import::mapping::finite(time, place)?;
        let mut remarks = Vec::new();
        let mut used = None;
        let printed = match &time.stamped {
            Some(stamped) => {
                let day = date.and_then(|d| d.stamped.as_ref());
                let seconds = match day {
                    Some(date) => {
                        let start = stamped.of_day.first().copied().unwrap_or(0.0);
                        let pairs = date.seconds.iter().zip(&stamped.of_day);
                        pairs.map(|(day, now)| day + now - start).collect()
                    }
                    None => stamped.seconds.clone(),
                };
                let day = day.map_or(String::new(), |day| format!("{} ", day.first));
                remarks.push(counted_from(&format!("{day}{}", stamped.first)));
                if date.is_none() && stamped.midnights > 0 {
                    remarks.push(format!(
                        "the clock passes midnight {} time(s)",
                        stamped.midnights
                    ));
                }
                PrintedTimes {
                    time: seconds,
                    unit: stamped.unit.clone(),
                }
            }
            None => {
                let scale = self.scale(time, &file)?;
                used = Some(scale.seconds).filter(|seconds| *seconds != 1.0);
                let first = time.values.first().copied().unwrap_or(0.0);
                let start = match first.abs() * scale.seconds >= SINCE_1970 {
                    true => first,
                    false => 0.0,
                };
                if let Some(unit) = scale.epoch {
                    remarks.push(format!("`{}` is read as a Unix time in {unit}", time.name));
                }
                if start != 0.0 {
                    remarks.push(counted_from(&start.to_string()));
                }
                scaled(time, start, scale.seconds)
            }
        };
        Ok(Some(Times {
            time,
            date,
            printed,
            scale: used,
            remarks,
        }))
    }

    /// The time variable; `None` if the file has none or it is ignored.
    fn time<'a>(
        &self,
        source: &'a Source,
        n: usize,
        file: &FilePlace,
    ) -> Result<Option<&'a Variable>, DataError> {
        if self.ignore_time {
            return Ok(None);
        }
        if let Some(name) = &self.t {
            return find(source, name, file).map(Some);
        }
        if let Some(known) = known_as(source, TIMES, file)? {
            return Ok(Some(known).filter(|t| t.values.len() == n));
        }
        let stamps = |kind: Kind| {
            let is_one = move |v: &&'a Variable| v.stamped.as_ref().is_some_and(|s| s.kind == kind);
            let mut found = source.variables.iter().filter(is_one);
            found.next().filter(|_| found.next().is_none())
        };
        let kinds = [Kind::DateTime, Kind::Clock, Kind::Date];
        Ok(kinds.into_iter().find_map(stamps))
    }

    fn is_ignored(&self, variable: &Variable) -> bool {
        let is_time = |name: &str| {
            TIMES
                .split_whitespace()
                .any(|t| t.eq_ignore_ascii_case(name))
        };
        self.ignore_time
            && (variable.stamped.is_some()
                || self.t.as_ref().is_some_and(|t| *t == variable.name)
                || is_time(&variable.name) && variable.name != "T")
    }

    fn scale(&self, time: &Variable, file: &FilePlace) -> Result<Scale, DataError> {
        let known = |seconds| Scale {
            seconds,
            epoch: None,
        };
        if let Some(scale) = self.t_scale {
            return Ok(known(scale));
        }
        if let Some(unit) = &time.unit {
            let why = || {
                format!(
                    "the unit `{unit}` of the time is unknown; give its length in seconds with --t-scale"
                )
            };
            let scale = seconds(unit)
                .ok_or_else(|| file.clone().error(ImportProblem::Unusable(why()).into()))?;
            return Ok(known(scale));
        }
        if let Some(scale) = seconds_by_name(&time.name) {
            return Ok(known(scale));
        }
        // The ranges correspond to times from September 2001 to November 2286.
        let first = time.values.first().copied().unwrap_or(0.0) / SINCE_1970;
        let epochs = [("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)];
        let is_one = |(_, seconds): &(&str, f64)| (1.0..10.0).contains(&(first * seconds));
        Ok(match epochs.into_iter().find(is_one) {
            Some((unit, seconds)) => Scale {
                seconds,
                epoch: Some(unit),
            },
            None => known(1.0),
        })
    }
}

fn counted_from(first: &str) -> String {
    format!("time is counted from the first row ({first})")
}

/// Clock times together with the only column of dates in the file, or dates together with the only
/// column of clock times.
fn with_date<'a>(
    source: &'a Source,
    time: &'a Variable,
    n: usize,
) -> (&'a Variable, Option<&'a Variable>) {
    let kind = |v: &Variable| v.stamped.as_ref().map(|s| s.kind);
    let other = |wanted: Kind| {
        let is_one = |v: &&Variable| kind(v) == Some(wanted) && v.values.len() == n;
        let mut found = source.variables.iter().filter(is_one);
        found.next().filter(|_| found.next().is_none())
    };
    match kind(time) {
        Some(Kind::Clock) => (time, other(Kind::Date)),
        Some(Kind::Date) => match other(Kind::Clock) {
            Some(clock) => (clock, Some(time)),
            None => (time, None),
        },
        _ => (time, None),
    }
}

/// The sampling period that a scalar of the file states.
fn stated_period(source: &Source) -> Option<f64> {
    let scalar = |name: &str| {
        let is_it = |v: &&Variable| v.name.rsplit('.').next() == Some(name);
        match source.variables.iter().find(is_it)?.values.as_slice() {
            &[value] if value.is_finite() && value > 0.0 => Some(value),
            _ => None,
        }
    };
    ["Ts", "dt", "sample_period_s"]
        .into_iter()
        .find_map(scalar)
        .or_else(|| Some(1.0 / ["fs", "Fs"].into_iter().find_map(scalar)?))
}

/// Times in seconds, counted from `start`, which is in the file's unit.
fn scaled(t: &Variable, start: f64, scale: f64) -> PrintedTimes {
    // Division by 1000 is exact; multiplication by 0.001 is not.
    let whole = (1.0 / scale).round();
    let by = |v: f64| match (whole * scale - 1.0).abs() < 1e-12 && whole > 1.0 {
        true => v / whole,
        false => v * scale,
    };
    let time: Vec<f64> = t.values.iter().map(|&v| by(v - start)).collect();
    let bits = |v: &f64| v.abs() * f64::EPSILON;
    let unit = match &t.exactness {
        Exactness::Printed(units) => {
            let units = units.iter().zip(&t.values);
            units.map(|(unit, v)| unit.max(bits(v)) * scale).collect()
        }
        // Times that are accumulated step by step have errors larger than the last bit.
        Exactness::Relative(share) => {
            let values = t.values.iter();
            values.map(|v| 8.0 * share * (v * scale).abs()).collect()
        }
    };
    PrintedTimes { time, unit }
}

/// The remark on a clock whose uneven steps are explained by rounding.
fn explained(clock: &Clock, rounded: &Rounded, times: &PrintedTimes, line: Option<&u64>) -> String {
    let (span, steps) = times.span();
    let mut text = format!(
        "times are printed with a resolution of {} s, so their differences are {} to {} s. The sampling period is \
             the mean, {} s / {steps} = {} s; no sample is missing",
        tidy(rounded.unit, 1e-6),
        tidy(rounded.shortest, 1e-6),
        tidy(rounded.longest, 1e-6),
        tidy(span, 1e-9),
        clock.period_s
    );
    if rounded.uncommon == 1
        && let Some(line) = line
    {
        text.push_str(&format!(
            " (only the time step before line {line} differs; if a sample is missing there, split the file there or \
                 give --fill-gaps SECONDS)"
        ));
    }
    text
}
