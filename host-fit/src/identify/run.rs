//! One identification, from records to a model.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use model_core::model::Averaging;
use model_core::recursion::Grading;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use super::arrival::factor;
use super::free_run::{Coefficients, DIVERGED_VALUE, FreeRun};
use super::free_run_steps::{FreeKickStep, InputStep, PredictedStep};
use super::free_runner::FreeRunner;
use super::layout::Delays;
use super::one_step::{ExchangeStep, KickStep, OneStep, PairStep};
use super::regression::Regression;
use super::structure::{InputDelay, Series, Structure, WINDOW};
use crate::data::{Record, Use};
use crate::fit::{FitOptions, fit};
use crate::linalg;
use crate::model::{Delay, Model, Training};
use crate::search::{
    Point, Progress, Report, SearchStep, Settings, Speculative, StopReason, minimise,
};

/// What the search of the delays minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Objective {
    /// Norm of the one-step prediction errors.
    OneStep,
    /// ε of the free run, eq. (9), with one-step least-squares coefficients: the paper's.
    #[default]
    FreeRun,
}

impl Objective {
    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::OneStep => "one-step",
            Self::FreeRun => "free-run",
        }
    }
}

/// How to identify.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifyOptions {
    /// Sizes and conventions of the model.
    pub structure: Structure,
    /// What the search minimises.
    pub objective: Objective,
    /// Budget, seed and threads of the search.
    pub search: Settings,
    /// Fruitless restarts after which the search ends; 0 for a single descent.
    pub patience: usize,
    /// Whether the coefficients are refined on the free run after a search with
    /// [`Objective::FreeRun`].
    pub refine: bool,
}

impl Default for IdentifyOptions {
    fn default() -> Self {
        Self {
            structure: Structure::default(),
            objective: Objective::default(),
            search: Settings::default(),
            patience: 3,
            refine: true,
        }
    }
}

/// Output-error refinement of the coefficients, delays unchanged.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// ε over the identify records before and after.
    pub identify: (f64, f64),
    /// ε over the validate records before and after, if there are any.
    pub validate: Option<(f64, f64)>,
    /// Whether the refined coefficients are those of the returned model: the
    /// held-out ε fell or, without held-out records, the one fitted.
    pub kept: bool,
}

/// Result of an identification.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The model; lags sorted, repeated lags dropped. Its training record has
    /// objective and seed; the caller adds what else it knows.
    pub model: Model,
    /// What was minimised.
    pub objective: Objective,
    /// Its value with least-squares coefficients.
    pub objective_value: f64,
    /// √Σ(y_{k+1} − prediction)² of the least-squares model over the identify
    /// records, summed directly from the samples.
    pub one_step_norm: f64,
    /// Evaluations of the objective.
    pub evaluations: usize,
    /// Candidates that search steps judged in closed form.
    pub screened: usize,
    /// Time taken.
    pub wall_time: Duration,
    /// Why the search ended.
    pub stop: StopReason,
    /// The refinement, where one was made.
    pub refinement: Option<Refinement>,
    /// Largest pole magnitude of the recursion without blowing.
    pub pole_off: f64,
    /// Largest pole magnitude of the recursion under steady blowing.
    pub pole_on: f64,
}

