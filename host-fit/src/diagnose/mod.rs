//! Which physical effect is missing.
//!
//! The search over [`terms`](crate::terms) finds the best model with effects and the
//! best without. What is said of them is decided here: whether anything is missing,
//! what it is called, what else it could be, and how sure that is.

mod ranking;
mod rules;

pub use crate::terms::HeldOutBy;
pub use ranking::{FLOW_LAG, FLOW_MEMORY};
pub use rules::{RULES, Rules};

use crate::data::Record;
use crate::experiment::{Experiment, Limits, separating};
use crate::fit::{Fit, FitOptions, restart_after};
use crate::model::{Model, Start};
use crate::residual::{FailureCoordinate, NoiseSource, examine};
use crate::simulate::SimulateError;
use crate::terms::{
    Found, HeldOut, Hypothesis, Judge, Judged, Known, Screen, Search, Term, Units,
    begins_in_mid_run, p_value,
};
use model_core::effect::Spec;
use model_core::effects::SLOW_WAKE;
use ranking::{Rival, alike, not_tried, ranked, rivals};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use thiserror::Error;

/// Decoys per candidate.
const DECOYS: usize = 19;
/// A lag below this many samples is the order of the flow, not a memory.
const SHORTEST_MEMORY: usize = 20;

/// A rate below this share of that of the way back is what lags leave that cancel.
const CANCELLED: f64 = 0.01;

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
    /// reduction of the held-out error, %; none where it was only screened.
    pub best_decoy_percent: Option<f64>,
    /// Fitted parameters by name.
    pub parameters: BTreeMap<String, ParameterEstimate>,
    /// Candidates that the held-out records cannot tell from it.
    pub confounded_with: Vec<String>,
    /// Whether the gain counts as real: significant, worthwhile, better than chance.
    pub significant: bool,
    /// Whether everything was refitted with it; otherwise its numbers are what the
    /// screening promises.
    pub refitted: bool,
}

/// What the flow feels of its own past.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Memory {
    /// How long ago, s.
    pub lag_s: f64,
    /// The level that the flow tends to, per y of then, without jets.
    pub weight: f64,
    /// The same under full jets.
    pub weight_blown: f64,
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
    /// "unexplained" or "partly explained", though the ladder shows what was tried.
    pub missing: Vec<String>,
    /// Effects that describe part of the misfit without being proven.
    pub stand_ins: Vec<String>,
    /// For each of `missing` all that the records cannot tell from it, itself first.
    pub sets: Vec<Vec<String>>,
    /// What the flow feels of its own past, in the final model.
    pub memory: Vec<Memory>,
    /// Models that were refitted in full on the way.
    pub tried: usize,
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
    /// All candidates for the final model without effects, best first.
    pub ranking: Vec<Ranked>,
    /// Parameters of the missing effects, or of the stand-ins, in the final model.
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

/// Estimates of an effect's parameters with 95 % intervals, of a fit in inner `units`.
pub(crate) fn estimates(
    fit: &Fit,
    spec: &Spec,
    units: &Units,
) -> BTreeMap<String, ParameterEstimate> {
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
        let out = |value: f64| units.value_out(parameter.unit, value);
        let estimate = ParameterEstimate {
            value: out(value),
            unit: parameter.unit.symbol().to_owned(),
            low: out(low.max(parameter.low.min(value))),
            high: out(high.min(parameter.high.max(value))),
        };
        (parameter.name.to_owned(), estimate)
    })
    .collect()
}

