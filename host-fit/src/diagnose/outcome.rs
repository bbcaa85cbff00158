//! The result of a diagnosis.

use super::estimate::is_identified;
use super::memory::memory;
use super::{Certificate, Memory, ParameterEstimate, Parsimony, Quoted};
use crate::data::Record;
use crate::experiment::Separation;
use crate::indicators::score;
use crate::model::Model;
use crate::residual::NoiseSource;
use crate::terms::{HeldOut, HeldOutBy, Hypothesis, Judge, Units};
use model_core::effect::Spec;
use model_core::effects::spec;
use serde::Serialize;
use std::collections::BTreeMap;

/// The verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The validation error is at the noise level.
    NothingMissing,
    /// One or more effects explain most of the model error above the noise.
    EffectMissing,
    /// Effects describe part of the model error without being significant: surrogates.
    PartlyExplained,
    /// A repeatable model error that no effect of the catalogue explains.
    Unexplained,
}

/// The verdict and the hypothesis to which it applies.
pub(super) struct Conclusion {
    pub(super) verdict: Verdict,
    /// The final model, inner units.
    pub(super) model: Hypothesis,
    pub(super) effects: Vec<&'static Spec>,
    pub(super) p_value: Option<f64>,
}

/// One step of the ladder: the validation error after adding effects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// The effects added so far, in this order; without those of the given model.
    pub effects: Vec<String>,
    /// Root mean square of the free-run error on the validation records, y.
    pub validate_rmse: f64,
    /// FIT on the validation records, %.
    pub validate_fit_percent: f64,
    /// The noise level, y rms; none without y_sd.
    pub noise_rmse: Option<f64>,
    /// The step in words.
    pub step: String,
    /// The model of this step, fitted to all estimation records. None during a discovery, where terms have no
    /// names yet.
    #[serde(skip)]
    pub model: Option<Model>,
}

impl Diagnosis {
    /// Whether the records determine the parameters of this effect of the final model.
    #[must_use]
    pub fn is_identified(&self, effect: &str) -> bool {
        let estimates = self.parameters.get(effect);
        let spec = spec(effect);
        estimates
            .zip(spec)
            .is_none_or(|(estimates, spec)| is_identified(estimates, spec))
    }

    /// Returns to the given model if no effect is named and the search did not lower its error.
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
    /// Repeats the step of the given model as the last step of a ladder without improvement.
    pub(crate) fn once_more(self) -> Self {
        Self {
            step: "the given model, which has a smaller error".to_owned(),
            ..self
        }
    }

    /// Replaces the error of the step by the free-run error over whole `records`, as `compare` computes it. Unchanged
    /// if the step has no model; infinite if the run diverges.
    pub(crate) fn as_compared(&mut self, records: &[Record]) {
        let Some(model) = &self.model else { return };
        let scores = score(model, records).map(|(scores, _)| scores);
        let held_out = scores.ok().and_then(|scores| scores.held_out().cloned());
        (self.validate_rmse, self.validate_fit_percent) = match held_out {
            Some(all) => (all.rmse, all.fit_percent),
            None => (f64::INFINITY, f64::NEG_INFINITY),
        };
    }

    /// The errors on the validation records, in the user's units.
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

/// A candidate compared with the model it was added to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranked {
    /// Name of the candidate.
    pub effect: String,
    /// Validation error with the candidate, y rms.
    pub validate_rmse: f64,
    /// Reduction of the validation error, %.
    pub error_reduction_percent: f64,
    /// Upper bound (by the e-value) of the family-wise p-value of the candidate; 1 if it was not refitted.
    pub p_value: f64,
    /// ln of the Bayes factor of the model with the candidate against the model without it, nats.
    pub gain_nats: Option<f64>,
    /// Fitted parameters by name.
    pub parameters: BTreeMap<String, ParameterEstimate>,
    /// Candidates that the validation records do not distinguish from this one.
    pub confounded_with: Vec<String>,
    /// Whether the gain is significant and above the practical margin.
    pub significant: bool,
    /// Whether the whole model was refitted with the candidate; if not, the numbers are first estimates, by a brief fit or
    /// the prediction of the screening.
    pub refitted: bool,
    /// ln of the evidence of the refitted model, nats. Comparable within one diagnosis.
    pub evidence_nats: Option<f64>,
}

/// A candidate that was not tried, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotTried {
    /// Name of the candidate.
    pub effect: String,
    /// Why not.
    pub reason: String,
}

/// The result of a diagnosis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// The missing effects in the order added. Empty if the verdict is "unexplained" or "partly explained", even if
    /// the ladder shows effects that were tried.
    pub missing: Vec<String>,
    /// Surrogates: effects that describe part of the model error without being significant. If effects are named in
    /// `missing`, surrogates are further effects that are not needed to reach the noise level.
    pub stand_ins: Vec<String>,
    /// The surrogates that are certified although something else is unexplained (verdict "partly explained").
    pub certified: Vec<String>,
    /// The equivalence set of each effect in `missing`, that effect first.
    pub sets: Vec<Vec<String>>,
    /// Memories of the flow in the final model.
    pub memory: Vec<Memory>,
    /// Number of models that were refitted in full: the family over which p-values are corrected.
    pub tried: usize,
    /// How the validation error was obtained.
    pub held_out_by: HeldOutBy,
    /// Free runs are restarted from the measurement after this many seconds, for plants that drift: see
    /// [`restart_after`](crate::fit::restart_after).
    pub restarted_s: Option<f64>,
    /// Where the noise level comes from.
    pub noise_source: NoiseSource,
    /// The noise level on the validation samples, y rms: measured or estimated.
    pub noise_estimate: f64,
    /// Relative scatter of a record's level between repeats, if `y_sd` shows one. Errors in proportion to
    /// y, which this scatter causes, are not counted as model error.
    pub level_scatter: Option<f64>,
    /// The final model's error on records that played no part in the choice of the structure. None if there
    /// are too few records to set some aside.
    pub quoted: Option<Quoted>,
    /// Validation errors from the given model to the final one.
    pub ladder: Vec<Rung>,
    /// Validation error of the base model to which each candidate of `ranking` is added, y rms.
    pub candidates_base_rmse: f64,
    /// All candidates for the final base model, best first.
    pub ranking: Vec<Ranked>,
    /// Parameters of the missing effects, or of the surrogates, in the final model.
    pub parameters: BTreeMap<String, BTreeMap<String, ParameterEstimate>>,
    /// ln of the evidence of the final model, nats; none where it cannot be computed.
    pub evidence_nats: Option<f64>,
    /// The certificate of each effect of the best model, named or not.
    pub certificates: BTreeMap<String, Certificate>,
    /// Parsimony: the model with `missing` or `certified` has more evidence than the given model, with fewer parameters.
    pub parsimony: Option<Parsimony>,
    /// Posterior probability of each member of each set in `sets`.
    pub posterior: Vec<Vec<f64>>,
    /// Candidates that could not be tried.
    pub not_tried: Vec<NotTried>,
    /// The experiment that would distinguish the members of an equivalence set.
    pub separation: Option<Separation>,
    /// Upper bound (by the e-value) of the family-wise p-value of the named effects or surrogates; `None` if no effect
    /// is named.
    pub p_value: Option<f64>,
    /// The final model.
    pub model: Model,
    /// The base model that effects were added to.
    pub base: Model,
}
