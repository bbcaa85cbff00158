//! Share of the error that is a function of a coordinate, by cross-validation.

use super::binned::{Binned, Folds};
use super::correlation::student;
use super::rules::RULES;
use numerics::linalg::dot;
use std::collections::BTreeMap;

/// The error of a free run, record by record, with the variance of the noise.
pub(super) struct Errors {
    /// y − y_sim.
    pub(super) residual: Vec<Vec<f64>>,
    /// y_sim.
    pub(super) simulated: Vec<Vec<f64>>,
    /// σ² of the noise.
    pub(super) noise: Vec<Vec<f64>>,
    /// Number of unscored samples at the start of each record.
    pub(super) lead: Vec<usize>,
    pub(super) period_s: f64,
    /// Length of blocks whose errors count as independent, samples.
    pub(super) block: usize,
}

/// How the error depends on a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dependence {
    /// The mean error depends on the coordinate.
    Mean,
    /// The ratio of error to y depends on the coordinate.
    Proportion,
    /// The mean error depends on the coordinate and on the dwell before the edge.
    Dwell,
    /// The size of the error depends on the coordinate, but not the sign.
    Size,
}

/// A cross-validated share of the unexplained variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Share {
    pub(super) fraction: f64,
    pub(super) dependence: Dependence,
}

/// A validation sample.
struct JudgedSample {
    fold: usize,
    block: usize,
    bin: Option<usize>,
    residual: f64,
    /// Covariates of the error: y_sim, and ln(dwell before the edge).
    covariates: [f64; 2],
    excess: f64,
}

impl Errors {
    /// Σ (e² − σ²).
    pub(super) fn excess(&self) -> f64 {
        let each = self.residual.iter().zip(&self.noise).zip(&self.lead);
        each.map(|((e, noise), lead)| {
            let (e, noise) = (
                e.get(*lead..).unwrap_or(&[]),
                noise.get(*lead..).unwrap_or(&[]),
            );
            dot(e, e) - noise.iter().sum::<f64>()
        })
        .sum()
    }

    fn samples(&self, binned: &Binned) -> Vec<JudgedSample> {
        let block = self.block;
        let mut samples = Vec::new();
        let mut blocks = 0;
        for record in 0..self.residual.len() {
            let length = self.residual[record].len();
            for k in self.lead[record]..length {
                let of_record = k / block;
                let residual = self.residual[record][k];
                samples.push(JudgedSample {
                    fold: match binned.folds {
                        Folds::Blocks => (of_record + record) % RULES.turns,
                        Folds::Records => record,
                    },
                    block: blocks + of_record,
                    bin: binned.bin[record][k].map(usize::from),
                    residual,
                    covariates: [
                        self.simulated[record][k],
                        binned.dwell.as_ref().map_or(0.0, |d| d[record][k]),
                    ],
                    excess: residual * residual - self.noise[record][k],
                });
            }
            blocks += length / block + 1;
        }
        samples
    }
}

/// Moments of the training samples.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: f64,
    e: f64,
    y: f64,
    e_y: f64,
    y_y: f64,
    excess: f64,
}

impl Moments {
    fn add(&mut self, sample: &JudgedSample, covariate: usize) {
        let y = sample.covariates[covariate];
        self.count += 1.0;
        self.e += sample.residual;
        self.y += y;
        self.e_y += sample.residual * y;
        self.y_y += y * y;
        self.excess += sample.excess;
    }

    fn with(&self, other: &Self, sign: f64) -> Self {
        Self {
            count: self.count + sign * other.count,
            e: self.e + sign * other.e,
            y: self.y + sign * other.y,
            e_y: self.e_y + sign * other.e_y,
            y_y: self.y_y + sign * other.y_y,
            excess: self.excess + sign * other.excess,
        }
    }

    fn mean(&self) -> f64 {
        if self.count < RULES.fewest_of_bin as f64 {
            return 0.0;
        }
        self.e / self.count
    }

