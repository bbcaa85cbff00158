//! Mapping of a file's variables to command, output and time, with their scaling.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::gaps::{Filling, Gaps};
use super::marker;
use super::mean::{mean_of, origin_of};
use super::names::{
    COMMANDS, CONTROLLER_OUTPUTS, OUTPUTS, PROCESS_VALUES, TIMES, find, is_in_percent, known_as,
    only_other, only_switch, only_two_levels,
};
use super::problem::ImportProblem;
use super::source::{Source, Variable};
use crate::error::{DataError, DataProblem, FilePlace, printable};
use crate::folder::mapping_of;
use crate::record::{Origin, RESERVED, Record, Use};

/// The assignment of a file's variables to a record. Stored in `dataset.toml` as the record's `[record.from]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mapping {
    /// Name of the time. With `None` the time is found by its usual names, or the sampling period
    /// is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t: Option<String>,
    /// Seconds per unit of the time; `None`: as stated in its header, otherwise 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_scale: Option<f64>,
    /// Sampling period, s, if the file has no time, or to check it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// The rows are a sampling period apart, and the file's time is ignored.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub ignore_time: bool,
    /// Longest gap that is filled, s, from the value before it to the value after it; `None`: no gap is filled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fill_gaps_s: Option<f64>,
    /// The numbers that mark missing readings of y and of further variables. A usual mark that is not among them is an
    /// error, unless the list is empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<Vec<f64>>,
    /// Name of the variable at whose changes a new record begins; the name of the time: where the time starts again, and
    /// after pauses. `None`: a file is one record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split_by: Option<String>,
    /// A sample is the mean of this many rows, at least 2; `None`: of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_of: Option<usize>,
    /// Name of the command. With `None` it is found by its usual names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u: Option<String>,
    /// Factor of u: u = u_scale · variable + u_offset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u_scale: Option<f64>,
    /// Offset of u.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u_offset: Option<f64>,
    /// u is 1 above this value of the scaled command and 0 elsewhere: makes a voltage an on/off command.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u_threshold: Option<f64>,
    /// Name of the output. With `None` it is found by its usual names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<String>,
    /// Factor of y: y = y_scale · variable + y_offset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_scale: Option<f64>,
    /// Offset of y. Standard errors and envelopes are scaled accordingly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_offset: Option<f64>,
    /// Further variables to keep. With `None` all variables that are as long as u are kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<Vec<String>>,
}

/// A record with its mapping.
pub(super) struct Mapped {
    pub(super) record: Record,
    pub(super) origin: Origin,
    /// The mapping with the names that were found.
    pub(super) mapping: Mapping,
    pub(super) remarks: Vec<String>,
    /// Units by column, where the header stated them.
    pub(super) units: BTreeMap<String, String>,
}

impl Mapping {
    /// The mapping with which an imported data set was made.
    ///
    /// # Errors
    /// [`DataError`] if there is no readable `dataset.toml`, or it contains no mapping.
    pub fn of(folder: &Path) -> Result<Self, DataError> {
        mapping_of(folder)
    }

