//! Noise colour: white noise plus first-order coloured noise, with its whitening filter.

use std::sync::Arc;

/// ε = w + v: w white, v first-order autoregressive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Share of v in the variance of a sample, from 0 to 1.
    pub share: f64,
    /// Correlation of v from sample to sample, from 0 to below 1.
    pub pole: f64,
}

/// The standard deviations of a record's samples, which are the same for every colour.
#[derive(Clone, Debug)]
pub(super) struct Deviations {
    /// Reciprocal standard deviation of each sample.
    weights: Arc<[f64]>,
    /// Sum of the logarithms of the variances.
    log_determinant: f64,
}

impl Deviations {
    /// The standard deviations of samples with these variances, all above 0.
    pub(super) fn of(variance: &[f64]) -> Self {
        Self {
            weights: variance.iter().map(|v| v.sqrt().recip()).collect(),
            log_determinant: variance.iter().map(|v| v.ln()).sum(),
        }
    }
}

/// The whitening filter of one record.
#[derive(Clone, Debug)]
pub struct Filter {
    deviations: Deviations,
    /// Gain of the one-step predictor per sample, up to its steady state.
    gains: Vec<f64>,
    /// Reciprocal standard deviation of each innovation, up to the steady state.
    roots: Vec<f64>,
    pole: f64,
    log_determinant: f64,
}

/// The predictor is in steady state when its gain changes by less than this; the rest is below double
/// precision.
const STILL: f64 = 1e-14;

impl Colour {
    /// White noise.
    pub const WHITE: Self = Self {
        share: 0.0,
        pole: 0.0,
    };

    /// The filter for a record whose samples have these variances, all above 0.
    #[must_use]
    pub fn filter(&self, variance: &[f64]) -> Filter {
        self.filter_of(&Deviations::of(variance))
    }

    pub(super) fn filter_of(&self, deviations: &Deviations) -> Filter {
        let samples = deviations.weights.len();
        let white = 1.0 - self.share;
        let driven = self.share * (1.0 - self.pole * self.pole);
        let (mut gains, mut roots) = (Vec::new(), Vec::new());
        let mut log_determinant = 0.0;
        // Variance of the prediction of v.
        let mut predicted = self.share;
        while gains.len() < samples {
            let innovation = (predicted + white).max(f64::MIN_POSITIVE);
            let gain = predicted / innovation;
            let still = gains
                .last()
                .is_some_and(|last: &f64| (last - gain).abs() < STILL);
            gains.push(gain);
            roots.push(innovation.sqrt().recip());
            log_determinant += innovation.ln();
            if still {
                log_determinant += (samples - gains.len()) as f64 * innovation.ln();
                break;
            }
            predicted = self.pole * self.pole * predicted * (1.0 - gain) + driven;
        }
        Filter {
            deviations: deviations.clone(),
            gains,
            roots,
            pole: self.pole,
            log_determinant: log_determinant + deviations.log_determinant,
        }
    }
}

impl Filter {
    /// Whitens a series of the record: white noise of variance 1.
    #[must_use]
    pub fn whiten(&self, series: &[f64]) -> Vec<f64> {
        let [whitened] = self.whiten_all([series]);
        whitened
    }

    /// Whitens series of equal length side by side, so that one recursion does not wait for another.
    pub(super) fn whiten_all<const N: usize>(&self, series: [&[f64]; N]) -> [Vec<f64>; N] {
        let shortest = series.iter().map(|series| series.len()).min().unwrap_or(0);
        let samples = shortest.min(self.deviations.weights.len());
        let series = series.map(|series| &series[..samples]);
        let mut whitened: [Vec<f64>; N] = std::array::from_fn(|_| vec![0.0; samples]);
        let out = whitened.each_mut().map(Vec::as_mut_slice);
        let (mut gains, mut roots) = (self.gains.iter(), self.roots.iter());
        let (mut gain, mut root, mut prediction) = (0.0, 1.0, [0.0; N]);
        for (k, weight) in self.deviations.weights[..samples].iter().enumerate() {
            // The steady-state values are used from here on.
            gain = *gains.next().unwrap_or(&gain);
            root = *roots.next().unwrap_or(&root);
            for lane in 0..N {
                let innovation = series[lane][k] * weight - prediction[lane];
                prediction[lane] = self.pole * (prediction[lane] + gain * innovation);
                out[lane][k] = innovation * root;
            }
        }
        whitened
    }

    /// ln det of the covariance of ε.
    pub(super) fn log_determinant(&self) -> f64 {
        self.log_determinant
    }
}