    /// Offset and slope of e over the covariate.
    fn line(&self) -> (f64, f64) {
        if self.count < RULES.fewest_of_bin as f64 {
            return (0.0, 0.0);
        }
        let spread = self.y_y - self.y * self.y / self.count;
        if spread <= 1e-6 * self.y_y {
            return (self.mean(), 0.0);
        }
        let slope = (self.e_y - self.e * self.y / self.count) / spread;
        ((self.e - slope * self.y) / self.count, slope)
    }
}

/// The ways in which the error may depend on a coordinate.
pub(super) fn ways(binned: &Binned, period_s: f64) -> Vec<Dependence> {
    let is_slow = binned.coordinate.is_slow(period_s);
    let with_dwell = binned.dwell.is_some();
    [Dependence::Mean, Dependence::Size]
        .into_iter()
        .chain(is_slow.then_some(Dependence::Proportion))
        .chain(with_dwell.then_some(Dependence::Dwell))
        .collect()
}

/// The share of the unexplained variance that is a function of the coordinate; none if its p-value is not below `level`.
pub(super) fn explained(
    errors: &Errors,
    binned: &Binned,
    excess: f64,
    level: f64,
) -> Option<Share> {
    let samples = errors.samples(binned);
    let gains = |covariate: usize| gains(&samples, binned, excess, level, covariate);
    let by_y = gains(0)?;
    let mut best: Option<Share> = None;
    for dependence in ways(binned, errors.period_s) {
        let gain = match dependence {
            Dependence::Mean => by_y[0],
            Dependence::Proportion => by_y[1],
            Dependence::Size => by_y[2],
            Dependence::Dwell => gains(1)?[1],
        };
        let fraction = gain / excess;
        if fraction > best.map_or(0.0, |b| b.fraction) {
            best = Some(Share {
                fraction: fraction.min(1.0),
                dependence,
            });
        }
    }
    best
}

/// Reduction of the error energy by the coordinate: by bin means, by a line in the covariate per bin, by
/// size.
fn gains(
    samples: &[JudgedSample],
    binned: &Binned,
    excess: f64,
    level: f64,
    covariate: usize,
) -> Option<[f64; 3]> {
    let folds = samples.iter().map(|s| s.fold + 1).max()?;
    let bins = binned.ranges.len();
    let mut by_bin = vec![vec![Moments::default(); bins]; folds];
    let mut overall = vec![Moments::default(); folds];
    for sample in samples {
        overall[sample.fold].add(sample, covariate);
        if let Some(bin) = sample.bin {
            by_bin[sample.fold][bin].add(sample, covariate);
        }
    }
    let sum = |of: &dyn Fn(usize) -> Moments| {
        (0..folds).fold(Moments::default(), |sum, fold| sum.with(&of(fold), 1.0))
    };
    let every = sum(&|fold| overall[fold]);
    let every_bin: Vec<Moments> = (0..bins).map(|b| sum(&|fold| by_bin[fold][b])).collect();
    let learned: Vec<Learned> = (0..folds)
        .map(|fold| Learned::new(&every, &overall[fold], &every_bin, &by_bin[fold]))
        .collect();
    let blocks = samples.iter().map(|s| s.block + 1).max()?;
    let mut gains = [vec![0.0; blocks], vec![0.0; blocks], vec![0.0; blocks]];
    let density = excess / every.count.max(1.0);
    for sample in samples {
        let each = learned[sample.fold].gains(sample, covariate, density);
        for (gains, gain) in gains.iter_mut().zip(each) {
            gains[sample.block] += gain;
        }
    }
    Some(match binned.folds {
        Folds::Blocks => gains.map(|gains| beyond_chance(&gains, level)),
        // A single event per record has no reproducible mean; the evidence is that it occurs at the same
        // place in most records.
        Folds::Records => {
            let mut of_record = vec![[0.0; 3]; folds];
            let fold_of_block: BTreeMap<usize, usize> =
                samples.iter().map(|s| (s.block, s.fold)).collect();
            for (block, fold) in fold_of_block {
                for (sum, gains) in of_record[fold].iter_mut().zip(&gains) {
                    *sum += gains[block];
                }
            }
            [0, 1, 2].map(|way| {
                let agreeing = of_record.iter().filter(|record| record[way] > 0.0).count();
                if agreeing as f64 >= RULES.agreeing_records * folds as f64 {
                    beyond_chance(&gains[way], RULES.record_level)
                } else {
                    0.0
                }
            })
        }
    })
}

