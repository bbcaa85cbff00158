//! Which variable of a file is the command, the output and the time, and what has to be done to its numbers.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::problem::ImportProblem;
use super::source::{Exactness, Source, Variable};
use crate::error::{DataError, DataProblem, FilePlace};
use crate::folder::mapping_of;
use crate::record::{Origin, RESERVED, Record, Use};
use crate::sampling::PrintedTimes;

/// How a file's variables become a record. Kept in `dataset.toml` as the record's `[record.from]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mapping {
    /// The time; none: found by its name, or the sampling period is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t: Option<String>,
    /// Seconds in one unit of the time; none: as its header says, otherwise 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_scale: Option<f64>,
    /// Sampling period, s, in place of a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// The command; none: found by its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u: Option<String>,
    /// u is this times the variable …
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u_scale: Option<f64>,
    /// … plus this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u_offset: Option<f64>,
    /// u is 1 above this value of the scaled command and 0 elsewhere: makes a voltage an on/off command.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u_threshold: Option<f64>,
    /// The output; none: found by its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<String>,
    /// y is this times the variable …
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_scale: Option<f64>,
    /// … plus this. Standard errors and envelopes are scaled along.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_offset: Option<f64>,
    /// Further variables to keep; none: all that are as long as u.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<Vec<String>>,
}

/// A record and how it came about.
pub(super) struct Mapped {
    pub(super) record: Record,
    pub(super) origin: Origin,
    /// With the names that were found.
    pub(super) mapping: Mapping,
    pub(super) remarks: Vec<String>,
    /// Units by column, where the header stated them.
    pub(super) units: BTreeMap<String, String>,
}

/// Names by which a variable is known, in lower case.
const TIMES: [&str; 7] = ["t", "time", "zeit", "temps", "tout", "x_value", "time_s"];
const COMMANDS: [&str; 8] = [
    "u", "input", "command", "valve", "actuator", "ventil", "cmd", "stell",
];
const OUTPUTS: [&str; 6] = ["y", "output", "shear", "friction", "sensor", "response"];

impl Mapping {
    /// The mapping that an imported data set was made with.
    ///
    /// # Errors
    /// [`DataError`] when there is no readable `dataset.toml`, or it holds no mapping.
    pub fn of(folder: &Path) -> Result<Self, DataError> {
        mapping_of(folder)
    }

    fn check(&self) -> Result<(), ImportProblem> {
        for (value, name) in [
            (self.t_scale, "t_scale"),
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
        let of = |wanted: &Option<String>, known: &[&str], what, option| match wanted {
            Some(name) => find(source, name),
            None => known_as(source, known).ok_or_else(|| ImportProblem::Which {
                what,
                option,
                found: source.listed(),
            }),
        };
        let u = of(&self.u, &COMMANDS, "the command u", "u").map_err(&fault)?;
        let y = of(&self.y, &OUTPUTS, "the output y", "y").map_err(&fault)?;
        let mut mapping = self.clone();
        mapping.u = Some(u.name.clone());
        mapping.y = Some(y.name.clone());
        let mut remarks = Vec::new();
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
        if y.values.len() != u.values.len() {
            return Err(place(y, 0).whole().error(DataProblem::UnequalLengths {
                expected: u.values.len(),
                found: y.values.len(),
            }));
        }
        let n = u.values.len();

        let time = match (&self.t, self.period_s) {
            (Some(name), _) => Some(find(source, name).map_err(&fault)?),
            (None, Some(_)) => None,
            (None, None) => known_as(source, &TIMES).filter(|t| t.values.len() == n),
        };
        let (t0, sample_period_s) = match (time, self.period_s.or_else(|| stated_period(source))) {
            (Some(t), _) => {
                mapping.t = Some(t.name.clone());
                let scale = match (self.t_scale, t.unit.as_deref()) {
                    (Some(scale), _) => scale,
                    (None, Some(unit)) => seconds(unit).ok_or_else(|| {
                        let why = format!(
                            "the unit `{unit}` of the time is not known here; give the seconds in it with --t-scale"
                        );
                        fault(ImportProblem::Unusable(why))
                    })?,
                    (None, None) => 1.0,
                };
                if scale != 1.0 {
                    mapping.t_scale = Some(scale);
                }
                if t.values.len() != n {
                    return Err(place(t, 0).whole().error(DataProblem::UnequalLengths {
                        expected: n,
                        found: t.values.len(),
                    }));
                }
                finite(t, &place)?;
                let times = scaled_times(t, scale);
                let period = times
                    .period(self.period_s)
                    .map_err(|f| place(t, f.row).error(f.problem))?;
                (times.time.first().copied().unwrap_or(0.0), period)
            }
            (None, Some(period)) => {
                mapping.period_s = Some(period);
                (0.0, period)
            }
            (None, None) => return Err(fault(ImportProblem::NoTime(source.listed()))),
        };

        for variable in [u, y] {
            finite(variable, &place)?;
        }
        let line = |scale: Option<f64>, offset: Option<f64>| {
            let (scale, offset) = (scale.unwrap_or(1.0), offset.unwrap_or(0.0));
            move |v: &f64| scale * v + offset
        };
        let mut command: Vec<f64> = u
            .values
            .iter()
            .map(line(self.u_scale, self.u_offset))
            .collect();
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
        } else if let Some((low, high)) = two_levels(&command) {
            remarks.push(format!(
                "u lies near {} and {}: if this is an on/off command, say --u-threshold {}",
                brief(low, 2),
                brief(high, 2),
                brief((low + high) / 2.0, 1)
            ));
        }
        let output = y
            .values
            .iter()
            .map(line(self.y_scale, self.y_offset))
            .collect();
        let mut record = Record::new(name, role, sample_period_s, command, output);
        record.t0 = t0;

        let taken = [Some(u), Some(y), time];
        let taken = |v: &Variable| taken.iter().flatten().any(|t| t.name == v.name);
        let chosen: Vec<&Variable> = match &self.channels {
            Some(names) => names
                .iter()
                .map(|name| find(source, name).map_err(&fault))
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
            if variable.values.len() != n {
                return Err(place(variable, 0)
                    .whole()
                    .error(DataProblem::UnequalLengths {
                        expected: n,
                        found: variable.values.len(),
                    }));
            }
            if let Err(error) = finite(variable, &place) {
                if self.channels.is_some() {
                    return Err(error);
                }
                remarks.push(format!(
                    "`{}` is left out: {}",
                    variable.name, error.problem
                ));
                continue;
            }
            let values = variable.values.iter();
            match variable.name.as_str() {
                "y_sd" => record.y_sd = Some(values.map(|v| v * scale.abs()).collect()),
                bound @ ("y_min" | "y_max") => {
                    let values = values.map(line(self.y_scale, self.y_offset)).collect();
                    // A scale below 0 turns the envelope over.
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
            remarks.push("an envelope needs both y_min and y_max; the one is left out".to_owned());
            (record.y_min, record.y_max) = (None, None);
        }
        if let (Some(unit), None) = (&y.unit, self.y_scale) {
            units.insert("y".to_owned(), unit.clone());
        }
        let passed_over = source.skipped.iter();
        remarks.extend(passed_over.map(|(name, why)| format!("`{name}` is left out: {why}")));
        Ok(Mapped {
            record,
            origin,
            mapping,
            remarks,
            units,
        })
    }
}

fn find<'a>(source: &'a Source, name: &str) -> Result<&'a Variable, ImportProblem> {
    if let Some(found) = source.get(name) {
        return Ok(found);
    }
    if let Some((_, why)) = source.skipped.iter().find(|(n, _)| n == name) {
        return Err(ImportProblem::Unusable(format!(
            "the variable `{name}` is {why}"
        )));
    }
    Err(ImportProblem::NoVariable {
        wanted: name.to_owned(),
        found: source.listed(),
    })
}

