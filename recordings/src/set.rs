//! Consistent records as a data set.

use crate::error::{DataError, DataProblem, FilePlace};
use crate::hash;
use crate::record::{Origin, Record, Use, indexed};
use crate::sampling::tidy;
use crate::thresholds::RULES;

/// The name of the file that makes a folder a data set.
pub(crate) const MANIFEST: &str = "dataset.toml";

/// Records of one rig and one sampling period.
///
/// Made by [`DataSet::load`] or [`DataSet::from_records`], which check every condition stated at [`Record`]; code
/// that receives a `DataSet` relies on it. Changed records must pass through [`DataSet::from_records`] again, which
/// also renews the hash.
#[derive(Debug, Clone)]
pub struct DataSet {
    /// Title for reports.
    pub title: Option<String>,
    /// Sampling period of every record, s.
    pub sample_period_s: f64,
    /// Kind of plant: affects the interpretation of effects, not the computation.
    pub plant: Plant,
    /// At least one record; names are unique.
    pub records: Vec<Record>,
    /// Hash of names, uses, sampling period and every value, 16 hexadecimal digits: FNV-1a, 64 bits.
    pub hash: String,
    /// Source of each record (folder or file, line of each sample), for messages.
    origin: Vec<Origin>,
}

/// Kinds of plants (`plant` in `dataset.toml`). Names of effects refer to flows; for other plants only the
/// observed behaviour is reported.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Plant {
    /// A separated flow with jets: the default.
    #[default]
    Flow,
    /// Heating, cooling, heat exchangers.
    Thermal,
    /// Electric drives.
    Motor,
    /// Tanks, pumps, valves.
    Process,
    /// Anything else.
    Other,
}

impl Plant {
    /// Whether the plant is the default, which is not written to files.
    #[must_use]
    pub fn is_flow(&self) -> bool {
        *self == Self::Flow
    }
}

impl DataSet {
    /// A data set from records in memory.
    ///
    /// # Errors
    /// [`DataError`] naming record, sample and column when a record breaks a rule of [`Record`], two records share a
    /// name, their sampling periods differ, or there is no record.
    pub fn from_records(title: Option<String>, records: Vec<Record>) -> Result<Self, DataError> {
        let origin = vec![Origin::default(); records.len()];
        Self::assemble(title, records, origin, &FilePlace::default())
    }

    /// Checks the records and their consistency; `whole` is the place for errors of the set itself.
    pub(crate) fn assemble(
        title: Option<String>,
        records: Vec<Record>,
        origin: Vec<Origin>,
        whole: &FilePlace,
    ) -> Result<Self, DataError> {
        let Some(first) = records.first() else {
            return Err(whole.clone().error(DataProblem::NoRecords));
        };
        let sample_period_s = first.sample_period_s;
        for (i, (record, origin)) in records.iter().zip(&origin).enumerate() {
            record.check(&|sample| origin.place(&record.name, sample))?;
            if record.sample_period_s != sample_period_s {
                return Err(origin
                    .place(&record.name, None)
                    .error(DataProblem::PeriodsDiffer {
                        found: record.sample_period_s,
                        other: sample_period_s,
                        first: first.name.clone(),
                    }));
            }
            if records.iter().take(i).any(|r| r.name == record.name) {
                return Err(whole
                    .clone()
                    .at_key("name")
                    .error(DataProblem::DoubledRecord(record.name.clone())));
            }
        }
        Ok(Self {
            hash: hash::of(sample_period_s, &records),
            title,
            plant: Plant::default(),
            sample_period_s,
            records,
            origin,
        })
    }

    /// The estimation records.
    pub fn identify(&self) -> impl Iterator<Item = &Record> {
        self.records.iter().filter(|r| r.role == Use::Identify)
    }

    /// The validation records.
    pub fn validate(&self) -> impl Iterator<Item = &Record> {
        self.records.iter().filter(|r| r.role == Use::Validate)
    }

    /// Whether the command is exactly 0 or 1 throughout.
    #[must_use]
    pub fn is_on_off(&self) -> bool {
        self.records.iter().all(Record::is_on_off)
    }

    /// Position of sample `k` of record `record` in the user's files, for messages.
    #[must_use]
    pub fn place(&self, record: usize, k: Option<usize>) -> FilePlace {
        let name = self.records.get(record).map_or("", |r| r.name.as_str());
        self.origin
            .get(record)
            .map_or_else(FilePlace::default, |origin| origin.place(name, k))
    }

