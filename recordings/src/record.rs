//! A record: its columns and their constraints.

use std::collections::BTreeMap;

use crate::error::{DataError, DataProblem, FilePlace};
use crate::thresholds::RULES;

/// Names of columns with a fixed meaning; every other column is a measured channel.
pub(crate) const RESERVED: [&str; 6] = ["t", "u", "y", "y_sd", "y_min", "y_max"];

/// Larger values are rejected: their squares would overflow.
const LARGEST: f64 = 1e100;

/// Shortest and longest sampling period, s: times are written to 12 decimals, a thousandth of the shortest.
pub const PERIODS_S: [f64; 2] = [1e-9, 1e9];

/// Largest number of measured channels of a record, and length of the longest channel name, bytes. With these limits
/// the header and the rows of a file are shorter than the longest line that is read.
const CHANNELS: (usize, usize) = (4096, 200);

/// Use of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Use {
    /// Estimation: parameters are fitted to it.
    Identify,
    /// Validation: models are compared on it.
    Validate,
}

/// One measured (usually phase-averaged) record, sampled uniformly.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Unique within the data set.
    pub name: String,
    /// Estimation or validation.
    pub role: Use,
    /// Sampling period, s, above 0.
    pub sample_period_s: f64,
    /// Time of sample 0 as written in the file, s.
    pub t0: f64,
    /// Command before the first sample, in the unit of `u`, constant before it; `None` for the first value of `u`.
    pub u_before: Option<f64>,
    /// Number of unscored samples at the start (simulated as a lead); at least one sample follows. 0 for
    /// none.
    pub lead: usize,
    /// y before the first sample, if known; set by the preparation, not stored in files.
    pub y_before: Option<f64>,
    /// y of the first samples, which a free run follows because the past that they depend on was not recorded.
    /// Empty for a record that starts at rest. Set by the preparation, not stored in files.
    pub followed: Vec<f64>,
    /// Command (or input) per sample; 0 and 1 for an on/off actuator, any finite value otherwise.
    pub u: Vec<f64>,
    /// Measured output per sample (normalised friction gain), as long as `u`.
    pub y: Vec<f64>,
    /// Standard error of the phase-averaged `y`, ≥ 0, as long as `u`.
    pub y_sd: Option<Vec<f64>>,
    /// Lower envelope of `y` over the repeats, as long as `u`.
    pub y_min: Option<Vec<f64>>,
    /// Upper envelope of `y` over the repeats, as long as `u`.
    pub y_max: Option<Vec<f64>>,
    /// Further measured channels by name (`u_inf`, `temperature` …), each as long as `u`.
    pub channels: BTreeMap<String, Vec<f64>>,
}

impl Record {
    /// The samples `from..to` as a separate record; samples beyond the end are left out.
    ///
    /// The command before a part is that of the preceding sample. Samples of the lead stay lead; a part inside the
    /// lead is entirely lead.
    #[must_use]
    pub fn part(&self, from: usize, to: usize) -> Self {
        let cut = |series: &Vec<f64>| -> Vec<f64> {
            let wanted = series.iter().skip(from).take(to.saturating_sub(from));
            wanted.copied().collect()
        };
        Self {
            name: self.name.clone(),
            role: self.role,
            sample_period_s: self.sample_period_s,
            t0: self.t0 + from as f64 * self.sample_period_s,
            u_before: match from.checked_sub(1).and_then(|k| self.u.get(k)) {
                Some(&before) => Some(before),
                None => self.u_before,
            },
            lead: self.lead.min(to).saturating_sub(from),
            y_before: self.y_before.filter(|_| from == 0),
            followed: cut(&self.followed),
            u: cut(&self.u),
            y: cut(&self.y),
            y_sd: self.y_sd.as_ref().map(cut),
            y_min: self.y_min.as_ref().map(cut),
            y_max: self.y_max.as_ref().map(cut),
            channels: self
                .channels
                .iter()
                .map(|(name, series)| (name.clone(), cut(series)))
                .collect(),
        }
    }

