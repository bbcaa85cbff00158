//! Which physical effect is missing.
//!
//! Every candidate is judged by refitting everything with it and running free
//! on held-out records. A candidate regressed on the residual alone misleads:
//! the base model has absorbed part of it (theory D).

mod evidence;

use crate::data::{Record, Use};
use crate::fit::{CandidateError, Fit, FitOptions, fit, fit_with_effect, lean_base};
use crate::indicators::{Indicators, score};
use crate::model::{Model, Start};
use crate::simulate::SimulateError;
use evidence::{HeldOut, decoys, p_above_noise, p_value};
use model_core::effect::{Place, Spec};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use thiserror::Error;

/// An effect must lower the held-out error by this fraction to be worth its parameters.
const WORTHWHILE: f64 = 0.015;
/// Family-wise level of the tests of a round.
const LEVEL: f64 = 0.05;
/// A model within this factor of the noise floor is not searched further.
const AT_THE_FLOOR: f64 = 1.005;
/// A misfit below this factor is within what y_sd itself is known to.
const FLOOR_MARGIN: f64 = 1.10;
/// Accepted effects that explain less than this share of the excess error leave
/// the verdict at "unexplained".
const EXPLAINED: f64 = 0.5;
/// Decoys per candidate.
const DECOYS: usize = 19;

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
    /// The effects in the model, in the order added.
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

/// The outcome.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What it says.
    pub verdict: Verdict,
    /// The missing effects in the order added.
    pub missing: Vec<String>,
    /// Held-out errors from the model as given to the last one.
    pub ladder: Vec<Rung>,
    /// All candidates of the first round, best first.
    pub ranking: Vec<Ranked>,
    /// Parameters of the missing effects in the final model.
    pub parameters: BTreeMap<String, BTreeMap<String, ParameterEstimate>>,
    /// Candidates that could not be tried.
    pub not_tried: Vec<NotTried>,
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

/// A model with its fit and its held-out error.
#[derive(Clone, Debug)]
struct Judged {
    fit: Fit,
    learned: HeldOut,
    held_out: HeldOut,
}

struct Bench<'a> {
    learning: Vec<&'a Record>,
    judging: Vec<&'a Record>,
    period_s: f64,
    noise: Option<f64>,
    on_off: bool,
    shifts: Vec<f64>,
}

impl<'a> Bench<'a> {
    fn new(records: &'a [Record], seed: u64) -> Result<Self, DiagnoseError> {
        use rand::{RngExt, SeedableRng};
        let of =
            |role: Use| -> Vec<&Record> { records.iter().filter(|r| r.role == role).collect() };
        let mut learning = of(Use::Identify);
        let Some(first) = learning.first() else {
            return Err(DiagnoseError::NothingToLearnFrom);
        };
        let period_s = first.sample_period_s;
        let mut judging = of(Use::Validate);
        if judging.is_empty() && learning.len() > 1 {
            // Nothing was held out: the last record is, from all fits.
            judging.extend(learning.pop());
        }
        if judging.is_empty() {
            judging.clone_from(&learning);
        }
        let (mut sum, mut count) = (0.0, 0.0);
        let mut noise = true;
        for record in &judging {
            match &record.y_sd {
                Some(sd) => {
                    sum += crate::fit::dot(sd, sd);
                    count += sd.len() as f64;
                }
                None => noise = false,
            }
        }
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        Ok(Self {
            on_off: records.iter().all(Record::is_on_off),
            learning,
            judging,
            period_s,
            noise: noise.then(|| f64::sqrt(sum / f64::max(count, 1.0))),
            shifts: (0..DECOYS).map(|_| rng.random_range(0.1..0.9)).collect(),
        })
    }

    fn errors(model: &Model, records: &[&Record]) -> Result<HeldOut, SimulateError> {
        let each = records.par_iter().map(|record| {
            let run = model.free_run(record)?;
            let pairs = record.y.iter().zip(&run).skip(model.warm_up());
            Ok(pairs.map(|(y, sim)| y - sim).collect())
        });
        let errors: Vec<Result<Vec<f64>, SimulateError>> = each.collect();
        Ok(HeldOut::new(errors.into_iter().collect::<Result<_, _>>()?))
    }

    fn judge(&self, fit: Fit) -> Result<Judged, SimulateError> {
        Ok(Judged {
            learned: Self::errors(&fit.model, &self.learning)?,
            held_out: Self::errors(&fit.model, &self.judging)?,
            fit,
        })
    }

    fn rung(&self, model: &Model, effects: &[String], step: &str) -> Result<Rung, SimulateError> {
        let own: Vec<Record> = self.judging.iter().map(|r| (*r).clone()).collect();
        let (scores, _) = score(model, &own)?;
        let all: Option<&Indicators> = scores.held_out();
        Ok(Rung {
            effects: effects.to_vec(),
            validate_rmse: all.map_or(f64::NAN, |i| i.rmse),
            validate_fit_percent: all.map_or(f64::NAN, |i| i.fit_percent),
            noise_rmse: self.noise,
            step: step.to_owned(),
        })
    }

