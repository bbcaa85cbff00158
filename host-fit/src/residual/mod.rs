//! Where a model fails: its free-run error, split along each coordinate and compared with the noise.

mod binned;
mod coordinate;
mod correlation;
mod explained;
mod noise;
mod oscillation;
#[cfg(test)]
pub(crate) mod plants;
mod rules;
mod samples;
mod spectrum;
mod trend;
mod words;

pub use coordinate::FailureCoordinate;
pub(crate) use correlation::{correlation_length, independent_block, p_above, student};
pub use explained::Dependence;
pub use noise::NoiseSource;
pub use oscillation::Oscillation;
pub use rules::{RULES, Rules};
pub use trend::Trend;
pub(crate) use trend::correlation;

use crate::data::{Record, Use};
use crate::indicators::ErrorKind;
use crate::model::Model;
use crate::order;
use crate::picture::{FailureBin, FailureView};
use crate::simulate::SimulateError;
use binned::{Binned, Source, coordinates};
use explained::{Errors, explained, ways};
use serde::Serialize;

/// The error along one coordinate. Serialises to the keys of `compare --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Where {
    /// The coordinate; its unit is that of `worst_from` and `worst_to`.
    #[serde(flatten)]
    pub coordinate: FailureCoordinate,
    /// Share of the unexplained variance Σ(e² − σ²) that is a function of the coordinate, cross-validated,
    /// 0–1; 0 unless significant.
    pub explained_fraction: f64,
    /// Lower end of the interval with the largest error, in the coordinate's unit.
    pub worst_from: f64,
    /// Upper end of that interval; equal to the lower end for a single pulse of a cycle.
    pub worst_to: f64,
    /// Root mean square of the error in that interval, in y.
    pub worst_rmse: f64,
    /// Mean error y − y_sim in that interval, in y.
    #[serde(skip)]
    pub bias: f64,
    /// Dependence of the error on the coordinate; `None` if it is not significant.
    #[serde(skip)]
    pub dependence: Option<Dependence>,
    /// The smallest interval with three quarters of the unexplained variance.
    #[serde(skip)]
    pub concentration: Option<Interval>,
    /// Trend of the worst error from edge to edge.
    #[serde(skip)]
    pub trend: Option<Trend>,
    /// The table that the picture draws.
    #[serde(skip)]
    pub bins: Vec<FailureBin>,
}

/// An interval of a coordinate with its share of the error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub from: f64,
    /// Upper end.
    pub to: f64,
    /// Share of the unexplained variance in the bin, 0–1.
    pub share: f64,
    /// Share of the samples in the bin, 0–1; for a frequency band, share of the energy of y.
    pub of_samples: f64,
}

/// Where a model fails.
#[derive(Clone, Debug)]
pub struct Failures {
    /// Root mean square error of the free run, in y.
    pub rmse: f64,
    /// Root mean square of the noise, in y.
    pub noise_rmse: f64,
    /// Where the noise level comes from.
    pub noise_source: NoiseSource,
    /// A steady oscillation of the residual that does not follow the command. It is part of the noise level.
    pub oscillation: Option<Oscillation>,
    /// The records of the error.
    pub kind: ErrorKind,
    /// Mean error y − y_sim, in y.
    pub bias: f64,
    /// Whether the error is significantly above the noise.
    pub above_noise: bool,
    /// The coordinates, the largest explained share first.
    pub by: Vec<Where>,
}

impl Failures {
    /// One panel per coordinate for
    /// [`picture::where_it_fails`](crate::picture::where_it_fails).
    #[must_use]
    pub fn views(&self) -> Vec<FailureView<'_>> {
        let view = |found| {
            let found: &Where = found;
            FailureView {
                coordinate: found.coordinate.to_string(),
                unit: found.coordinate.unit(),
                explained_fraction: Some(found.explained_fraction),
                bins: &found.bins,
            }
        };
        self.by.iter().map(view).collect()
    }
}

/// Splits the free-run error of `model` on the validation records (on all records if there are none).
///
/// # Errors
/// A missing channel, or a free run that diverges.
pub fn where_it_fails(model: &Model, records: &[Record]) -> Result<Failures, SimulateError> {
    let held_out: Vec<&Record> = records.iter().filter(|r| r.role == Use::Validate).collect();
    let judged = if held_out.is_empty() {
        records.iter().collect()
    } else {
        held_out
    };
    let runs: Result<Vec<Vec<f64>>, SimulateError> =
        judged.iter().map(|r| model.free_run(r)).collect();
    Ok(examine(&judged, runs?, model.longest_delay()))
}