    /// A record of input and output alone, starting at t = 0.
    #[must_use]
    pub fn new(name: &str, role: Use, sample_period_s: f64, u: Vec<f64>, y: Vec<f64>) -> Self {
        Self {
            name: name.to_owned(),
            role,
            sample_period_s,
            t0: 0.0,
            u_before: None,
            lead: 0,
            y_before: None,
            followed: Vec::new(),
            u,
            y,
            y_sd: None,
            y_min: None,
            y_max: None,
            channels: BTreeMap::new(),
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.u.len()
    }

    /// Memory of the record, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        let columns = self.columns().count() as u64;
        (columns + 2) * 8 * self.len() as u64
    }

    /// Whether the record has no sample (never true for a record of a data set).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.u.is_empty()
    }

    /// Time of sample `k`, s.
    #[must_use]
    pub fn time(&self, k: usize) -> f64 {
        self.t0 + k as f64 * self.sample_period_s
    }

    /// Whether every value of the command is exactly 0 or 1.
    #[must_use]
    pub fn is_on_off(&self) -> bool {
        self.u.iter().all(|&u| u == 0.0 || u == 1.0)
    }

    /// The first sample of an otherwise on/off command that is neither 0 nor 1; `None` for a command with levels.
    pub(crate) fn stray(&self) -> Option<usize> {
        let takes = |level: f64| self.u.contains(&level);
        let odd = |u: &f64| *u != 0.0 && *u != 1.0;
        let count = self.u.iter().filter(|u| odd(u)).count();
        let few = count <= 1 || count as f64 <= RULES.stray * self.len() as f64;
        if takes(0.0) && takes(1.0) && few {
            self.u.iter().position(odd)
        } else {
            None
        }
    }

    /// Every column with its name, in the order of the file.
    pub(crate) fn columns(&self) -> impl Iterator<Item = (&str, &[f64])> {
        [("u", Some(&self.u)), ("y", Some(&self.y))]
            .into_iter()
            .chain([
                ("y_sd", self.y_sd.as_ref()),
                ("y_min", self.y_min.as_ref()),
                ("y_max", self.y_max.as_ref()),
            ])
            .filter_map(|(name, values)| Some((name, values?.as_slice())))
            .chain(
                self.channels
                    .iter()
                    .map(|(name, values)| (name.as_str(), values.as_slice())),
            )
    }

    /// Checks all properties of a record that a [`DataSet`] guarantees; `place` turns a sample into a place in a
    /// file.
    pub(crate) fn check(
        &self,
        place: &dyn Fn(Option<usize>) -> FilePlace,
    ) -> Result<(), DataError> {
        if self.name.trim().is_empty() || self.name.chars().any(char::is_control) {
            return Err(place(None).error(DataProblem::BadName));
        }
        check_period(self.sample_period_s).map_err(|problem| place(None).error(problem))?;
        if self.u.len() < 2 {
            return Err(place(None).error(DataProblem::TooFewRows(self.u.len())));
        }
        check_values("t", &[self.t0], place)?;
        self.check_times()
            .map_err(|problem| place(None).in_column("t").error(problem))?;
        let (most, longest) = CHANNELS;
        if self.channels.len() > most {
            let found = self.channels.len();
            return Err(place(None).error(DataProblem::TooManyChannels { found, most }));
        }
        if let Some(name) = self.channels.keys().find(|name| name.len() > longest) {
            return Err(place(None)
                .in_column(name)
                .error(DataProblem::LongName(longest)));
        }
        self.check_start(&place(None))?;
        for (name, values) in self.columns() {
            if values.len() != self.u.len() {
                return Err(place(None)
                    .in_column(name)
                    .error(DataProblem::UnequalLengths {
                        expected: self.u.len(),
                        found: values.len(),
                    }));
            }
            check_values(name, values, place)?;
        }
        if let Some(name) = self
            .channels
            .keys()
            .find(|n| RESERVED.contains(&n.as_str()))
        {
            return Err(place(None)
                .in_column(name)
                .error(DataProblem::ReservedChannel));
        }
        if let Some(name) = self.channels.keys().find(|n| {
            n.trim().is_empty() || n.trim() != n.as_str() || n.chars().any(char::is_control)
        }) {
            return Err(place(None).in_column(name).error(DataProblem::BadName));
        }
        if let Some((k, &sd)) = indexed(self.y_sd.as_deref()).find(|&(_, &sd)| sd < 0.0) {
            return Err(place(Some(k))
                .in_column("y_sd")
                .error(DataProblem::NegativeDeviation(sd)));
        }
        let envelope = indexed(self.y_min.as_deref()).zip(self.y_max.iter().flatten());
        for ((k, &low), &high) in envelope {
            if low > high {
                return Err(place(Some(k))
                    .in_column("y_min")
                    .error(DataProblem::EnvelopeCrossed { low, high }));
            }
        }
        Ok(())
    }
}