/// Why an identification could not be made.
#[derive(Debug, Clone, Error, PartialEq)]
#[non_exhaustive]
pub enum IdentifyError {
    /// Nothing to fit.
    #[error(
        "the data set has no record with use \"identify\". Mark at least one record so in dataset.toml."
    )]
    NoRecords,
    /// A structure that makes no sense.
    #[error("{what}. {remedy}")]
    Structure {
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// A record shorter than the lags.
    #[error(
        "record `{record}` has {samples} samples, too few for lags up to {longest}. \
         Give a smaller --max-lag or a longer record."
    )]
    TooShort {
        /// The record.
        record: String,
        /// Its samples.
        samples: usize,
        /// Longest lag asked for.
        longest: usize,
    },
    /// Fewer rows than coefficients.
    #[error(
        "the records give {rows} equations for {coefficients} coefficients. \
         Give longer records, or fewer lags with --n1 and --n2."
    )]
    TooFewSamples {
        /// Equations.
        rows: usize,
        /// Coefficients.
        coefficients: usize,
    },
    /// A signal of unequal length or with a value that is no number.
    #[error(
        "record `{record}`: signal `{signal}` has the wrong length or a value that is not finite. Clean the CSV file."
    )]
    BadSignal {
        /// The record.
        record: String,
        /// `u` or `y`.
        signal: &'static str,
    },
    /// The input never changes.
    #[error(
        "the command u never changes in the identify records, so no input delay can be found. \
         Add a record with switching, or use --n3 0."
    )]
    ConstantInput,
    /// No candidate had a bounded free run.
    #[error(
        "every candidate model diverges in free run ({stop}). \
         Use fewer lags, or --objective one-step and a refinement."
    )]
    NoStableModel {
        /// How the search ended.
        stop: StopReason,
    },
    /// The search was stopped before its first result.
    #[error("{stop}, before there was any result. Run again with more evaluations.")]
    NoResult {
        /// How the search ended.
        stop: StopReason,
    },
    /// The final least squares failed.
    #[error(transparent)]
    NotConverged(#[from] linalg::NotConverged),
}

/// Fruitless kicks of a free-run search per unit of patience, and kicks in all.
const FREE_KICKS: (usize, usize) = (8, 12);

/// Identifies a model from the identify records of `data`; validate records only
/// judge the refinement.
///
/// # Errors
/// [`IdentifyError`] names what is wrong with the data or the structure and the remedy.
pub fn identify(
    data: &[Record],
    options: &IdentifyOptions,
    progress: &dyn Progress,
    interrupt: &AtomicBool,
) -> Result<Identified, IdentifyError> {
    let started = Instant::now();
    let records: Vec<&Record> = data.iter().filter(|r| r.role == Use::Identify).collect();
    check(&records, &options.structure)?;
    let series: Vec<Series<'_>> = records
        .iter()
        .map(|r| Series { u: &r.u, y: &r.y })
        .collect();
    let regression = Regression::new(&series, &options.structure);
    let (regression, report) = search(regression, options, progress, interrupt);
    let Some(best) = report.best else {
        return Err(IdentifyError::NoResult { stop: report.stop });
    };
    if options.objective == Objective::FreeRun && best.value >= 0.5 * DIVERGED_VALUE {
        return Err(IdentifyError::NoStableModel { stop: report.stop });
    }
    let delays = regression.layout.delays(&best.point);
    let (solution, one_step_norm) = regression.exact(&delays)?;
    let mut model = model(&delays, &solution, &records, options, best.value);
    let objective_value = match options.objective {
        Objective::OneStep => one_step_norm,
        Objective::FreeRun => best.value,
    };
    model.training.objective_value = objective_value;
    let refinement = match options.objective {
        Objective::FreeRun if options.refine => refine(&mut model, data),
        _ => None,
    };
    let (pole_off, pole_on) = (pole(&model, false)?, pole(&model, true)?);
    Ok(Identified {
        model,
        objective: options.objective,
        objective_value,
        one_step_norm,
        evaluations: report.evaluations,
        screened: report.screened,
        wall_time: started.elapsed(),
        stop: report.stop,
        refinement,
        pole_off,
        pole_on,
    })
}

