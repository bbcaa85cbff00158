//! Standard checks of a model: residual correlations with their 95 % bands, the residual spectrum, step responses, poles,
//! frequency responses.

mod correlation;
mod frequency;
mod response;
mod spectrum;

pub use correlation::{Correlation, correlations};
pub use frequency::{
    Estimate, FrequencyPoint, FrequencyResponse, estimated_response, frequency_response,
};
pub use response::{Pole, StepResponse, poles, step_response};
pub use spectrum::{Spectrum, spectrum};

use crate::data::{Record, Use};

/// Residuals y − ŷ of free runs over the validation records (over all records where none is marked `validate`), with the
/// command of the same samples.
#[derive(Clone, Debug, Default)]
pub struct Residuals {
    /// Sampling period, s.
    pub period_s: f64,
    /// Residual of each record, in the unit of y.
    pub e: Vec<Vec<f64>>,
    /// Command of each record, 0 to 1.
    pub u: Vec<Vec<f64>>,
    /// Measured output of each record.
    pub y: Vec<Vec<f64>>,
    /// Noise variance of a sample, mean over the records, in the unit of y squared; none without `y_sd`.
    pub noise_variance: Option<f64>,
}

impl Residuals {
    /// The residuals of `runs`, one free run for each of `records`; runs of another length are ignored.
    #[must_use]
    pub fn of(records: &[Record], runs: &[Vec<f64>]) -> Self {
        let validate = records.iter().any(|r| r.role == Use::Validate);
        let judged = records
            .iter()
            .zip(runs)
            .filter(|(r, run)| (!validate || r.role == Use::Validate) && run.len() == r.len());
        let mut all = Self::default();
        let (mut variance, mut samples, mut known) = (0.0, 0, true);
        for (record, run) in judged {
            all.period_s = record.sample_period_s;
            all.e
                .push(record.y.iter().zip(run).map(|(y, m)| y - m).collect());
            all.u.push(record.u.clone());
            all.y.push(record.y.clone());
            match &record.y_sd {
                Some(sd) => variance += sd.iter().map(|sd| sd * sd).sum::<f64>(),
                None => known = false,
            }
            samples += record.len();
        }
        all.noise_variance = (known && samples > 0).then(|| variance / samples as f64);
        all
    }
}
