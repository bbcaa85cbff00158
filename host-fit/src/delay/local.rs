//! The dead time of single edges, when the dynamics are known from all of them.
//!
//! On the *trajectory* of one plant through the record, one edge is moved in time. The best shift d of its response,
//! K·Δu·(s(t − a − d) − s(t − a)), explains the residual around the edge, together with an offset. In a *window* an
//! edge has its own level, initial state and gain, and shares only the time constants with the other edges. The time
//! constants are searched in the windows too, because a fit with one dead time describes different dead times of the
//! edges by a second time constant.

use super::linear::{Series, evaluate, prewhiten};
use super::onset::Unmeasured;
use super::plant::{Change, Plant, Switching};
use super::pooled::Pooled;
use super::rules::RULES;
use super::spread::mean;

/// Largest number of edges used to estimate the time constants.
const SHAPE_EDGES: usize = 60;
/// Smallest number of samples on either side of an arrival.
const LEAST_SIDE: f64 = 2.0;
/// Ratios b that are tried in windows.
const RATIOS: [f64; 6] = [0.0, 0.03, 0.08, 0.15, 0.25, 0.6];

/// The dead time of one edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EdgeDelayed {
    /// Samples.
    pub(crate) delay: f64,
    /// Standard error of the delay for fixed time constants, samples.
    pub(crate) standard_error: f64,
}

/// Minimum of a sampled curve by a parabola, in steps, with its curvature (per squared step).
fn valley(values: &[f64]) -> Option<(f64, f64)> {
    let (best, middle) = values
        .iter()
        .copied()
        .enumerate()
        .filter(|v| v.1.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let at = |i: usize| values.get(i).copied().filter(|v| v.is_finite());
    let (left, right) = (best.checked_sub(1).and_then(at)?, at(best + 1)?);
    let curvature = left - 2.0 * middle + right;
    (curvature > 0.0).then(|| (best as f64 + 0.5 * (left - right) / curvature, curvature))
}

/// Every change of the command in one record, on the trajectory of the plant.
pub(crate) fn by_trajectory(
    series: &Series,
    pooled: &Pooled,
) -> Vec<Result<EdgeDelayed, Unmeasured>> {
    let residual = series.residual(&pooled.plant, pooled.gain);
    let mut last_level = 0.0;
    let changes = series.switching.changes.iter().enumerate();
    changes
        .map(|(i, change)| {
            let size = pooled.gain * (change.level - last_level);
            last_level = change.level;
            shifted(series, pooled, &residual, i, size)
        })
        .collect()
}

/// The shift of one response of `size` that explains the surrounding residual best.
fn shifted(
    series: &Series,
    pooled: &Pooled,
    residual: &[f64],
    index: usize,
    size: f64,
) -> Result<EdgeDelayed, Unmeasured> {
    let plant = &pooled.plant;
    let changes = &series.switching.changes;
    let change = changes.get(index).ok_or(Unmeasured::CutOff)?;
    let arrival = |c: &Change| c.time + plant.delay[usize::from(!c.rising)];
    let delay = plant.delay[usize::from(!change.rising)];
    let sum = plant.sum[usize::from(!change.on)];
    let least = RULES.least_side as f64;
    let end = series.y.len() as f64;
    let middle = arrival(change);
    let before = index
        .checked_sub(1)
        .and_then(|i| changes.get(i))
        .map_or(0.0, arrival);
    let next = changes.get(index + 1).map_or(end, arrival);
    let from = (middle - sum.max(least))
        .max(before)
        .max(series.from as f64);
    let from = from.floor();
    let to = (middle + (1.5 * sum).max(2.0 * least))
        .min(next.max(middle + least))
        .min(end)
        .floor();
    if middle < from || to < middle + least || to < from + 4.0 {
        return Err(Unmeasured::CutOff);
    }
    let window = residual
        .get(from as usize..to as usize)
        .ok_or(Unmeasured::CutOff)?;
    let steady = Plant {
        delay: [0.0; 2],
        sum: [sum; 2],
        ratio: plant.ratio,
        third: plant.third,
    };
    let respond = |shift: f64| -> Vec<f64> {
        let edge = Switching {
            changes: vec![Change {
                time: middle + shift - from,
                level: size,
                ..*change
            }],
            on: change.on,
        };
        let mut out = vec![0.0; window.len()];
        steady.respond(&edge, &mut out);
        prewhiten(&mut out, series.whitening);
        out
    };
    let own = respond(0.0);
    let level = mean(&own);
    let seen: f64 = own.iter().map(|v| (v - level).powi(2)).sum();
    if !pooled.responds || seen < RULES.detection * pooled.noise {
        return Err(Unmeasured::BelowNoise);
    }
    let half = (0.5 * delay).max(0.5 * sum).max(4.0);
    let step = (sum / 40.0).clamp(0.1, 2.0);
    let lowest = (delay.min(half) / step).floor();
    let longest = half.min(pooled.max_delay - delay).max(0.0);
    let steps = (lowest + (longest / step).ceil()) as usize;
    let profile: Vec<f64> = (0..=steps)
        .map(|s| {
            let moved = respond((s as f64 - lowest) * step);
            let left: Vec<f64> = window
                .iter()
                .zip(own.iter().zip(&moved))
                .map(|(e, (own, moved))| e + own - moved)
                .collect();
            let offset = mean(&left);
            left.iter().map(|e| (e - offset).powi(2)).sum()
        })
        .collect();
    let (place, curvature) = match valley(&profile) {
        Some(found) => found,
        // At a dead time of 0 the minimum has one side only.
        None if profile
            .first()
            .is_some_and(|first| delay <= half && profile.iter().all(|value| value >= first)) =>
        {
            let rise =
                profile.get(1).copied().unwrap_or(0.0) - profile.first().copied().unwrap_or(0.0);
            (0.0, (2.0 * rise).max(f64::MIN_POSITIVE))
        }
        None => return Err(Unmeasured::Blurred),
    };
    Ok(EdgeDelayed {
        delay: (delay + (place - lowest) * step).clamp(0.0, pooled.max_delay),
        standard_error: (2.0 * pooled.noise / curvature).sqrt() * step,
    })
}

/// An edge with the part of its record between the neighbouring responses.
#[derive(Debug, Clone)]
struct Window<'a> {
    y: &'a [f64],
    /// First sample of the window in the record.
    from: f64,
    change: Change,
    /// Change of the command.
    size: f64,
    /// First and last arrival that are tried, samples of the record.
    first: f64,
    last: f64,
}

