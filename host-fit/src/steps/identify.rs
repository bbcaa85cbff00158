//! Identification of a model from records.

use serde::{Serialize, Serializer};

use super::candidate_law::candidate_law;
use super::memory::Work;
use super::onlooker::{Searching, watched};
use super::prepared::prepared;
use super::{
    Answer, Beside, Onlooker, StepError, finite_fit, level, trained_in_free_run, training,
};
use crate::data::{DataSet, Record, Use};
use crate::excitation::{Demand, ExcitationError, check_excitation};
use crate::extend::{effects_for, extend};
use crate::identify::{
    ExponentialDelay, Identified, IdentifyError, IdentifyOptions, InputDelay, Objective, RULES,
    Refinement, Structure, identify as search,
};
use crate::indicators::{Scores, one_step_norm, score, score_new};
use crate::model::{Delay, Model, Start};
use crate::noise::without_outliers;
use crate::preparation::Preparation;
use crate::search::{Settings, StopReason};
use crate::terms::{Frame, Units, base_model, baselines, measured_inputs};
use crate::user_effect::Definition;
use model_core::effects::{NUISANCES, StateDependentDelay};
use model_core::recursion::LagConvention;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Options of an identification.
#[derive(Debug, Clone)]
pub struct IdentifyRequest {
    /// Kind of the input delays; none for the kind with the lower validation error.
    pub delay: Option<DelayKind>,
    /// Keep unrounded delays even if the validation error hardly differs.
    pub interpolated: bool,
    /// Factors f of the delay law, one per input, instead of a search for them; empty to search.
    pub factors: Vec<f64>,
    /// Identify the model of the moving averages, eqs. (14) and (15).
    pub averaged: bool,
    /// Number of state lags N1. If no number is given and the objective is the free run, the structure is chosen by
    /// validation error; otherwise 5, for the averaged model 2.
    pub n1: Option<u16>,
    /// Number of product lags N2; by default 10, for the averaged model 2.
    pub n2: Option<u16>,
    /// Number of input delays N3; by default 1, for the averaged model 2.
    pub n3: Option<u16>,
    /// Longest lag and input delay, samples; by default 500, at most a quarter of the shortest record.
    pub max_lag: Option<u16>,
    /// Meaning of a lag.
    pub lags: LagConvention,
    /// Objective of the search.
    pub objective: Objective,
    /// Largest number of evaluations of the objective.
    pub evaluations: usize,
    /// Number of threads; the result does not depend on it.
    pub threads: usize,
    /// Seed of every random choice.
    pub seed: u64,
    /// Physical effects to add to the base model.
    pub effects: Vec<String>,
    /// The user's own effects.
    pub definitions: Vec<&'static Definition>,
}

/// Kind of the input delays of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DelayKind {
    /// Constant, eq. (3).
    Fixed,
    /// Falling with the averaged output, eq. (4); the law is measured on the records.
    StateDependent,
    /// Falling with the averaged output, with a prescribed law.
    Prescribed(ExponentialDelay),
}

impl Default for IdentifyRequest {
    fn default() -> Self {
        let search = Settings::default();
        Self {
            delay: None,
            interpolated: false,
            factors: Vec::new(),
            averaged: false,
            n1: None,
            n2: None,
            n3: None,
            max_lag: None,
            lags: LagConvention::OneStep,
            objective: Objective::FreeRun,
            evaluations: search.evaluations,
            threads: search.threads,
            seed: search.seed,
            effects: Vec::new(),
            definitions: Vec::new(),
        }
    }
}

/// An identified model. Serialises to the keys of `identify --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Identification {
    /// The model, with its effects and its training record.
    #[serde(skip)]
    pub model: Model,
    /// The answer: verdict, evidence, confidence, next command.
    pub answer: Answer,
    /// Objective that was minimised.
    #[serde(serialize_with = "objective_name")]
    pub objective: Objective,
    /// Value of the objective with least-squares coefficients.
    pub objective_value: f64,
    /// √Σ(y_{k+1} − prediction)² over the identify records.
    pub one_step_norm: f64,
    /// Evaluations of the objective.
    pub evaluations: usize,
    /// Time taken by the search, s.
    pub wall_time_s: f64,
    /// Indicators of the free run per record, and together.
    #[serde(flatten)]
    pub scores: Scores,
    /// Baselines on the same samples.
    #[serde(flatten)]
    pub beside: Beside,
    /// Lags and delays of the model.
    pub delays: IdentifiedDelays,
    /// Number of candidates that the search evaluated in closed form.
    pub screened: usize,
    /// Why the search ended.
    #[serde(serialize_with = "stop_name")]
    pub stop: StopReason,
    /// The refinement on the free run; `None` without refinement.
    pub refinement: Option<Refinement>,
    /// Largest pole magnitudes of the recursion, closed and open.
    pub poles: [f64; 2],
    /// Remarks for the user, one sentence each.
    pub remarks: Vec<String>,
    /// Remarks on the excitation, one sentence each.
    pub excitation: Vec<String>,
}

