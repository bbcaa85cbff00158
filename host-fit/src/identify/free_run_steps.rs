//! Search steps for the free-run objective.

use rand::RngExt;

use super::exchange::{Exchange, List, Slot, set};
use super::free_run::FreeRun;
use super::layout::Delays;
use super::linearised::Linearised;
use super::rules::RULES;
use crate::order;
use crate::search::{Around, Evaluator, Point, SearchStep, StopReason, Success};

/// Steps tried around the best of the predicted lags.
const AROUND: [i32; 6] = [-1, 1, -2, 2, -4, 4];

/// Search step: exchanges lags for those with the lowest error predicted by the linearised free
/// run.
pub(crate) fn exchange_predicted(
    evaluator: &mut Evaluator<'_, FreeRun>,
    around: &Around<'_>,
    screened: &mut usize,
) -> Result<(Point, Option<Success>), StopReason> {
    let best = descend(evaluator, incumbent(around), screened, |_, _| false)?;
    Ok(settled(best, around))
}

/// Search step: moves the input delays step by step.
pub(crate) fn move_inputs(
    evaluator: &mut Evaluator<'_, FreeRun>,
    around: &Around<'_>,
    _: &mut usize,
) -> Result<(Point, Option<Success>), StopReason> {
    Ok(settled(walk_inputs(evaluator, incumbent(around))?, around))
}

fn incumbent(around: &Around<'_>) -> Success {
    Success {
        point: around.point.to_vec(),
        value: around.value,
    }
}

fn settled(best: Success, around: &Around<'_>) -> (Point, Option<Success>) {
    let better = best.value < around.value;
    (best.point.clone(), better.then_some(best))
}

/// Sweeps over all slots until the gain of a sweep is small or `hopeless` returns true.
fn descend(
    evaluator: &mut Evaluator<'_, FreeRun>,
    mut best: Success,
    screened: &mut usize,
    hopeless: impl Fn(usize, f64) -> bool,
) -> Result<Success, StopReason> {
    for sweep in 1.. {
        let before = best.value;
        let delays = evaluator.problem().regression.layout.delays(&best.point);
        evaluator.problem_mut().regression.tabulate(&delays.ticks);
        let Some(mut linearised) = evaluator.problem().linearise(&delays) else {
            return Ok(best);
        };
        let slots = Exchange::new(&evaluator.problem().regression, &delays.ticks).slots(&delays);
        for slot in slots {
            let delays = evaluator.problem().regression.layout.delays(&best.point);
            let minima = predicted_minima(
                evaluator.problem(),
                &mut linearised,
                &delays,
                slot,
                best.value * RULES.promising,
            );
            *screened += usize::from(evaluator.problem().regression.layout.longest_lag);
            let trials: Vec<Point> = minima
                .iter()
                .map(|lag| with_lag(evaluator.problem(), &delays, slot, *lag))
                .collect();
            let found = best_of(evaluator, &trials, &mut best)?;
            // The search continues from the best lag of the slot, whether it is new or not.
            let mut lag = match found {
                Some(at) => minima[at],
                None => lag_in(&delays, slot),
            };
            loop {
                let near: Vec<u16> = AROUND
                    .iter()
                    .map(|d| i32::from(lag) + d)
                    .filter(|l| {
                        *l >= 1
                            && *l <= i32::from(evaluator.problem().regression.layout.longest_lag)
                    })
                    .map(|l| l as u16)
                    .collect();
                let trials: Vec<Point> = near
                    .iter()
                    .map(|lag| with_lag(evaluator.problem(), &delays, slot, *lag))
                    .collect();
                match best_of(evaluator, &trials, &mut best)? {
                    Some(at) => lag = near[at],
                    None => break,
                }
            }
        }
        if best.value >= before * (1.0 - RULES.small_gain) || hopeless(sweep, best.value) {
            break;
        }
    }
    Ok(best)
}

/// Evaluates all points; returns the best one if it is better than the incumbent.
fn best_of(
    evaluator: &mut Evaluator<'_, FreeRun>,
    points: &[Point],
    best: &mut Success,
) -> Result<Option<usize>, StopReason> {
    let mut found = None;
    let mut from = 0;
    while let Some(better) =
        evaluator.first_better(points.get(from..).unwrap_or_default(), best.value)?
    {
        let at = points
            .iter()
            .skip(from)
            .position(|p| *p == better.point)
            .map_or(points.len(), |i| from + i);
        found = Some(at);
        from = at + 1;
        *best = better;
    }
    Ok(found)
}

fn with_lag(problem: &FreeRun, delays: &Delays, slot: Slot, lag: u16) -> Point {
    let mut trial = delays.clone();
    set(&mut trial, slot, lag);
    problem.regression.layout.point(&trial)
}

fn lag_in(delays: &Delays, slot: Slot) -> u16 {
    let list = match slot.list {
        List::State => &delays.state,
        List::Product => &delays.product,
    };
    list.get(slot.index).copied().unwrap_or(1)
}

/// The deepest local minima of the predicted ε over the lag of a slot, if they are below a
/// threshold.
fn predicted_minima(
    problem: &FreeRun,
    linearised: &mut Linearised,
    delays: &Delays,
    slot: Slot,
    below: f64,
) -> Vec<u16> {
    let layout = &problem.regression.layout;
    linearised.include(layout, delays);
    let mut trial = delays.clone();
    let predicted: Vec<f64> = (1..=layout.longest_lag)
        .map(|lag| {
            set(&mut trial, slot, lag);
            linearised.predict(&problem.regression, &trial)
        })
        .collect();
    let at = |i: usize| predicted.get(i).copied().unwrap_or(f64::INFINITY);
    // Even and odd lags can form two curves, so the second neighbours are compared too.
    let mut minima: Vec<(f64, u16)> = (0..predicted.len())
        .filter(|&i| {
            at(i) < below * below
                && [i.wrapping_sub(1), i + 1, i.wrapping_sub(2), i + 2]
                    .iter()
                    .all(|j| at(i) <= at(*j))
        })
        .map(|i| (at(i), i as u16 + 1))
        .collect();
    order::ascending(&mut minima, |one| one.0);
    minima
        .into_iter()
        .take(RULES.minima)
        .map(|(_, lag)| lag)
        .collect()
}

