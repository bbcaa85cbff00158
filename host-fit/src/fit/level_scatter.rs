//! Scatter of the level between repeats: the tunnel's speed never comes back exactly, and a mean over repeats
//! keeps a share of that all through its record.
//!
//! A standard error that grows with y says that it is there, σ² = A + B·y². Noise that is only louder at a high level
//! says so too, but equally in every record, as each has many independent samples of it; of what is drawn once
//! a repeat a record has no more samples than repeats, and B differs from record to record.
//!
//! The error of a record is then g·y + noise with g drawn once. Generalised least squares weighs what lies along y by
//! what it scatters: that part of errors and derivatives is shrunk, and sums of squares are taken of the rest as ever.

use super::rules::RULES;
use crate::data::Record;
use crate::linalg::dot;

/// How the level of a record scatters, and the noise beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelScatter {
    /// √B: standard deviation of a record's level, relative to itself.
    pub deviation: f64,
    /// A: variance of the noise beside it, y².
    noise: f64,
}

impl LevelScatter {
    /// What the standard errors of `records` say; none where the level does not scatter, or nobody knows.
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

    /// What of the energy along y is left out, when its sum of squares is `square` of means over `stride` samples.
    fn left_out(&self, square: f64, stride: usize) -> f64 {
        let scatter = self.deviation * self.deviation * square * stride as f64;
        scatter / (scatter + RULES.correlated * self.noise)
    }

    /// The sum of squares of an error with `squares` and with `product` with a y of `square`.
    pub(crate) fn sum_of_squares(&self, squares: f64, product: f64, square: f64) -> f64 {
        if square > 0.0 {
            squares - self.left_out(square, 1) * product * product / square
        } else {
            squares
        }
    }

    /// Shrinks what of `series` lies along `y`, both of them means over `stride` samples.
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

    /// Takes from the variances of a record what its level scatters by, leaving at least a small share of each.
    pub(crate) fn take_from(&self, variances: &mut [f64], y: &[f64]) {
        for (variance, y) in variances.iter_mut().zip(y) {
            let rest = *variance - (self.deviation * y).powi(2);
            *variance = rest.max(RULES.noise_beside_scatter * *variance);
        }
    }
}

/// How the standard error of one record grows with y, by least squares.
struct Growth {
    /// Mean σ².
    variance: f64,
    b: f64,
    /// The share of σ² that B·y² is.
    share: f64,
}

impl Growth {
    /// `None` without standard errors, or where y does not move.
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

    /// Means of 20 repeats with coloured noise; in some the level scatters from repeat to repeat, in others
    /// the noise is louder where y is high.
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

    /// What lies along y loses what scatter explains of it, what lies across stays; and the sum of squares is the same
    /// from products as from the shrunk series.
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
        // Scatter and noise weigh the same there: half of the energy stays.
        assert!((shrunk[1] - 3.0 * 0.5_f64.sqrt()).abs() < 1e-12);
        assert!((shrunk[0] - 1.0).abs() < 1e-12);
        let sum = scatter.sum_of_squares(dot(&series, &series), dot(&series, &y), dot(&y, &y));
        assert!((sum - dot(&shrunk, &shrunk)).abs() < 1e-9);
    }
}
