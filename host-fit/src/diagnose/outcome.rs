//! What a diagnosis hands over.

use super::memory::memory;
use super::{Certificate, Memory, ParameterEstimate, Parsimony, Quoted};
use crate::data::Record;
use crate::experiment::Separation;
use crate::indicators::score;
use crate::model::Model;
use crate::residual::NoiseSource;
use crate::terms::{HeldOut, HeldOutBy, Hypothesis, Judge, Units};
use model_core::effect::Spec;
use serde::Serialize;
use std::collections::BTreeMap;

/// What a diagnosis says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The held-out error is at the repeat scatter.
    NothingMissing,
    /// One effect or several account for most of the misfit.
    EffectMissing,
    /// Effects describe part of the misfit without being proven: stand-ins.
    PartlyExplained,
    /// A repeatable misfit that the catalogue does not explain.
    Unexplained,
}

/// What is said, and of which hypothesis.
pub(super) struct Conclusion {
    pub(super) verdict: Verdict,
    /// The model that is handed over, inner units.
    pub(super) model: Hypothesis,
    pub(super) effects: Vec<&'static Spec>,
    pub(super) p_value: Option<f64>,
}

/// Held-out error after adding effects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// The effects added so far, in their order; those of the given model are not among them.
    pub effects: Vec<String>,
    /// Root mean square error of the free run on the held-out records, y.
    pub validate_rmse: f64,
    /// FIT on the held-out records, %.
    pub validate_fit_percent: f64,
    /// The noise floor, y; none without y_sd.
    pub noise_rmse: Option<f64>,
    /// What was done to get here, in words.
    pub step: String,
    /// The model that stands here, fitted to everything that may be learned from; none on the way to a discovery, where
    /// the terms have no names yet.
    #[serde(skip)]
    pub model: Option<Model>,
}

impl Diagnosis {
    /// The same, with the model as it was given where nothing is named and the search ended
    /// above what that leaves.
    pub(super) fn no_worse_than(mut self, given: &Model, as_given: Rung) -> Self {
        let named = !self.missing.is_empty() || !self.stand_ins.is_empty();
        let last = self.ladder.last().map_or(0.0, |rung| rung.validate_rmse);
        if named || last <= as_given.validate_rmse {
            return self;
        }
        self.memory = memory(given);
        self.ladder.push(as_given.once_more());
        self.model = given.clone();
        self.base = given.clone();
        self
    }
}

impl Rung {
    /// The rung of the model as given at the end of a ladder that led to nothing better.
    pub(crate) fn once_more(self) -> Self {
        Self {
            step: "the model as given, which is better".to_owned(),
            ..self
        }
    }

    /// The same with the error of the model's free run over whole `records`, as `compare` has it; as it was where no model
    /// stands here. A run that diverges errs without end.
    pub(crate) fn as_compared(&mut self, records: &[Record]) {
        let Some(model) = &self.model else { return };
        let scores = score(model, records).map(|(scores, _)| scores);
        let held_out = scores.ok().and_then(|scores| scores.held_out().cloned());
        (self.validate_rmse, self.validate_fit_percent) = match held_out {
            Some(all) => (all.rmse, all.fit_percent),
            None => (f64::INFINITY, f64::NEG_INFINITY),
        };
    }

    /// What was held out, in the user's units.
    pub(crate) fn of(
        judge: &Judge,
        units: &Units,
        held_out: &HeldOut,
        effects: &[String],
        step: &str,
        model: Option<Model>,
    ) -> Self {
        let measured = judge.noise_source == NoiseSource::Measured;
        Self {
            effects: effects.to_vec(),
            validate_rmse: held_out.measured_rmse() * units.y,
            validate_fit_percent: 100.0 * (1.0 - judge.unexplained_share(held_out).sqrt()),
            noise_rmse: measured.then(|| judge.measured_noise_rmse() * units.y),
            step: step.to_owned(),
            model,
        }
    }
}

