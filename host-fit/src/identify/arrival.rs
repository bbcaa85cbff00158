//! The command as it arrives at the sensor, for any input delay.

use model_core::delay::{DelayLaw as _, ScaledDelay, Tap};
use model_core::effects::StateDependentDelay;

use super::structure::{ExponentialDelay, FACTOR_STEP, InputDelay, Series, Structure};
use crate::averages::{averaged_past, moving_average};
use model_core::average::WINDOW;

/// Weights of the samples in a sum of products.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Weights {
    /// 1 inside the intervals of each record, 0 outside.
    Intervals(Vec<Vec<(usize, usize)>>),
    /// Any value at each sample of each record.
    Samples(Vec<Vec<f64>>),
}

impl Weights {
    /// Sample by sample product of two sequences.
    pub(crate) fn product(&self, other: &Self) -> Self {
        match (self, other) {
            (Self::Intervals(a), Self::Intervals(b)) => {
                Self::Intervals(a.iter().zip(b).map(|(a, b)| intersection(a, b)).collect())
            }
            (Self::Samples(a), Self::Samples(b)) => Self::Samples(
                a.iter()
                    .zip(b)
                    .map(|(a, b)| a.iter().zip(b).map(|(x, y)| x * y).collect())
                    .collect(),
            ),
            (Self::Intervals(on), Self::Samples(values))
            | (Self::Samples(values), Self::Intervals(on)) => Self::Samples(
                values
                    .iter()
                    .zip(on)
                    .map(|(values, on)| {
                        let mut masked = vec![0.0; values.len()];
                        for &(start, end) in on {
                            if let (Some(to), Some(from)) =
                                (masked.get_mut(start..end), values.get(start..end))
                            {
                                to.copy_from_slice(from);
                            }
                        }
                        masked
                    })
                    .collect(),
            ),
        }
    }

    /// Whether the weights are 0 and 1 only.
    pub(crate) fn is_binary(&self) -> bool {
        matches!(self, Self::Intervals(_))
    }
}

fn intersection(a: &[(usize, usize)], b: &[(usize, usize)]) -> Vec<(usize, usize)> {
    let (mut i, mut j, mut common) = (0, 0, Vec::new());
    while let (Some(x), Some(y)) = (a.get(i), b.get(j)) {
        let (start, end) = (x.0.max(y.0), x.1.min(y.1));
        if start < end {
            common.push((start, end));
        }
        if x.1 < y.1 { i += 1 } else { j += 1 }
    }
    common
}

/// Intervals in which two binary sequences differ, each with the sign of `to − from`.
pub(crate) fn difference(
    from: &[(usize, usize)],
    to: &[(usize, usize)],
) -> Vec<(usize, usize, f64)> {
    let mut edges: Vec<(usize, i32, i32)> = Vec::with_capacity(2 * (from.len() + to.len()));
    edges.extend(from.iter().flat_map(|&(s, e)| [(s, 1, 0), (e, -1, 0)]));
    edges.extend(to.iter().flat_map(|&(s, e)| [(s, 0, 1), (e, 0, -1)]));
    edges.sort_unstable_by_key(|e| e.0);
    let (mut in_from, mut in_to, mut since) = (0, 0, 0);
    let mut pieces = Vec::new();
    for (at, d_from, d_to) in edges {
        if at > since && in_from != in_to {
            pieces.push((since, at, f64::from(in_to - in_from)));
        }
        since = at;
        in_from += d_from;
        in_to += d_to;
    }
    pieces
}

/// The signals that the recursion is fitted to, one entry per record.
#[derive(Debug, Clone)]
pub(crate) struct FitSignals {
    /// Input: u, or its average for an averaged model.
    pub(crate) u: Vec<Vec<f64>>,
    /// Output: y, or its average for an averaged model.
    pub(crate) y: Vec<Vec<f64>>,
    /// h̃_k from the measured output, samples; empty for fixed delays.
    pub(crate) base_delay: Vec<Vec<f64>>,
    /// Smallest and largest of `base_delay` in each block of [`STRETCH`] samples.
    base_range: Vec<Vec<(f64, f64)>>,
    /// Where the input changes.
    pub(crate) edges: Vec<Vec<usize>>,
    /// Whether every input is 0 or 1.
    binary: bool,
    /// Number of rows at the start of each record that are not fitted.
    pub(crate) skipped: usize,
}

