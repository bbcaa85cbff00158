//! The noise model that all likelihoods use.
//!
//! The error of record g is r_g = b_g·1 + d_g·t + a_g·f_g + ε_g (theory 4.4), with f_g the free run of the model.
//! Offset b, drift d and level a are Gaussian random effects per record, marginalised by Woodbury's identity of rank 3:
//! errors along them are weighted by the record-to-record scatter, other errors in full. ε is white noise plus
//! first-order coloured noise, proportional to the standard errors of the samples. A scalar Kalman filter whitens it;
//! the filter is linear, so errors and derivatives are whitened in the same way.

mod colour;
mod estimate;
mod white;

pub use colour::{Colour, Filter};
pub(crate) use white::{white_noise, without_outliers};

use numerics::linalg::{dot, dots};

/// Random effects of a record: offset, drift, level.
const EFFECTS: usize = 3;

/// The error of one record with its noise variances.
#[derive(Clone, Debug)]
pub struct Series {
    /// Measurement minus model, y.
    pub residual: Vec<f64>,
    /// Variance of the measurement noise per sample, y²; as many values, all above 0.
    pub variance: Vec<f64>,
    /// Free run of the model, to which the level's random effect is proportional, y. The measurement is not
    /// suitable, because it contains the noise, which the effect would then absorb.
    pub run: Vec<f64>,
}

/// The noise model of a set of records.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseModel {
    /// Variance of ε relative to the samples' variances; at least 1 where standard errors are measured.
    pub scale: f64,
    /// The spectrum of ε.
    pub colour: Colour,
    /// Variance of the record-to-record offset, y².
    pub offset: f64,
    /// Variance of the drift from a record's start to its end, y².
    pub drift: f64,
    /// Variance of the relative level of a record.
    pub level: f64,
}

impl NoiseModel {
    /// Number of parameters: scale, share and correlation time of the colour, and the random effects.
    pub const PARAMETERS: usize = 3 + EFFECTS;

    /// The metric of a record with these sample variances (all above 0) and this free run.
    #[must_use]
    pub fn metric(&self, variance: &[f64], run: &[f64]) -> Metric {
        let filter = self.colour.filter(variance);
        let [offset, drift] = offset_and_drift(run.len());
        let effects = filter.whiten_all([&offset, &drift, run]);
        let variances = [self.offset, self.drift, self.level].map(|v| v / self.scale);
        let (factor, log_determinant) = woodbury(&effects, variances);
        let samples = variance.len() as f64;
        Metric {
            log_determinant: samples * self.scale.ln() + filter.log_determinant() + log_determinant,
            scale: self.scale,
            filter,
            effects,
            factor,
        }
    }

    /// Log-likelihood of these errors, without the constant −½·n·ln 2π.
    #[must_use]
    pub fn log_likelihood(&self, errors: &[Series]) -> f64 {
        let each = errors.iter().map(|error| {
            let metric = self.metric(&error.variance, &error.run);
            metric.log_likelihood(&error.residual)
        });
        each.sum()
    }
}

/// Offset and drift of a record of `n` samples.
fn offset_and_drift(n: usize) -> [Vec<f64>; 2] {
    let last = n.saturating_sub(1).max(1) as f64;
    [
        vec![1.0; n],
        (0..n).map(|k| k as f64 / last - 0.5).collect(),
    ]
}

/// L with L·Lᵀ = D^½ (1 + D^½ ZᵀZ D^½)⁻¹ D^½ for whitened effects Z of variances D, and ln det(1 + D^½ ZᵀZ D^½).
fn woodbury(
    effects: &[Vec<f64>; EFFECTS],
    variances: [f64; EFFECTS],
) -> ([[f64; EFFECTS]; EFFECTS], f64) {
    let gram: [[f64; EFFECTS]; EFFECTS] =
        std::array::from_fn(|i| std::array::from_fn(|j| dot(&effects[i], &effects[j])));
    woodbury_of(&gram, variances)
}

