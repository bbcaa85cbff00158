//! Effects added to a model.

use std::collections::BTreeMap;

use serde::{Serialize, Serializer};

use super::design::command_after;
use super::memory::Work;
use super::onlooker::watched;
use super::prepared::prepared;
use super::{Answer, Onlooker, StepError, check_period, level, trained_in_free_run};
use crate::data::{DataSet, Use};
use crate::diagnose::ParameterEstimate;
use crate::extend::{Extended, extend as refit};
use crate::indicators::{Indicators, Scores, score, score_new};
use crate::model::Model;
use crate::picture::{listed, significant};
use crate::residual::where_it_fails;
use crate::terms::measured_inputs;

/// A model with effects added. Serialises to the keys of `extend --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Extension {
    /// The model.
    #[serde(skip)]
    pub model: Model,
    /// The answer: verdict, evidence, next command.
    pub answer: Answer,
    /// The effects that were added: one name, or a list of them.
    #[serde(rename = "effect", serialize_with = "one_or_several")]
    pub effects: Vec<String>,
    /// Parameters of the effects by name; preceded by the effect's name if several were added.
    pub parameters: BTreeMap<String, ParameterEstimate>,
    /// Validation indicators before; `None` if the given model diverges on these records.
    pub before: Option<Indicators>,
    /// Validation indicators after.
    pub after: Option<Indicators>,
    /// Terms of the given model that the new one does not need: base terms by name, `lags`.
    pub dropped: Vec<String>,
    /// Error of each record before and after.
    pub records: Vec<RecordChange>,
    /// All indicators before.
    #[serde(skip)]
    pub scores_before: Option<Scores>,
    /// All indicators after.
    #[serde(skip)]
    pub scores_after: Scores,
}

/// The error of a record before and after.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordChange {
    /// The record.
    pub name: String,
    /// Root mean square error of the free run before, y; none if it diverges.
    pub before_rmse: Option<f64>,
    /// After.
    pub after_rmse: f64,
    /// The noise level, y; none without `y_sd`.
    pub noise_rmse: Option<f64>,
}

fn one_or_several<S: Serializer>(effects: &[String], serializer: S) -> Result<S::Ok, S::Error> {
    match effects {
        [one] => one.serialize(serializer),
        several => several.serialize(serializer),
    }
}

/// Base terms of `model` that `extended` lacks, and `lags` if it has fewer of them.
fn dropped(model: &Model, extended: &Model) -> Vec<String> {
    let lags = |model: &Model| model.state_lags.len() + model.product_lags.len();
    let mut dropped = model.effect_names();
    let kept = extended.effect_names();
    dropped.retain(|name| !kept.contains(name));
    dropped.extend((lags(extended) < lags(model)).then(|| "lags".to_owned()));
    dropped
}

/// A model with a larger error than the given one is rejected.
fn refuse_worse(
    effects: &[String],
    before: Option<&Scores>,
    after: &Scores,
) -> Result<(), StepError> {
    let (Some(before), Some(after)) = (before.and_then(Scores::held_out), after.held_out()) else {
        return Ok(());
    };
    if after.rmse <= before.rmse {
        return Ok(());
    }
    Err(StepError::NoGain {
        effects: listed(effects),
        before: significant(before.rmse, 5),
        after: match after.rmse.is_finite() {
            true => significant(after.rmse, 5),
            false => "it diverges".to_owned(),
        },
        on: match after.role {
            Use::Validate => "validation",
            Use::Identify => "estimation",
        },
    })
}

/// Adds the effects called `effects` to `model` and refits everything on the identify records of `set`.
///
/// ```no_run
/// use host_fit::data::DataSet;
/// use host_fit::model::Model;
/// use host_fit::steps::extend;
///
/// let model = Model::load("model.toml".as_ref())?;
/// let set = DataSet::load("data/hidden-ramp".as_ref())?;
/// let extended = extend(&model, &set, &["plenum-droop".to_owned()], &())?;
/// println!("{:.1} s", extended.parameters["recovery_time"].value);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`]: an unknown or doubled effect, a missing channel, a model that diverges from every start.
pub fn extend(
    model: &Model,
    set: &DataSet,
    effects: &[String],
    onlooker: &dyn Onlooker,
) -> Result<Extension, StepError> {
    check_period(model, set)?;
    Work::Diagnose.fits(set)?;
    let prepared = prepared(set)?;
    let records = model.targets(&prepared.records);
    // A model that diverges on these records can still be extended.
    let scores_before = score(model, &records).ok().map(|(scores, _)| scores);
    let Extended {
        model: mut extended,
        parameters,
    } = watched(onlooker, "refitting everything", || {
        let knowing = model.with_inputs(measured_inputs(&records));
        let progress = |what: &str| onlooker.now(what);
        refit(&knowing, &records, effects, onlooker.interrupt(), &progress)
    })?;
    extended.forget_unused(model);
    let (scores_after, diverged) = score_new(&extended, &records)?;
    if scores_before.is_none()
        && let Some(diverged) = diverged.into_iter().next()
    {
        return Err(diverged.into());
    }
    refuse_worse(effects, scores_before.as_ref(), &scores_after)?;
    extended.training = trained_in_free_run(set, &scores_after, model.training.seed);
    let above_noise = where_it_fails(&extended, &records).map_or(true, |of| of.above_noise);
    let finished = (!above_noise).then(|| command_after(&extended));
    let several = parameters.len() > 1;
    let named = |effect: &str, name: String| match several {
        true => format!("{effect}.{name}"),
        false => name,
    };
    let parameters = parameters.into_iter().flat_map(|(effect, own)| {
        let each = own.into_iter();
        each.map(move |(name, estimate)| (named(&effect, name), estimate))
    });
    let before_rmse = |index: usize| Some(scores_before.as_ref()?.records.get(index)?.rmse);
    let changes = scores_after.records.iter().enumerate();
    Ok(Extension {
        answer: level::extended(
            &listed(effects),
            finished,
            scores_before.as_ref().and_then(Scores::held_out),
            scores_after.held_out(),
        ),
        effects: effects.to_vec(),
        parameters: parameters.collect(),
        before: scores_before.as_ref().and_then(Scores::held_out).cloned(),
        after: scores_after.held_out().cloned(),
        dropped: dropped(model, &extended),
        records: changes
            .map(|(index, after)| RecordChange {
                name: after.name.clone(),
                before_rmse: before_rmse(index),
                after_rmse: after.rmse,
                noise_rmse: after.noise_rmse,
            })
            .collect(),
        model: extended,
        scores_before,
        scores_after,
    })
}