/// σ² of the noise per record and sample, from `y_sd`, from repeats of the
/// command, or from the scatter of `series` (one per record).
pub(crate) fn noise_floor(
    records: &[&Record],
    series: &[Vec<f64>],
) -> (Vec<Vec<f64>>, NoiseSource) {
    noise::floor(records, series)
}

/// As [`where_it_fails`], with given free runs y_sim per record and the dead time from command to flow in
/// samples.
#[must_use]
pub fn examine(records: &[&Record], simulated: Vec<Vec<f64>>, delay: usize) -> Failures {
    let residual: Vec<Vec<f64>> = records
        .iter()
        .zip(&simulated)
        .map(|(record, run)| record.y.iter().zip(run).map(|(y, sim)| y - sim).collect())
        .collect();
    let period_s = records.first().map_or(1.0, |r| r.sample_period_s);
    let (mut noise, noise_source) = noise::floor(records, &residual);
    let oscillation = oscillation::steady(records, &residual);
    if let (Some(oscillation), NoiseSource::Scatter) = (&oscillation, noise_source) {
        oscillation.join(&mut noise, period_s);
    }
    let lead: Vec<usize> = records.iter().map(|record| record.lead).collect();
    let scored: Vec<&[f64]> = residual
        .iter()
        .zip(&lead)
        .map(|(e, lead)| e.get(*lead..).unwrap_or_default())
        .collect();
    let errors = Errors {
        block: independent_block(&scored),
        residual,
        simulated,
        noise,
        lead,
        period_s,
    };
    let source = Source {
        records,
        simulated: &errors.simulated,
        delay,
    };
    let above_noise = is_above(&errors);
    let excess = errors.excess().max(f64::MIN_POSITIVE);
    let mut by: Vec<Where> = Vec::new();
    let mut cycles: Vec<Where> = Vec::new();
    let all = coordinates(&source);
    let tests: usize = all
        .iter()
        .map(|binned| ways(binned, errors.period_s).len())
        .sum();
    let level = RULES.share_level / tests.max(1) as f64;
    for binned in all {
        let found = along(&errors, &binned, excess, above_noise.then_some(level));
        if found.coordinate.is_cycle() {
            cycles.push(found);
        } else {
            by.push(found);
        }
    }
    by.extend(shortest_cycle(cycles));
    let share = |coordinate: FailureCoordinate| {
        by.iter()
            .find(|w| w.coordinate == coordinate)
            .map_or(0.0, |w| w.explained_fraction)
    };
    let by_time = share(FailureCoordinate::TimeInRecord);
    if share(FailureCoordinate::PulseNumber) <= RULES.pulses_are_a_clock * by_time {
        by.retain(|w| w.coordinate != FailureCoordinate::PulseNumber);
    }
    if above_noise {
        by.extend(spectrum::by_frequency(&errors, excess));
    }
    for found in &mut by {
        found.trend = trend::from_edge_to_edge(&errors, records, found);
    }
    order::descending(&mut by, |one| one.explained_fraction);
    let each = errors.residual.iter().zip(&errors.lead);
    let judged = each.flat_map(|(e, lead)| e.iter().skip(*lead));
    let (n, sum, squares) =
        judged.fold((0.0, 0.0, 0.0), |(n, s, q), e| (n + 1.0, s + e, q + e * e));
    let n = f64::max(n, 1.0);
    Failures {
        rmse: f64::sqrt(squares / n),
        noise_rmse: errors.noise_rmse(),
        noise_source,
        oscillation,
        kind: ErrorKind::of(records.first().map_or(Use::Identify, |record| record.role)),
        bias: sum / n,
        above_noise,
        by,
    }
}

/// Whether Σ e² exceeds Σ σ² significantly and by more than the uncertainty of σ.
fn is_above(errors: &Errors) -> bool {
    let mut blocks = Vec::new();
    let mut noise = 0.0;
    for record in 0..errors.residual.len() {
        let judged = errors.residual[record]
            .iter()
            .zip(&errors.noise[record])
            .skip(errors.lead[record]);
        let excess: Vec<f64> = judged.map(|(e, v)| e * e - v).collect();
        blocks.extend(excess.chunks(errors.block).map(|c| c.iter().sum::<f64>()));
        noise += errors.noise[record]
            .iter()
            .skip(errors.lead[record])
            .sum::<f64>();
    }
    blocks.iter().sum::<f64>() > RULES.least_excess * noise && p_above(&blocks) < RULES.above_level
}