    /// Why a candidate makes no sense on this data or in this model.
    fn pointless(&self, model: &Model, spec: &Spec) -> Option<String> {
        if model.effect_names().iter().any(|name| name == spec.name) {
            return Some("it is in the model already".to_owned());
        }
        match spec.name {
            "input-nonlinearity" if self.on_off => {
                Some("the input has two levels only, which any static curve maps on two".to_owned())
            }
            "edge-dependent-delay" if !self.on_off => {
                Some("the input is not on/off: it has no edges".to_owned())
            }
            _ => None,
        }
    }

    /// Refits `current` with each candidate and judges it on the held-out records.
    fn round(&self, current: &Model, options: &FitOptions, interrupt: &AtomicBool) -> Round {
        let candidates: Vec<&'static Spec> = current.candidates().collect();
        let tried: Vec<(&'static Spec, Result<Judged, String>)> = candidates
            .into_par_iter()
            .map(|spec| {
                if let Some(reason) = self.pointless(current, spec) {
                    return (spec, Err(reason));
                }
                if interrupt.load(Ordering::Relaxed) {
                    return (spec, Err("interrupted".to_owned()));
                }
                (spec, self.candidate(current, spec, options))
            })
            .collect();
        let mut round = Round::default();
        for (spec, outcome) in tried {
            match outcome {
                Ok(judged) => round.candidates.push((spec, judged)),
                Err(reason) => round.not_tried.push(NotTried {
                    effect: spec.name.to_owned(),
                    reason,
                }),
            }
        }
        round
    }

    fn candidate(
        &self,
        current: &Model,
        spec: &'static Spec,
        options: &FitOptions,
    ) -> Result<Judged, String> {
        if let Some(channel) = spec.channel
            && let Some(record) = self
                .judging
                .iter()
                .find(|r| !r.channels.contains_key(channel))
        {
            let error = CandidateError::MissingChannel {
                effect: spec.name.to_owned(),
                channel: channel.to_owned(),
                record: record.name.clone(),
            };
            return Err(error.to_string());
        }
        let fit =
            fit_with_effect(current, spec, &self.learning, options).map_err(|e| e.to_string())?;
        self.judge(fit).map_err(|e| e.to_string())
    }

    /// Ranks candidates against the model they were added to.
    fn rank(&self, current: &Judged, round: &Round) -> Vec<Ranked> {
        let mut order: Vec<usize> = (0..round.candidates.len()).collect();
        let sum = |i: &usize| round.candidates[*i].1.held_out.sum_of_squares;
        order.sort_by(|a, b| sum(a).total_cmp(&sum(b)));
        let p: Vec<f64> = round
            .candidates
            .iter()
            .map(|(_, judged)| p_value(&current.held_out, &judged.held_out, self.period_s))
            .collect();
        let adjusted = holm(&p);
        let mut ranked: Vec<Ranked> = order
            .iter()
            .map(|i| {
                let (spec, judged) = &round.candidates[*i];
                let reduction = 1.0 - judged.held_out.rmse() / current.held_out.rmse();
                let chance = self.best_decoy(current, judged);
                Ranked {
                    effect: spec.name.to_owned(),
                    validate_rmse: judged.held_out.rmse(),
                    error_reduction_percent: 100.0 * reduction,
                    p_value: adjusted[*i],
                    best_decoy_percent: 100.0 * chance,
                    parameters: estimates(&judged.fit, spec),
                    confounded_with: Vec::new(),
                    significant: adjusted[*i] < LEVEL
                        && reduction > WORTHWHILE
                        && reduction > chance,
                }
            })
            .collect();
        // Two significant candidates are one class when neither beats the other.
        for (a, i) in order.iter().enumerate() {
            for (b, j) in order.iter().enumerate() {
                let (x, y) = (&round.candidates[*i].1, &round.candidates[*j].1);
                if a != b && ranked[a].significant && ranked[b].significant {
                    let (better, worse) = if a < b { (x, y) } else { (y, x) };
                    let apart = p_value(&worse.held_out, &better.held_out, self.period_s) < LEVEL;
                    if !apart {
                        let other = ranked[b].effect.clone();
                        ranked[a].confounded_with.push(other);
                    }
                }
            }
        }
        ranked
    }

    /// The best reduction of the held-out rms error among the decoys.
    fn best_decoy(&self, current: &Judged, candidate: &Judged) -> f64 {
        let change = |with: &HeldOut, without: &HeldOut| -> Vec<Vec<f64>> {
            let pairs = with.errors.iter().zip(&without.errors);
            pairs
                .map(|(with, without)| {
                    let skip = without.len().saturating_sub(with.len());
                    without
                        .iter()
                        .skip(skip)
                        .zip(with)
                        .map(|(b, w)| b - w)
                        .collect()
                })
                .collect()
        };
        let learning = change(&candidate.learned, &current.learned);
        let judging = change(&candidate.held_out, &current.held_out);
        decoys(
            (&current.learned, &learning),
            (&current.held_out, &judging),
            &self.shifts,
        )
        .into_iter()
        .map(|energy| 1.0 - (1.0 - energy).max(0.0).sqrt())
        .fold(0.0, f64::max)
    }

    fn at_the_floor(&self, held_out: &HeldOut) -> bool {
        self.noise
            .is_some_and(|noise| held_out.rmse() <= AT_THE_FLOOR * noise)
    }
}

/// From a base model, effect by effect.
struct Climb {
    base: Judged,
    current: Judged,
    added: Vec<&'static Spec>,
    ladder: Vec<Rung>,
    ranking: Vec<Ranked>,
    not_tried: Vec<NotTried>,
}

#[derive(Default)]
struct Round {
    candidates: Vec<(&'static Spec, Judged)>,
    not_tried: Vec<NotTried>,
}

/// Holm's step-down adjustment: valid under any dependence.
fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut adjusted = vec![1.0; p.len()];
    let mut running: f64 = 0.0;
    for (rank, i) in order.iter().enumerate() {
        running = running.max(p[*i] * (p.len() - rank) as f64).min(1.0);
        adjusted[*i] = running;
    }
    adjusted
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
            unit: parameter.unit.to_owned(),
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
    let bench = Bench::new(records, options.seed)?;
    let fit_options = FitOptions {
        constant: given.start == Start::Measured || given.constant != 0.0,
        ..FitOptions::default()
    };
    let mut ladder = vec![
        bench
            .rung(given, &given.effect_names(), "the model as given")
            .unwrap_or_else(|_| Rung {
                effects: given.effect_names(),
                validate_rmse: f64::INFINITY,
                validate_fit_percent: f64::NEG_INFINITY,
                noise_rmse: bench.noise,
                step: "the model as given diverges on these records".to_owned(),
            }),
    ];
    let mut climb = if given.start == Start::Measured {
        // Records that begin in mid-run come from rigs that are no blown ramp:
        // their dynamics is the user's choice of lags.
        let base = bench.refitted(given, &fit_options)?;
        bench.climb(
            base,
            "refitted in free run",
            options,
            &fit_options,
            interrupt,
        )?
    } else {
        let lean = bench.lean(given, &fit_options)?;
        let step = "refitted with the fewest lags";
        let climb = bench.climb(lean, step, options, &fit_options, interrupt)?;
        bench.or_from_given(climb, given, options, &fit_options, interrupt)?
    };
    if interrupt.load(Ordering::Relaxed) && climb.ranking.is_empty() {
        return Err(DiagnoseError::Interrupted);
    }
    ladder.append(&mut climb.ladder);
    let Climb {
        base,
        current,
        added,
        mut ranking,
        not_tried,
        ..
    } = climb;
    let base_model = base.fit.model.clone();