fn check(records: &[&Record], structure: &Structure) -> Result<(), IdentifyError> {
    let refuse = |what: String, remedy: &str| {
        Err(IdentifyError::Structure {
            what,
            remedy: remedy.to_owned(),
        })
    };
    if records.is_empty() {
        return Err(IdentifyError::NoRecords);
    }
    let longest = usize::from(structure.longest_lag);
    if structure.state_lags == 0 || longest == 0 {
        return refuse(
            "a model needs at least one state lag".to_owned(),
            "Give --n1 and --max-lag of 1 or more.",
        );
    }
    if structure.state_lags.max(structure.product_lags) > longest {
        return refuse(
            format!(
                "{} lags do not fit into 1 … {longest}",
                structure.state_lags.max(structure.product_lags)
            ),
            "Give a larger --max-lag, or fewer lags with --n1 and --n2.",
        );
    }
    if let Some(given) = structure.given_ticks()
        && given.len() != structure.inputs
    {
        return refuse(
            format!(
                "{} input delays are given for {} inputs",
                given.len(),
                structure.inputs
            ),
            "Give one delay or factor per input, or --n3 with their number.",
        );
    }
    if let InputDelay::StateDependent { law, .. } = &structure.delay
        && !(law.floor.is_finite()
            && law.rise.is_finite()
            && law.rate.is_finite()
            && law.floor >= 0.0)
    {
        return refuse(
            "the delay law has a negative or non-finite parameter".to_owned(),
            "Give --delay-law P0,P1,P2 with P0 ≥ 0.",
        );
    }
    for record in records {
        for (signal, values) in [("u", &record.u), ("y", &record.y)] {
            if values.len() != record.y.len() || values.iter().any(|v| !v.is_finite()) {
                return Err(IdentifyError::BadSignal {
                    record: record.name.clone(),
                    signal,
                });
            }
        }
        if record.y.len() <= longest + 1 + structure.skipped() {
            return Err(IdentifyError::TooShort {
                record: record.name.clone(),
                samples: record.y.len(),
                longest,
            });
        }
    }
    let rows: usize = records
        .iter()
        .map(|r| r.y.len() - 1 - structure.skipped())
        .sum();
    let coefficients = structure.state_lags + structure.inputs * (1 + structure.product_lags);
    if rows <= coefficients {
        return Err(IdentifyError::TooFewSamples { rows, coefficients });
    }
    let constant = |r: &&Record| r.u.iter().all(|u| Some(u) == r.u.first());
    let same = records.iter().all(|r| r.u.first() == records[0].u.first());
    // From rest, a command that is on from the start is a step.
    let rises = structure.skipped() == 0
        && records
            .iter()
            .any(|r| r.u.first().is_some_and(|u| *u != 0.0));
    if structure.inputs > 0 && same && !rises && records.iter().all(constant) {
        return Err(IdentifyError::ConstantInput);
    }
    Ok(())
}

/// Runs the search that the options ask for.
fn search(
    regression: Regression,
    options: &IdentifyOptions,
    progress: &dyn Progress,
    interrupt: &AtomicBool,
) -> (Regression, Report) {
    let mut rng = ChaCha8Rng::seed_from_u64(options.search.seed);
    let mut draw = || -> Point {
        regression
            .layout
            .variables
            .iter()
            .map(|v| rng.random_range(v.lower..=v.upper.max(v.lower)))
            .collect()
    };
    let starts: Vec<Point> = vec![draw()];
    let mut one_step = OneStep { regression };
    let kicks = match options.objective {
        Objective::OneStep => 6 * options.patience,
        // Only a starting point is needed.
        Objective::FreeRun => options.patience,
    };
    let mut steps: Vec<Box<dyn SearchStep<OneStep>>> = vec![
        Box::new(ExchangeStep::default()),
        Box::new(Speculative::default()),
        Box::new(PairStep::default()),
        Box::new(KickStep::new(kicks)),
    ];
    let report = minimise(
        &mut one_step,
        &starts,
        &mut steps,
        &options.search,
        progress,
        interrupt,
    );
    if options.objective == Objective::OneStep {
        return (one_step.regression, report);
    }
    let starts: Vec<Point> = report
        .best
        .iter()
        .map(|b| b.point.clone())
        .chain(starts)
        .collect();
    let regression = one_step.regression;
    let runner = FreeRunner::new(&regression.signals, &options.structure);
    let mut free_run = FreeRun { regression, runner };
    let mut steps: Vec<Box<dyn SearchStep<FreeRun>>> = vec![
        Box::new(PredictedStep::default()),
        Box::new(InputStep::default()),
        Box::new(Speculative::default()),
        Box::new(FreeKickStep::new(
            FREE_KICKS.0 * options.patience,
            FREE_KICKS.1 * options.patience,
        )),
    ];
    let mut free = minimise(
        &mut free_run,
        &starts,
        &mut steps,
        &options.search,
        progress,
        interrupt,
    );
    free.evaluations += report.evaluations;
    free.screened += report.screened;
    (free_run.regression, free)
}

