//! Diagnosis of a missing physical effect.

use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

use super::memory::Work;
use super::onlooker::watched;
use super::prepared::prepared;
use super::{Answer, Onlooker, StepError, check_period, symptom, trained_in_free_run, verdict};
use crate::data::{DataSet, Plant, Record};
use crate::diagnose::{
    Certificate, Diagnosis, HeldOutBy, Memory, NotTried, Options, Parsimony, Quoted,
    RULES as DIAGNOSE, Ranked, Rung, Verdict, diagnose as search,
};
use crate::discover::{Glance, glance};
use crate::excitation::says_little;
use crate::experiment::Separation;
use crate::indicators::{Scores, score, score_new};
use crate::model::{Model, Training};
use crate::power::{Detectable, detectable};
use crate::residual::{FailureCoordinate, Failures, NoiseSource, Where, where_it_fails};
use crate::simulate::SimulateError;
use crate::terms::leading_inputs;

/// A diagnosis with its reports. Serialises to the keys of `diagnose --json`.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The final model with the missing effects and its training record.
    pub model: Model,
    /// Kind of plant: in a flow, effects are stated by name, in other plants by what the records show.
    pub plant: Plant,
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// The answer: verdict, evidence, confidence, next command.
    pub answer: Answer,
    /// "Where it fails" of the final model; `None` if its free run diverges.
    pub failures: Option<Failures>,
    /// The error message if the free run of the final model diverges.
    pub unstable: Option<String>,
    /// Indicators of the final model.
    pub scores: Scores,
    /// The free run of the given model over each record, y; none if it diverges.
    pub runs_before: Option<Vec<Vec<f64>>>,
    /// The free run of the final model over each record, y; none if it diverges.
    pub runs: Option<Vec<Vec<f64>>>,
    /// First-order prediction for a term outside the catalogue; computed if the catalogue explains too
    /// little.
    pub beyond: Option<Glance>,
    /// Detectable size of each effect; reported if no effect is missing.
    pub detectable: Vec<Detectable>,
    /// The final validation error, y rms, if it is not that of whole free runs over `validate` records.
    pub judged_rmse: Option<f64>,
    /// A measured channel that the error depends on, and the explained share of the unexplained variance.
    pub channel: Option<(String, f64)>,
}

impl Serialize for Finding {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Document<'a> {
            verdict: Verdict,
            answer: &'a Answer,
            missing: &'a [String],
            stand_ins: &'a [String],
            certified: &'a [String],
            sets: &'a [Vec<String>],
            memory: &'a [Memory],
            ladder: &'a [Rung],
            ranking: &'a [Ranked],
            evidence_nats: Option<f64>,
            posterior: &'a [Vec<f64>],
            certificate: &'a BTreeMap<String, Certificate>,
            parsimony: Option<&'a Parsimony>,
            not_tried: &'a [NotTried],
            #[serde(rename = "where")]
            places: &'a [Where],
            detectable: &'a [Detectable],
            beyond: Option<&'a Glance>,
            held_out_by: HeldOutBy,
            quoted: Option<&'a Quoted>,
            tried: usize,
            p_value: Option<f64>,
            restarted_s: Option<f64>,
            judged_rmse: Option<f64>,
            channel: Option<&'a str>,
            noise_source: NoiseSource,
            noise_estimate: f64,
            experiment: Option<&'a Separation>,
            words: String,
        }
        let found = &self.diagnosis;
        let document = Document {
            verdict: found.verdict,
            answer: &self.answer,
            missing: &found.missing,
            stand_ins: &found.stand_ins,
            certified: &found.certified,
            sets: &found.sets,
            memory: &found.memory,
            ladder: &found.ladder,
            ranking: &found.ranking,
            evidence_nats: found.evidence_nats,
            posterior: &found.posterior,
            certificate: &found.certificates,
            parsimony: found.parsimony.as_ref(),
            not_tried: &found.not_tried,
            places: self.failures.as_ref().map_or(&[], |f| &f.by),
            detectable: &self.detectable,
            beyond: self.beyond.as_ref(),
            held_out_by: found.held_out_by,
            quoted: found.quoted.as_ref(),
            tried: found.tried,
            p_value: found.p_value,
            restarted_s: found.restarted_s,
            judged_rmse: self.judged_rmse,
            channel: self.channel.as_ref().map(|(name, _)| name.as_str()),
            noise_source: found.noise_source,
            noise_estimate: found.noise_estimate,
            experiment: found.separation.as_ref(),
            words: self.answer.sentence(),
        };
        document.serialize(serializer)
    }
}