/// Diagnoses `given` on `records`. `progress` is told what is being tried.
///
/// # Errors
/// [`DiagnoseError`].
pub fn diagnose(
    given: &Model,
    records: &[Record],
    options: &Options,
    interrupt: &AtomicBool,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    let units = Units::of(given, records);
    let inner: Vec<Record> = records.iter().map(|r| units.record_in(r)).collect();
    let given_inside = units.model_in(given);
    let mid_run = inner.iter().any(begins_in_mid_run);
    let fit_options = FitOptions {
        constant: mid_run || given.constant != 0.0,
        ..FitOptions::default()
    };
    let restarted = restart_after(&given_inside, &inner);
    let judge = |records: &[Record]| {
        Judge::new(records, restarted, fit_options).ok_or(DiagnoseError::NothingToLearnFrom)
    };
    let judge = judge(&inner)?;
    let known = Known::of(&judge.learning(0));
    let search = Search {
        judge: &judge,
        known,
        effects: true,
        most_effects: options.most_effects,
        interrupt,
        progress,
    };
    let session = Session {
        search: &search,
        units,
        options,
    };
    progress("the model as given");
    let as_given = judge.held_out(|_| &given_inside)?;
    let first = session.rung(&as_given, &[], "the model as given");
    if let Some(diagnosis) = session.nothing_at_once(given, &given_inside, &as_given, &first) {
        return Ok(diagnosis);
    }
    progress("the leanest model");
    let (root, step) = if mid_run && given.start == Start::Measured && !judge.on_off {
        // Rigs that are no blown ramp: their dynamics is the user's choice of lags.
        session.root_of_given(&given_inside, &as_given)?
    } else {
        let root = search.root(&given_inside, mid_run)?;
        (root, "refitted with the fewest lags")
    };
    if interrupt.load(Ordering::Relaxed) {
        return Err(DiagnoseError::Interrupted);
    }
    let root_errors = root.judged.held_out.clone();
    let mut found = search.run(root);
    // The given structure may hold what terms that are added one by one do not reach.
    let reached = found.best.judged.rmse();
    if (judge.over_noise(reached) > RULES.floor_margin
        || reached > (1.0 - RULES.worthwhile) * as_given.rmse())
        && let Ok(judged) = judge.refitted(&given_inside)
        && judged.rmse() < root_errors.rmse()
    {
        let from_given = search.run(Hypothesis::new(judged));
        if from_given.best.judged.rmse() < (1.0 - RULES.worthwhile) * reached {
            found = from_given;
        }
    }
    let restarted_s = restarted.map(|samples| samples as f64 * given.sample_period_s);
    Ok(session.conclude(
        found,
        [first, session.rung(&root_errors, &[], step)],
        &as_given,
        restarted_s,
    ))
}

/// A diagnosis in the making.
struct Session<'a> {
    search: &'a Search<'a>,
    units: Units,
    options: &'a Options,
}

/// What is said, and of which hypothesis.
struct Conclusion {
    verdict: Verdict,
    /// The model that is handed over, inner units.
    model: Hypothesis,
    effects: Vec<&'static Spec>,
}

