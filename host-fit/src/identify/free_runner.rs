//! Fast free runs of candidates: the inner loop of the free-run search.
//!
//! The recursion of `model-core`, in blocks of samples. Lags longer than the block read outputs known before it, so
//! their terms are added to all its samples at once; short lags are added sample by sample. If the delay decides
//! whether an edge has arrived, a block is run with the delay of its first sample, and again sample by sample if
//! the delay changes within it. The order of additions differs from `model-core`, so the last bits differ; this
//! does not affect a search.

use model_core::delay::DelayLaw as _;

use super::arrival::{CoreLaw, FitSignals, core_law, factor};
use super::coefficients::Coefficients;
use super::layout::Delays;
use super::rules::RULES;
use super::structure::{ExponentialDelay, InputDelay, Structure};
use model_core::average::WINDOW;

/// Samples computed together at most.
const BLOCK: usize = 32;

/// Result of a simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum RunOutcome {
    /// Σ (y − y_sim)² over all records.
    Squared(f64),
    /// The run was stopped when the sum reached this value.
    AtLeast(f64),
    /// The run diverged after this share of the samples.
    Diverged(f64),
}

/// A simulated candidate: output and arriving commands of each record.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trajectory {
    /// y_sim, as many values as samples.
    pub(crate) simulated: Vec<Vec<f64>>,
    /// d_k of each input.
    pub(crate) arrived: Vec<Vec<Vec<f64>>>,
}

/// Simulates candidates over the records.
#[derive(Debug)]
pub(crate) struct FreeRunner {
    structure: Structure,
    bound: f64,
    /// [`diverged_value`].
    pub(crate) diverged: f64,
    samples: usize,
}

/// Lags behind the newest output with their multipliers: the newest output itself, lags shorter than a block,
/// and lags known before a block begins.
struct Terms {
    newest: f64,
    near: Vec<(usize, f64)>,
    far: Vec<(usize, f64)>,
}

impl Terms {
    fn new(terms: impl Iterator<Item = (usize, f64)>) -> Self {
        let (short, far): (Vec<_>, Vec<_>) = terms.partition(|(behind, _)| behind + 1 < BLOCK);
        let (newest, near): (Vec<_>, Vec<_>) =
            short.into_iter().partition(|(behind, _)| *behind == 0);
        Self {
            newest: newest.iter().map(|(_, weight)| weight).sum(),
            near,
            far,
        }
    }

    /// Adds the terms of the long lags to `sums`, whose first element follows position `at`.
    #[inline(always)]
    fn add_far(&self, past: &[f64], at: usize, sums: &mut [f64; BLOCK]) {
        for &(behind, weight) in &self.far {
            if let Some(from) = past[at - behind..].first_chunk::<BLOCK>() {
                for (sum, y) in sums.iter_mut().zip(from) {
                    *sum += weight * y;
                }
            }
        }
    }

    /// The short lags' terms of the value that follows position `at`, without the newest.
    #[inline(always)]
    fn near(&self, outputs: &[f64], at: usize) -> f64 {
        self.near.iter().fold(0.0, |sum, (behind, weight)| {
            sum + weight * outputs[at - behind]
        })
    }
}

/// The recursion of one candidate.
struct Recursion {
    constant: f64,
    state: Terms,
    /// b and the products of each input.
    inputs: Vec<(f64, Terms)>,
}

impl Recursion {
    fn new(structure: &Structure, delays: &Delays, coefficients: &Coefficients) -> Self {
        let behind = |lag: &u16| structure.convention.behind_newest(*lag);
        let terms = |lags: &[u16], weights: &[f64]| {
            Terms::new(lags.iter().map(behind).zip(weights.iter().copied()))
        };
        let width = delays.product.len();
        let inputs = coefficients.b.iter().enumerate().map(|(l, b)| {
            let c = coefficients.c.get(l * width..(l + 1) * width);
            (*b, terms(&delays.product, c.unwrap_or_default()))
        });
        Self {
            constant: coefficients.constant,
            state: terms(&delays.state, &coefficients.a),
            inputs: inputs.collect(),
        }
    }