impl FitSignals {
    /// Prepares the records for a structure.
    pub(crate) fn new(records: &[Series<'_>], structure: &Structure) -> Self {
        let pick = |signal: &[f64]| {
            if structure.averaged {
                moving_average(signal, WINDOW, false)
            } else {
                signal.to_vec()
            }
        };
        let u: Vec<Vec<f64>> = records.iter().map(|r| pick(r.u)).collect();
        let y: Vec<Vec<f64>> = records.iter().map(|r| pick(r.y)).collect();
        let base_delay = match &structure.delay {
            InputDelay::Fixed { .. } => Vec::new(),
            InputDelay::StateDependent { law, .. } => y
                .iter()
                .map(|y| {
                    let law = core_law(law, 1.0);
                    let follows = if structure.averaged {
                        y.clone()
                    } else {
                        averaged_past(y, WINDOW)
                    };
                    follows.iter().map(|f| law.evaluate(f.max(0.0))).collect()
                })
                .collect(),
        };
        let binary = u.iter().flatten().all(|u| *u == 0.0 || *u == 1.0);
        let base_range = base_delay
            .iter()
            .map(|d: &Vec<f64>| d.chunks(STRETCH).map(range).collect())
            .collect();
        let edges = u
            .iter()
            .map(|u| {
                let before = std::iter::once(&0.0).chain(u);
                u.iter()
                    .zip(before)
                    .enumerate()
                    .filter(|(_, (now, before))| now != before)
                    .map(|(k, _)| k)
                    .collect()
            })
            .collect();
        Self {
            u,
            y,
            base_delay,
            base_range,
            edges,
            binary,
            skipped: structure.skipped(),
        }
    }

    /// d_k = u_{k−h_k} for one input, at k = 0 … N−2 of each record. `tick` is h
    /// in samples, or f in steps of [`FACTOR_STEP`].
    pub(crate) fn arrived(&self, tick: i64) -> Weights {
        let factor = factor(tick);
        let delay =
            |record: usize, k: usize| match self.base_delay.get(record).and_then(|d| d.get(k)) {
                Some(base) => delay_samples(factor, *base),
                None => tick.max(0) as usize,
            };
        if !self.binary {
            let arrived = |(record, u): (usize, &Vec<f64>)| -> Vec<f64> {
                (0..u.len().saturating_sub(1))
                    .map(|k| match k.checked_sub(delay(record, k)) {
                        Some(i) if k >= self.skipped => u.get(i).copied().unwrap_or(0.0),
                        _ => 0.0,
                    })
                    .collect()
            };
            return Weights::Samples(self.u.iter().enumerate().map(arrived).collect());
        }
        let arrived = |(record, u): (usize, &Vec<f64>)| {
            let rows = u.len().saturating_sub(1);
            let mut intervals = Vec::new();
            let mut on_since = None;
            let mut next = 0;
            for (start, end) in self.undecided(record, factor, tick, rows) {
                for k in next.max(start)..end {
                    let delay = delay(record, k);
                    let on = k >= delay && u[k - delay] != 0.0;
                    match (on, on_since) {
                        (true, None) => on_since = Some(k),
                        (false, Some(start)) => {
                            intervals.push((start, k));
                            on_since = None;
                        }
                        _ => {}
                    }
                }
                next = next.max(end);
            }
            intervals.extend(on_since.map(|start| (start, rows)));
            intersection(&intervals, &[(self.skipped, rows)])
        };
        Weights::Intervals(self.u.iter().enumerate().map(arrived).collect())
    }

    /// For each edge of u the interval `(first, end)` of samples in which it may arrive, ascending: it has not
    /// arrived before `first`, and it has arrived at `end`. Outside these intervals the arrived command is
    /// constant.
    fn undecided(&self, record: usize, factor: f64, tick: i64, rows: usize) -> Vec<(usize, usize)> {
        let stretches = self.base_range.get(record).map(Vec::as_slice);
        let delays = |(low, high)| (delay_samples(factor, low), delay_samples(factor, high));
        let whole = match stretches {
            Some(stretches) => delays(joined(stretches)),
            None => [tick.max(0) as usize; 2].into(),
        };
        let window = |edge: &usize| {
            let (mut first, mut last) = (edge + whole.0, edge + whole.1);
            // The range of delays within the window is smaller than that of the whole record.
            if let Some(stretches) = stretches {
                for _ in 0..REFINEMENTS {
                    if first == last || first >= rows {
                        break;
                    }
                    let end = (last / STRETCH + 1).min(stretches.len());
                    let (low, high) = delays(joined(&stretches[first / STRETCH..end]));
                    (first, last) = (first.max(edge + low), last.min(edge + high));
                }
            }
            (first, (last + 1).min(rows))
        };
        let edges = self.edges.get(record).into_iter().flatten();
        let mut windows: Vec<(usize, usize)> = edges.map(window).collect();
        windows.sort_unstable();
        windows
    }

    /// Ticks of an input delay that move it by one sample.
    pub(crate) fn ticks_per_sample(&self) -> f64 {
        let longest = self
            .base_delay
            .iter()
            .flatten()
            .fold(0.0f64, |m, d| m.max(*d));
        if longest > 0.0 {
            1.0 / (FACTOR_STEP * longest)
        } else {
            1.0
        }
    }

    /// Weight 1 at every row of the regression.
    pub(crate) fn everywhere(&self) -> Weights {
        Weights::Intervals(
            self.y
                .iter()
                .map(|y| {
                    intersection(
                        &[(0, y.len().saturating_sub(1))],
                        &[(self.skipped, usize::MAX)],
                    )
                })
                .collect(),
        )
    }
}

/// The factor that a tick stands for.
pub(crate) fn factor(tick: i64) -> f64 {
    tick as f64 * FACTOR_STEP
}

/// The law for one input, computed as in `model-core`.
pub(crate) type CoreLaw = ScaledDelay<StateDependentDelay<f64>, [f64; 1], true>;

/// The law, computed as in `model-core`.
pub(crate) fn core_law(law: &ExponentialDelay, factor: f64) -> CoreLaw {
    ScaledDelay {
        law: StateDependentDelay {
            floor: law.floor,
            rise: law.rise,
            rate: law.rate,
        },
        factors: [factor],
    }
}

/// Samples per block with a common range of delays.
const STRETCH: usize = 16;

/// Number of refinements of an arrival interval; further ones rarely narrow it.
const REFINEMENTS: usize = 3;

/// Smallest and largest of some delays.
fn range(delays: &[f64]) -> (f64, f64) {
    let wider = |(low, high): (f64, f64), d: &f64| (low.min(*d), high.max(*d));
    delays.iter().fold((f64::INFINITY, 0.0), wider)
}

fn joined(ranges: &[(f64, f64)]) -> (f64, f64) {
    let wider = |(low, high): (f64, f64), r: &(f64, f64)| (low.min(r.0), high.max(r.1));
    ranges.iter().fold((f64::INFINITY, 0.0), wider)
}

fn delay_samples(factor: f64, base: f64) -> usize {
    Tap::at(factor * base, true).whole
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave() -> (Vec<f64>, Vec<f64>) {
        let u: Vec<f64> = (0..900)
            .map(|k| f64::from(u8::from((k / 70) % 2 == 1)))
            .collect();
        let y = (0..900)
            .map(|k| 0.5 + 0.6 * (k as f64 * 0.01).sin())
            .collect();
        (u, y)
    }

    #[test]
    fn the_arriving_command_follows_the_definition() {
        let (u, y) = wave();
        let law = ExponentialDelay {
            floor: 20.0,
            rise: 30.0,
            rate: 3.0,
        };
        let structure = Structure {
            delay: InputDelay::StateDependent { law, factors: None },
            ..Structure::default()
        };
        let signals = FitSignals::new(&[Series { u: &u, y: &y }], &structure);
        let Weights::Intervals(on) = signals.arrived(12_500) else {
            panic!("u is on/off")
        };
        let follows = averaged_past(&y, WINDOW);
        for k in 0..899 {
            let delay =
                (1.25 * (20.0 + 30.0 * (-3.0 * follows[k].max(0.0)).exp())).round() as usize;
            let expected = k >= delay && u[k - delay] == 1.0;
            assert_eq!(
                on[0].iter().any(|&(s, e)| (s..e).contains(&k)),
                expected,
                "{k}"
            );
        }
    }

    /// A steep law with large factors, whose delay changes by several samples per sample, so that an edge
    /// arrives more than once.
    #[test]
    fn narrowed_windows_miss_no_arrival() {
        let law = ExponentialDelay {
            floor: 5.0,
            rise: 40.0,
            rate: 30.0,
        };
        let structure = Structure {
            delay: InputDelay::StateDependent { law, factors: None },
            ..Structure::default()
        };
        let u: Vec<f64> = (0..4000)
            .map(|k| f64::from(u8::from((k / 37) % 3 == 1 || (k / 11) % 5 == 0)))
            .collect();
        let y: Vec<f64> = (0..4000)
            .map(|k| 0.4 * ((k as f64 * 0.004).sin() + (k as f64 * 0.05).cos()))
            .collect();
        let signals = FitSignals::new(&[Series { u: &u, y: &y }], &structure);
        for tick in [0, 700, 10_000, 12_345, 60_000] {
            let Weights::Intervals(on) = signals.arrived(tick) else {
                panic!("u is on/off")
            };
            let mut expected = vec![false; 3999];
            for (k, arrived) in expected.iter_mut().enumerate() {
                let delay = delay_samples(factor(tick), signals.base_delay[0][k]);
                *arrived = k >= delay && u[k - delay] != 0.0;
            }
            let mut found = vec![false; 3999];
            on[0].iter().for_each(|&(s, e)| found[s..e].fill(true));
            assert_eq!(found, expected, "{tick}");
        }
    }

    #[test]
    fn differences_and_products_of_sequences() {
        let (a, b) = (vec![(2, 5), (8, 12)], vec![(3, 6), (8, 10), (11, 12)]);
        assert_eq!(
            difference(&a, &b),
            [(2, 3, -1.0), (5, 6, 1.0), (10, 11, -1.0)]
        );
        assert_eq!(intersection(&a, &b), [(3, 5), (8, 10), (11, 12)]);
    }
}
