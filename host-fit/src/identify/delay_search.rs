//! Strategy of the delay search: its steps, their order, and the number of restarts.

use std::sync::atomic::AtomicBool;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::free_run::FreeRun;
use super::free_run_steps::{FreeKickStep, exchange_predicted, move_inputs};
use super::free_runner::FreeRunner;
use super::one_step::{KickStep, OneStep, exchange_pairs, exchange_singles};
use super::options::{IdentifyOptions, Objective};
use super::regression::Regression;
use super::rules::RULES;
use crate::search::{
    Evaluation, Point, Progress, SearchReport, SearchStep, Settle, Speculative, Success, minimise,
};

/// Runs the search that the options specify.
pub(crate) fn search(
    regression: Regression,
    options: &IdentifyOptions,
    progress: &dyn Progress,
    interrupt: &AtomicBool,
) -> (Regression, SearchReport) {
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
        Objective::OneStep => RULES.kicks * options.patience,
        // The free-run search needs only a starting point from this stage.
        Objective::FreeRun => options.patience,
    };
    let mut steps: Vec<Box<dyn SearchStep<OneStep>>> = vec![
        Box::new(Settle::new(exchange_singles)),
        Box::new(Speculative::default()),
        Box::new(Settle::new(exchange_pairs)),
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
        Box::new(Settle::new(exchange_predicted)),
        Box::new(Settle::new(move_inputs)),
        Box::new(Speculative::default()),
        Box::new(FreeKickStep::new(
            RULES.free_kicks * options.patience,
            RULES.most_free_kicks * options.patience,
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
    if free.best.is_none() {
        // After an interrupt in the first stage, the best point of that stage is the result.
        free.best = report.best.map(|best| {
            let delays = free_run.regression.layout.delays(&best.point);
            let value = match free_run.epsilon(&delays, f64::INFINITY) {
                Evaluation::Value(value) | Evaluation::AtLeast(value) => value,
            };
            Success { value, ..best }
        });
    }
    free.evaluations += report.evaluations;
    free.screened += report.screened;
    (free_run.regression, free)
}
