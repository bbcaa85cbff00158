//! Free runs of candidates, fast: the innermost loop of the free-run search.
//!
//! The recursion is that of `model-core`, taken in blocks of samples. A lag
//! longer than the block reads outputs that are known before it begins, so its
//! terms are added to all samples of the block at once; only the short lags go
//! sample by sample. So do the few samples around each edge of the command where
//! the delay decides whether it has arrived. Terms are added in another order
//! than in `model-core`: the last bits differ, which a search does not see.

use model_core::delay::DelayLaw as _;

use super::arrival::{Signals, core_law, factor};
use super::free_run::Coefficients;
use super::layout::Delays;
use super::structure::{DelayLaw, InputDelay, Structure, WINDOW};

/// A run beyond this many times the measured range has diverged.
const DIVERGED: f64 = 10.0;

/// Samples computed together at most.
const BLOCK: usize = 32;

/// What a simulation came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// Σ (y − y_sim)² over all records.
    Squared(f64),
    /// Given up once the sum had reached this.
    AtLeast(f64),
    /// Left all bounds, with this share of the samples done.
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
    samples: usize,
}

/// Lags behind the newest output and what multiplies them: those shorter than a
/// block and the others.
struct Terms {
    near: Vec<(usize, f64)>,
    far: Vec<(usize, f64)>,
}

impl Terms {
    fn new(terms: impl Iterator<Item = (usize, f64)>) -> Self {
        let (near, far) = terms.partition(|(behind, _)| behind + 1 < BLOCK);
        Self { near, far }
    }

    /// Adds the long lags' terms to `sums`, the first of which follows place `at`.
    #[inline]
    fn add_far(&self, past: &[f64], at: usize, sums: &mut [f64]) {
        for &(behind, weight) in &self.far {
            let from = &past[at - behind..][..sums.len()];
            sums.iter_mut().zip(from).for_each(|(s, y)| *s += weight * y);
        }
    }

    /// The short lags' terms of the value that follows place `at`.
    #[inline]
    fn near(&self, outputs: &[f64], at: usize) -> f64 {
        self.near
            .iter()
            .fold(0.0, |sum, (behind, weight)| sum + weight * outputs[at - behind])
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

    /// Computes the `count` values that follow place `at`, at most [`BLOCK`].
    /// `arrived` are the commands of each input at these steps.
    fn run(&self, outputs: &mut [f64], at: usize, count: usize, arrived: &[[f64; BLOCK]]) {
        let (past, next) = outputs.split_at_mut(at + 1);
        let next = &mut next[..count];
        next.fill(self.constant);
        self.state.add_far(past, at, next);
        for ((b, products), d) in self.inputs.iter().zip(arrived) {
            let d = &d[..count];
            if d.iter().any(|d| *d != 0.0) {
                let mut gain = [*b; BLOCK];
                let gain = &mut gain[..count];
                products.add_far(past, at, gain);
                next.iter_mut()
                    .zip(gain)
                    .zip(d)
                    .for_each(|((n, g), d)| *n += *g * d);
            }
        }
        for step in 0..count {
            let mut value = self.state.near(outputs, at + step);
            for ((_, products), d) in self.inputs.iter().zip(arrived) {
                if d[step] != 0.0 {
                    value += d[step] * products.near(outputs, at + step);
                }
            }
            outputs[at + 1 + step] += value;
        }
    }
}

/// One input of a candidate: its law, and its shortest and longest delay.
struct Arrival {
    law: Option<model_core::effects::StateDependentDelay<f64>>,
    shortest: usize,
    longest: usize,
}

impl Arrival {
    fn new(tick: i64, law: Option<&DelayLaw>) -> Self {
        let law = law.map(|law| core_law(law, factor(tick)));
        let ends = match &law {
            None => [tick.max(0) as usize; 2],
            Some(law) => [law.floor, law.floor + law.rise].map(|h| law.tap(0, h).whole),
        };
        Self {
            law,
            shortest: ends[0].min(ends[1]),
            longest: ends[0].max(ends[1]),
        }
    }
}

/// Where the delay decides whether an edge has arrived, in ascending order.
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

impl FreeRunner {
    pub(crate) fn new(signals: &Signals, structure: &Structure) -> Self {
        let largest = signals
            .y
            .iter()
            .flatten()
            .fold(0.0f64, |m, y| m.max(y.abs()));
        Self {
            structure: structure.clone(),
            bound: DIVERGED * largest.max(1e-9),
            samples: signals.y.iter().map(Vec::len).sum(),
        }
    }

