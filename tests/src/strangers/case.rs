//! A case: records, commands, and the expected answer.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A command that is run on a case, in addition to `import` and `compare`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Step {
    /// `identify`, and `compare` with the file that it writes.
    Identify,
    /// `delay`.
    Delay,
    /// `diagnose -o`, and `compare` with the file that it writes.
    Diagnose,
    /// `discover -o`, and `compare` with the file that it writes.
    Discover,
    /// `extend -o` with one effect, and `compare` with the file that it writes.
    Extend,
}

impl Step {
    /// The step by the name of its command.
    #[must_use]
    pub fn named(word: &str) -> Option<Self> {
        let all = [
            ("identify", Self::Identify),
            ("delay", Self::Delay),
            ("diagnose", Self::Diagnose),
            ("discover", Self::Discover),
            ("extend", Self::Extend),
        ];
        let found = all.into_iter().find(|(name, _)| *name == word)?;
        Some(found.1)
    }
}

/// Records, commands and the expected answer.
#[derive(Clone, Debug, Default)]
pub struct Case {
    /// Name of the set.
    pub set: String,
    /// Name of the case.
    pub name: String,
    /// Kind of the records.
    pub kind: String,
    /// Estimation records.
    pub files: Vec<PathBuf>,
    /// Validation records.
    pub validate: Vec<PathBuf>,
    /// Options of `import`; none for CSV files that are used directly.
    pub import: Option<Vec<String>>,
    /// Commands to run.
    pub commands: Vec<Step>,
    /// A case of the same set that must have the same answer.
    pub same_answer_as: Option<String>,
    /// The expected answer.
    pub right: Right,
}

/// The expected answer; omitted items are not checked, apart from general requirements.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Right {
    /// Exit codes other than 0, by command.
    pub exit: BTreeMap<String, i32>,
    /// Range of every input delay of the model, which must be constant, samples.
    pub delay_samples: Option<[f64; 2]>,
    /// Range of every delay that `delay` measures, samples.
    pub edge_delay_samples: Option<[f64; 2]>,
    /// Value that the interval of the dead time measured by `delay` must contain, to half a sample.
    pub dead_time_samples: Option<f64>,
    /// Largest number of state lags.
    pub n1_at_most: Option<usize>,
    /// Largest number of product lags.
    pub n2_at_most: Option<usize>,
    /// Correct verdicts of `diagnose`; any if empty.
    pub verdicts: Vec<String>,
    /// Effects that may be named.
    pub names: Vec<String>,
    /// Largest number of terms of `discover`.
    pub terms_at_most: Option<usize>,
    /// Least FIT of `compare`, in percent.
    pub fit_at_least: Option<f64>,
    /// Least share of scored samples; half by default.
    pub scored_at_least: Option<f64>,
    /// Range of the sampling period of the data set, s.
    pub period_s: Option<[f64; 2]>,
    /// Range that u of the data set must stay in and reach, within 1 %.
    pub u: Option<[f64; 2]>,
    /// Range that y of the data set must stay in.
    pub y: Option<[f64; 2]>,
    /// Range of the number of samples of the data set.
    pub samples: Option<[usize; 2]>,
    /// Phrases that the output must contain.
    pub said: Vec<String>,
    /// Phrases that the output must not contain.
    pub not_said: Vec<String>,
}

/// `expected.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Expected {
    /// Kind of the records.
    pub(super) kind: String,
    #[serde(rename = "case")]
    pub(super) cases: Vec<ExpectedCase>,
}

/// `[[case]]` of `expected.toml`.
#[derive(Debug, Deserialize)]
pub(super) struct ExpectedCase {
    pub(super) name: String,
    pub(super) files: Vec<String>,
    #[serde(default)]
    pub(super) validate: Vec<String>,
    pub(super) import: Option<Vec<String>>,
    pub(super) commands: Option<Vec<Step>>,
    pub(super) same_answer_as: Option<String>,
    /// Further keys, checked for unknown names.
    #[serde(flatten)]
    pub(super) right: toml::Table,
}