    /// The command and the output, by option, by usual name, or because no other variable fits.
    fn command_and_output<'a>(
        &self,
        source: &'a Source,
        file: &FilePlace,
        remarks: &mut Vec<String>,
    ) -> Result<(&'a Variable, &'a Variable), DataError> {
        let named = |wanted: &Option<String>, known: &str| match wanted {
            Some(name) => find(source, name, file).map(Some),
            None => known_as(source, known, file),
        };
        // A variable with another known role is not a candidate.
        let time = match &self.t {
            Some(name) => source.get(name),
            None => known_as(source, TIMES, &FilePlace::default())
                .ok()
                .flatten(),
        };
        let is_controlled = known_as(source, PROCESS_VALUES, file)?.is_some();
        let mut u = named(&self.u, COMMANDS)?;
        if u.is_none() && is_controlled {
            u = known_as(source, CONTROLLER_OUTPUTS, file)?;
        }
        let y = named(&self.y, OUTPUTS)?;
        let which = |what, option| {
            let found = source.listed();
            let problem = ImportProblem::Which {
                what,
                option,
                found,
            };
            file.clone().error(problem.into())
        };
        let taken: Vec<&Variable> = time.into_iter().chain(y).collect();
        let (u, by_value) = match u {
            Some(u) => (u, false),
            None => match only_switch(source, &taken) {
                Some(u) => (u, true),
                None => {
                    let two = only_two_levels(source, &taken);
                    let levels = two.map(|(switch, [low, high])| ImportProblem::TwoLevels {
                        name: printable(&switch.name),
                        low: brief(low, 2),
                        high: brief(high, 2),
                        middle: brief((low + high) / 2.0, 2),
                        found: source.listed(),
                    });
                    return Err(levels.map_or_else(
                        || which("the command u", "u"),
                        |problem| file.clone().error(problem.into()),
                    ));
                }
            },
        };
        if by_value {
            remarks.push(format!(
                "u is `{}`, the only on/off column; --u names another",
                u.name
            ));
        }
        remarks.extend(u.notes.iter().cloned());
        let taken: Vec<&Variable> = time.into_iter().chain([u]).collect();
        let y = match y {
            Some(y) => y,
            None => match only_other(source, &taken) {
                Some(y) => {
                    remarks.push(format!("y is `{}`, the only other column", y.name));
                    y
                }
                None => return Err(which("the output y", "y")),
            },
        };
        remarks.extend(y.notes.iter().cloned());
        Ok((u, y))
    }

    /// The factor of the command: a command in percent becomes one of 0 to 1, unless a factor is given.
    fn scale_of_command(
        &self,
        u: &Variable,
        values: &[f64],
        remarks: &mut Vec<String>,
    ) -> Option<f64> {
        let is_percent = match u.unit.as_deref() {
            Some(unit) => unit == "%",
            None => is_in_percent(&u.name),
        };
        if self.u_scale.is_some() || !is_percent {
            return self.u_scale;
        }
        let largest = values.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        if largest <= 1.0 {
            remarks.push(
                "the header gives u in %, but all values are below 1: u is not scaled".to_owned(),
            );
            return None;
        }
        remarks.push("u is in %: 100 % is u = 1 (--u-scale 1 keeps the percentages)".to_owned());
        Some(0.01)
    }

    fn check(&self) -> Result<(), ImportProblem> {
        for (value, name) in [
            (self.t_scale, "t_scale"),
            (self.fill_gaps_s, "fill_gaps_s"),
            (self.u_scale, "u_scale"),
            (self.y_scale, "y_scale"),
        ] {
            if value.is_some_and(|v| !v.is_finite() || v == 0.0) {
                return Err(ImportProblem::BadScale(name));
            }
        }
        for (value, name) in [
            (self.u_offset, "u_offset"),
            (self.y_offset, "y_offset"),
            (self.u_threshold, "u_threshold"),
        ] {
            if value.is_some_and(|v| !v.is_finite()) {
                return Err(ImportProblem::BadNumber(name));
            }
        }
        if self.mean_of.is_some_and(|rows| rows < 2) {
            return Err(ImportProblem::MeanOfOne);
        }
        Ok(())
    }

    /// The record `name` of a file.
    pub(super) fn record(
        &self,
        source: &Source,
        name: &str,
        role: Use,
    ) -> Result<Mapped, DataError> {
        let at = FilePlace::file(source.path());
        let fault = |problem: ImportProblem| at.clone().error(problem.into());
        self.check().map_err(&fault)?;
        let mut remarks = source.remarks.clone();
        let (u, y) = self.command_and_output(source, &at, &mut remarks)?;
        let mut mapping = self.clone();
        mapping.u = Some(u.name.clone());
        mapping.y = Some(y.name.clone());
        let mut units = BTreeMap::new();
        let origin = Origin {
            file: Some(source.path().to_path_buf()),
            lines: source.lines.clone(),
        };
        let place = |variable: &Variable, row: usize| {
            let here = origin.place(name, Some(row));
            match source.lines.is_empty() {
                false => here.in_column(&variable.name),
                true => FilePlace {
                    file: at.file.clone(),
                    record: None,
                    sample: Some(row),
                    variable: Some(variable.name.clone()),
                    ..FilePlace::default()
                },
            }
        };
        let n = u.values.len();
        same_length(y, n, &place)?;

        let timing = self.timing(source, n, &place, &mut mapping, &mut remarks)?;
        let gaps = Gaps {
            most_s: self.fill_gaps_s,
            period_s: timing.period_s,
            rows: timing.rows,
        };
        let interpolated = |variable: &Variable, remarks: &mut Vec<String>| {
            let values = marker::without(variable, self.missing.as_deref())
                .map_err(|(row, problem)| place(variable, row).error(problem.into()))?;
            gaps.filled(variable, &values, Filling::Interpolated, &place, remarks)
        };
        let measured = interpolated(y, &mut remarks)?;
        let values = held(u, &place, &mut remarks)?;
        let values = gaps.filled(u, &values, Filling::Held, &place, &mut remarks)?;
        let u_scale = self.scale_of_command(u, &values, &mut remarks);
        mapping.u_scale = u_scale;
        let line = |scale: Option<f64>, offset: Option<f64>| {
            let (scale, offset) = (scale.unwrap_or(1.0), offset.unwrap_or(0.0));
            move |v: &f64| scale * v + offset
        };
        let mut command: Vec<f64> = values.iter().map(line(u_scale, self.u_offset)).collect();
        if let Some(threshold) = self.u_threshold {
            let low = command.iter().copied().fold(f64::INFINITY, f64::min);
            let high = command.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if !(low <= threshold && threshold < high) {
                return Err(place(u, 0).whole().error(
                    ImportProblem::NeverCrosses {
                        low,
                        high,
                        threshold,
                    }
                    .into(),
                ));
            }
            for value in &mut command {
                *value = f64::from(u8::from(*value > threshold));
            }
        } else if let Some((low, high)) = near_two_levels(&command) {
            remarks.push(format!(
                "u takes values near {} and {}: if this is an on/off command, use --u-threshold {}",
                brief(low, 2),
                brief(high, 2),
                brief((low + high) / 2.0, 1)
            ));
        }
        let output = measured.iter().map(line(self.y_scale, self.y_offset));
        let output = output.collect();
        let mut record = Record::new(name, role, timing.period_s, command, output);
        record.t0 = timing.t0;

        let taken: Vec<&Variable> = [u, y].into_iter().chain(timing.variables).collect();
        let taken = |v: &Variable| {
            taken.iter().any(|t| t.name == v.name) || self.split_by.as_ref() == Some(&v.name)
        };
        let chosen: Vec<&Variable> = match &self.channels {
            Some(names) => names
                .iter()
                .map(|name| find(source, name, &at))
                .collect::<Result<_, _>>()?,
            None => {
                let fits = |v: &&Variable| v.values.len() == n && !taken(v);
                source.variables.iter().filter(fits).collect()
            }
        };
        let scale = self.y_scale.unwrap_or(1.0);
        for variable in chosen {
            if taken(variable) {
                continue;
            }
            same_length(variable, n, &place)?;
            if variable.stamped.is_some() {
                remarks.push(format!(
                    "`{}` is left out: a second time column",
                    variable.name
                ));
                continue;
            }
            let values = match interpolated(variable, &mut remarks) {
                Ok(values) => values,
                Err(error) if self.channels.is_some() => return Err(error),
                Err(error) => {
                    let line = error.place.line.map(|line| format!("line {line}: "));
                    remarks.push(format!(
                        "`{}` is left out: {}{}",
                        variable.name,
                        line.unwrap_or_default(),
                        error.problem
                    ));
                    continue;
                }
            };
            remarks.extend(variable.notes.iter().cloned());
            let values = values.iter();
            match variable.name.as_str() {
                "y_sd" => record.y_sd = Some(values.map(|v| v * scale.abs()).collect()),
                bound @ ("y_min" | "y_max") => {
                    let values = values.map(line(self.y_scale, self.y_offset)).collect();
                    // A negative scale exchanges the limits of the envelope.
                    match (bound == "y_min") == (scale > 0.0) {
                        true => record.y_min = Some(values),
                        false => record.y_max = Some(values),
                    }
                }
                reserved if RESERVED.contains(&reserved) => {
                    return Err(fault(ImportProblem::ChannelName(reserved.to_owned())));
                }
                other => {
                    if let Some(unit) = &variable.unit {
                        units.insert(other.to_owned(), unit.clone());
                    }
                    record
                        .channels
                        .insert(other.to_owned(), values.copied().collect());
                }
            }
        }
        if record.y_min.is_some() != record.y_max.is_some() {
            remarks.push(
                "an envelope needs both y_min and y_max; only one is present, so it is left out"
                    .to_owned(),
            );
            (record.y_min, record.y_max) = (None, None);
        }
        if let (Some(unit), None) = (&y.unit, self.y_scale) {
            units.insert("y".to_owned(), unit.clone());
        }
        let unread = source.unread.iter();
        remarks.extend(unread.map(|u| format!("`{}` is left out: {}", u.name, u.words())));
        let passed_over = source.skipped.iter();
        remarks.extend(passed_over.map(|(name, why)| format!("`{name}` is left out: {why}")));
        let lines = gaps.rows.iter().filter_map(|&row| source.lines.get(row));
        let mut origin = Origin {
            lines: lines.copied().collect(),
            ..origin
        };
        if let Some(rows) = self.mean_of {
            if record.len() / 2 < rows {
                let samples = record.len();
                return Err(fault(ImportProblem::TooFewRows { rows, samples }));
            }
            record = mean_of(record, rows, &mut remarks);
            origin = origin_of(origin, rows, record.len());
        }
        Ok(Mapped {
            record,
            origin,
            mapping,
            remarks,
            units,
        })
    }
}