/// Woodbury's factor from ZᵀZ, column by column: with C·Cᵀ = 1 + D^½ ZᵀZ D^½, L = D^½ C⁻ᵀ.
#[allow(clippy::needless_range_loop, reason = "indices as in the equations")]
fn woodbury_of(
    gram: &[[f64; EFFECTS]; EFFECTS],
    variances: [f64; EFFECTS],
) -> ([[f64; EFFECTS]; EFFECTS], f64) {
    let deviation = variances.map(|v| v.max(0.0).sqrt());
    let mut lower = [[0.0; EFFECTS]; EFFECTS];
    let mut log_determinant = 0.0;
    for i in 0..EFFECTS {
        for j in 0..=i {
            let unit = if i == j { 1.0 } else { 0.0 };
            let mut rest = unit + deviation[i] * gram[i][j] * deviation[j];
            for k in 0..j {
                rest -= lower[i][k] * lower[j][k];
            }
            lower[i][j] = if i == j {
                rest.max(f64::MIN_POSITIVE).sqrt()
            } else {
                rest / lower[j][j]
            };
        }
        log_determinant += 2.0 * lower[i][i].ln();
    }
    // The columns of C⁻¹; L = D^½ C⁻ᵀ is the scaled transpose.
    let mut factor = [[0.0; EFFECTS]; EFFECTS];
    for column in 0..EFFECTS {
        let solved = &mut factor[column];
        for i in column..EFFECTS {
            let mut rest = if i == column { 1.0 } else { 0.0 };
            for k in column..i {
                rest -= lower[i][k] * solved[k];
            }
            solved[i] = rest / lower[i][i];
        }
        for value in solved {
            *value *= deviation[column];
        }
    }
    (factor, log_determinant)
}

/// The inverse noise covariance of one record, as a metric for its errors.
#[derive(Clone, Debug)]
pub struct Metric {
    filter: Filter,
    effects: [Vec<f64>; EFFECTS],
    /// L of the random effects, see [`woodbury_of`].
    factor: [[f64; EFFECTS]; EFFECTS],
    scale: f64,
    /// ln det of the covariance.
    log_determinant: f64,
}

/// An error or a derivative, whitened with this metric.
#[derive(Clone, Debug)]
pub struct Whitened {
    /// The whitened series, unit variance per sample.
    series: Vec<f64>,
    /// Components of the whitened series along the random effects.
    along: [f64; EFFECTS],
}

impl Metric {
    /// A series of the record, whitened with this metric.
    #[must_use]
    pub fn whiten(&self, series: &[f64]) -> Whitened {
        let root = self.scale.sqrt();
        let whitened: Vec<f64> = self
            .filter
            .whiten(series)
            .iter()
            .map(|x| x / root)
            .collect();
        let products: [f64; EFFECTS] = std::array::from_fn(|i| dot(&self.effects[i], &whitened));
        let along = std::array::from_fn(|j| {
            (0..EFFECTS)
                .map(|i| self.factor[i][j] * products[i])
                .sum::<f64>()
        });
        Whitened {
            series: whitened,
            along,
        }
    }

    /// Log-likelihood of an error, without the constant −½·n·ln 2π.
    #[must_use]
    pub fn log_likelihood(&self, residual: &[f64]) -> f64 {
        let whitened = self.whiten(residual);
        -0.5 * (whitened.dot(&whitened) + self.log_determinant)
    }
}

impl Whitened {
    /// The inner product xᵀ Σ⁻¹ y.
    #[must_use]
    pub fn dot(&self, other: &Self) -> f64 {
        dot(&self.series, &other.series) - self.along(other)
    }

    /// [`dot`](Self::dot) with each of `others`.
    pub(crate) fn dots(&self, others: &[Self]) -> Vec<f64> {
        let products = dots(&self.series, others.iter().map(|other| &*other.series));
        let each = products.into_iter().zip(others);
        each.map(|(product, other)| product - self.along(other))
            .collect()
    }

    fn along(&self, other: &Self) -> f64 {
        (0..EFFECTS).map(|i| self.along[i] * other.along[i]).sum()
    }
}

#[cfg(test)]
mod tests;