/// An edge measured in its window.
#[derive(Debug, Clone, Copy)]
struct Measured {
    arrival: f64,
    rss: f64,
    /// Curvature of `rss` per squared sample of arrival.
    curvature: f64,
    free: f64,
}

impl<'a> Window<'a> {
    /// The window of one edge; `arrivals` are those of all edges of the record.
    fn of(
        series: &'a Series,
        plant: &Plant,
        arrivals: &[f64],
        index: usize,
        max_delay: f64,
    ) -> Option<Self> {
        let change = *series.switching.changes.get(index)?;
        let level_before = index
            .checked_sub(1)
            .and_then(|i| series.switching.changes.get(i))
            .map_or(0.0, |c| c.level);
        let middle = *arrivals.get(index)?;
        let end = series.y.len() as f64;
        let sum = plant.mean_sum();
        let before = index.checked_sub(1).and_then(|i| arrivals.get(i));
        let next = arrivals.get(index + 1).copied().unwrap_or(end);
        let from = (middle - (1.5 * sum).max(8.0))
            .max(before.map_or(0.0, |b| b + 0.5))
            .max(series.from as f64)
            .ceil();
        let to = (middle + (2.0 * sum).max(8.0))
            .min(next + 0.5)
            .min(end)
            .floor();
        let half = (0.6 * plant.mean_delay()).max(0.5 * sum).max(2.0);
        let first = (middle - half).max(change.time).max(from + 0.5);
        let last = (middle + half)
            .min(to - LEAST_SIDE)
            .min(change.time + max_delay);
        if to < from + 6.0 || last <= first {
            return None;
        }
        Some(Self {
            y: series.y.get(from as usize..to as usize)?,
            from,
            change,
            size: change.level - level_before,
            first,
            last,
        })
    }

    /// Residual sum of squares for an arrival at `arrival`; a response of the wrong sign does not count.
    fn rss(&self, plant: &Plant, arrival: f64, gain_sign: f64) -> f64 {
        let series = Series {
            y: self.y.to_vec(),
            switching: Switching {
                changes: vec![Change {
                    time: arrival - self.from,
                    level: self.size,
                    ..self.change
                }],
                on: !self.change.on,
            },
            from: 0,
            whitening: 0.0,
        };
        let here = Plant {
            delay: [0.0; 2],
            ..*plant
        };
        evaluate(&[series], here)
            .filter(|found| found.gain * gain_sign > 0.0)
            .map_or(f64::INFINITY, |found| found.rss)
    }

    fn measure(&self, plant: &Plant, gain_sign: f64) -> Option<Measured> {
        let step = ((self.last - self.first) / 24.0).clamp(0.1, 1.0);
        let steps = ((self.last - self.first) / step).floor() as usize;
        let profile: Vec<f64> = (0..=steps)
            .map(|s| self.rss(plant, self.first + s as f64 * step, gain_sign))
            .collect();
        let (place, curvature) = valley(&profile)?;
        let least = profile.iter().copied().fold(f64::INFINITY, f64::min);
        let arrival = self.first + place * step;
        Some(Measured {
            arrival,
            rss: self.rss(plant, arrival, gain_sign).min(least),
            curvature: curvature / (step * step),
            free: (self.y.len() as f64 - 5.0).max(1.0),
        })
    }
}