/// Refuses a variable that is not as long as the command.
pub(super) fn same_length(
    variable: &Variable,
    n: usize,
    place: &dyn Fn(&Variable, usize) -> FilePlace,
) -> Result<(), DataError> {
    match variable.values.len() == n {
        true => Ok(()),
        false => Err(place(variable, 0)
            .whole()
            .error(DataProblem::UnequalLengths {
                expected: n,
                found: variable.values.len(),
            })),
    }
}

/// Refuses a variable with a value that is missing or not finite.
pub(super) fn finite(
    variable: &Variable,
    place: &dyn Fn(&Variable, usize) -> FilePlace,
) -> Result<(), DataError> {
    match variable.values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(k) if variable.blanks.contains(&k) => {
            Err(place(variable, k).error(ImportProblem::Unread(String::new()).into()))
        }
        Some(k) => {
            let value = variable.values.get(k).copied().unwrap_or(f64::NAN);
            Err(place(variable, k).error(DataProblem::NotFinite(value)))
        }
    }
}

/// A command written on change: an empty cell keeps the previous value.
fn held(
    u: &Variable,
    place: &dyn Fn(&Variable, usize) -> FilePlace,
    remarks: &mut Vec<String>,
) -> Result<Vec<f64>, DataError> {
    let mut values = u.values.clone();
    for &row in &u.blanks {
        let before = row.checked_sub(1).and_then(|k| values.get(k)).copied();
        let (Some(before), Some(value)) = (before, values.get_mut(row)) else {
            return Err(place(u, row).error(ImportProblem::NoFirstCommand.into()));
        };
        *value = before;
    }
    if !u.blanks.is_empty() {
        remarks.push(format!(
            "u is written on change only: an empty cell repeats the previous value ({} of {} cells)",
            u.blanks.len(),
            values.len()
        ));
    }
    Ok(values)
}

/// Two values near which a command lies, if it is a noisy or scaled on/off command: its lowest and its highest value.
/// `None` if it is 0 and 1 only, or has other values.
#[must_use]
pub fn near_two_levels(u: &[f64]) -> Option<(f64, f64)> {
    let low = u.iter().copied().fold(f64::INFINITY, f64::min);
    let high = u.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let on_off = u.iter().all(|&v| v == 0.0 || v == 1.0);
    if on_off || high <= low {
        return None;
    }
    let near = |v: &&f64| {
        let x = (**v - low) / (high - low);
        !(0.2..=0.8).contains(&x)
    };
    (u.iter().filter(near).count() as f64 >= 0.98 * u.len() as f64).then_some((low, high))
}

/// The value rounded to its first digit and `digits` further ones.
fn brief(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value)
}