/// Finds the effect that `model` lacks on `set`, by the free-run error on validation records. User effects
/// known to the model ([`Model::define`]) are tried as well.
///
/// ```no_run
/// use host_fit::data::DataSet;
/// use host_fit::diagnose::Options;
/// use host_fit::model::Model;
/// use host_fit::steps::diagnose;
///
/// let model = Model::load("model.toml".as_ref())?;
/// let set = DataSet::load("data/hidden-ramp".as_ref())?;
/// let found = diagnose(&model, &set, &Options::default(), &())?;
/// println!("{}", found.answer.words());
/// found.model.save("with-the-missing-effect.toml".as_ref())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`]: different sampling periods, no estimation record, a missing channel, an interrupt before
/// the first result.
pub fn diagnose(
    model: &Model,
    set: &DataSet,
    options: &Options,
    onlooker: &dyn Onlooker,
) -> Result<Finding, StepError> {
    check_period(model, set)?;
    Work::Diagnose.fits(set)?;
    let prepared = prepared(set)?;
    let records = model.targets(&prepared.records);
    let (mut judged_rmse, mut channel) = (None, None);
    let (mut diagnosis, failures, detectable, beyond) = watched(onlooker, "diagnosis", || {
        let progress = |what: &str| onlooker.now(what);
        let knowing = model.with_inputs(leading_inputs(model, &records));
        let mut diagnosis = search(&knowing, &records, options, onlooker.interrupt(), &progress)?;
        diagnosis.model.forget_unused(model);
        judged_rmse = as_written(&mut diagnosis, model, &records);
        let failures = where_it_fails(&diagnosis.model, &records);
        channel = followed_channel(&diagnosis, failures.as_ref().ok());
        if channel.is_some() && diagnosis.verdict == Verdict::NothingMissing {
            diagnosis.verdict = Verdict::Unexplained;
        }
        let detectable = match diagnosis.verdict {
            Verdict::NothingMissing => detectable(&diagnosis.model, &records),
            Verdict::EffectMissing | Verdict::PartlyExplained | Verdict::Unexplained => {
                Ok(Vec::new())
            }
        };
        let beyond = match diagnosis.verdict {
            Verdict::PartlyExplained | Verdict::Unexplained => {
                progress("a first estimate beyond the catalogue");
                glance(&diagnosis.model, &records, onlooker.interrupt())
            }
            Verdict::NothingMissing | Verdict::EffectMissing => None,
        };
        Ok::<_, StepError>((diagnosis, failures, detectable, beyond))
    })?;
    let (failures, unstable) = match failures {
        Ok(failures) => (Some(failures), None),
        Err(error @ SimulateError::Diverged { .. }) => (None, Some(error.to_string())),
        Err(error) => return Err(error.into()),
    };
    let mut detectable = match detectable {
        // A model at the stability limit has no detectable sizes.
        Err(SimulateError::Diverged { .. }) => Vec::new(),
        other => other?,
    };
    if set.plant != Plant::Flow {
        for effect in &mut detectable {
            if let Some(behaviour) = symptom::shown(&effect.effect, None) {
                effect.words = effect.words.replacen(effect.subject, &behaviour, 1);
            }
        }
    }
    let runs_before = score(model, &records).ok().map(|(_, runs)| runs);
    let (scores, runs) = match score(&diagnosis.model, &records) {
        Ok((scores, runs)) => (scores, Some(runs)),
        Err(_) => (score_new(&diagnosis.model, &records)?.0, None),
    };
    let mut answer = verdict::answer(&diagnosis, judged_rmse, channel.as_ref(), set.plant);
    if let Some(remark) = says_little(&records) {
        answer.note(remark);
    }
    if let Some(beyond) = &beyond {
        answer.note(verdict::beyond(beyond));
    }
    if let Some(steady) = failures.as_ref().and_then(|failures| failures.oscillation) {
        answer.note(steady.to_string());
    }
    if let Some(moving) = &prepared.moving_zero {
        answer.note(moving.to_string());
    }
    if set.plant != Plant::Flow {
        // Only the command of the answer has the name of an effect.
        for rung in &mut diagnosis.ladder {
            for effect in &rung.effects {
                let words = symptom::effect_in_words(effect, set.plant);
                rung.step = rung.step.replace(effect.as_str(), &words);
            }
        }
    }
    Ok(Finding {
        plant: set.plant,
        model: Model {
            training: Training {
                stand_ins: diagnosis.stand_ins.clone(),
                ..trained_in_free_run(set, &scores, options.seed)
            },
            ..diagnosis.model.clone()
        },
        answer,
        failures,
        unstable,
        scores,
        runs_before,
        runs,
        beyond,
        detectable,
        judged_rmse,
        channel,
        diagnosis,
    })
}