/// The arrivals of all edges of a record if every dead time is the plant's.
fn expected_arrivals(series: &Series, plant: &Plant) -> Vec<f64> {
    let changes = series.switching.changes.iter();
    changes
        .map(|c| c.time + plant.delay[usize::from(!c.rising)])
        .collect()
}

/// Every change of the command in every record, each in a window of its own.
pub(crate) fn by_window(
    all: &[Series],
    pooled: &Pooled,
) -> Vec<Vec<Result<EdgeDelayed, Unmeasured>>> {
    let gain_sign = pooled.gain.signum();
    let mut arrivals: Vec<Vec<f64>> = all
        .iter()
        .map(|s| expected_arrivals(s, &pooled.plant))
        .collect();
    let mut plant = pooled.plant;
    let mut measured: Vec<Vec<Option<Measured>>> = Vec::new();
    // Two passes are needed, because the neighbouring responses limit a window and are known only roughly in
    // the first pass.
    for _ in 0..2 {
        let windows: Vec<Vec<Option<Window<'_>>>> = all
            .iter()
            .zip(&arrivals)
            .map(|(s, arrivals)| {
                (0..arrivals.len())
                    .map(|i| Window::of(s, &plant, arrivals, i, pooled.max_delay))
                    .collect()
            })
            .collect();
        let some: Vec<&Window<'_>> = windows.iter().flatten().flatten().collect();
        let stride = some.len().div_ceil(SHAPE_EDGES).max(1);
        // An odd stride alternates between rising and falling edges.
        let stride = stride + usize::from(stride > 1 && stride.is_multiple_of(2));
        let some: Vec<&Window<'_>> = some.into_iter().step_by(stride).collect();
        plant = shape(&some, plant, gain_sign);
        measured = windows
            .iter()
            .map(|windows| {
                windows
                    .iter()
                    .map(|w| w.as_ref()?.measure(&plant, gain_sign))
                    .collect()
            })
            .collect();
        for (arrivals, measured) in arrivals.iter_mut().zip(&measured) {
            for (arrival, measured) in arrivals.iter_mut().zip(measured) {
                if let Some(measured) = measured {
                    *arrival = measured.arrival;
                }
            }
        }
    }
    // All windows have one variance, because a single window has few samples.
    let mut variances: Vec<f64> = measured
        .iter()
        .flatten()
        .flatten()
        .map(|m| m.rss / m.free)
        .collect();
    let middle = variances.len() / 2;
    let variance = if variances.is_empty() {
        0.0
    } else {
        *variances.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    all.iter()
        .zip(&measured)
        .map(|(series, measured)| {
            let changes = series.switching.changes.iter();
            changes
                .zip(measured)
                .map(|(change, measured)| {
                    let measured = measured.ok_or(Unmeasured::CutOff)?;
                    let noise = variance.max(measured.rss / measured.free);
                    Ok(EdgeDelayed {
                        delay: (measured.arrival - change.time).max(0.0),
                        standard_error: (2.0 * noise / measured.curvature).sqrt(),
                    })
                })
                .collect()
        })
        .collect()
}

/// The time constants with the least residual over some windows, each at its best arrival.
fn shape(windows: &[&Window<'_>], start: Plant, gain_sign: f64) -> Plant {
    let left = |plant: &Plant| -> f64 {
        windows
            .iter()
            .map(|w| {
                w.measure(plant, gain_sign).map_or_else(
                    || {
                        let level = mean(w.y);
                        w.y.iter().map(|y| (y - level).powi(2)).sum()
                    },
                    |m| m.rss,
                )
            })
            .sum()
    };
    let search = |mut plant: Plant| -> (f64, Plant) {
        let mut least = left(&plant);
        for factor in [1.5f64, 1.2, 1.08] {
            for _ in 0..4 {
                let before = least;
                for mode in 0..2 {
                    for power in [factor, 1.0 / factor] {
                        let mut next = plant;
                        next.sum[mode] *= power;
                        let value = left(&next);
                        if value < least {
                            (least, plant) = (value, next);
                            break;
                        }
                    }
                }
                if least >= before {
                    break;
                }
            }
        }
        (least, plant)
    };
    let samples: usize = windows.iter().map(|w| w.y.len()).sum();
    let tried: Vec<(f64, Plant)> = RATIOS
        .into_iter()
        .map(|ratio| search(Plant { ratio, ..start }))
        .collect();
    let first = tried.first().copied();
    let best = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    match (first, best) {
        (Some(first), Some(best)) => {
            // A second order is kept only if it improves BIC.
            let samples = samples.max(2) as f64;
            let gain = samples * (first.0 / best.0.max(f64::MIN_POSITIVE)).ln();
            if gain > samples.ln() { best.1 } else { first.1 }
        }
        _ => start,
    }
}