/// Lags and delays of a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdentifiedDelays {
    /// State lags τ, samples.
    pub state: Vec<u16>,
    /// Product lags τ̄, samples.
    pub product: Vec<u16>,
    /// Fixed input delays, samples; empty under a law.
    pub input: Vec<u16>,
    /// Factors of the delay law; empty without a law.
    pub factors: Vec<f64>,
    /// Parameters of the delay law, in the order of its card; none for fixed delays.
    pub law: Option<Vec<f64>>,
}

fn objective_name<S: Serializer>(objective: &Objective, to: S) -> Result<S::Ok, S::Error> {
    objective.name().serialize(to)
}

fn stop_name<S: Serializer>(stop: &StopReason, to: S) -> Result<S::Ok, S::Error> {
    stop.name().serialize(to)
}

impl IdentifiedDelays {
    fn of(model: &Model) -> Self {
        let (input, factors, law) = match &model.delay {
            Delay::Fixed { delays } => (delays.clone(), Vec::new(), None),
            Delay::Law(law) => (
                Vec::new(),
                law.factors.clone(),
                Some(law.parameters.clone()),
            ),
        };
        Self {
            state: model.state_lags.clone(),
            product: model.product_lags.clone(),
            input,
            factors,
            law,
        }
    }
}

impl IdentifyRequest {
    /// Sizes and conventions, without the input delay.
    fn structure(&self, set: &DataSet, prepared: &Preparation) -> Result<Structure, StepError> {
        let learning: Vec<&Record> = set.identify().collect();
        let shortest = learning.iter().map(|r| r.len()).min();
        let shortest = shortest.ok_or(ExcitationError::NoIdentifyRecord)?;
        let at_rest = prepared.at_rest;
        let size = |given: Option<u16>, full: u16, averaged: u16| -> usize {
            given
                .unwrap_or(if self.averaged { averaged } else { full })
                .into()
        };
        let longest_lag = self.max_lag.unwrap_or_else(|| {
            let fitting = shortest / RULES.longest_lag_fits;
            u16::try_from(fitting).map_or(RULES.longest_lag, |lag| lag.clamp(1, RULES.longest_lag))
        });
        Ok(Structure {
            state_lags: size(self.n1, 5, 2).min(longest_lag.into()),
            product_lags: size(self.n2, 10, 2).min(longest_lag.into()),
            inputs: size(self.n3, 1, 2),
            longest_lag,
            convention: self.lags,
            delay: InputDelay::Fixed { delays: None },
            averaged: self.averaged,
            constant: !at_rest,
            start: if at_rest {
                Start::Rest
            } else {
                Start::Measured
            },
        })
    }

    /// The direct search over delays.
    fn settings(&self) -> Settings {
        Settings {
            evaluations: self.evaluations,
            seed: self.seed,
            threads: self.threads,
            ..Settings::default()
        }
    }

    /// Whether the structure is chosen by validation error.
    fn is_automatic(&self) -> bool {
        let counted = self.n1.or(self.n2).or(self.n3).or(self.max_lag).is_some();
        let of_the_paper = self.averaged || self.lags == LagConvention::Literal;
        let prescribed = !self.factors.is_empty();
        !counted && !of_the_paper && !prescribed && self.objective == Objective::FreeRun
    }

    /// The delay laws that an automatic structure may have.
    fn laws(&self) -> Vec<Delay> {
        let constant = Delay::Fixed { delays: vec![0] };
        let exponential = |law: ExponentialDelay| {
            Delay::of::<StateDependentDelay<f64>>(&[law.floor, law.rise, law.rate], vec![1.0], true)
        };
        match self.delay {
            None => vec![constant, exponential(ExponentialDelay::USUAL)],
            Some(DelayKind::Fixed) => vec![constant],
            Some(DelayKind::StateDependent) => vec![exponential(ExponentialDelay::USUAL)],
            Some(DelayKind::Prescribed(law)) => vec![exponential(law)],
        }
    }