    let parameters: BTreeMap<_, _> = added
        .iter()
        .map(|spec| (spec.name.to_owned(), estimates(&current.fit, spec)))
        .collect();
    // The ranking shows what the effects are in the final model.
    for entry in &mut ranking {
        if let Some(last) = parameters.get(&entry.effect) {
            entry.parameters.clone_from(last);
        }
    }
    let verdict = bench.verdict(&base, &current, added.len());
    Ok(Diagnosis {
        verdict,
        missing: added.iter().map(|spec| spec.name.to_owned()).collect(),
        ladder,
        ranking,
        parameters,
        not_tried,
        model: current.fit.model,
        base: base_model,
    })
}

impl Bench<'_> {
    /// The leanest base, with the effects that the given model has already.
    fn lean(&self, given: &Model, options: &FitOptions) -> Result<Judged, DiagnoseError> {
        let mut bare = given.clone();
        // What was added before stays: the question is what is missing still.
        let kept = std::mem::take(&mut bare.effects);
        let mut model = lean_base(&bare, &self.learning)?.model;
        model.effects = kept;
        Ok(self.judge(fit(&model, &self.learning, options)?)?)
    }

    /// The given model refitted in free run, its structure and delays kept.
    fn refitted(&self, given: &Model, options: &FitOptions) -> Result<Judged, DiagnoseError> {
        Ok(self.judge(fit(given, &self.learning, options)?)?)
    }

