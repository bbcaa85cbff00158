//! The one-step objective as a function of the delays, with its search steps.

use std::sync::atomic::Ordering;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::exchange::{Exchange, best_input, set};
use super::layout::Delays;
use super::regression::Regression;
use super::rules::RULES;
use crate::search::{
    Around, Evaluation, Evaluator, Point, Problem, SearchStep, StopReason, Success, Variable,
};

/// Norm of the one-step prediction errors as a function of the delays.
pub(crate) struct OneStep {
    pub(crate) regression: Regression,
}

impl Problem for OneStep {
    fn variables(&self) -> &[Variable] {
        &self.regression.layout.variables
    }

    fn canonical(&self, point: &[i64]) -> Point {
        self.regression.layout.canonical(point)
    }

    fn groups(&self) -> Vec<Vec<usize>> {
        self.regression.layout.groups()
    }

    fn prepare(&mut self, points: &[&Point]) {
        for point in points {
            let delays = self.regression.layout.delays(point);
            self.regression.tabulate_near(&delays.ticks);
        }
    }

    fn evaluate(&self, point: &Point, _give_up_at: f64) -> Evaluation {
        let delays = self.regression.layout.delays(point);
        Evaluation::Value(self.regression.normal(&delays).squared_residual().sqrt())
    }
}

/// Moves a candidate to a point where no exchange of a single lag and no other delay of one input lowers the
/// one-step residual. Returns the squared norm.
///
/// `reach` limits the moves of input delays, in samples.
pub(crate) fn settle(
    regression: &mut Regression,
    delays: &mut Delays,
    reach: Option<f64>,
    screened: &mut usize,
) -> f64 {
    loop {
        let reach = reach.map_or(i64::MAX / 4, |r| {
            (r * regression.signals.ticks_per_sample()) as i64
        });
        let bounds = regression.layout.input_bounds();
        let inputs: Vec<(i64, i64)> = bounds
            .iter()
            .zip(&delays.ticks)
            .map(|((low, high), tick)| ((*low).max(tick - reach), (*high).min(tick + reach)))
            .collect();
        regression.tabulate(&delays.ticks);
        let mut exchange = Exchange::new(regression, &delays.ticks);
        let residual = exchange.descend(delays);
        *screened += exchange.screened();
        let mut moved = false;
        for (input, bounds) in inputs.iter().enumerate() {
            if let Some((tick, better)) = best_input(regression, delays, input, *bounds, screened)
                && better < residual * (1.0 - 1e-9)
                && !delays.ticks.contains(&tick)
            {
                delays.ticks[input] = tick;
                moved = true;
                break;
            }
        }
        if !moved {
            return residual;
        }
        delays.ticks.sort_unstable();
    }
}

/// Search step: exchanges single lags and input delays until none improves the fit.
pub(crate) fn exchange_singles(
    evaluator: &mut Evaluator<'_, OneStep>,
    around: &Around<'_>,
    screened: &mut usize,
) -> Result<(Point, Option<Success>), StopReason> {
    let regression = &mut evaluator.problem_mut().regression;
    let mut delays = regression.layout.delays(around.point);
    settle(regression, &mut delays, None, screened);
    let point = regression.layout.point(&delays);
    let success = evaluator.first_better(std::slice::from_ref(&point), around.value)?;
    Ok((point, success))
}

/// Search step: exchanges pairs of lags when single exchanges no longer improve the fit.
pub(crate) fn exchange_pairs(
    evaluator: &mut Evaluator<'_, OneStep>,
    around: &Around<'_>,
    screened: &mut usize,
) -> Result<(Point, Option<Success>), StopReason> {
    let interrupt = evaluator.interrupt();
    let regression = &mut evaluator.problem_mut().regression;
    let mut delays = regression.layout.delays(around.point);
    regression.tabulate(&delays.ticks);
    let mut exchange = Exchange::new(regression, &delays.ticks);
    exchange.descend_in_pairs(&mut delays, || !interrupt.load(Ordering::Relaxed));
    *screened += exchange.screened();
    let point = regression.layout.point(&delays);
    let success = evaluator.first_better(std::slice::from_ref(&point), around.value)?;
    Ok((point, success))
}

/// Search step: replaces a few lags of a local optimum at random and descends again. Ends after `patience` such
/// kicks without improvement.
pub(crate) struct KickStep {
    patience: usize,
    fruitless: usize,
    screened: usize,
}

impl KickStep {
    pub(crate) fn new(patience: usize) -> Self {
        Self {
            patience,
            fruitless: 0,
            screened: 0,
        }
    }
}

impl SearchStep<OneStep> for KickStep {
    fn search(
        &mut self,
        evaluator: &mut Evaluator<'_, OneStep>,
        around: &mut Around<'_>,
    ) -> Result<Option<Success>, StopReason> {
        if !around.locally_optimal || self.fruitless >= self.patience {
            return Ok(None);
        }
        self.fruitless += 1;
        if evaluator.is_interrupted() {
            return Err(StopReason::Interrupted);
        }
        let regression = &mut evaluator.problem_mut().regression;
        let mut delays = regression.layout.delays(around.point);
        let strength = 2 + self.fruitless % 5;
        kick(regression, &mut delays, strength, around.rng);
        settle(
            regression,
            &mut delays,
            Some(RULES.kick_reach),
            &mut self.screened,
        );
        let point = regression.layout.point(&delays);
        let success = evaluator.first_better(&[point], around.value)?;
        if success.is_some() {
            self.fruitless = 0;
        }
        Ok(success)
    }

    fn has_given_up(&self) -> bool {
        self.fruitless >= self.patience
    }

    fn screened(&self) -> usize {
        self.screened
    }
}

/// Replaces `strength` lags by random ones, and sometimes an input delay.
pub(crate) fn kick(
    regression: &Regression,
    delays: &mut Delays,
    strength: usize,
    rng: &mut ChaCha8Rng,
) {
    let slots = Exchange::new(regression, &delays.ticks).slots(delays);
    for _ in 0..strength.min(slots.len()) {
        let slot = slots[rng.random_range(0..slots.len())];
        set(
            delays,
            slot,
            rng.random_range(1..=regression.layout.longest_lag),
        );
    }
    for (input, (low, high)) in regression.layout.input_bounds().into_iter().enumerate() {
        // Without on/off edges every new input delay costs new tables.
        if regression.is_binary() && rng.random_bool(RULES.kicked_inputs) {
            delays.ticks[input] = rng.random_range(low..=high);
        }
    }
    *delays = regression.layout.delays(&regression.layout.point(delays));
}