    /// Computes the `count` (at most [`BLOCK`]) values that follow position `at`; `arrived` are the commands
    /// of each input at these steps.
    ///
    /// Terms that do not depend on values of the block are summed for the whole block first. Each step then
    /// takes one multiply-add and the few lags within the block.
    #[inline(always)]
    fn run(&self, outputs: &mut [f64], at: usize, count: usize, arrived: &[[f64; BLOCK]]) {
        let mut known = [self.constant; BLOCK];
        self.state.add_far(outputs, at, &mut known);
        let mut newest = [self.state.newest; BLOCK];
        let mut waits = !self.state.near.is_empty();
        for ((b, products), d) in self.inputs.iter().zip(arrived) {
            if d[..count].iter().all(|d| *d == 0.0) {
                continue;
            }
            let mut gain = [*b; BLOCK];
            products.add_far(outputs, at, &mut gain);
            for i in 0..BLOCK {
                known[i] += gain[i] * d[i];
                newest[i] += products.newest * d[i];
            }
            waits |= !products.near.is_empty();
        }
        let mut value = outputs[at];
        for step in 0..count {
            let mut next = known[step];
            if waits {
                next += self.state.near(outputs, at + step);
                for ((_, products), d) in self.inputs.iter().zip(arrived) {
                    if d[step] != 0.0 {
                        next += d[step] * products.near(outputs, at + step);
                    }
                }
            }
            value = next + newest[step] * value;
            outputs[at + 1 + step] = value;
        }
    }
}

/// One input of a candidate: its law, and its shortest and longest delay.
struct Arrival {
    law: Option<CoreLaw>,
    shortest: usize,
    longest: usize,
}

impl Arrival {
    fn new(tick: i64, law: Option<&ExponentialDelay>) -> Self {
        let law = law.map(|law| core_law(law, factor(tick)));
        let ends = match &law {
            None => [tick.max(0) as usize; 2],
            Some(law) => [law.law.floor, law.law.floor + law.law.rise].map(|h| law.tap(0, h).whole),
        };
        Self {
            law,
            shortest: ends[0].min(ends[1]),
            longest: ends[0].max(ends[1]),
        }
    }

    /// The delay in samples for a value of the signal that it depends on.
    #[inline(always)]
    fn delay(&self, follows: f64) -> usize {
        match &self.law {
            Some(law) => law.tap(0, law.evaluate(follows)).whole,
            None => self.shortest,
        }
    }
}

/// Intervals in which the delay decides whether an edge has arrived, ascending.
fn undecided(edges: &[usize], arrivals: &[Arrival]) -> Vec<(usize, usize)> {
    let mut all: Vec<(usize, usize)> = arrivals
        .iter()
        .filter(|a| a.shortest < a.longest)
        .flat_map(|a| edges.iter().map(|e| (e + a.shortest, e + a.longest)))
        .collect();
    if arrivals.len() > 1 {
        all.sort_unstable();
    }
    all
}

/// Largest |y| of the records.
fn largest_output(signals: &FitSignals) -> f64 {
    let outputs = signals.y.iter().flatten();
    let largest = outputs.fold(0.0f64, |m, y| m.max(y.abs()));
    largest.max(f64::MIN_POSITIVE)
}

/// ε assigned to a candidate that diverges at once: larger than that of any bounded run.
pub(crate) fn diverged_value(signals: &FitSignals) -> f64 {
    1e9 * largest_output(signals)
}

impl FreeRunner {
    pub(crate) fn new(signals: &FitSignals, structure: &Structure) -> Self {
        let largest = largest_output(signals);
        Self {
            structure: structure.clone(),
            bound: RULES.hopeless * largest,
            diverged: diverged_value(signals),
            samples: signals.y.iter().map(Vec::len).sum(),
        }
    }

