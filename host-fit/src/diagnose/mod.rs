//! Which physical effect is missing.
//!
//! Every candidate is judged by refitting everything with it and running free
//! on held-out records. A candidate regressed on the residual alone misleads:
//! the base model has absorbed part of it (theory 4.2).

mod bench;
mod climb;
mod evidence;
mod folds;
mod rank;

pub use folds::HeldOutBy;

use crate::data::Record;
use crate::experiment::{Experiment, Limits, separating};
use crate::fit::{Fit, FitOptions, restart_after};
use crate::model::{Model, Start};
use crate::residual::NoiseSource;
use crate::simulate::SimulateError;
use bench::{Bench, Judged};
use climb::Climb;
use model_core::effect::Spec;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use thiserror::Error;

/// Effects that explain less than this share of the excess error leave the verdict
/// at "unexplained", where the noise floor is known …
const EXPLAINED: f64 = 0.9;
/// … and where it is not, so that part of what is left may be noise.
const EXPLAINED_IN_UNKNOWN_NOISE: f64 = 0.75;

/// What a diagnosis says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The held-out error is at the repeat scatter.
    NothingMissing,
    /// One effect or several account for most of the misfit.
    EffectMissing,
    /// A repeatable misfit that the catalogue does not explain.
    Unexplained,
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
}

/// A fitted physical parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterEstimate {
    /// The estimate.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Lower end of the 95 % confidence interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
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
    /// p-value of the gain, corrected for the number of candidates (Holm).
    pub p_value: f64,
    /// The best that chance did with time-shifted and swapped versions of it:
    /// reduction of the held-out error, %.
    pub best_decoy_percent: f64,
    /// Fitted parameters by name.
    pub parameters: BTreeMap<String, ParameterEstimate>,
    /// Candidates that the held-out records cannot tell from it.
    pub confounded_with: Vec<String>,
    /// Whether the gain counts as real: significant, worthwhile, better than chance.
    pub significant: bool,
}

/// A candidate that was not tried, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotTried {
    /// Its name.
    pub effect: String,
    /// Why not.
    pub reason: String,
}

/// How to tell apart what the data cannot.
#[derive(Clone, Debug)]
pub struct Separation {
    /// The effects that one of the models has and another has not.
    pub effects: Vec<String>,
    /// The command that separates the models most.
    pub experiment: Experiment,
}

/// The outcome.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What it says.
    pub verdict: Verdict,
    /// The missing effects in the order added; none where the verdict is
    /// "unexplained", though the ladder shows what was tried.
    pub missing: Vec<String>,
    /// How the errors were held out.
    pub held_out_by: HeldOutBy,
    /// After how many seconds free runs started anew from the measurement, for rigs
    /// that drift: see [`restart_after`].
    pub restarted_s: Option<f64>,
    /// Where the noise floor comes from.
    pub noise_source: NoiseSource,
    /// The noise floor on what was judged, y rms: measured or estimated.
    pub noise_estimate: f64,
    /// Held-out errors from the model as given to the last one.
    pub ladder: Vec<Rung>,
    /// All candidates of the first round, best first.
    pub ranking: Vec<Ranked>,
    /// Parameters of the missing effects in the final model.
    pub parameters: BTreeMap<String, BTreeMap<String, ParameterEstimate>>,
    /// Candidates that could not be tried.
    pub not_tried: Vec<NotTried>,
    /// The experiment for effects that the data cannot tell apart.
    pub separation: Option<Separation>,
    /// The final model.
    pub model: Model,
    /// The base model that effects were added to.
    pub base: Model,
}

/// Why there is no diagnosis.
#[derive(Clone, Debug, Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No record to learn from.
    #[error(
        "the data set has no `identify` record to refit the model on. \
         Set `use = \"identify\"` for at least one record in dataset.toml."
    )]
    NothingToLearnFrom,
    /// The model cannot be run on the data.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The user stopped it.
    #[error("the diagnosis was interrupted before it had a result; nothing was written.")]
    Interrupted,
}

/// What to try, and how far.
#[derive(Clone, Debug)]
pub struct Options {
    /// Most effects added one after the other.
    pub most_effects: usize,
    /// Seed of the decoys.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            most_effects: 4,
            seed: 0,
        }
    }
}

/// Estimates of an effect's parameters with 95 % intervals.
pub(crate) fn estimates(fit: &Fit, spec: &Spec) -> BTreeMap<String, ParameterEstimate> {
    let values = fit.model.values();
    let coordinates = fit.model.coordinates();
    let own = coordinates
        .iter()
        .enumerate()
        .filter_map(|(index, coordinate)| {
            let parameter = coordinate.parameter()?;
            let of_spec = coordinate.name == format!("{}.{}", spec.name, parameter.name);
            of_spec.then_some((index, parameter))
        });
    own.map(|(index, parameter)| {
        let value = values[index];
        let half = 1.96 * fit.standard_error(index).unwrap_or(f64::INFINITY);
        let (low, high) = if parameter.is_logarithmic() {
            let factor = (half / value).exp();
            (value / factor, value * factor)
        } else {
            (value - half, value + half)
        };
        let estimate = ParameterEstimate {
            value,
            unit: parameter.unit.to_string(),
            low: low.max(parameter.low.min(value)),
            high: high.min(parameter.high.max(value)),
        };
        (parameter.name.to_owned(), estimate)
    })
    .collect()
}