    /// Runs all records, until the sum of squares reaches `give_up_at`.
    pub(crate) fn run(
        &self,
        signals: &Signals,
        delays: &Delays,
        coefficients: &Coefficients,
        give_up_at: f64,
        mut keep: Option<&mut Trajectory>,
    ) -> Outcome {
        let recursion = Recursion::new(&self.structure, delays, coefficients);
        let law = match &self.structure.delay {
            InputDelay::Fixed { .. } => None,
            InputDelay::StateDependent { law, .. } => Some(law),
        };
        let arrivals: Vec<Arrival> = delays.ticks.iter().map(|t| Arrival::new(*t, law)).collect();
        let averaged_terms = WINDOW as usize - 1;
        // Zeros before a record, for the longest lag and the average.
        let padding = usize::from(self.structure.longest_lag).max(averaged_terms);
        let mut sum = 0.0;
        let mut done = 0;
        let mut outputs: Vec<f64> = Vec::new();
        let mut arrived = vec![[0.0; BLOCK]; arrivals.len()];
        for (record, measured) in signals.y.iter().enumerate() {
            let u = &signals.u[record];
            let samples = measured.len();
            let mut kept_arrived = vec![Vec::new(); arrivals.len()];
            outputs.clear();
            outputs.resize(padding + samples + 1, 0.0);
            if signals.skipped > 0 {
                outputs[padding] = measured.first().copied().unwrap_or(0.0);
            } else {
                sum += measured.first().map_or(0.0, |y| y * y);
            }
            let undecided = undecided(&signals.edges[record], &arrivals);
            let mut undecided = undecided.into_iter().peekable();
            // ỹ's sum, for the step that it was formed for.
            let mut average: Option<(usize, f64)> = None;
            let mut k = 0;
            while k < samples {
                let at = padding + k;
                while undecided.next_if(|(_, end)| *end <= k).is_some() {}
                let mut count = BLOCK.min(samples - k);
                let mut decided = true;
                if let Some((start, _)) = undecided.peek() {
                    decided = *start > k;
                    count = if decided { count.min(start - k) } else { 1 };
                }
                if decided {
                    for (arrived, arrival) in arrived.iter_mut().zip(&arrivals) {
                        for (step, d) in arrived[..count].iter_mut().enumerate() {
                            let source = (k + step).checked_sub(arrival.shortest);
                            *d = source.map_or(0.0, |i| u[i]);
                        }
                    }
                } else {
                    let follows = if self.structure.averaged {
                        outputs[at]
                    } else {
                        let sum = match average {
                            Some((step, sum)) if step + 1 == k => {
                                sum + outputs[at - 1] - outputs[at - 1 - averaged_terms]
                            }
                            _ => outputs[at - averaged_terms..at].iter().sum(),
                        };
                        average = Some((k, sum));
                        sum / f64::from(WINDOW)
                    };
                    for (arrived, arrival) in arrived.iter_mut().zip(&arrivals) {
                        let delay = match &arrival.law {
                            Some(law) => law.tap(0, law.evaluate(follows.max(0.0))).whole,
                            None => arrival.shortest,
                        };
                        arrived[0] = k.checked_sub(delay).map_or(0.0, |i| u[i]);
                    }
                }
                recursion.run(&mut outputs, at, count, &arrived);
                if keep.is_some() {
                    for (kept, arrived) in kept_arrived.iter_mut().zip(&arrived) {
                        kept.extend_from_slice(&arrived[..count]);
                    }
                }
                let next = &mut outputs[at + 1..at + 1 + count];
                let known = measured.get(k + 1..).unwrap_or_default();
                if k + 1 < signals.skipped {
                    // Until the past is recorded the run follows the measurement.
                    let follow = signals.skipped - (k + 1);
                    next.iter_mut()
                        .zip(known)
                        .take(follow)
                        .for_each(|(n, y)| *n = *y);
                }
                if next.iter().any(|y| y.abs() > self.bound || y.is_nan()) {
                    return Outcome::Diverged((done + k) as f64 / self.samples as f64);
                }
                let judged = signals.skipped.saturating_sub(k + 1);
                sum += next
                    .iter()
                    .zip(known)
                    .skip(judged)
                    .map(|(s, y)| (y - s) * (y - s))
                    .sum::<f64>();
                if sum >= give_up_at {
                    return Outcome::AtLeast(sum);
                }
                k += count;
            }
            done += samples;
            if let Some(keep) = keep.as_deref_mut() {
                keep.arrived.push(kept_arrived);
                keep.simulated
                    .push(outputs[padding..padding + samples].to_vec());
            }
        }
        Outcome::Squared(sum)
    }
}
