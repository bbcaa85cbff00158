//! Comparison of a model with records: indicators and where it fails.

use serde::{Serialize, Serializer};

use super::design::command_after;
use super::memory::Work;
use super::prepared::prepared;
use super::{Answer, Beside, StepError, check_period, level};
use crate::data::DataSet;
use crate::indicators::{Scores, score};
use crate::model::Model;
use crate::preparation::Preparation;
use crate::residual::{Failures, where_it_fails};

/// A model compared with records. Serialises to the keys of `compare --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Indicators per record, and of the identify and of the validate records together.
    #[serde(flatten)]
    pub scores: Scores,
    /// Where the model fails.
    #[serde(rename = "where", serialize_with = "places")]
    pub failures: Failures,
    /// Baselines on the same samples.
    #[serde(flatten)]
    pub beside: Beside,
    /// The answer: verdict, evidence, confidence, next command.
    pub answer: Answer,
    /// Where the model fails, in sentences.
    pub words: Vec<String>,
    /// The free run of each record, y.
    #[serde(skip)]
    pub runs: Vec<Vec<f64>>,
}

/// Several models compared with the same records. Serialises to the keys of `compare --json` of several
/// models.
#[derive(Clone, Debug, Serialize)]
pub struct SideBySide {
    /// The answer: which model has the lowest error.
    pub answer: Answer,
    /// The models in the order in which they were given.
    pub models: Vec<NamedComparison>,
}

/// One of several models.
#[derive(Clone, Debug, Serialize)]
pub struct NamedComparison {
    /// Name of the model.
    pub model: String,
    /// Number of parameters: non-zero coefficients, delay and effects.
    pub parameters: usize,
    /// Effects of the model.
    pub effects: Vec<String>,
    /// The model compared with the recordings.
    #[serde(flatten)]
    pub comparison: Comparison,
}

/// Runs each of the `given` models, which have names, free over every record of `set`.
///
/// # Errors
/// [`StepError`] as [`compare`], with the name of the model.
pub fn compare_several(
    given: &[(String, &Model)],
    set: &DataSet,
) -> Result<SideBySide, (String, StepError)> {
    let of_first = |error| {
        (
            given.first().map(|(n, _)| n.clone()).unwrap_or_default(),
            error,
        )
    };
    Work::Compare
        .fits(set)
        .map_err(|error| of_first(error.into()))?;
    let ready = prepared(set).map_err(of_first)?;
    let each = given.iter().map(|(name, model)| {
        let comparison = check_period(model, set).and_then(|()| compared_on(model, &ready));
        let comparison = comparison.map_err(|error| (name.clone(), error))?;
        Ok(NamedComparison {
            model: name.clone(),
            parameters: model.parameter_count(),
            effects: model.effect_names(),
            comparison,
        })
    });
    let models: Vec<NamedComparison> = each.collect::<Result<_, _>>()?;
    let finished = |name: &str| {
        let best = given.iter().find(|(own, _)| own == name);
        best.map_or_else(String::new, |(_, model)| command_after(model))
    };
    Ok(SideBySide {
        answer: level::ranked(&models, finished),
        models,
    })
}

impl SideBySide {
    /// The model with the lowest error, to which the next command of the answer applies.
    #[must_use]
    pub fn best(&self) -> Option<&NamedComparison> {
        level::ascending(&self.models)
            .first()
            .map(|(best, _)| *best)
    }
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
    Work::Compare.fits(set)?;
    compared_on(model, &prepared(set)?)
}

/// [`compare`] on records that are made ready.
fn compared_on(model: &Model, prepared: &Preparation) -> Result<Comparison, StepError> {
    let records = model.targets(&prepared.records);
    let (scores, runs) = score(model, &records)?;
    let failures = where_it_fails(model, &records)?;
    Ok(Comparison {
        words: failures.describe(),
        answer: level::compared(|| command_after(model), &scores, &failures, &records, &runs),
        beside: Beside::of(&records),
        scores,
        failures,
        runs,
    })
}
