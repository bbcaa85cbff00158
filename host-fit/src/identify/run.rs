//! One identification, from records to a model.

use model_core::effects::StateDependentDelay;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use model_core::model::Averaging;

use super::arrival::factor;
use super::coefficients::Coefficients;
use super::delay_search::search;
use super::error::{IdentifyError, check};
use super::free_runner::diverged_value;
use super::layout::Delays;
use super::options::{IdentifyOptions, Objective};
use super::refinement::{Refinement, refine};
use super::regression::{Regression, fits_in_memory};
use super::structure::{InputDelay, Series};
use crate::data::{Record, Use};
use crate::model::{Delay, Model, Training};
use crate::search::{Point, Progress, Snapshot, StopReason};
use model_core::average::WINDOW;

/// Result of an identification.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The model, with sorted lags and without repeated ones. Its training record has objective and seed; the
    /// caller adds the rest.
    pub model: Model,
    /// Objective that was minimised.
    pub objective: Objective,
    /// Value of the objective with least-squares coefficients.
    pub objective_value: f64,
    /// √Σ(y_{k+1} − prediction)² of the least-squares model over the identify
    /// records, summed directly from the samples.
    pub one_step_norm: f64,
    /// Evaluations of the objective.
    pub evaluations: usize,
    /// Candidates that search steps evaluated in closed form.
    pub screened: usize,
    /// Time taken.
    pub wall_time: Duration,
    /// Why the search ended.
    pub stop: StopReason,
    /// The refinement; `None` without refinement.
    pub refinement: Option<Refinement>,
    /// Largest pole magnitude of the recursion without blowing.
    pub pole_off: f64,
    /// Largest pole magnitude of the recursion under steady blowing.
    pub pole_on: f64,
}

/// Observer of an identification: progress of the search, and the model behind it.
pub trait Watcher: Progress {
    /// Receives the best model so far after each report. The model is built only when the closure is called,
    /// in the time of the search.
    fn model(&self, _best: &dyn Fn() -> Option<Model>) {}
}

/// No observer.
impl Watcher for () {}

/// Converts the best point of a search to a model.
struct Shown<'a> {
    to: &'a dyn Watcher,
    series: &'a [Series<'a>],
    records: &'a [&'a Record],
    options: &'a IdentifyOptions,
    /// A separate regression, since the search owns the other; built at first use.
    regression: OnceLock<Regression>,
}

impl Progress for Shown<'_> {
    fn report(&self, snapshot: &Snapshot) {
        self.to.report(snapshot);
    }

    fn best(&self, point: &Point) {
        self.to.model(&|| {
            let make = || Regression::new(self.series, &self.options.structure);
            let regression = self.regression.get_or_init(make);
            let delays = regression.layout.delays(point);
            let (solution, squares) = regression.normal(&delays).solve();
            let norm = squares.sqrt();
            Some(model(&delays, &solution, self.records, self.options, norm))
        });
    }
}

/// Identifies a model from the identify records of `data`; validate records only
/// judge the refinement.
///
/// # Errors
/// [`IdentifyError`] names the problem of the data or the structure, and the remedy.
pub fn identify(
    data: &[Record],
    options: &IdentifyOptions,
    watcher: &dyn Watcher,
    interrupt: &AtomicBool,
) -> Result<Identified, IdentifyError> {
    let started = Instant::now();
    let records: Vec<&Record> = data.iter().filter(|r| r.role == Use::Identify).collect();
    check(&records, &options.structure)?;
    fits_in_memory(&options.structure)?;
    let series: Vec<Series<'_>> = records
        .iter()
        .map(|r| Series { u: &r.u, y: &r.y })
        .collect();
    let regression = Regression::new(&series, &options.structure);
    let shown = Shown {
        to: watcher,
        series: &series,
        records: &records,
        options,
        regression: OnceLock::new(),
    };
    let (regression, report) = search(regression, options, &shown, interrupt);
    let Some(best) = report.best else {
        return Err(IdentifyError::NoResult { stop: report.stop });
    };
    if options.objective == Objective::FreeRun
        && best.value >= 0.5 * diverged_value(&regression.signals)
    {
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
    let (pole_off, pole_on) = (model.largest_pole(false)?, model.largest_pole(true)?);
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
            InputDelay::StateDependent { law, .. } => Delay::of::<StateDependentDelay<f64>>(
                &[law.floor, law.rise, law.rate],
                delays.ticks.iter().map(|f| factor(*f)).collect(),
                false,
            ),
        },
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
        ..Model::default()
    }
}

#[cfg(test)]
mod tests {
    use super::super::refinement::epsilon;
    use super::super::structure::Structure;
    use super::*;
    use crate::search::{PollKind, Settings};
    use model_core::recursion::LagConvention;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A first-order flow with a product term, computed by its recursion.
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

    /// The reported norm equals its definition, for both lag conventions.
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

    /// ε inside the search equals that of the model's own free run.
    #[test]
    fn the_search_simulates_what_the_model_simulates() {
        let law = super::super::ExponentialDelay {
            floor: 15.0,
            rise: 12.0,
            rate: 4.0,
        };
        let law = InputDelay::StateDependent { law, factors: None };
        let fixed = InputDelay::Fixed { delays: None };
        for (delay, inputs, averaged) in [
            (fixed.clone(), 1, false),
            (fixed.clone(), 2, false),
            (fixed, 1, true),
            (law.clone(), 1, false),
            (law.clone(), 2, false),
            (law, 1, true),
        ] {
            let mut options = options(Objective::FreeRun, delay);
            options.refine = false;
            options.patience = 1;
            options.structure.inputs = inputs;
            options.structure.averaged = averaged;
            let found = run(&data(), &options).expect("identifies");
            let data = found.model.targets(&data());
            let identify: Vec<&Record> = data.iter().take(2).collect();
            let epsilon = epsilon(&found.model, &identify).expect("stable");
            let relative = (epsilon - found.objective_value).abs() / epsilon;
            assert!(
                relative < 1e-6,
                "{inputs} {averaged}: {epsilon} {}",
                found.objective_value
            );
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
        impl Watcher for StopAfter<'_> {}
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
