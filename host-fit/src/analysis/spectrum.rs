//! Power spectral density of residuals.

use super::Residuals;
use numerics::fourier::{Complex, Fourier};
use std::f64::consts::TAU;

/// One-sided power spectral densities, in the unit of y squared per Hz. Their integrals over frequency are mean squares.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrum {
    /// Frequencies, Hz.
    pub hz: Vec<f64>,
    /// Spectrum of the residual y − ŷ.
    pub residual: Vec<f64>,
    /// Spectrum of the measured output about its mean.
    pub output: Vec<f64>,
    /// Spectrum of white noise with the standard error `y_sd`; `None` without `y_sd`.
    pub noise: Option<f64>,
}

/// Longest segment, samples.
const LONGEST: usize = 4096;

/// Segments of records for Welch's estimates: a quarter of the shortest record (at most 4096 samples), half
/// overlapping, Hann window.
pub(super) struct Segments {
    /// Length of a segment, samples; a power of two.
    pub(super) length: usize,
    window: Vec<f64>,
    transform: Fourier,
}

impl Segments {
    /// The segments of `residuals`; none if the records are too short or the sampling period is unknown.
    pub(super) fn of(residuals: &Residuals) -> Option<Self> {
        let shortest = residuals.e.iter().map(Vec::len).min().unwrap_or(0);
        let length = (shortest / 4).min(LONGEST);
        if length < 32 || residuals.period_s.is_nan() || residuals.period_s <= 0.0 {
            return None;
        }
        let length = 1 << length.ilog2();
        Some(Self {
            length,
            window: (0..length)
                .map(|k| 0.5 - 0.5 * (TAU * k as f64 / length as f64).cos())
                .collect(),
            transform: Fourier::new(length),
        })
    }

    /// Σ w², the energy of the window.
    fn weight(&self) -> f64 {
        self.window.iter().map(|w| w * w).sum()
    }

    /// The transforms of the segments of `signal`, each about its mean, from frequency 0 to half the sampling rate.
    pub(super) fn lines<'a>(
        &'a self,
        signal: &'a [f64],
    ) -> impl Iterator<Item = Vec<Complex<f64>>> + 'a {
        let starts = (0..=signal.len().saturating_sub(self.length)).step_by(self.length / 2);
        let parts = starts.filter_map(|start| signal.get(start..start + self.length));
        parts.map(|part| {
            let mean = part.iter().sum::<f64>() / self.length as f64;
            let windowed = part.iter().zip(&self.window).map(|(v, w)| (v - mean) * w);
            self.transform.lines(windowed.collect())
        })
    }
}

/// Welch's estimate: segments of a quarter of the shortest record (at most 4096 samples), half overlapping, Hann window.
#[must_use]
pub fn spectrum(residuals: &Residuals) -> Spectrum {
    let Some(segments) = Segments::of(residuals) else {
        return Spectrum::default();
    };
    let (length, weight) = (segments.length, segments.weight());
    let density = |signals: &[Vec<f64>]| {
        let mut sum = vec![0.0; length / 2 + 1];
        let mut count = 0.0;
        for lines in signals.iter().flat_map(|signal| segments.lines(signal)) {
            for (sum, line) in sum.iter_mut().zip(&lines) {
                *sum += line.norm_sqr();
            }
            count += 1.0;
        }
        let scale = 2.0 * residuals.period_s / (weight * f64::max(count, 1.0));
        // The mean (frequency 0) is left out.
        sum.into_iter().skip(1).map(|s| s * scale).collect()
    };
    let finest = 1.0 / (length as f64 * residuals.period_s);
    Spectrum {
        hz: (1..=length / 2).map(|i| i as f64 * finest).collect(),
        residual: density(&residuals.e),
        output: density(&residuals.y),
        noise: residuals
            .noise_variance
            .map(|variance| 2.0 * residuals.period_s * variance),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_is_the_mean_square_and_a_tone_is_at_its_frequency() {
        let tone: Vec<f64> = (0..8192)
            .map(|k| 0.3 * (TAU * 31.25 * f64::from(k) * 0.001).sin())
            .collect();
        let found = spectrum(&Residuals {
            period_s: 0.001,
            e: vec![tone.clone()],
            u: vec![tone.clone()],
            y: vec![tone],
            noise_variance: Some(0.01),
        });
        let step = found.hz[1] - found.hz[0];
        let power: f64 = found.residual.iter().sum::<f64>() * step;
        assert!((power / 0.045 - 1.0).abs() < 1e-3, "{power}");
        let top =
            (0..found.hz.len()).max_by(|a, b| found.residual[*a].total_cmp(&found.residual[*b]));
        assert!((found.hz[top.unwrap()] - 31.25).abs() < step);
        // White noise fills the band to half the sampling rate.
        assert!((found.noise.unwrap() * 500.0 / 0.01 - 1.0).abs() < 1e-12);
        assert_eq!(spectrum(&Residuals::default()), Spectrum::default());
    }
}