    /// Climbs again from the given structure where its free lags hold more than
    /// the lean model and all its effects: then its dynamics is not lean.
    fn or_from_given(
        &self,
        climb: Climb,
        given: &Model,
        options: &Options,
        fit_options: &FitOptions,
        interrupt: &AtomicBool,
    ) -> Result<Climb, DiagnoseError> {
        let richer = given.a.len() + given.c.len()
            > climb.base.fit.model.a.len() + climb.base.fit.model.c.len();
        let reached = self
            .noise
            .is_some_and(|noise| climb.current.held_out.rmse() <= FLOOR_MARGIN * noise);
        if !richer || reached || interrupt.load(Ordering::Relaxed) {
            return Ok(climb);
        }
        let Ok(base) = self.refitted(given, fit_options) else {
            return Ok(climb);
        };
        if base.held_out.rmse() > (1.0 - WORTHWHILE) * climb.current.held_out.rmse() {
            return Ok(climb);
        }
        self.climb(
            base,
            "refitted in free run",
            options,
            fit_options,
            interrupt,
        )
    }

    /// Adds one effect after the other as long as one is significant and worth it.
    fn climb(
        &self,
        base: Judged,
        step: &str,
        options: &Options,
        fit_options: &FitOptions,
        interrupt: &AtomicBool,
    ) -> Result<Climb, DiagnoseError> {
        let base_model = base.fit.model.clone();
        let mut climb = Climb {
            ladder: vec![self.rung(&base_model, &base_model.effect_names(), step)?],
            current: base.clone(),
            base,
            added: Vec::new(),
            ranking: Vec::new(),
            not_tried: Vec::new(),
        };
        while climb.added.len() < options.most_effects
            && !self.at_the_floor(&climb.current.held_out)
        {
            let round = self.round(&climb.current.fit.model, fit_options, interrupt);
            if interrupt.load(Ordering::Relaxed) {
                break;
            }
            let ranked = self.rank(&climb.current, &round);
            let winner = ranked
                .iter()
                .find(|candidate| candidate.significant)
                .cloned();
            if climb.added.is_empty() {
                climb.ranking = ranked;
                climb.not_tried.clone_from(&round.not_tried);
            }
            let Some(winner) = winner else { break };
            let mut candidates = round.candidates.into_iter();
            let Some((spec, judged)) = candidates.find(|(spec, _)| spec.name == winner.effect)
            else {
                break;
            };
            climb.added.push(spec);
            climb.current = self.prune(judged, &base_model, &mut climb.added, fit_options);
            let names: Vec<String> = climb
                .added
                .iter()
                .map(|spec| spec.name.to_owned())
                .collect();
            let step = format!("with {}", winner.effect);
            climb
                .ladder
                .push(self.rung(&climb.current.fit.model, &names, &step)?);
        }
        Ok(climb)
    }

    /// Drops effects that the last one has made needless.
    fn prune(
        &self,
        current: Judged,
        base: &Model,
        added: &mut Vec<&'static Spec>,
        options: &FitOptions,
    ) -> Judged {
        let mut current = current;
        let mut index = 0;
        while added.len() > 1 && index + 1 < added.len() {
            let spec = added[index];
            let mut without = current.fit.model.clone();
            without.effects.retain(|effect| effect.name != spec.name);
            if spec.place == Place::Delay {
                without.delay = base.delay.clone();
            }
            let refitted = fit(&without, &self.learning, options).ok();
            let judged = refitted.and_then(|fit| self.judge(fit).ok());
            let needless = judged.filter(|judged| {
                let loss = judged.held_out.rmse() / current.held_out.rmse() - 1.0;
                loss < WORTHWHILE
                    || p_value(&judged.held_out, &current.held_out, self.period_s) > LEVEL
            });
            match needless {
                Some(judged) => {
                    current = judged;
                    added.remove(index);
                }
                None => index += 1,
            }
        }
        current
    }

    fn verdict(&self, base: &Judged, last: &Judged, added: usize) -> Verdict {
        let noise = self.noise.unwrap_or(0.0);
        let excess = |judged: &Judged| judged.held_out.rmse().powi(2) - noise * noise;
        let above_floor = |judged: &Judged| match self.noise {
            None => true,
            Some(_) => {
                let warm_up = judged.fit.model.warm_up();
                let margin = FLOOR_MARGIN * FLOOR_MARGIN;
                let p = p_above_noise(&judged.held_out, &self.judging, warm_up, margin);
                p.is_none_or(|p| p < LEVEL)
            }
        };
        let explained = 1.0 - excess(last) / excess(base).max(f64::MIN_POSITIVE);
        if added == 0 {
            if above_floor(base) {
                Verdict::Unexplained
            } else {
                Verdict::NothingMissing
            }
        } else if explained < EXPLAINED && above_floor(last) {
            Verdict::Unexplained
        } else {
            Verdict::EffectMissing
        }
    }
}
