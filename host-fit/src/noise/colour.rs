//! Noise colour: white noise plus first-order coloured noise, with its whitening filter.

/// ε = w + v: w white, v first-order autoregressive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Share of v in the variance of a sample, from 0 to 1.
    pub share: f64,
    /// Correlation of v from sample to sample, from 0 to below 1.
    pub pole: f64,
}

/// The whitening filter of one record.
#[derive(Clone, Debug)]
pub struct Filter {
    /// Reciprocal standard deviation of each sample.
    weights: Vec<f64>,
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
        let white = 1.0 - self.share;
        let driven = self.share * (1.0 - self.pole * self.pole);
        let (mut gains, mut roots) = (Vec::new(), Vec::new());
        let mut log_determinant = 0.0;
        // Variance of the prediction of v.
        let mut predicted = self.share;
        while gains.len() < variance.len() {
            let innovation = (predicted + white).max(f64::MIN_POSITIVE);
            let gain = predicted / innovation;
            let still = gains
                .last()
                .is_some_and(|last: &f64| (last - gain).abs() < STILL);
            gains.push(gain);
            roots.push(innovation.sqrt().recip());
            log_determinant += innovation.ln();
            if still {
                log_determinant += (variance.len() - gains.len()) as f64 * innovation.ln();
                break;
            }
            predicted = self.pole * self.pole * predicted * (1.0 - gain) + driven;
        }
        log_determinant += variance.iter().map(|v| v.ln()).sum::<f64>();
        Filter {
            weights: variance.iter().map(|v| v.sqrt().recip()).collect(),
            gains,
            roots,
            pole: self.pole,
            log_determinant,
        }
    }
}

impl Filter {
    /// Whitens a series of the record: white noise of variance 1.
    #[must_use]
    pub fn whiten(&self, series: &[f64]) -> Vec<f64> {
        let (mut gains, mut roots) = (self.gains.iter(), self.roots.iter());
        let (mut gain, mut root, mut prediction) = (0.0, 1.0, 0.0);
        let each = series.iter().zip(&self.weights).map(|(x, weight)| {
            // The steady-state values are used from here on.
            gain = *gains.next().unwrap_or(&gain);
            root = *roots.next().unwrap_or(&root);
            let innovation = x * weight - prediction;
            prediction = self.pole * (prediction + gain * innovation);
            innovation * root
        });
        each.collect()
    }

    /// ln det of the covariance of ε.
    pub(super) fn log_determinant(&self) -> f64 {
        self.log_determinant
    }
}
