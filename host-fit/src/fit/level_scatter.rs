//! Scatter of the level between repeats. Operating conditions never repeat exactly, and an average over repeats
//! keeps part of that scatter throughout its record.
//!
//! Standard errors that grow with y reveal it: σ² = A + B·y². Noise that is stronger at a high level gives the same
//! B in every record, because each record has many independent samples of it. Scatter between repeats has only as
//! many samples as there are repeats, so B varies from record to record.
//!
//! The error of a record is then g·y + noise with one random g. Generalised least squares weights the
//! component along y by the scatter's variance: that component of errors and derivatives is shrunk before
//! sums of squares are formed.

use super::rules::RULES;
use crate::data::Record;
use numerics::linalg::dot;

/// The relative scatter of a record's level, and the remaining noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelScatter {
    /// √B: relative standard deviation of a record's level.
    pub deviation: f64,
    /// A: variance of the remaining noise, y².
    noise: f64,
}

impl LevelScatter {
    /// Estimated from the standard errors of `records`; `None` if the level does not scatter or the records do not
    /// show it.
    #[must_use]
    pub fn of(records: &[Record]) -> Option<Self> {
        let each: Option<Vec<Growth>> = records.iter().map(Growth::of).collect();
        let each = each.filter(|each| each.len() >= RULES.records_of_scatter)?;
        let n = each.len() as f64;
        let mean = |of: &dyn Fn(&Growth) -> f64| each.iter().map(of).sum::<f64>() / n;
        let b = mean(&|record| record.b);
        let variance = mean(&|record| (record.b - b).powi(2)) * n / (n - 1.0);
        let share = mean(&|record| record.share);
        let scatters =
            share > RULES.share_of_scatter && variance.sqrt() > RULES.scatter_differs * b;
        scatters.then(|| Self {
            deviation: b.sqrt(),
            noise: mean(&|record| record.variance) * (1.0 - share).max(RULES.noise_beside_scatter),
        })
    }

    /// The part of the energy along y that is not counted, when the sum of squares of y is `square` over
    /// means of `stride` samples.
    fn left_out(&self, square: f64, stride: usize) -> f64 {
        let scatter = self.deviation * self.deviation * square * stride as f64;
        scatter / (scatter + RULES.correlated * self.noise)
    }

    /// The sum of squares of an error with energy `squares` and inner product `product` with a y of energy
    /// `square`.
    pub(crate) fn sum_of_squares(&self, squares: f64, product: f64, square: f64) -> f64 {
        if square > 0.0 {
            squares - self.left_out(square, 1) * product * product / square
        } else {
            squares
        }
    }

    /// Shrinks the component of `series` along `y`, both as means over `stride` samples.
    pub(crate) fn shrink(&self, series: &mut [f64], y: &[f64], stride: usize) {
        let square = dot(y, y);
        if square > 0.0 {
            let kept = (1.0 - self.left_out(square, stride)).sqrt();
            let along = (1.0 - kept) * dot(series, y) / square;
            for (x, y) in series.iter_mut().zip(y) {
                *x -= along * y;
            }
        }
    }

    /// Subtracts the scatter of the level from the variances of a record, leaving at least a small share of
    /// each.
    pub(crate) fn take_from(&self, variances: &mut [f64], y: &[f64]) {
        for (variance, y) in variances.iter_mut().zip(y) {
            let rest = *variance - (self.deviation * y).powi(2);
            *variance = rest.max(RULES.noise_beside_scatter * *variance);
        }
    }
}

/// Growth of one record's standard error with y, by least squares.
struct Growth {
    /// Mean σ².
    variance: f64,
    b: f64,
    /// The share of B·y² in σ².
    share: f64,
}

impl Growth {
    /// `None` without standard errors, or if y is constant.
    fn of(record: &Record) -> Option<Self> {
        let (n, sd) = (record.len() as f64, record.y_sd.as_ref()?);
        let variances: Vec<f64> = sd.iter().map(|sd| sd * sd).collect();
        let squares: Vec<f64> = record.y.iter().map(|y| y * y).collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
        let (variance, square) = (mean(&variances), mean(&squares));
        let spread = dot(&squares, &squares) - n * square * square;
        let b = (dot(&squares, &variances) - n * square * variance) / spread;
        let share = b * square / variance;
        (b.is_finite() && share.is_finite()).then_some(Self { variance, b, share })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Averages over 20 repeats with coloured noise; in some records the level scatters between repeats, in
    /// others the noise is stronger at high y.
    fn records(scatter: f64, louder: f64) -> Vec<Record> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = move || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
        let (repeats, samples) = (20, 3000);
        let mut record = |index: usize| {
            let truth: Vec<f64> = (0..samples)
                .map(|k| f64::from((k / 250) % 2 == 0))
                .collect();
            let mut readings = vec![Vec::new(); samples];
            for _ in 0..repeats {
                let level = 1.0 + scatter * normal();
                let mut slow = 0.0;
                for (readings, y) in readings.iter_mut().zip(&truth) {
                    slow = 0.9 * slow + 0.01 * normal();
                    readings.push(level * y + slow * (1.0 + louder * y));
                }
            }
            let n = f64::from(repeats);
            let mean = |values: &Vec<f64>| values.iter().sum::<f64>() / n;
            let error = |values: &Vec<f64>| {
                let mean = mean(values);
                let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
                (squares / (n - 1.0) / n).sqrt()
            };
            let y = readings.iter().map(mean).collect();
            let own = Record::new(
                &index.to_string(),
                Use::Identify,
                0.001,
                vec![0.0; samples],
                y,
            );
            Record {
                y_sd: Some(readings.iter().map(error).collect()),
                ..own
            }
        };
        (0..8).map(&mut record).collect()
    }

    #[test]
    fn scatter_of_the_level_is_told_from_noise_that_is_louder_there() {
        let found = LevelScatter::of(&records(0.04, 0.0)).expect("scatter");
        let stated = 0.04 / 20.0_f64.sqrt();
        let ratio = found.deviation / stated;
        assert!((ratio - 1.0).abs() < 0.3, "{found:?} for {stated}");
        assert_eq!(LevelScatter::of(&records(0.0, 1.0)), None);
        assert_eq!(LevelScatter::of(&records(0.0, 0.0)), None);
    }

    /// The component along y loses the explained part, the orthogonal one is unchanged, and products and
    /// shrunk series give the same sum of squares.
    #[test]
    fn only_what_lies_along_y_is_shrunk() {
        let y: Vec<f64> = (0..400).map(|k| f64::from(k % 2)).collect();
        let across: Vec<f64> = (0..400).map(|k| f64::from((k + 1) % 2)).collect();
        let scatter = LevelScatter {
            deviation: 0.01,
            noise: 1e-4 * 200.0 / RULES.correlated,
        };
        let series: Vec<f64> = y.iter().zip(&across).map(|(a, b)| 3.0 * a + b).collect();
        let mut shrunk = series.clone();
        scatter.shrink(&mut shrunk, &y, 1);
        // Scatter and noise have equal weights: half of the energy remains.
        assert!((shrunk[1] - 3.0 * 0.5_f64.sqrt()).abs() < 1e-12);
        assert!((shrunk[0] - 1.0).abs() < 1e-12);
        let sum = scatter.sum_of_squares(dot(&series, &series), dot(&series, &y), dot(&y, &y));
        assert!((sum - dot(&shrunk, &shrunk)).abs() < 1e-9);
    }
}