/// Moves the input delays step by step while that lowers ε, with everything else unchanged.
fn walk_inputs(
    evaluator: &mut Evaluator<'_, FreeRun>,
    mut best: Success,
) -> Result<Success, StopReason> {
    let layout = &evaluator.problem().regression.layout;
    let bounds = layout.input_bounds();
    let first = layout.variables.len() - bounds.len();
    let per_sample = evaluator.problem().regression.signals.ticks_per_sample();
    let mut moved = true;
    while moved && !bounds.is_empty() {
        let mut trials: Vec<Point> = Vec::new();
        for (input, (low, high)) in bounds.iter().enumerate() {
            for shift in RULES.input_moves.iter().flat_map(|m| [-m, *m]) {
                let mut trial = best.point.clone();
                let ticks = (shift * per_sample).round() as i64;
                trial[first + input] = (trial[first + input] + ticks).clamp(*low, *high);
                trials.push(trial);
            }
        }
        moved = best_of(evaluator, &trials, &mut best)?.is_some();
    }
    Ok(best)
}

/// Search step: a variable neighbourhood search with informed perturbations (kicks). A few lags of a local optimum
/// move to other minima of the prediction, which mostly avoids diverging models, and a descent follows. Ends after
/// `patience` kicks without improvement or `most` kicks in all.
pub(crate) struct FreeKickStep {
    patience: usize,
    most: usize,
    fruitless: usize,
    kicks: usize,
    screened: usize,
    /// The linearisation at the incumbent, reused for all kicks.
    linearised: Option<(Point, Linearised)>,
}

impl FreeKickStep {
    pub(crate) fn new(patience: usize, most: usize) -> Self {
        Self {
            patience,
            most,
            fruitless: 0,
            kicks: 0,
            screened: 0,
            linearised: None,
        }
    }

    /// A point that differs from the incumbent in some lags.
    fn kick(
        &mut self,
        evaluator: &mut Evaluator<'_, FreeRun>,
        around: &mut Around<'_>,
    ) -> Option<Point> {
        let layout = &evaluator.problem().regression.layout;
        let mut delays = layout.delays(around.point);
        if self
            .linearised
            .as_ref()
            .is_none_or(|(at, _)| at != around.point)
        {
            evaluator.problem_mut().regression.tabulate(&delays.ticks);
            let linearised = evaluator.problem().linearise(&delays)?;
            self.linearised = Some((around.point.to_vec(), linearised));
        }
        let (_, linearised) = self.linearised.as_mut()?;
        let problem = evaluator.problem();
        let slots = Exchange::new(&problem.regression, &delays.ticks).slots(&delays);
        for _ in 0..RULES.kicked_lags.min(slots.len()) {
            let slot = slots[around.rng.random_range(0..slots.len())];
            let now = lag_in(&delays, slot);
            let mut others = predicted_minima(problem, linearised, &delays, slot, f64::INFINITY);
            self.screened += usize::from(problem.regression.layout.longest_lag);
            others.retain(|lag| lag.abs_diff(now) > RULES.kick_distance);
            if !others.is_empty() {
                let lag = others[around.rng.random_range(0..others.len())];
                set(&mut delays, slot, lag);
            }
        }
        // Without on/off edges every new input delay costs new tables.
        if problem.regression.is_binary() && around.rng.random_bool(RULES.kicked_inputs) {
            let per_sample = problem.regression.signals.ticks_per_sample();
            let bounds = problem.regression.layout.input_bounds();
            for (tick, (low, high)) in delays.ticks.iter_mut().zip(bounds) {
                let reach = RULES.free_kick_reach;
                let shift = around.rng.random_range(-reach..reach);
                *tick = (*tick + (shift * per_sample).round() as i64).clamp(low, high);
            }
        }
        Some(problem.regression.layout.point(&delays))
    }
}

impl SearchStep<FreeRun> for FreeKickStep {
    fn search(
        &mut self,
        evaluator: &mut Evaluator<'_, FreeRun>,
        around: &mut Around<'_>,
    ) -> Result<Option<Success>, StopReason> {
        if !around.locally_optimal || SearchStep::<FreeRun>::has_given_up(self) {
            return Ok(None);
        }
        self.kicks += 1;
        self.fruitless += 1;
        let Some(point) = self.kick(evaluator, around) else {
            return Ok(None);
        };
        let value = evaluator.value(&point)?;
        if value >= 0.5 * evaluator.problem().runner.diverged {
            return Ok(None);
        }
        let start = Success { point, value };
        let hopeless = |sweep: usize, value: f64| {
            value > around.value * (1.0 + RULES.falling_behind / sweep as f64)
        };
        let mut end = descend(evaluator, start, &mut self.screened, hopeless)?;
        if end.value < RULES.close * around.value {
            end = walk_inputs(evaluator, end)?;
        }
        if end.value < around.value {
            self.fruitless = 0;
            return Ok(Some(end));
        }
        Ok(None)
    }

    fn has_given_up(&self) -> bool {
        self.fruitless >= self.patience || self.kicks >= self.most
    }

    fn screened(&self) -> usize {
        self.screened
    }
}