    /// Refuses on/off commands with values that are neither 0 nor 1.
    ///
    /// # Errors
    /// [`DataError`] naming file and line (or record and sample) of the first such value.
    pub(crate) fn refuse_strays(&self) -> Result<(), DataError> {
        for (i, record) in self.records.iter().enumerate() {
            if let Some(k) = record.stray() {
                let u = record.u.get(k).copied().unwrap_or(f64::NAN);
                return Err(self
                    .place(i, Some(k))
                    .in_column("u")
                    .error(DataProblem::StrayInput(u)));
            }
        }
        Ok(())
    }

    /// Refuses data whose command is not on/off.
    ///
    /// # Errors
    /// [`DataError`] naming file and line (or record and sample) of the first value that is neither 0 nor 1.
    pub fn require_on_off(&self) -> Result<(), DataError> {
        for (i, record) in self.records.iter().enumerate() {
            if let Some((k, &u)) = indexed(Some(&record.u)).find(|&(_, &u)| u != 0.0 && u != 1.0) {
                return Err(self
                    .place(i, Some(k))
                    .in_column("u")
                    .error(DataProblem::NotOnOff(u)));
            }
        }
        Ok(())
    }
}

/// Sampling periods of records before they were unified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OnePeriod {
    /// Shortest period, s.
    pub(crate) shortest: f64,
    /// Longest, s.
    pub(crate) longest: f64,
    /// Mean over all steps, s: the unified period.
    pub(crate) mean: f64,
}

/// Gives records one period, the mean over all steps, if their sampling periods differ by less than a sample over
/// the longest record. If they are equal or differ by more, nothing is changed and `None` returned.
pub(crate) fn unite_periods(records: &mut [Record]) -> Option<OnePeriod> {
    let mut found = OnePeriod {
        shortest: f64::INFINITY,
        longest: 0.0,
        mean: 0.0,
    };
    let (mut steps, mut most) = (0.0, 0.0_f64);
    for record in &*records {
        found.shortest = found.shortest.min(record.sample_period_s);
        found.longest = found.longest.max(record.sample_period_s);
        let own = record.len().saturating_sub(1) as f64;
        found.mean += own * record.sample_period_s;
        steps += own;
        most = most.max(own);
    }
    found.mean /= steps;
    let spread = found.longest - found.shortest;
    if !(spread > 0.0 && spread * most < RULES.drift * found.mean) {
        return None;
    }
    found.mean = tidy(found.mean, (spread / found.mean / 4.0).max(1e-9));
    for record in records {
        record.sample_period_s = found.mean;
    }
    Some(found)
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

    #[test]
    fn sets_need_unique_names_and_one_period() {
        let error = |records| {
            DataSet::from_records(None, records)
                .unwrap_err()
                .to_string()
        };
        assert!(error(vec![]).contains("[[record]]"));
        assert!(error(vec![record(), record()]).contains("used twice"));
        let other = Record {
            name: "b".into(),
            sample_period_s: 0.002,
            ..record()
        };
        assert!(error(vec![record(), other]).contains("0.002"));
    }

    #[test]
    fn periods_that_differ_by_less_than_a_sample_are_made_one() {
        let of = |period: f64, n: usize| {
            let u = (0..n).map(|k| k as f64).collect::<Vec<_>>();
            Record::new("a", Use::Identify, period, u.clone(), u)
        };
        let mut records = [of(0.990396, 900), of(0.990492, 900)];
        let found = unite_periods(&mut records).unwrap();
        assert!((found.mean - 0.990444).abs() < 2e-5, "{found:?}");
        assert!(records.iter().all(|r| r.sample_period_s == found.mean));
        assert_eq!(unite_periods(&mut records), None);
        // 899 steps that are each 0.2 % longer are together 1.8 samples longer.
        let mut records = [of(0.990, 900), of(0.992, 900)];
        assert_eq!(unite_periods(&mut records), None);
        assert_eq!(records[1].sample_period_s, 0.992);
        assert_eq!(unite_periods(&mut [of(1.0, 1), of(1.0, 1)]), None);
    }

    #[test]
    fn on_off_is_asked_for_where_needed() {
        let mut half = record();
        half.u[2] = 0.5;
        let set = DataSet::from_records(None, vec![half]).unwrap();
        assert!(!set.is_on_off());
        let text = set.require_on_off().unwrap_err().to_string();
        assert!(
            text.contains("sample 2, column `u`") && text.contains("0.5"),
            "{text}"
        );
        let set = DataSet::from_records(None, vec![record()]).unwrap();
        assert!(set.require_on_off().is_ok());
        assert_eq!((set.identify().count(), set.validate().count()), (1, 0));
    }
}