/// Diagnoses `given` on `records`.
///
/// # Errors
/// [`DiagnoseError`].
pub fn diagnose(
    given: &Model,
    records: &[Record],
    options: &Options,
    interrupt: &AtomicBool,
) -> Result<Diagnosis, DiagnoseError> {
    let fit_options = FitOptions {
        constant: given.start == Start::Measured || given.constant != 0.0,
        ..FitOptions::default()
    };
    let restarted = restart_after(given, records);
    let bench = Bench::new(records, restarted, options.seed, fit_options, interrupt)?;
    let as_given = bench.held_out(|_| given)?;
    let mut ladder = vec![bench.rung(&as_given, &[], "the model as given")];
    let most = options.most_effects;
    let mut climb = if given.start == Start::Measured {
        // Records that begin in mid-run come from rigs that are no blown ramp:
        // their dynamics is the user's choice of lags.
        let (base, step) = bench.with_the_product(given, &as_given)?;
        bench.climb(base, step, most)
    } else {
        let lean = bench.lean(given)?;
        let climb = bench.climb(lean, "refitted with the fewest lags", most);
        bench.or_from_given(climb, given, most)?
    };
    if interrupt.load(Ordering::Relaxed) && climb.ranking.is_empty() {
        return Err(DiagnoseError::Interrupted);
    }
    ladder.append(&mut climb.ladder);
    let verdict = match bench.verdict(&climb.base, &climb.current, climb.added.len()) {
        // Effects on a base that is worse than what was given explain nothing.
        Verdict::EffectMissing if climb.current.held_out.rmse() >= as_given.rmse() => {
            Verdict::Unexplained
        }
        verdict => verdict,
    };
    if verdict == Verdict::Unexplained {
        // Effects that explain the lesser part are imitations: the ladder shows
        // them, the model is handed over without.
        climb.current = climb.base.clone();
        climb.added.clear();
        climb.matched.clear();
    }
    let stand_ins = bench.stand_ins(&climb);
    let Climb {
        base,
        current,
        added,
        mut ranking,
        not_tried,
        ..
    } = climb;
    let last = bench.final_fit(&current);
    let parameters: BTreeMap<_, _> = added
        .iter()
        .map(|spec| (spec.name.to_owned(), estimates(&last, spec)))
        .collect();
    // The ranking shows what the effects are in the final model, and only what
    // still cannot be told apart there.
    for entry in &mut ranking {
        let Some(own) = parameters.get(&entry.effect) else {
            continue;
        };
        entry.parameters.clone_from(own);
        let others = stand_ins.iter().filter(|(one, ..)| *one == entry.effect);
        entry.confounded_with = others.map(|(_, other, _)| other.clone()).collect();
    }
    let separation = bench.separation(&last.model, &stand_ins, options.seed);
    Ok(Diagnosis {
        verdict,
        missing: added.iter().map(|spec| spec.name.to_owned()).collect(),
        held_out_by: bench.held_out_by,
        restarted_s: restarted.map(|samples| samples as f64 * given.sample_period_s),
        noise_source: bench.noise_source,
        noise_estimate: bench.noise_rmse(),
        ladder,
        ranking,
        parameters,
        not_tried,
        separation,
        base: bench.final_fit(&base).model,
        model: last.model,
    })
}

impl Bench<'_> {
    fn verdict(&self, base: &Judged, last: &Judged, added: usize) -> Verdict {
        let above_floor = self.is_above_floor(last);
        if added == 0 {
            return if above_floor {
                Verdict::Unexplained
            } else {
                Verdict::NothingMissing
            };
        }
        let left = self.excess(&last.held_out) / self.excess(&base.held_out).max(f64::MIN_POSITIVE);
        let enough = match self.noise_source {
            NoiseSource::Scatter => EXPLAINED_IN_UNKNOWN_NOISE,
            NoiseSource::Measured | NoiseSource::Repeats => EXPLAINED,
        };
        if 1.0 - left < enough && above_floor {
            Verdict::Unexplained
        } else {
            Verdict::EffectMissing
        }
    }

    /// The command that would tell the final model from those in which another
    /// effect stands for one of its own.
    fn separation(
        &self,
        model: &Model,
        stand_ins: &[(String, String, Model)],
        seed: u64,
    ) -> Option<Separation> {
        if stand_ins.is_empty() || !self.is_on_off() || self.interrupted() {
            return None;
        }
        let models: Vec<Model> = std::iter::once(model)
            .chain(stand_ins.iter().map(|(_, _, model)| model))
            .cloned()
            .collect();
        let mut effects: Vec<String> = Vec::new();
        for (one, other, _) in stand_ins {
            for name in [one, other] {
                if !effects.contains(name) {
                    effects.push(name.clone());
                }
            }
        }
        let limits = Limits::default();
        let noise = self.noise_rmse().max(f64::MIN_POSITIVE);
        let experiment = separating(&models, noise, &limits, seed).ok()?;
        Some(Separation {
            effects,
            experiment,
        })
    }
}