/// The cycle that explains most; its multiples explain equally much and are not preferred.
fn shortest_cycle(cycles: Vec<Where>) -> Option<Where> {
    cycles.into_iter().reduce(|best, next| {
        if next.explained_fraction > RULES.longer_cycle * best.explained_fraction {
            next
        } else {
            best
        }
    })
}

/// Sums over the samples of a bin.
#[derive(Clone, Copy, Default)]
struct Tally {
    count: f64,
    error: f64,
    square: f64,
    noise: f64,
}

impl Tally {
    fn excess(&self) -> f64 {
        self.square - self.noise
    }
    fn density(&self) -> f64 {
        self.excess() / self.count.max(1.0)
    }
    fn plus(&self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            error: self.error + other.error,
            square: self.square + other.square,
            noise: self.noise + other.noise,
        }
    }
    fn rms(&self, sum: f64) -> f64 {
        if self.count > 0.0 {
            (sum / self.count).max(0.0).sqrt()
        } else {
            f64::NAN
        }
    }
}

/// The error along a coordinate; its share at this `level`, if the error is above the noise.
fn along(errors: &Errors, binned: &Binned, excess: f64, level: Option<f64>) -> Where {
    let mut tallies = vec![Tally::default(); binned.ranges.len()];
    let mut samples = 0.0;
    for (record, bins) in binned.bin.iter().enumerate() {
        for (k, bin) in bins.iter().enumerate().skip(errors.lead[record]) {
            samples += 1.0;
            if let Some(bin) = bin {
                let e = errors.residual[record][k];
                let tally = &mut tallies[usize::from(*bin)];
                tally.count += 1.0;
                tally.error += e;
                tally.square += e * e;
                tally.noise += errors.noise[record][k];
            }
        }
    }
    let share = level.and_then(|level| explained(errors, binned, excess, level));
    let bins = binned
        .ranges
        .iter()
        .zip(&tallies)
        .map(|((from, to), tally)| FailureBin {
            from: *from,
            to: *to,
            rmse: tally.rms(tally.square),
            noise_rmse: tally.rms(tally.noise),
        })
        .collect();
    let (first, last, worst) = worst(&tallies, samples, binned.coordinate.is_cycle());
    Where {
        coordinate: binned.coordinate.clone(),
        explained_fraction: share.map_or(0.0, |s| s.fraction),
        worst_from: binned.ranges[first].0,
        worst_to: binned.ranges[last].1,
        worst_rmse: worst.rms(worst.square),
        bias: worst.error / worst.count.max(1.0),
        dependence: share.map(|s| s.dependence),
        concentration: level.and_then(|_| concentration(&tallies, &binned.ranges, excess, samples)),
        trend: None,
        bins,
    }
}

/// The bin with the largest unexplained variance per sample, and its neighbours with at least half of that.
fn worst(tallies: &[Tally], samples: f64, single: bool) -> (usize, usize, Tally) {
    let large = |i: &usize| tallies[*i].count >= RULES.worst_holds * samples;
    let peak = (0..tallies.len())
        .filter(large)
        .max_by(|a, b| tallies[*a].density().total_cmp(&tallies[*b].density()))
        .unwrap_or(0);
    let (mut first, mut last, mut sum) = (peak, peak, tallies[peak]);
    if single || sum.density() <= 0.0 {
        return (first, last, sum);
    }
    let half = RULES.worst_neighbour * sum.density();
    while first > 0 && tallies[first - 1].density() >= half {
        first -= 1;
        sum = sum.plus(&tallies[first]);
    }
    while last + 1 < tallies.len() && tallies[last + 1].density() >= half {
        last += 1;
        sum = sum.plus(&tallies[last]);
    }
    (first, last, sum)
}

/// The interval with the smallest number of samples that contains three quarters of the unexplained variance.
fn concentration(
    tallies: &[Tally],
    ranges: &[(f64, f64)],
    excess: f64,
    samples: f64,
) -> Option<Interval> {
    let mut best: Option<(f64, Interval)> = None;
    for first in 0..tallies.len() {
        let mut sum = Tally::default();
        for (last, tally) in tallies.iter().enumerate().skip(first) {
            sum = sum.plus(tally);
            if sum.excess() >= RULES.concentration * excess {
                if best.as_ref().is_none_or(|(count, _)| sum.count < *count) {
                    let interval = Interval {
                        from: ranges[first].0,
                        to: ranges[last].1,
                        share: (sum.excess() / excess).min(1.0),
                        of_samples: sum.count / samples.max(1.0),
                    };
                    best = Some((sum.count, interval));
                }
                break;
            }
        }
    }
    best.map(|(_, interval)| interval)
}