/// Recomputes the errors of the ladder's models as `compare` does, and replaces a model that is worse than
/// the given one by the given one. Returns the final error if it is not that of whole runs over `validate`
/// records, but of restarted runs or cross-validation.
fn as_written(diagnosis: &mut Diagnosis, given: &Model, records: &[Record]) -> Option<f64> {
    let judged = diagnosis.ladder.last().map(|rung| rung.validate_rmse);
    for rung in &mut diagnosis.ladder {
        rung.as_compared(records);
    }
    let error = |rung: Option<&Rung>| rung.map_or(f64::INFINITY, |rung| rung.validate_rmse);
    let (first, last) = (
        diagnosis.ladder.first().cloned(),
        error(diagnosis.ladder.last()),
    );
    if let Some(first) = first
        && diagnosis.model != *given
        && (last.is_nan() || last > first.validate_rmse)
    {
        if !diagnosis.missing.is_empty() || !diagnosis.stand_ins.is_empty() {
            diagnosis.verdict = of_the_given(first.validate_rmse, first.noise_rmse);
        }
        diagnosis.missing.clear();
        diagnosis.stand_ins.clear();
        diagnosis.certified.clear();
        diagnosis.sets.clear();
        diagnosis.p_value = None;
        diagnosis.model = given.clone();
        diagnosis.ladder.push(first.once_more());
    }
    let whole = diagnosis.held_out_by == HeldOutBy::Records && diagnosis.restarted_s.is_none();
    judged.filter(|_| !whole)
}

/// The verdict on a given model whose error no effect lowers: something is missing unless it is at a known `noise` level.
fn of_the_given(error: f64, noise: Option<f64>) -> Verdict {
    match noise.is_some_and(|noise| error <= DIAGNOSE.floor_margin * noise) {
        true => Verdict::NothingMissing,
        false => Verdict::Unexplained,
    }
}

/// The measured channel that the error of the final model depends on, with the explained share. `None` if there is
/// none, or if an effect of the model already uses it.
fn followed_channel(diagnosis: &Diagnosis, failures: Option<&Failures>) -> Option<(String, f64)> {
    let failures = failures.filter(|failures| failures.above_noise)?;
    let known = diagnosis.model.channels();
    failures
        .by
        .iter()
        .find_map(|place| match &place.coordinate {
            FailureCoordinate::Channel(name) if !known.contains(name) => {
                let enough = place.explained_fraction >= DIAGNOSE.follows_a_channel;
                enough.then(|| (name.clone(), place.explained_fraction))
            }
            _ => None,
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_given_model_lacks_something_unless_it_is_at_a_known_noise_level() {
        assert_eq!(of_the_given(1.02, Some(1.0)), Verdict::NothingMissing);
        assert_eq!(of_the_given(1.04, Some(1.0)), Verdict::Unexplained);
        assert_eq!(of_the_given(1.0, None), Verdict::Unexplained);
    }
}
