//! Starting points of the fits: a scan over time constants and dead times on decimated records, on every time
//! scale between sample and record.

use super::arx;
use super::projection::{Gram, Stretch};
use super::response::{Response, Shape};
use super::series::Series;
use crate::order;

/// Decimated samples per scan, all records together.
const BUDGET: usize = 4000;
/// Largest number of records in a scan.
const RECORDS: usize = 20;
/// Dead times of a scan, decimated samples.
const DEAD_TIMES: usize = 150;
/// Factor from one time scale to the next.
const SCALE: usize = 4;
/// Smallest number of decimated samples of the longest record.
const SHORTEST: usize = 60;
/// Time constants of a scan, decimated samples, and further ones that only the coarsest scan tries.
const TIMES: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];
const LONG_TIMES: [f64; 5] = [16.0, 32.0, 64.0, 128.0, 256.0];
const DAMPINGS: [f64; 5] = [0.05, 0.2, 0.5, 1.0, 2.5];

/// A start: a process and its dead time, in samples of the records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    pub(super) shape: Shape,
    pub(super) dead_time: f64,
}

/// Starts of first and of second order, the best of each time scale first.
#[derive(Clone, Debug, Default)]
pub(super) struct Starts {
    pub(super) first: Vec<Start>,
    pub(super) second: Vec<Start>,
}

/// Scans `series` with dead times up to `longest_dead_time` samples.
pub(super) fn starts(series: &[Series], longest_dead_time: usize) -> Starts {
    let longest = series.iter().map(Series::len).max().unwrap_or(0);
    let hop = series.len().div_ceil(RECORDS).max(1);
    let looked_at: Vec<&Series> = series.iter().step_by(hop).collect();
    let share = BUDGET / looked_at.len().max(1);
    let mut starts = Starts::default();
    let mut factor = 1;
    while factor == 1 || longest / factor >= SHORTEST {
        let coarsest = longest / (factor * SCALE) < SHORTEST;
        let limit = DEAD_TIMES.min(longest_dead_time / factor);
        let cut = |s: &&Series| s.liveliest(share * factor, limit * factor);
        let thin: Vec<Series> = looked_at.iter().map(|s| cut(s).thinned(factor)).collect();
        let more: &[f64] = if coarsest { &LONG_TIMES } else { &[] };
        let times = || TIMES.iter().chain(more).copied();
        let first = times().map(|time_constant| Shape::First { time_constant });
        let grid = times().flat_map(|time| {
            DAMPINGS.iter().map(move |damping| Shape::Second {
                frequency: 1.0 / time,
                damping: *damping,
            })
        });
        let second = grid.chain(arx::shapes(&thin));
        let keep = |shapes: Vec<Shape>, most: usize| {
            let mut found = scan(&thin, &shapes, limit);
            order::ascending(&mut found, |one| one.0);
            let whole = |(_, shape, dead): (f64, Shape, usize)| Start {
                shape: slower(shape, factor as f64),
                dead_time: (dead * factor) as f64,
            };
            found.into_iter().take(most).map(whole).collect::<Vec<_>>()
        };
        starts.first.extend(keep(first.collect(), 2));
        starts.second.extend(keep(second.collect(), 3));
        factor *= SCALE;
    }
    starts
}

fn slower(shape: Shape, factor: f64) -> Shape {
    match shape {
        Shape::First { time_constant } => Shape::First {
            time_constant: factor * time_constant,
        },
        Shape::Second { frequency, damping } => Shape::Second {
            frequency: frequency / factor,
            damping,
        },
    }
}

/// The best dead time of each shape, with its cost.
fn scan(series: &[Series], shapes: &[Shape], limit: usize) -> Vec<(f64, Shape, usize)> {
    let mut found = Vec::new();
    for shape in shapes {
        let response = Response::new(*shape, 0.0);
        let mut grams = vec![Gram::default(); limit + 1];
        for stretch in series {
            let y = stretch.y.get(stretch.lead..).unwrap_or_default();
            let judged = Stretch::new(&response, y);
            let run = response.forced(&stretch.u, stretch.before);
            let first = run.first().copied().unwrap_or(0.0);
            let mut padded = vec![first; limit];
            padded.extend(run);
            for (dead, gram) in grams.iter_mut().enumerate() {
                let from = limit + stretch.lead - dead;
                let mut x = padded
                    .get(from..from + y.len())
                    .unwrap_or_default()
                    .to_vec();
                gram.add(&judged.gram(&mut x));
            }
        }
        let costs = grams.iter().map(|gram| gram.solve().cost).enumerate();
        let best = costs.min_by(|a, b| a.1.total_cmp(&b.1));
        found.extend(best.map(|(dead, cost)| (cost, *shape, dead)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow process with a long dead time in long records: at least one starting point must be near it.
    #[test]
    fn a_scan_comes_near_on_the_scale_of_the_process() {
        for (slow, fast, dead) in [(900.0, 200.0, 333.0), (6.0, 2.0, 5.0)] {
            let period = (3.0 * (slow + dead)) as usize;
            let u: Vec<f64> = (0..20_000)
                .map(|k| f64::from(u8::from((k / period) % 2 == 1)))
                .collect();
            let response = Response::new(Shape::of_time_constants(slow, fast), dead);
            let y = response.forced(&u, 0.0);
            let series = Series {
                u,
                y,
                ..Series::default()
            };
            let found = starts(&[series], 6000);
            let near = |start: &Start| {
                let total = match start.shape {
                    Shape::First { time_constant } => time_constant,
                    Shape::Second { frequency, damping } => 2.0 * damping / frequency,
                };
                let whole = slow + fast + dead;
                ((start.dead_time + total) / whole - 1.0).abs() < 0.15
            };
            assert!(found.first.iter().any(near), "{:?}", found.first);
            assert!(found.second.iter().any(near), "{:?}", found.second);
        }
    }
}