    /// Runs all records, until the sum of squares reaches `give_up_at`.
    pub(crate) fn run(
        &self,
        signals: &FitSignals,
        delays: &Delays,
        coefficients: &Coefficients,
        give_up_at: f64,
        keep: Option<&mut Trajectory>,
    ) -> RunOutcome {
        let recursion = Recursion::new(&self.structure, delays, coefficients);
        let law = match &self.structure.delay {
            InputDelay::Fixed { .. } => None,
            InputDelay::StateDependent { law, .. } => Some(law),
        };
        let arrivals: Vec<Arrival> = delays.ticks.iter().map(|t| Arrival::new(*t, law)).collect();
        pulp::Arch::new().dispatch(BlockRun {
            runner: self,
            signals,
            recursion: &recursion,
            arrivals: &arrivals,
            give_up_at,
            keep,
        })
    }
}

/// One run over all records, compiled for the vector unit that the machine has.
struct BlockRun<'a> {
    runner: &'a FreeRunner,
    signals: &'a FitSignals,
    recursion: &'a Recursion,
    arrivals: &'a [Arrival],
    give_up_at: f64,
    keep: Option<&'a mut Trajectory>,
}

/// Number of terms in the sum of ỹ, eq. (1).
const AVERAGED: usize = WINDOW as usize - 1;

impl BlockRun<'_> {
    /// The signal on which the delay depends at position `at`, given the sum of ỹ.
    #[inline(always)]
    fn follows(&self, outputs: &[f64], at: usize, sum: f64) -> f64 {
        let follows = if self.runner.structure.averaged {
            outputs[at]
        } else {
            sum / f64::from(WINDOW)
        };
        follows.max(0.0)
    }

    /// The delays of all inputs at the averaged output `follows`, samples.
    #[inline(always)]
    fn delays(&self, follows: f64, delays: &mut [usize]) {
        for (delay, arrival) in delays.iter_mut().zip(self.arrivals) {
            *delay = arrival.delay(follows);
        }
    }
}