impl Session<'_> {
    fn judge(&self) -> &Judge {
        self.search.judge
    }

    fn rung(&self, held_out: &HeldOut, effects: &[String], step: &str) -> Rung {
        let judge = self.judge();
        let measured = judge.noise_source == NoiseSource::Measured;
        Rung {
            effects: effects.to_vec(),
            validate_rmse: held_out.rmse() * self.units.y,
            validate_fit_percent: 100.0 * (1.0 - judge.unexplained_share(held_out).sqrt()),
            noise_rmse: measured.then(|| judge.noise_rmse() * self.units.y),
            step: step.to_owned(),
        }
    }

    /// Decoys' shifts, as fractions of a record.
    fn shifts(&self) -> Vec<f64> {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(self.options.seed);
        (0..DECOYS).map(|_| rng.random_range(0.1..0.9)).collect()
    }

    /// The given model's own structure, for rigs whose dynamics is the user's choice of
    /// lags; with the product u·y where it has none and gains by it: that term is in
    /// the base class and never counts as missing.
    fn root_of_given(
        &self,
        given: &Model,
        as_given: &HeldOut,
    ) -> Result<(Hypothesis, &'static str), DiagnoseError> {
        let mut model = given.clone();
        model.delay_between_samples();
        let plain = self.judge().refitted(&model)?;
        if given.product_lags.is_empty() {
            let bilinear = Model {
                product_lags: vec![1],
                c: vec![0.0; given.b.len()],
                ..plain.model().clone()
            };
            if let Ok(bilinear) = self.judge().refitted(&bilinear) {
                let before = plain.rmse().min(as_given.rmse());
                let gain = 1.0 - bilinear.rmse() / before;
                let p = p_value(&plain.held_out, &bilinear.held_out);
                if gain > RULES.worthwhile && p < RULES.level {
                    return Ok((
                        Hypothesis::new(bilinear),
                        "refitted with the product of input and output",
                    ));
                }
            }
        }
        Ok((Hypothesis::new(plain), "refitted in free run"))
    }

    /// The answer for a given model that is at the noise floor already, unless a
    /// single effect promises to do clearly better.
    fn nothing_at_once(
        &self,
        given: &Model,
        given_inside: &Model,
        as_given: &HeldOut,
        first: &Rung,
    ) -> Option<Diagnosis> {
        let judge = self.judge();
        let over = judge.over_noise(as_given.rmse());
        if over > RULES.floor_margin
            || judge.p_above_noise(as_given, RULES.floor_margin) < RULES.level
        {
            return None;
        }
        let screen = Screen::new(judge, given_inside)?;
        let table = screen.table(&self.search.known, over > crate::terms::RULES.at_the_floor);
        let promised = table
            .candidates
            .iter()
            .filter(|candidate| candidate.term.effect().is_some())
            .map(|candidate| 1.0 - (1.0 - candidate.held_out).max(0.0).sqrt())
            .fold(0.0, f64::max);
        if promised > RULES.promising {
            return None;
        }
        Some(Diagnosis {
            verdict: Verdict::NothingMissing,
            missing: Vec::new(),
            stand_ins: Vec::new(),
            sets: Vec::new(),
            memory: memory(given),
            tried: 0,
            held_out_by: judge.held_out_by,
            restarted_s: None,
            noise_source: judge.noise_source,
            noise_estimate: judge.noise_rmse() * self.units.y,
            ladder: vec![first.clone()],
            ranking: Vec::new(),
            parameters: BTreeMap::new(),
            not_tried: not_tried(self.search, given_inside),
            separation: None,
            model: given.clone(),
            base: given.clone(),
        })
    }

    /// Whether an error is no more than the noise, or than the noise is known.
    fn fits(&self, judged: &Judged) -> bool {
        let judge = self.judge();
        if judge.p_above_noise(&judged.held_out, RULES.floor_margin) >= RULES.level {
            return true;
        }
        match judge.noise_source {
            NoiseSource::Measured | NoiseSource::Repeats => {
                judge.over_noise(judged.rmse()) <= RULES.floor_margin
            }
            NoiseSource::Scatter => {
                judge.unexplained_share(&judged.held_out) <= RULES.too_much && !self.depends(judged)
            }
        }
    }

    /// Whether the held-out error depends on anything but its own frequency.
    fn depends(&self, judged: &Judged) -> bool {
        let (mut records, mut runs) = (Vec::new(), Vec::new());
        for (fold, fit) in self.judge().folds.iter().zip(&judged.fits) {
            for judging in &fold.judging {
                let Ok(run) = fit.model.free_run(&judging.record) else {
                    return true;
                };
                records.push(&judging.record);
                runs.push(run);
            }
        }
        let model = judged.model();
        let failures = examine(&records, runs, model.warm_up(), model.longest_delay());
        failures
            .by
            .iter()
            .filter(|place| place.coordinate != FailureCoordinate::FrequencyBand)
            .any(|place| place.explained_fraction > RULES.depends)
    }

    /// Whether effects have earned to be named or to stand in: they beat what lags can
    /// do, or do as well with fewer parameters.
    fn earned(&self, best: &Hypothesis, bare: &Hypothesis) -> bool {
        let (with, without) = (best.judged.rmse(), bare.judged.rmse());
        let scatter = self.judge().noise_source == NoiseSource::Scatter;
        let in_the_dark = scatter && self.fits(&bare.judged);
        // The best of so many alternatives is often good by chance. Where the base
        // errs far beyond what scatters from sample to sample, records are few and
        // short as a rule: one test for each effect has to do.
        let alternatives = if scatter && !in_the_dark {
            best.judged.model().candidates().count() as f64
        } else {
            RULES.alternatives
        };
        let p = alternatives * p_value(&bare.judged.held_out, &best.judged.held_out);
        let worthwhile = if in_the_dark {
            RULES.worthwhile_in_the_dark
        } else {
            RULES.worthwhile
        };
        let better = with < (1.0 - worthwhile) * without && p < RULES.level;
        let leaner = with < (1.0 + RULES.alike) * without && best.cost() < bare.cost();
        let drifts = self.judge().drifts_more(&best.judged, &bare.judged);
        (better || (leaner && !scatter)) && !drifts
    }

    /// A hypothesis without the effects that the rest of it does as well without, for
    /// all that one test for each effect says.
    fn proven(&self, found: &Found) -> Hypothesis {
        let mut best = found.best.clone();
        let mut index = 0;
        while index < best.terms.len() {
            let lesser = match best.terms[index].effect() {
                Some(_) => self.search.without(&best, index, &found.root),
                None => None,
            };
            let chance = lesser.filter(|lesser| {
                let p = p_value(&lesser.judged.held_out, &best.judged.held_out);
                let count = best.judged.model().candidates().count() as f64;
                count * p >= RULES.level
            });
            match chance {
                Some(lesser) => best = lesser,
                None => index += 1,
            }
        }
        best
    }

    fn conclusion(&self, found: &Found, as_given: &HeldOut) -> Conclusion {
        let scatter = self.judge().noise_source == NoiseSource::Scatter;
        let dark = scatter
            && self.judge().unexplained_share(&found.bare.judged.held_out) <= RULES.too_much;
        let proven = if dark {
            self.proven(found)
        } else {
            found.best.clone()
        };
        let (best, bare) = (&proven, &found.bare);
        let effects: Vec<&'static Spec> = best.terms.iter().filter_map(Term::effect).collect();
        let judge = self.judge();
        let of = |verdict: Verdict, model: &Hypothesis, effects: Vec<&'static Spec>| Conclusion {
            verdict,
            model: model.clone(),
            effects,
        };
        if effects.is_empty() || !self.earned(best, bare) {
            let verdict = if self.fits(&bare.judged) {
                Verdict::NothingMissing
            } else {
                Verdict::Unexplained
            };
            return of(verdict, bare, Vec::new());
        }
        let left = judge.excess(&best.judged.held_out)
            / judge.excess(&bare.judged.held_out).max(f64::MIN_POSITIVE);
        let fits = self.fits(&best.judged);
        let explained = match judge.noise_source {
            NoiseSource::Scatter => 1.0 - left >= RULES.explained_in_unknown_noise,
            NoiseSource::Measured | NoiseSource::Repeats => {
                1.0 - left >= RULES.explained
                    && judge.over_noise(best.judged.rmse()) <= RULES.nearly
            }
        };
        // Effects on a base that is worse than what was given explain nothing.
        let no_better = best.judged.rmse() >= as_given.rmse();
        match () {
            () if no_better => of(Verdict::Unexplained, bare, Vec::new()),
            () if fits || explained => of(Verdict::EffectMissing, best, effects),
            () if 1.0 - left >= RULES.stands_in => of(Verdict::PartlyExplained, best, effects),
            () => of(Verdict::Unexplained, bare, Vec::new()),
        }
    }

    fn conclude(
        &self,
        found: Found,
        first: [Rung; 2],
        as_given: &HeldOut,
        restarted_s: Option<f64>,
    ) -> Diagnosis {
        let (search, judge, units) = (self.search, self.judge(), &self.units);
        let Conclusion {
            verdict,
            model: last,
            effects,
        } = self.conclusion(&found, as_given);
        (search.progress)("what else it could be");
        let mut context = last.clone();
        while let Some(index) = context.terms.iter().rposition(|t| t.effect().is_some()) {
            match search.without(&context, index, &found.root) {
                Some(lesser) => context = lesser,
                None => break,
            }
        }
        let names: Vec<&str> = effects.iter().map(|spec| spec.name).collect();
        let others = rivals(search, &context, &names);
        let mut order = effects.clone();
        // The best single effect leads: the ladder falls as the ranking does.
        let place = |spec: &Spec| others.iter().position(|r| r.name == spec.name);
        order.sort_by_key(|spec| place(spec).unwrap_or(usize::MAX));
        let mut ladder = first.to_vec();
        if !context.terms.is_empty() {
            let step = format!("with {}", context.words());
            ladder.push(self.rung(&context.judged.held_out, &[], &step));
        }
        ladder.extend(self.rungs(&last, &order, &found.root));
        let sets = self.sets(&last, &order, &others, &found.root);
        let alternatives: Vec<Model> = sets
            .iter()
            .flat_map(|set| &set.models)
            .map(|model| units.model_out(model))
            .collect();
        let end = judge.final_fit(&last.judged);
        let model = units.model_out(&end.model);
        let parameters: BTreeMap<_, _> = order
            .iter()
            .map(|spec| (spec.name.to_owned(), estimates(&end, spec, units)))
            .collect();
        let mut ranking = ranked(judge, units, &context, &others, &self.shifts());
        for entry in &mut ranking {
            // The ranking shows what the effects are in the final model, and only what
            // still cannot be told apart there.
            if let Some(own) = parameters.get(&entry.effect) {
                entry.parameters.clone_from(own);
                let set = sets
                    .iter()
                    .find(|set| set.names.first() == Some(&entry.effect));
                entry.confounded_with = set.map(|s| s.names[1..].to_vec()).unwrap_or_default();
            }
        }
        let separated: Vec<String> = {
            let mut names: Vec<String> = Vec::new();
            for set in sets.iter().filter(|set| !set.models.is_empty()) {
                for name in &set.names {
                    if !names.contains(name) {
                        names.push(name.clone());
                    }
                }
            }
            names
        };
        let separation = self.separation(&model, alternatives, separated);
        let names: Vec<String> = order.iter().map(|spec| spec.name.to_owned()).collect();
        let (missing, stand_ins) = match verdict {
            Verdict::EffectMissing => (names, Vec::new()),
            Verdict::PartlyExplained => (Vec::new(), names),
            Verdict::NothingMissing | Verdict::Unexplained => (Vec::new(), Vec::new()),
        };
        Diagnosis {
            verdict,
            sets: if missing.is_empty() {
                Vec::new()
            } else {
                sets.into_iter().map(|set| set.names).collect()
            },
            missing,
            stand_ins,
            memory: memory(&model),
            tried: found.tried,
            held_out_by: judge.held_out_by,
            restarted_s,
            noise_source: judge.noise_source,
            noise_estimate: judge.noise_rmse() * units.y,
            ladder,
            ranking,
            parameters,
            not_tried: not_tried(search, found.root.judged.model()),
            separation,
            base: units.model_out(&judge.final_fit(&found.bare.judged).model),
            model,
        }
    }

    /// The rungs from the first effect to the last, each with one effect more.
    fn rungs(&self, last: &Hypothesis, order: &[&'static Spec], root: &Hypothesis) -> Vec<Rung> {
        let mut rungs = Vec::new();
        let mut current = last.clone();
        for count in (1..=order.len()).rev() {
            let names: Vec<String> = order[..count].iter().map(|s| s.name.to_owned()).collect();
            let step = format!("with {}", order[count - 1].name);
            rungs.push(self.rung(&current.judged.held_out, &names, &step));
            if count > 1 {
                let of = |t: &Term| t.effect().is_some_and(|s| s.name == order[count - 1].name);
                let without = current.terms.iter().position(of);
                match without.and_then(|index| self.search.without(&current, index, root)) {
                    Some(lesser) => current = lesser,
                    None => break,
                }
            }
        }
        rungs.reverse();
        rungs
    }

    /// For each effect all that the records cannot tell from it.
    fn sets(
        &self,
        last: &Hypothesis,
        order: &[&'static Spec],
        first: &[Rival],
        root: &Hypothesis,
    ) -> Vec<Set> {
        order
            .iter()
            .map(|spec| {
                let mut set = Set {
                    names: vec![spec.name.to_owned()],
                    models: Vec::new(),
                };
                let owned: Vec<Rival>;
                let others = if order.len() == 1 {
                    first
                } else {
                    let of = |t: &Term| t.effect().is_some_and(|s| s.name == spec.name);
                    let index = last.terms.iter().position(of);
                    let without = index.and_then(|i| self.search.without(last, i, root));
                    let Some(without) = without else { return set };
                    owned = rivals(self.search, &without, &[spec.name]);
                    &owned
                };
                for rival in others {
                    let Some(judged) = &rival.judged else {
                        continue;
                    };
                    let present = order.iter().any(|s| s.name == rival.name);
                    if !present && alike(&judged.held_out, &last.judged.held_out) {
                        set.names.push(rival.name.clone());
                        set.models.push(judged.model().clone());
                    }
                }
                set
            })
            .collect()
    }

    /// The command that would tell the final model from those in which something else
    /// stands for one of its effects.
    fn separation(
        &self,
        model: &Model,
        alternatives: Vec<Model>,
        effects: Vec<String>,
    ) -> Option<Separation> {
        let interrupted = self.search.interrupt.load(Ordering::Relaxed);
        if alternatives.is_empty() || !self.judge().on_off || interrupted {
            return None;
        }
        let models: Vec<Model> = std::iter::once(model.clone()).chain(alternatives).collect();
        let noise = (self.judge().noise_rmse() * self.units.y).max(f64::MIN_POSITIVE);
        let experiment = separating(&models, noise, &Limits::default(), self.options.seed).ok()?;
        Some(Separation {
            effects,
            experiment,
        })
    }
}

/// An effect with what the records cannot tell from it.
struct Set {
    names: Vec<String>,
    /// The models with the others in its place, inner units.
    models: Vec<Model>,
}

/// What the flow of `model` feels of its own past: a term a·y(t − τ) of the recursion
/// over the rate at which the flow forgets; and a slow wake.
fn memory(model: &Model) -> Vec<Memory> {
    let behind = |lag: &u16| model.convention.behind_newest(*lag);
    let is_memory = |lag: &u16| behind(lag) >= SHORTEST_MEMORY;
    let pairs = || model.state_lags.iter().zip(&model.a);
    let products = || model.product_lags.iter().zip(&model.c);
    let short: f64 = pairs()
        .filter(|(lag, _)| !is_memory(lag))
        .map(|(_, a)| a)
        .sum();
    let blown: f64 = products()
        .filter(|(lag, _)| !is_memory(lag))
        .map(|(_, c)| c)
        .sum();
    // Where lags cancel, what is left of them is no rate: that of the way back is.
    let slowest = model.sample_period_s / model.time_constant();
    let or_slowest = |rate: f64| {
        if rate > CANCELLED * slowest {
            rate
        } else {
            slowest
        }
    };
    let (rate, rate_blown) = (or_slowest(1.0 - short), or_slowest(1.0 - short - blown));
    let mut lags: Vec<u16> = pairs().chain(products()).map(|(lag, _)| *lag).collect();
    lags.retain(is_memory);
    lags.sort_unstable();
    lags.dedup();
    let wakes = model.effects.iter().filter(|e| e.name == SLOW_WAKE.name);
    let wakes = wakes.filter_map(|wake| match wake.parameters.as_slice() {
        [time_constant, pull] => Some(Memory {
            lag_s: *time_constant,
            weight: -pull,
            weight_blown: -pull,
        }),
        _ => None,
    });
    lags.iter()
        .map(|lag| {
            let a: f64 = pairs().filter(|(l, _)| *l == lag).map(|(_, a)| a).sum();
            let c: f64 = products().filter(|(l, _)| *l == lag).map(|(_, c)| c).sum();
            Memory {
                lag_s: behind(lag) as f64 * model.sample_period_s,
                weight: a / rate,
                weight_blown: (a + c) / rate_blown,
            }
        })
        .chain(wakes)
        .collect()
}