fn model(
    delays: &Delays,
    solution: &[f64],
    records: &[&Record],
    options: &IdentifyOptions,
    objective_value: f64,
) -> Model {
    let structure = &options.structure;
    let Coefficients { a, b, c, constant } = Coefficients::new(solution, delays);
    let ys = || records.iter().flat_map(|r| r.y.iter().copied());
    Model {
        sample_period_s: records.first().map_or(0.001, |r| r.sample_period_s),
        convention: structure.convention,
        averaging: Averaging {
            window: WINDOW,
            averaged_model: structure.averaged,
        },
        start: structure.start,
        grading: Grading::Proportional,
        constant,
        state_lags: delays.state.clone(),
        a,
        product_lags: delays.product.clone(),
        b,
        c,
        delay: match &structure.delay {
            InputDelay::Fixed { .. } => Delay::Fixed {
                delays: delays
                    .ticks
                    .iter()
                    .map(|h| u16::try_from(*h).unwrap_or(u16::MAX))
                    .collect(),
            },
            InputDelay::StateDependent { law, .. } => Delay::StateDependent {
                delay_floor: law.floor,
                delay_rise: law.rise,
                delay_rate: law.rate,
                factors: delays.ticks.iter().map(|f| factor(*f)).collect(),
                interpolated: false,
            },
        },
        effects: Vec::new(),
        definitions: Vec::new(),
        training: Training {
            y_range: [
                ys().fold(f64::INFINITY, f64::min),
                ys().fold(f64::NEG_INFINITY, f64::max),
            ],
            seed: options.search.seed,
            objective: options.objective.name().to_owned(),
            objective_value,
            ..Training::default()
        },
        law: None,
    }
}

/// Refines the coefficients on the identify records; keeps them in `model` if
/// the held-out ε falls. `None` if the free run cannot be judged.
fn refine(model: &mut Model, data: &[Record]) -> Option<Refinement> {
    // The model of averaged signals runs on averaged records, which `fit` does not see.
    if model.averaging.averaged_model {
        return None;
    }
    let (identify, validate): (Vec<&Record>, Vec<&Record>) =
        data.iter().partition(|r| r.role == Use::Identify);
    let options = FitOptions {
        constant: model.constant != 0.0,
        ..FitOptions::default()
    };
    let refined = fit(model, &identify, &options).ok()?.model;
    let before = epsilon(model, &identify)?;
    let after = epsilon(&refined, &identify)?;
    let held_out = match validate.is_empty() {
        true => None,
        // A model that diverges on held-out records is no improvement.
        false => Some((
            epsilon(model, &validate).unwrap_or(f64::INFINITY),
            epsilon(&refined, &validate).unwrap_or(f64::INFINITY),
        )),
    };
    let (from, to) = held_out.unwrap_or((before, after));
    let kept = to < from;
    if kept {
        *model = refined;
    }
    Some(Refinement {
        identify: (before, after),
        validate: held_out,
        kept,
    })
}

/// ε over records, eq. (9); `None` if a run diverges.
fn epsilon(model: &Model, records: &[&Record]) -> Option<f64> {
    let warm_up = model.warm_up();
    let mut sum = 0.0;
    for record in records {
        let simulated = model.free_run(record).ok()?;
        sum += record
            .y
            .iter()
            .zip(simulated)
            .skip(warm_up)
            .map(|(y, s)| (y - s).powi(2))
            .sum::<f64>();
    }
    Some(sum.sqrt())
}