    /// The kinds of input delay to search, the requested one first; the validation error decides.
    fn input_delays(
        &self,
        set: &DataSet,
        remarks: &mut Vec<String>,
    ) -> Result<Vec<InputDelay>, StepError> {
        if self.factors.iter().any(|f| !(f.is_finite() && *f >= 0.0)) {
            return Err(StepError::BadFactors);
        }
        let constant = InputDelay::Fixed { delays: None };
        let factors = (!self.factors.is_empty()).then(|| self.factors.clone());
        let by_law = |law| InputDelay::StateDependent {
            law,
            factors: factors.clone(),
        };
        match self.delay.unwrap_or(DelayKind::Fixed) {
            DelayKind::Fixed if factors.is_none() => Ok(vec![constant]),
            DelayKind::Fixed => Err(StepError::FactorsWithoutLaw),
            DelayKind::Prescribed(law) => Ok(vec![by_law(law)]),
            DelayKind::StateDependent => {
                let learning: Vec<&Record> = set.identify().collect();
                let found = candidate_law(set, &learning)?;
                if let Some((_, origin)) = &found {
                    remarks.push(format!("delay law {origin}"));
                }
                match (found, &factors) {
                    (Some((law, _)), Some(_)) => Ok(vec![by_law(law)]),
                    (None, Some(_)) => Err(StepError::NoDelayLaw),
                    (Some((law, _)), None) => Ok(vec![by_law(law), constant]),
                    (None, None) => Ok(vec![constant]),
                }
            }
        }
    }
}

/// The error, with the file of the record concerned.
fn located(set: &DataSet, error: IdentifyError) -> StepError {
    let at_fault = |r: &Record| Some(r.name.as_str()) == error.record();
    match set.records.iter().position(at_fault) {
        Some(index) => StepError::IdentifyRecord {
            place: Box::new(set.place(index, None)),
            cause: error,
        },
        None => error.into(),
    }
}

/// The remark on an over-fitted model.
fn overfitted(scores: &Scores, model: &Model) -> Option<String> {
    let (own, held_out) = (
        finite_fit(scores.identify.as_ref())?,
        finite_fit(scores.validate.as_ref())?,
    );
    // The remark gives only advice that the model does not follow already.
    let fewer = match (model.state_lags.len(), model.product_lags.len()) {
        (0..=1, 0..=1) => "",
        (0..=2, 0..=2) => "fewer lags (`--n1 1 --n2 1`), ",
        _ => "fewer lags (`--n1 2 --n2 2`), ",
    };
    (held_out < own - RULES.overfitted_points).then(|| {
        format!(
            "The model over-fits: FIT {own:.0} % on the estimation records, {held_out:.0} % on the validation records. Use \
             {fewer}more varied records, or `host-fit diagnose`, which adds physical effects to the fewest lags."
        )
    })
}

/// The remark on single wrong readings, if they lower the FIT of the model by more than a point.
fn wrong_readings(model: &Model, records: &[Record], scores: &Scores) -> Option<String> {
    let mut count = 0;
    let mut cleaned = records.to_vec();
    for record in &mut cleaned {
        let y = without_outliers(&record.y);
        count += y.iter().zip(&record.y).filter(|(a, b)| a != b).count();
        record.y = y;
    }
    let without = (count > 0).then(|| score(model, &cleaned).ok())??.0;
    let [with, without] = [scores, &without].map(|scores| finite_fit(scores.held_out()));
    let without = without.filter(|without| *without > with.unwrap_or(f64::NAN) + 1.0)?;
    Some(format!(
        "{count} readings of y are wrong: each is far from both neighbours. Without them the FIT is {without:.1} %."
    ))
}