/// A candidate, judged against the model it was added to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranked {
    /// Its name.
    pub effect: String,
    /// Held-out error with it, y.
    pub validate_rmse: f64,
    /// By how much the held-out error falls, %.
    pub error_reduction_percent: f64,
    /// p-value of the whole search: how often noise alone lets any effect, at any point of its
    /// grid, take as much of the held-out error.
    pub p_value: f64,
    /// By how much noise alone lets the best of all effects lower the held-out error in one
    /// case of twenty, %.
    pub by_chance_percent: f64,
    /// Fitted parameters by name.
    pub parameters: BTreeMap<String, ParameterEstimate>,
    /// Candidates that the held-out records cannot tell from it.
    pub confounded_with: Vec<String>,
    /// Whether the gain counts as real: significant, worthwhile, better than chance.
    pub significant: bool,
    /// Whether everything was refitted with it; otherwise its numbers are what the
    /// screening promises.
    pub refitted: bool,
    /// ln of the evidence of the refitted model on the estimation records, nats; comparable within one diagnosis.
    pub evidence_nats: Option<f64>,
}

/// A candidate that was not tried, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotTried {
    /// Its name.
    pub effect: String,
    /// Why not.
    pub reason: String,
}

/// The outcome.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What it says.
    pub verdict: Verdict,
    /// The missing effects in the order added; none where the verdict is
    /// "unexplained" or "partly explained", though the ladder shows what was tried.
    pub missing: Vec<String>,
    /// Effects that describe part of the misfit without being proven; beside `missing` those that take the rest only,
    /// without which the model fits as well as the noise floor is known.
    pub stand_ins: Vec<String>,
    /// For each of `missing` all that the records cannot tell from it, itself first.
    pub sets: Vec<Vec<String>>,
    /// What the flow feels of its own past, in the final model.
    pub memory: Vec<Memory>,
    /// Models that were refitted in full on the way.
    pub tried: usize,
    /// Effects at points of their grids that were screened on the final model without effects:
    /// what the p-values of the ranking are corrected for.
    pub alternatives: usize,
    /// How the errors were held out.
    pub held_out_by: HeldOutBy,
    /// After how many seconds free runs started anew from the measurement, for rigs
    /// that drift: see [`restart_after`](crate::fit::restart_after).
    pub restarted_s: Option<f64>,
    /// Where the noise floor comes from.
    pub noise_source: NoiseSource,
    /// The noise floor on what was judged, y rms: measured or estimated.
    pub noise_estimate: f64,
    /// By how much of itself the level of a record scatters between repeats, where `y_sd` says so: what that explains of an
    /// error is not held against a model.
    pub level_scatter: Option<f64>,
    /// The last error on records that nothing was chosen by; none where there are too few to keep
    /// some back.
    pub quoted: Option<Quoted>,
    /// Share of the held-out energy that the best of all effects takes of noise alone in one search of twenty.
    pub usual_by_chance: f64,
    /// Held-out errors from the model as given to the last one.
    pub ladder: Vec<Rung>,
    /// All candidates for the final model without effects, best first.
    pub ranking: Vec<Ranked>,
    /// Parameters of the missing effects, or of the stand-ins, in the final model.
    pub parameters: BTreeMap<String, BTreeMap<String, ParameterEstimate>>,
    /// ln of the evidence of the final model on the estimation records, nats; none where it was not searched for.
    pub evidence_nats: Option<f64>,
    /// How sure each effect of the best model is that was found, named or not.
    pub certificates: BTreeMap<String, Certificate>,
    /// What `missing` explains better with fewer parameters than the given model has.
    pub parsimony: Option<Parsimony>,
    /// The share of the evidence that each member of each of `sets` has.
    pub posterior: Vec<Vec<f64>>,
    /// Candidates that could not be tried.
    pub not_tried: Vec<NotTried>,
    /// The experiment for effects that the data cannot tell apart.
    pub separation: Option<Separation>,
    /// p-value of the whole search by which the effects were named or stand in; none where none are, or where
    /// they do only as well as lags, with fewer parameters.
    pub p_value: Option<f64>,
    /// The final model.
    pub model: Model,
    /// The base model that effects were added to.
    pub base: Model,
}