impl pulp::NullaryFnOnce for BlockRun<'_> {
    type Output = RunOutcome;

    #[inline(always)]
    fn call(mut self) -> RunOutcome {
        let FreeRunner {
            structure,
            bound,
            samples: all_samples,
            ..
        } = self.runner;
        let inputs = self.arrivals.len();
        // Zeros precede a record, for the longest lag and the average.
        let padding = usize::from(structure.longest_lag).max(AVERAGED);
        let mut sum = 0.0;
        let mut done = 0;
        let mut outputs: Vec<f64> = Vec::new();
        let mut arrived = vec![[0.0; BLOCK]; inputs];
        let (mut delays, mut moved) = (vec![0; inputs], vec![0; inputs]);
        for (record, measured) in self.signals.y.iter().enumerate() {
            let u = &self.signals.u[record];
            let samples = measured.len();
            let mut kept_arrived = vec![Vec::new(); inputs];
            outputs.clear();
            outputs.resize(padding + samples + BLOCK, 0.0);
            if self.signals.skipped > 0 {
                outputs[padding] = measured.first().copied().unwrap_or(0.0);
            } else {
                sum += measured.first().map_or(0.0, |y| y * y);
            }
            let undecided = undecided(&self.signals.edges[record], self.arrivals);
            let mut undecided = undecided.into_iter().peekable();
            // Up to this position samples are computed one by one, because the delay changes.
            let mut singly = 0;
            let mut k = 0;
            while k < samples {
                let at = padding + k;
                while undecided.next_if(|(_, end)| *end <= k).is_some() {}
                let mut count = BLOCK.min(samples - k);
                let mut decided = true;
                if let Some((start, end)) = undecided.peek() {
                    decided = *start > k;
                    count = count.min(if decided { *start } else { *end } - k);
                }
                let mut average = 0.0;
                if decided {
                    for (delay, arrival) in delays.iter_mut().zip(self.arrivals) {
                        *delay = arrival.shortest;
                    }
                } else {
                    if k < singly {
                        count = 1;
                    }
                    average = sum_of(&outputs[at - AVERAGED..at]);
                    self.delays(self.follows(&outputs, at, average), &mut delays);
                }
                for (arrived, delay) in arrived.iter_mut().zip(&delays) {
                    copy_late(u, k, *delay, &mut arrived[..count]);
                }
                self.recursion.run(&mut outputs, at, count, &arrived);
                if !decided && count > 1 {
                    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
                    for step in 0..count {
                        let follows = self.follows(&outputs, at + step, average);
                        (least, most) = (least.min(follows), most.max(follows));
                        average += outputs[at + step] - outputs[at + step - AVERAGED];
                    }
                    let mut same = true;
                    for end in [least, most] {
                        self.delays(end, &mut moved);
                        same &= moved == delays;
                    }
                    if !same {
                        singly = k + count;
                        continue;
                    }
                }
                if self.keep.is_some() {
                    for (kept, arrived) in kept_arrived.iter_mut().zip(&arrived) {
                        kept.extend_from_slice(&arrived[..count]);
                    }
                }
                let next = &mut outputs[at + 1..at + 1 + count];
                let known = measured.get(k + 1..).unwrap_or_default();
                let unjudged = self.signals.skipped.saturating_sub(k + 1);
                // During the lead-in the run is set to the measurement.
                let follow = next.iter_mut().zip(known).take(unjudged);
                follow.for_each(|(n, y)| *n = *y);
                if beyond(next, *bound) {
                    return RunOutcome::Diverged((done + k) as f64 / *all_samples as f64);
                }
                let unjudged = unjudged.min(next.len()).min(known.len());
                sum += squared_distance(&next[unjudged..], &known[unjudged..]);
                if sum >= self.give_up_at {
                    return RunOutcome::AtLeast(sum);
                }
                k += count;
            }
            done += samples;
            if let Some(keep) = self.keep.as_deref_mut() {
                keep.arrived.push(kept_arrived);
                keep.simulated
                    .push(outputs[padding..padding + samples].to_vec());
            }
        }
        RunOutcome::Squared(sum)
    }
}

/// Partial sums computed in parallel.
const LANES: usize = 8;

#[inline(always)]
fn sum_of(values: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let chunks = values.chunks_exact(LANES);
    let rest: f64 = chunks.remainder().iter().sum();
    for chunk in chunks {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += value;
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Σ (a − b)² over the shorter of the two.
#[inline(always)]
fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (&a[..a.len().min(b.len())], &b[..a.len().min(b.len())]);
    let mut sums = [0.0; LANES];
    let (chunks_a, chunks_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest = chunks_a.remainder().iter().zip(chunks_b.remainder());
    let rest: f64 = rest.map(|(a, b)| (a - b) * (a - b)).sum();
    for (a, b) in chunks_a.zip(chunks_b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += (a - b) * (a - b);
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Whether any value exceeds `bound` in magnitude or is NaN.
#[inline(always)]
fn beyond(values: &[f64], bound: f64) -> bool {
    // A loop without an early exit is vectorised.
    let inside = values.iter().fold(true, |all, y| all & (y.abs() <= bound));
    !inside
}

/// The command from step `k` on, delayed by `delay` samples; 0 before it begins.
#[inline(always)]
fn copy_late(u: &[f64], k: usize, delay: usize, late: &mut [f64]) {
    let missing = delay.saturating_sub(k).min(late.len());
    let (before, after) = late.split_at_mut(missing);
    before.fill(0.0);
    if !after.is_empty() {
        after.copy_from_slice(&u[k + missing - delay..][..after.len()]);
    }
}