/// Identifies a model on the identify records of `set`. The delays are found by search, and for each candidate the
/// coefficients by least squares. If the objective is the free run, the coefficients are refined on it, and kept
/// if the validation error falls.
///
/// ```
/// use host_fit::data::DataSet;
/// use host_fit::steps::{DelayKind, IdentifyRequest, identify};
///
/// let set = DataSet::load("../data/paper-like".as_ref())?;
/// // One lag of each kind, for a short example; without these counts the structure is chosen by validation error.
/// let request = IdentifyRequest {
///     delay: Some(DelayKind::Fixed),
///     n1: Some(1),
///     n2: Some(1),
///     max_lag: Some(80),
///     evaluations: 200,
///     ..IdentifyRequest::default()
/// };
/// let found = identify(&set, &request, &())?;
/// assert_eq!(found.delays.state.len(), 1);
/// assert!(found.scores.validate.is_some_and(|held_out| held_out.fit_percent > 50.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`]: data that do not permit a fit (naming the file), a contradictory request, no stable model.
pub fn identify(
    set: &DataSet,
    request: &IdentifyRequest,
    onlooker: &dyn Onlooker,
) -> Result<Identification, StepError> {
    Work::Identify.fits(set)?;
    let prepared = prepared(set)?;
    let structure = request.structure(set, &prepared)?;
    let demand = Demand {
        max_lag: structure.longest_lag.into(),
        coefficients: structure.coefficients(),
    };
    let excitation = check_excitation(set, demand)?.remarks;
    for remark in &excitation {
        onlooker.hears(remark);
    }
    let mut remarks = Vec::new();
    remarks.extend(prepared.remarks());
    if request.is_automatic() {
        return automatic(set, &prepared, request, onlooker, (remarks, excitation));
    }
    // In the recursion the rest level of the records is 0, and jets are between 0 and 1.
    let units = Units {
        zero: prepared.zero,
        command: prepared.command,
        ..Units::NONE
    };
    let inner: Vec<Record> = prepared
        .records
        .iter()
        .map(|r| units.record_in(r))
        .collect();
    let delays = request.input_delays(set, &mut remarks)?;
    let mut searched: Vec<(Identified, Vec<Record>)> = Vec::new();
    for delay in delays {
        // After an interrupt the law that was searched is the result.
        if !searched.is_empty() && onlooker.interrupt().load(Ordering::Relaxed) {
            break;
        }
        let options = IdentifyOptions {
            structure: Structure {
                delay,
                ..structure.clone()
            },
            objective: request.objective,
            search: request.settings(),
            ..IdentifyOptions::default()
        };
        let mut identified: Identified = watched(onlooker, "searching the delays", || {
            let progress = Searching(onlooker);
            search(&inner, &options, &progress, onlooker.interrupt())
        })
        .map_err(|error| located(set, error))?;
        identified.model = units.model_out(&identified.model);
        let records = identified.model.targets(&prepared.records);
        searched.push((identified, records));
    }
    if let [by_law, constant] = searched.as_slice() {
        let [law, fixed] = [by_law, constant].map(|(found, records)| {
            let scores = score(&found.model, records).ok().map(|(scores, _)| scores);
            finite_fit(scores.as_ref().and_then(Scores::held_out)).unwrap_or(f64::NEG_INFINITY)
        });
        if fixed >= law {
            remarks.push(format!(
                "The delay is constant: with law (2) the FIT is {law:.1} %, with a constant delay {fixed:.1} %."
            ));
            searched.swap(0, 1);
        }
    }
    let (identified, records) = searched.swap_remove(0);
    let (mut model, scores, beside) =
        with_effects(identified.model, &records, request, onlooker, &mut remarks)?;
    let (name, value) = (identified.objective.name(), identified.objective_value);
    model.training = training(set, &scores, request.seed, name, value);
    Ok(Identification {
        answer: answer(&scores, &beside, &model),
        objective: identified.objective,
        objective_value: value,
        one_step_norm: if model.effects.is_empty() {
            one_step_norm(&model, &records)?
        } else {
            identified.one_step_norm
        },
        evaluations: identified.evaluations,
        wall_time_s: identified.wall_time.as_secs_f64(),
        scores,
        beside,
        delays: IdentifiedDelays::of(&model),
        screened: identified.screened,
        stop: identified.stop,
        refinement: identified.refinement,
        poles: [identified.pole_off, identified.pole_on],
        remarks,
        excitation,
        model,
    })
}

fn answer(scores: &Scores, beside: &Beside, model: &Model) -> Answer {
    level::identified(scores, &beside.fits, model.parameter_count())
}

/// The base model with the requested effects, and its scores.
fn with_effects(
    mut model: Model,
    records: &[Record],
    request: &IdentifyRequest,
    onlooker: &dyn Onlooker,
    remarks: &mut Vec<String>,
) -> Result<(Model, Scores, Beside), StepError> {
    for definition in &request.definitions {
        model.define(definition)?;
    }
    if !request.effects.is_empty() {
        let given = model.clone();
        model = model.with_inputs(measured_inputs(records));
        effects_for(&model, &request.effects)?;
        model = watched(onlooker, "refitting with the effects", || {
            let progress = |what: &str| onlooker.now(what);
            extend(
                &model,
                records,
                &request.effects,
                onlooker.interrupt(),
                &progress,
            )
        })?
        .model;
        model.forget_unused(&given);
    }
    let (scores, diverged) = score_new(&model, records)?;
    if let Some(diverged) = diverged.into_iter().next() {
        return Err(StepError::Unstable(diverged));
    }
    remarks.extend(overfitted(&scores, &model));
    remarks.extend(wrong_readings(&model, records, &scores));
    let beside = Beside::of(records);
    let fit = scores.held_out().map_or(f64::NAN, |all| all.fit_percent);
    remarks.extend(beside.better_than(fit));
    remarks.extend(beside.much_faster());
    Ok((model, scores, beside))
}

