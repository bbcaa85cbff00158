//! How well a model matches, and where it fails.

use serde::{Serialize, Serializer};

use super::{StepError, check_period};
use crate::data::DataSet;
use crate::indicators::{Scores, score};
use crate::model::Model;
use crate::residual::{Failures, where_it_fails};

/// A model beside recordings. Serialises to the keys of `compare --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Indicators per record, and of the identify and of the validate records together.
    #[serde(flatten)]
    pub scores: Scores,
    /// Where the model fails.
    #[serde(rename = "where", serialize_with = "places")]
    pub failures: Failures,
    /// The same in sentences.
    pub words: Vec<String>,
    /// The free run of each record, y.
    #[serde(skip)]
    pub runs: Vec<Vec<f64>>,
}

fn places<S: Serializer>(failures: &Failures, serializer: S) -> Result<S::Ok, S::Error> {
    failures.by.serialize(serializer)
}

/// Runs `model` free over every record of `set`.
///
/// ```
/// use host_fit::data::DataSet;
/// use host_fit::model::Model;
/// use host_fit::steps::compare;
///
/// let model = Model::load("../data/paper/table-2-state-dependent.toml".as_ref())?;
/// let set = DataSet::load("../data/paper-like".as_ref())?;
/// let compared = compare(&model, &set)?;
/// assert_eq!(compared.scores.records.len(), set.records.len());
/// println!("{}", compared.words.join(" "));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`] when the sampling periods differ, a channel is missing or a run diverges.
pub fn compare(model: &Model, set: &DataSet) -> Result<Comparison, StepError> {
    check_period(model, set)?;
    let records = model.targets(&set.records);
    let (scores, runs) = score(model, &records)?;
    let failures = where_it_fails(model, &records)?;
    Ok(Comparison {
        words: failures.describe(),
        scores,
        failures,
        runs,
    })
}