/// The sum over independent blocks; 0 if the p-value of a sum above 0, by Student's t, is not below `level`. The standard
/// deviation is that of all blocks: most blocks gain nothing, so a robust one would be too small.
pub(super) fn beyond_chance(gains: &[f64], level: f64) -> f64 {
    let n = gains.len() as f64;
    let sum: f64 = gains.iter().sum();
    let squares: f64 = gains.iter().map(|gain| (gain - sum / n).powi(2)).sum();
    let degrees = (n - 1.0).max(1.0);
    let error = (squares / degrees / n).sqrt();
    match student(sum / n, error, degrees) < level {
        true => sum,
        false => 0.0,
    }
}

/// Bin statistics of the training folds.
struct Learned {
    mean: f64,
    line: (f64, f64),
    means: Vec<f64>,
    lines: Vec<(f64, f64)>,
    /// Bins that contain a larger share of the error energy than of the samples.
    rich: Vec<bool>,
}

impl Learned {
    fn new(every: &Moments, own: &Moments, bins: &[Moments], own_bins: &[Moments]) -> Self {
        let rest = every.with(own, -1.0);
        let each: Vec<Moments> = bins
            .iter()
            .zip(own_bins)
            .map(|(all, own)| all.with(own, -1.0))
            .collect();
        let density = rest.excess / rest.count.max(1.0);
        Self {
            mean: rest.mean(),
            line: rest.line(),
            means: each.iter().map(Moments::mean).collect(),
            lines: each.iter().map(Moments::line).collect(),
            rich: each
                .iter()
                .map(|m| m.count >= RULES.fewest_of_bin as f64 && m.excess > density * m.count)
                .collect(),
        }
    }

    /// Reduction of a sample's squared error by knowing its bin: by bin mean, by a line in the covariate, by
    /// size.
    fn gains(&self, sample: &JudgedSample, covariate: usize, density: f64) -> [f64; 3] {
        let Some(bin) = sample.bin else {
            return [0.0; 3];
        };
        let e = sample.residual;
        let y = sample.covariates[covariate];
        let square = |x: f64| x * x;
        let line = |(offset, slope): (f64, f64)| square(e - offset - slope * y);
        [
            square(e - self.mean) - square(e - self.means[bin]),
            line(self.line) - line(self.lines[bin]),
            if self.rich[bin] {
                sample.excess - density
            } else {
                0.0
            },
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum of 2.7 standard errors has a p-value of 0.0035 by the normal distribution, and of 0.012 by Student's for ten
    /// blocks.
    #[test]
    fn few_blocks_have_to_say_more() {
        // The sum is 2.7 standard errors above 0 for every n.
        let gains = |n: usize| -> Vec<f64> {
            let apart = (n as f64 - 1.0).sqrt() / 2.7;
            (0..n)
                .map(|k| if k % 2 == 0 { 1.0 + apart } else { 1.0 - apart })
                .collect()
        };
        assert_eq!(beyond_chance(&gains(10), 0.006), 0.0);
        assert!((beyond_chance(&gains(400), 0.006) - 400.0).abs() < 1e-9);
        assert!(beyond_chance(&gains(10), 0.03) > 0.0);
    }

    /// Three large errors that happen to lie in one bin: every other block gains nothing, and the sum is 1.7 standard
    /// errors above 0.
    #[test]
    fn a_few_outliers_are_no_dependence() {
        let mut gains = vec![0.0; 100];
        gains[10] = 5.0;
        gains[40] = 4.0;
        gains[70] = 6.0;
        assert_eq!(beyond_chance(&gains, 0.006), 0.0);
    }
}