/// The best linear baseline as a model, if its validation error is lower than that of `model`; requested
/// effects are kept.
fn better_baseline(
    model: &Model,
    scores: &Scores,
    beside: &Beside,
    records: &[Record],
) -> Option<(Model, Scores)> {
    let fit = |scores: &Scores| finite_fit(scores.held_out()).unwrap_or(f64::NEG_INFINITY);
    beside.better_than(fit(scores))?;
    let is_nuisance = |name: &str| NUISANCES.iter().any(|spec| spec.name == name);
    if !model.effects.iter().all(|added| is_nuisance(&added.name)) {
        return None;
    }
    let frame = Model {
        sample_period_s: model.sample_period_s,
        ..Model::default()
    };
    let learning: Vec<&Record> = records.iter().filter(|r| r.role == Use::Identify).collect();
    let all = baselines(&frame, &learning)
        .into_iter()
        .filter_map(|model| {
            let (scores, _) = score(&model, records).ok()?;
            Some((model, scores))
        });
    all.filter(|(_, own)| fit(own) > fit(scores))
        .max_by(|a, b| fit(&a.1).total_cmp(&fit(&b.1)))
}

/// Identifies a model whose structure is chosen by validation error.
fn automatic(
    set: &DataSet,
    prepared: &Preparation,
    request: &IdentifyRequest,
    onlooker: &dyn Onlooker,
    (mut remarks, excitation): (Vec<String>, Vec<String>),
) -> Result<Identification, StepError> {
    let started = Instant::now();
    let found = watched(onlooker, "choosing the structure", || {
        let progress = |what: &str| onlooker.now(what);
        let laws = request.laws();
        let interrupt = onlooker.interrupt();
        let how = Frame {
            laws: &laws,
            interpolated: request.interpolated,
            settings: request.settings(),
        };
        base_model(
            &prepared.records,
            &how,
            interrupt,
            &progress,
            &Searching(onlooker),
        )
    });
    let found = found.ok_or(ExcitationError::NoIdentifyRecord)??;
    let records = found.model.targets(&prepared.records);
    let (mut model, mut scores, beside) =
        with_effects(found.model, &records, request, onlooker, &mut remarks)?;
    if let Some((baseline, better)) = better_baseline(&model, &scores, &beside, &records) {
        (model, scores) = (baseline, better);
        remarks.push(
            "The written model is that baseline: no bilinear structure has a lower validation error."
                .to_owned(),
        );
    }
    model.training = trained_in_free_run(set, &scores, request.seed);
    let objective_value = model.training.objective_value;
    let objective = Objective::FreeRun;
    let pole = |on| model.largest_pole(on).map_err(IdentifyError::from);
    Ok(Identification {
        answer: answer(&scores, &beside, &model),
        objective,
        objective_value,
        one_step_norm: one_step_norm(&model, &records)?,
        evaluations: found.evaluations,
        wall_time_s: started.elapsed().as_secs_f64(),
        scores,
        beside,
        delays: IdentifiedDelays::of(&model),
        screened: found.tried,
        stop: if onlooker.interrupt().load(Ordering::Relaxed) {
            StopReason::Interrupted
        } else {
            found.stop
        },
        refinement: None,
        poles: [pole(false)?, pole(true)?],
        remarks,
        excitation,
        model,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};

    #[test]
    fn wrong_readings_are_counted_and_the_fit_is_stated_without_them() {
        let mut records = records(&[], &[], 1);
        let model = base(&records);
        let remark = |records: &[Record]| {
            let (scores, _) = score(&model, records).expect("stable");
            wrong_readings(&model, records, &scores)
        };
        assert_eq!(remark(&records), None);
        let clean = records.clone();
        let middle = records[0].len() / 2;
        for record in &mut records {
            record.y[middle] += 20.0;
        }
        let (right, _) = score(&model, &clean).expect("stable");
        let fit = right.held_out().expect("scored").fit_percent;
        let remark = remark(&records).expect("wrong readings");
        assert!(remark.contains(&format!("FIT is {fit:.1} %")), "{remark}");
        let count: usize = remark
            .split(' ')
            .next()
            .and_then(|n| n.parse().ok())
            .unwrap_or(0);
        assert!(
            (records.len()..=records.len() + 1).contains(&count),
            "{remark}"
        );
    }
}