/// Largest pole magnitude with all inputs off or all on.
fn pole(model: &Model, on: bool) -> Result<f64, linalg::NotConverged> {
    let mut weights = vec![0.0; model.longest_lag() + 1];
    let mut add = |lag: &u16, weight: &f64| {
        if let Some(place) = weights.get_mut(model.convention.behind_newest(*lag)) {
            *place += weight;
        }
    };
    model
        .state_lags
        .iter()
        .zip(&model.a)
        .for_each(|(lag, a)| add(lag, a));
    if on {
        model
            .product_lags
            .iter()
            .cycle()
            .zip(&model.c)
            .for_each(|(lag, c)| add(lag, c));
    }
    Ok(linalg::pole_magnitudes(&weights)?
        .first()
        .copied()
        .unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::{PollKind, Snapshot};
    use model_core::recursion::LagConvention;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A first-order flow with a product term, from the recursion written out here.
    fn record(name: &str, role: Use, period: usize, seed: u32) -> Record {
        let n = 2500;
        let u: Vec<f64> = (0..n)
            .map(|k| f64::from(u8::from((k / period) % 2 == 1 && k < 2200)))
            .collect();
        let mut y = vec![0.0f64; n];
        let mut noise = seed;
        for k in 0..n - 1 {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let w = f64::from(noise >> 8) / f64::from(1 << 24) - 0.5;
            let past = |lag: usize| if lag <= k { y[k - lag] } else { 0.0 };
            let on = if k >= 23 { u[k - 23] } else { 0.0 };
            y[k + 1] = 0.9 * past(0) + 0.07 * past(30) + on * (0.05 - 0.02 * past(12)) + 0.004 * w;
        }
        Record::new(name, role, 0.001, u, y)
    }

    fn data() -> Vec<Record> {
        vec![
            record("a", Use::Identify, 150, 1),
            record("b", Use::Identify, 210, 2),
            record("c", Use::Validate, 100, 3),
        ]
    }

    fn options(objective: Objective, delay: InputDelay) -> IdentifyOptions {
        IdentifyOptions {
            structure: Structure {
                state_lags: 2,
                product_lags: 1,
                longest_lag: 40,
                delay,
                ..Structure::default()
            },
            objective,
            patience: 2,
            ..IdentifyOptions::default()
        }
    }

    fn run(data: &[Record], options: &IdentifyOptions) -> Result<Identified, IdentifyError> {
        identify(data, options, &(), &AtomicBool::new(false))
    }

    #[test]
    fn the_delays_of_the_truth_are_found_by_one_step_errors() {
        for seed in 0..4 {
            let mut options = options(Objective::OneStep, InputDelay::Fixed { delays: None });
            options.search.seed = seed;
            let found = run(&data(), &options).expect("identifies");
            assert_eq!(found.model.state_lags, [1, 31], "seed {seed}");
            assert_eq!(found.model.product_lags, [13]);
            assert_eq!(found.model.delay, Delay::Fixed { delays: vec![23] });
            assert!(
                (found.model.b[0] - 0.05).abs() < 0.01 && (found.model.a[0] - 0.9).abs() < 0.02
            );
            assert_eq!(found.stop, StopReason::LocallyOptimal);
            assert!(found.pole_off < 1.0 && found.pole_on < 1.0);
        }
    }

    /// The reported norm is that of the definition, for both lag conventions.
    #[test]
    fn the_reported_norms_follow_from_the_model_alone() {
        for (convention, shift) in [(LagConvention::OneStep, 1), (LagConvention::Literal, 0)] {
            let mut options = options(Objective::OneStep, InputDelay::Fixed { delays: None });
            options.structure.convention = convention;
            let found = run(&data(), &options).expect("identifies");
            let Model {
                a,
                b,
                c,
                state_lags,
                product_lags,
                delay,
                ..
            } = &found.model;
            let Delay::Fixed { delays } = delay else {
                panic!("asked for fixed")
            };
            let h = usize::from(delays[0]);
            let mut sum = 0.0;
            for record in data().iter().take(2) {
                for k in 0..record.y.len() - 1 {
                    let past = |lag: u16| {
                        (k + shift)
                            .checked_sub(lag.into())
                            .map_or(0.0, |i| record.y[i])
                    };
                    let on = k.checked_sub(h).map_or(0.0, |i| record.u[i]);
                    let mut next: f64 = a
                        .iter()
                        .zip(state_lags)
                        .map(|(a, lag)| a * past(*lag))
                        .sum();
                    next += on
                        * (b[0]
                            + c.iter()
                                .zip(product_lags)
                                .map(|(c, lag)| c * past(*lag))
                                .sum::<f64>());
                    sum += (record.y[k + 1] - next).powi(2);
                }
            }
            assert!((found.one_step_norm - sum.sqrt()).abs() < 1e-9);
            assert!((found.objective_value - sum.sqrt()).abs() < 1e-9);
        }
    }

    /// ε inside the search is that of the model's own free run.
    #[test]
    fn the_search_simulates_what_the_model_simulates() {
        let law = super::super::DelayLaw {
            floor: 15.0,
            rise: 12.0,
            rate: 4.0,
        };
        for delay in [
            InputDelay::Fixed { delays: None },
            InputDelay::StateDependent { law, factors: None },
        ] {
            let mut options = options(Objective::FreeRun, delay);
            options.refine = false;
            let found = run(&data(), &options).expect("identifies");
            let data = data();
            let identify: Vec<&Record> = data.iter().take(2).collect();
            let epsilon = epsilon(&found.model, &identify).expect("stable");
            let relative = (epsilon - found.objective_value).abs() / epsilon;
            assert!(relative < 1e-6, "{epsilon} {}", found.objective_value);
        }
    }

    #[test]
    fn refinement_lowers_the_free_run_error_and_is_judged_held_out() {
        let found = run(
            &data(),
            &options(Objective::FreeRun, InputDelay::Fixed { delays: None }),
        )
        .expect("identifies");
        let refinement = found.refinement.expect("was asked for");
        assert!(refinement.identify.1 <= refinement.identify.0);
        let (before, after) = refinement.validate.expect("there is a validate record");
        assert_eq!(refinement.kept, after < before);
    }

    #[test]
    fn averaged_models_and_several_inputs_are_identified() {
        let mut options = options(Objective::OneStep, InputDelay::Fixed { delays: None });
        options.structure.averaged = true;
        options.structure.inputs = 2;
        options.structure.state_lags = 2;
        options.patience = 1;
        let found = run(&data(), &options).expect("identifies");
        assert!(found.model.averaging.averaged_model);
        assert_eq!((found.model.b.len(), found.model.c.len()), (2, 2));
        assert!(found.one_step_norm.is_finite());
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_with_any_number_of_threads() {
        let bits = |threads: usize, poll: PollKind| {
            let mut options = options(Objective::FreeRun, InputDelay::Fixed { delays: None });
            options.search = Settings {
                seed: 5,
                threads,
                poll,
                ..Settings::default()
            };
            let found = run(&data(), &options).expect("identifies");
            (
                found.objective_value.to_bits(),
                found.evaluations,
                found.model.state_lags.clone(),
                found.model.a[0].to_bits(),
            )
        };
        assert_eq!(bits(1, PollKind::Ortho2N), bits(2, PollKind::Ortho2N));
    }

    #[test]
    fn an_interrupt_returns_the_best_so_far() {
        struct StopAfter<'a>(&'a AtomicBool, AtomicUsize);
        impl Progress for StopAfter<'_> {
            fn report(&self, snapshot: &Snapshot) {
                self.1.store(snapshot.evaluations, Ordering::Relaxed);
                self.0.store(snapshot.evaluations > 3, Ordering::Relaxed);
            }
        }
        let flag = AtomicBool::new(false);
        let watch = StopAfter(&flag, AtomicUsize::new(0));
        let options = options(Objective::OneStep, InputDelay::Fixed { delays: None });
        let found = identify(&data(), &options, &watch, &flag).expect("the best so far");
        assert_eq!(found.stop, StopReason::Interrupted);
        assert!(watch.1.load(Ordering::Relaxed) < 40);
    }

    #[test]
    fn bad_requests_are_refused_with_a_remedy() {
        let fixed = || options(Objective::OneStep, InputDelay::Fixed { delays: None });
        assert_eq!(run(&[], &fixed()).err(), Some(IdentifyError::NoRecords));
        let mut flat = data();
        flat.iter_mut().for_each(|r| r.u.fill(0.0));
        assert_eq!(
            run(&flat, &fixed()).err(),
            Some(IdentifyError::ConstantInput)
        );
        let mut short = data();
        short[0].u.truncate(30);
        short[0].y.truncate(30);
        assert!(matches!(
            run(&short, &fixed()),
            Err(IdentifyError::TooShort { .. })
        ));
        let mut bad = data();
        bad[1].y[7] = f64::NAN;
        assert!(matches!(
            run(&bad, &fixed()),
            Err(IdentifyError::BadSignal { signal: "y", .. })
        ));
        let mut none = fixed();
        none.structure.state_lags = 0;
        assert!(matches!(
            run(&data(), &none),
            Err(IdentifyError::Structure { .. })
        ));
        let given = options(
            Objective::OneStep,
            InputDelay::Fixed {
                delays: Some(vec![1, 2]),
            },
        );
        assert!(matches!(
            run(&data(), &given),
            Err(IdentifyError::Structure { .. })
        ));
    }
}