impl Record {
    /// Checks that the times are finite and resolved in double precision.
    fn check_times(&self) -> Result<(), DataProblem> {
        let latest = self.t0.abs().max(self.time(self.len()).abs());
        if latest >= RULES.latest_s {
            return Err(DataProblem::NotSeconds(latest));
        }
        if latest * f64::EPSILON > RULES.uneven * self.sample_period_s {
            return Err(DataProblem::LateTimes {
                time: latest,
                period: self.sample_period_s,
            });
        }
        Ok(())
    }

    /// Checks the start settings of the record; `place` is the file or record, or its `dataset.toml`.
    pub(crate) fn check_start(&self, place: &FilePlace) -> Result<(), DataError> {
        let before = self.u_before.unwrap_or(0.0);
        if !before.is_finite() || before.abs() > LARGEST {
            let problem = DataProblem::BadCommandBefore(before);
            return Err(place.clone().at_key("u_before").error(problem));
        }
        if self.lead >= self.len() {
            let problem = DataProblem::OnlyLead {
                lead: self.lead,
                samples: self.len(),
            };
            return Err(place.clone().at_key("lead_samples").error(problem));
        }
        Ok(())
    }
}

/// Checks a sampling period, s.
pub(crate) fn check_period(seconds: f64) -> Result<(), DataProblem> {
    let [shortest, longest] = PERIODS_S;
    match (shortest..=longest).contains(&seconds) {
        true => Ok(()),
        false => Err(DataProblem::BadPeriod(seconds)),
    }
}

pub(crate) fn indexed(values: Option<&[f64]>) -> impl Iterator<Item = (usize, &f64)> {
    values.unwrap_or_default().iter().enumerate()
}

/// Checks that every value is finite and not too large.
pub(crate) fn check_values(
    column: &str,
    values: &[f64],
    place: &dyn Fn(Option<usize>) -> FilePlace,
) -> Result<(), DataError> {
    for (k, &value) in values.iter().enumerate() {
        let problem = if !value.is_finite() {
            DataProblem::NotFinite(value)
        } else if value.abs() > LARGEST {
            DataProblem::TooLarge(value)
        } else {
            continue;
        };
        return Err(place(Some(k)).in_column(column).error(problem));
    }
    Ok(())
}

/// Origin of a record.
#[derive(Debug, Clone, Default)]
pub(crate) struct Origin {
    pub(crate) file: Option<std::path::PathBuf>,
    /// Line of each sample, when it came from a file.
    pub(crate) lines: Vec<u64>,
}

impl Origin {
    pub(crate) fn place(&self, name: &str, sample: Option<usize>) -> FilePlace {
        match &self.file {
            Some(file) => FilePlace {
                file: Some(file.clone()),
                line: sample.and_then(|k| self.lines.get(k).copied()),
                ..FilePlace::default()
            },
            None => FilePlace {
                record: Some(name.to_owned()),
                sample,
                ..FilePlace::default()
            },
        }
    }
}