/// The one variable that goes by a known name, alone or as the field of a structure; an earlier name wins.
fn known_as<'a>(source: &'a Source, known: &[&str]) -> Option<&'a Variable> {
    known.iter().find_map(|name| {
        let is_it = |v: &&Variable| {
            let last = v.name.rsplit('.').next().unwrap_or_default();
            // `T` is a temperature, `Time` a time.
            let same = match name.len() {
                1 => last == *name,
                _ => last.eq_ignore_ascii_case(name),
            };
            v.values.len() > 1 && same
        };
        let mut found = source.variables.iter().filter(is_it);
        found.next().filter(|_| found.next().is_none())
    })
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

/// Seconds in a unit of time.
fn seconds(unit: &str) -> Option<f64> {
    Some(match unit {
        "s" | "sec" | "S" | "seconds" => 1.0,
        "ms" | "msec" => 1e-3,
        "us" | "µs" | "μs" => 1e-6,
        "ns" => 1e-9,
        "min" => 60.0,
        "h" => 3600.0,
        _ => return None,
    })
}

fn scaled_times(t: &Variable, scale: f64) -> PrintedTimes {
    // Milliseconds divide exactly where a multiplication by 0.001 would not.
    let whole = (1.0 / scale).round();
    let by = |v: f64| match (whole * scale - 1.0).abs() < 1e-12 && whole > 1.0 {
        true => v / whole,
        false => v * scale,
    };
    let time: Vec<f64> = t.values.iter().map(|&v| by(v)).collect();
    let unit = match &t.exactness {
        Exactness::Printed(units) => units.iter().map(|u| u * scale).collect(),
        // A clock that was added up is off by more than the last bit of one value.
        Exactness::Relative(share) => time.iter().map(|v| 8.0 * share * v.abs()).collect(),
    };
    PrintedTimes { time, unit }
}

fn finite(
    variable: &Variable,
    place: &dyn Fn(&Variable, usize) -> FilePlace,
) -> Result<(), DataError> {
    match variable.values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(k) => {
            let value = variable.values.get(k).copied().unwrap_or(f64::NAN);
            Err(place(variable, k).error(DataProblem::NotFinite(value)))
        }
    }
}

/// Two values near which a command lies, if it is a noisy or scaled on/off command.
fn two_levels(u: &[f64]) -> Option<(f64, f64)> {
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

/// The value with so many digits after its first.
fn brief(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value)
}