/// Variance of the rounding of records' readings y, the mean of Δ²/12 over the records, with Δ the smallest difference
/// between two readings of a record, in the unit of y. 0 without records, and for a record whose readings are all
/// equal.
#[must_use]
pub fn rounding_variance<'a>(records: impl Iterator<Item = &'a [f64]>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for y in records {
        let mut sorted = y.to_vec();
        sorted.sort_by(f64::total_cmp);
        let steps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
        let least = steps.filter(|step| *step > 0.0).reduce(f64::min);
        sum += least.unwrap_or(0.0).powi(2) / 12.0;
        count += 1.0;
    }
    sum / f64::max(count, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record() -> Record {
        Record::new(
            "a",
            Use::Identify,
            0.001,
            vec![0.0, 1.0, 1.0],
            vec![0.0, 0.1, 0.2],
        )
    }

    fn message(change: impl FnOnce(&mut Record)) -> String {
        let mut r = record();
        change(&mut r);
        let here = |sample| Origin::default().place("a", sample);
        r.check(&here).unwrap_err().to_string()
    }

    #[test]
    fn a_stray_value_is_told_from_a_level() {
        let of = |u: Vec<f64>| Record::new("a", Use::Identify, 0.001, u.clone(), u).stray();
        let mut command: Vec<f64> = (0..200).map(|k| f64::from(k / 50 % 2)).collect();
        assert_eq!(of(command.clone()), None);
        command[60] = 2.0;
        assert_eq!(of(command.clone()), Some(60));
        command[10] = 0.5;
        assert_eq!(of(command.clone()), Some(10));
        // The commands are a staircase, a relay between other levels, and a short command with one
        // wrong value.
        let levels = (0..200).map(|k| f64::from(k / 20) / 9.0).collect();
        assert_eq!(of(levels), None);
        assert_eq!(of(vec![0.0, 0.0, 2.0, 0.0]), None);
        assert_eq!(of(vec![0.0, 1.0, 2.0, 0.0]), Some(2));
    }

    #[test]
    fn a_part_keeps_the_command_before_it_and_its_share_of_the_lead() {
        let mut whole = record();
        (whole.u_before, whole.lead) = (Some(0.5), 2);
        let start_of = |whole: &Record, from, to| {
            let part = whole.part(from, to);
            (part.u_before, part.lead, part.len())
        };
        assert_eq!(start_of(&whole, 0, 3), (Some(0.5), 2, 3));
        assert_eq!(start_of(&whole, 0, 1), (Some(0.5), 1, 1));
        assert_eq!(start_of(&whole, 1, 3), (Some(0.0), 1, 2));
        assert_eq!(start_of(&whole, 2, 3), (Some(1.0), 0, 1));
        whole.u_before = None;
        assert_eq!(start_of(&whole, 0, 3).0, None);
        assert!(message(|r| r.lead = 3).contains("key `lead_samples`"));
        assert!(message(|r| r.u_before = Some(f64::NAN)).contains("key `u_before`"));
    }

    #[test]
    fn every_rule_of_a_record_is_checked_and_named() {
        assert!(message(|r| r.y[1] = f64::NAN).contains("record `a`, sample 1, column `y`"));
        assert!(message(|r| r.u[0] = 1e200).contains("units"));
        assert!(message(|r| r.y.truncate(2)).contains("2 values where u has 3"));
        assert!(
            message(|r| r.y_sd = Some(vec![0.0, 0.0, -0.1])).contains("sample 2, column `y_sd`")
        );
        assert!(message(|r| r.sample_period_s = 0.0).contains("above 0"));
        assert!(message(|r| r.t0 = f64::INFINITY).contains("column `t`"));
        assert!(message(|r| r.name = " ".into()).contains("empty"));
        assert!(
            message(|r| {
                r.channels.insert("y_sd".into(), vec![0.0; 3]);
            })
            .contains("reserved")
        );
        assert!(
            message(|r| {
                r.y_min = Some(vec![0.0, 0.0, 2.0]);
                r.y_max = Some(vec![1.0, 1.0, 1.0]);
            })
            .contains("sample 2, column `y_min`")
        );
        assert!(
            message(|r| {
                r.u.truncate(1);
                r.y.truncate(1);
            })
            .contains("at least 2")
        );
    }

    #[test]
    fn a_coarse_converter_rounds_and_a_fine_one_does_not() {
        let smooth: Vec<f64> = (0..1000).map(|k| (k as f64 * 0.37).sin()).collect();
        let coarse: Vec<f64> = smooth.iter().map(|y| (y / 0.25).round() * 0.25).collect();
        let of = |records: &[&[f64]]| rounding_variance(records.iter().copied());
        let known = 0.25f64.powi(2) / 12.0;
        assert!((of(&[&coarse]) - known).abs() < 1e-12);
        assert!(of(&[&smooth]) < 1e-8);
        assert!((of(&[&coarse, &[3.0; 9]]) - known / 2.0).abs() < 1e-12);
        assert_eq!(of(&[]), 0.0);
    }
}
