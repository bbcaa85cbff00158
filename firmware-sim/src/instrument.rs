//! Instruments between the film's voltage and a phase-averaged column: noise, converter, repeats.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StudentT};
use thiserror::Error;

use crate::plant::SAMPLE_PERIOD_S;

/// Why an instrument is rejected.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum InstrumentError {
    /// Fewer than two repeats have no scatter.
    #[error("{0} repeats have no standard error; use at least 2 (20 is usual)")]
    TooFewRepeats(usize),
}

/// An analogue-to-digital converter; readings beyond its range stay at the ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Number of bits (1–24).
    pub bits: u32,
    /// Reading of code 0 (y).
    pub low: f64,
    /// Reading of the highest code (y).
    pub high: f64,
}

impl Converter {
    /// 12 bits over −1 … 3 (one step is 0.001 in y): no effect drives the flow out of it.
    pub const TWELVE_BIT: Self = Self {
        bits: 12,
        low: -1.0,
        high: 3.0,
    };

    /// The code a converter would give for `y`.
    pub fn code(&self, y: f64) -> u32 {
        let top = f64::from((1_u32 << self.bits.clamp(1, 24)) - 1);
        let scaled = (y - self.low) / (self.high - self.low) * top;
        // The cast saturates: the code stays at the end of its range.
        scaled.round().clamp(0.0, top) as u32
    }

    /// The reading for a code (y).
    pub fn reading(&self, code: u32) -> f64 {
        let top = f64::from((1_u32 << self.bits.clamp(1, 24)) - 1);
        self.low + (self.high - self.low) * f64::from(code) / top
    }
}

/// Sensor noise of one repeat: white plus first-order coloured, both Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation of the white part (y).
    pub white: f64,
    /// Standard deviation of the coloured part (y).
    pub coloured: f64,
    /// Correlation time of the coloured part (s): its autocorrelation is exp(−t/time).
    pub correlation_s: f64,
}

impl Noise {
    /// A hot film in a turbulent flow: white 0.03, coloured 0.035 over 20 ms.
    pub const HOT_FILM: Self = Self {
        white: 0.03,
        coloured: 0.035,
        correlation_s: 0.020,
    };

    /// Standard deviation of one sample of one repeat (y).
    pub fn standard_deviation(&self) -> f64 {
        self.white.hypot(self.coloured)
    }
}

/// A running noise signal at 1 kHz, stationary from its first sample.
#[derive(Debug, Clone)]
pub struct NoiseSignal {
    noise: Noise,
    memory: f64,
    coloured: f64,
    rng: ChaCha8Rng,
}

impl NoiseSignal {
    /// Starts the noise.
    pub fn new(noise: Noise, mut rng: ChaCha8Rng) -> Self {
        let first: f64 = StandardNormal.sample(&mut rng);
        Self {
            noise,
            memory: (-SAMPLE_PERIOD_S / noise.correlation_s).exp(),
            coloured: noise.coloured * first,
            rng,
        }
    }

    /// The next sample (y).
    pub fn sample(&mut self) -> f64 {
        let white: f64 = StandardNormal.sample(&mut self.rng);
        let drive: f64 = StandardNormal.sample(&mut self.rng);
        let now = self.noise.white * white + self.coloured;
        let fresh = (1.0 - self.memory * self.memory).sqrt();
        self.coloured = self.memory * self.coloured + self.noise.coloured * fresh * drive;
        now
    }
}

/// Further disturbances of a repeat: slow drift, heavy tails, outliers. 0 for none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Unrest {
    /// Standard deviation of a slow component (y).
    pub wander: f64,
    /// Correlation time of the slow component (s).
    pub wander_s: f64,
    /// Standard deviation of a white part with heavy tails: Student's t with 3 degrees of freedom (y).
    pub tails: f64,
    /// Share of outliers.
    pub outliers: f64,
    /// Size of an outlier (y).
    pub outlier_size: f64,
}

impl Unrest {
    /// Standard deviation of one sample of one repeat (y).
    pub fn standard_deviation(&self) -> f64 {
        self.wander
            .hypot(self.tails)
            .hypot(self.outlier_size * self.outliers.sqrt())
    }
}

/// Generator of these disturbances at 1 kHz, stationary from its first sample.
#[derive(Debug, Clone)]
struct UnrestSource {
    size: Unrest,
    slow: NoiseSignal,
    tails: StudentT<f64>,
    rng: ChaCha8Rng,
}

impl UnrestSource {
    /// `None` without disturbances.
    fn new(size: Unrest, mut rng: ChaCha8Rng) -> Option<Self> {
        if size.standard_deviation() == 0.0 {
            return None;
        }
        let slow = Noise {
            white: 0.0,
            coloured: size.wander,
            correlation_s: size.wander_s.max(SAMPLE_PERIOD_S),
        };
        let slow = NoiseSignal::new(slow, ChaCha8Rng::seed_from_u64(rng.random()));
        Some(Self {
            size,
            slow,
            tails: StudentT::new(3.0).ok()?,
            rng,
        })
    }

    fn sample(&mut self) -> f64 {
        // The variance of this Student distribution is 3.
        let tail = self.tails.sample(&mut self.rng) / 3.0_f64.sqrt();
        let off = if self.rng.random_bool(self.size.outliers.clamp(0.0, 1.0)) {
            self.size.outlier_size
        } else {
            0.0
        };
        let off = if self.rng.random_bool(0.5) { off } else { -off };
        self.slow.sample() + self.size.tails * tail + off
    }
}

/// Instruments of a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// Noise of each repeat.
    pub noise: Noise,
    /// Converter of each repeat; `None` for readings in full precision.
    pub converter: Option<Converter>,
    /// Repeats that are averaged (at least 2).
    pub repeats: usize,
    /// Relative scatter of the level between repeats (0 for none): a tunnel's speed is never exactly
    /// repeatable.
    pub level_scatter: f64,
    /// Further disturbances of a repeat.
    pub unrest: Unrest,
}

impl Default for Instrument {
    /// 20 repeats of the hot film on a 12-bit converter.
    fn default() -> Self {
        Self {
            noise: Noise::HOT_FILM,
            converter: Some(Converter::TWELVE_BIT),
            repeats: 20,
            level_scatter: 0.0,
            unrest: Unrest::default(),
        }
    }
}

/// A phase average with its scatter, one value per sample.
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseAverage {
    /// Mean over the repeats (y).
    pub mean: Vec<f64>,
    /// Standard error of the mean, estimated from the scatter (y).
    pub standard_error: Vec<f64>,
    /// Smallest repeat (y).
    pub min: Vec<f64>,
    /// Largest repeat (y).
    pub max: Vec<f64>,
}

/// Random streams of the disturbances; those of the noise are numbered by repeat.
const UNREST_STREAMS: u64 = 1 << 32;

impl Instrument {
    /// Standard deviation of one sample of the average, for readings of order 1 (y).
    pub fn standard_error(&self) -> f64 {
        let once = self.noise.standard_deviation();
        let once = once.hypot(self.unrest.standard_deviation());
        once.hypot(self.level_scatter) / (self.repeats as f64).sqrt()
    }

    /// Measures the noise-free readings `truth` once per repeat and averages.
    ///
    /// # Errors
    /// [`InstrumentError::TooFewRepeats`] below two repeats.
    pub fn measure(&self, truth: &[f64], seed: u64) -> Result<PhaseAverage, InstrumentError> {
        if self.repeats < 2 {
            return Err(InstrumentError::TooFewRepeats(self.repeats));
        }
        let n = truth.len();
        let mut sum = vec![0.0; n];
        let mut square = vec![0.0; n];
        let mut min = vec![f64::INFINITY; n];
        let mut max = vec![f64::NEG_INFINITY; n];
        for repeat in 0..self.repeats {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(repeat as u64);
            let scatter: f64 = StandardNormal.sample(&mut rng);
            let level = 1.0 + self.level_scatter * scatter;
            let mut noise = NoiseSignal::new(self.noise, rng);
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(UNREST_STREAMS + repeat as u64);
            let mut unrest = UnrestSource::new(self.unrest, rng);
            for (k, &y) in truth.iter().enumerate() {
                let mut analogue = y * level + noise.sample();
                if let Some(unrest) = &mut unrest {
                    analogue += unrest.sample();
                }
                let reading = self
                    .converter
                    .map_or(analogue, |c| c.reading(c.code(analogue)));
                // The scatter is summed about the truth to keep precision.
                let off = reading - y;
                sum[k] += off;
                square[k] += off * off;
                min[k] = min[k].min(reading);
                max[k] = max[k].max(reading);
            }
        }
        let r = self.repeats as f64;
        let mean = truth.iter().zip(&sum).map(|(y, s)| y + s / r).collect();
        let standard_error = sum
            .iter()
            .zip(&square)
            .map(|(s, q)| ((q - s * s / r).max(0.0) / (r - 1.0) / r).sqrt())
            .collect();
        Ok(PhaseAverage {
            mean,
            standard_error,
            min,
            max,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variance(x: &[f64]) -> f64 {
        x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64
    }

    #[test]
    fn noise_has_the_stated_size_and_correlation() {
        let mut source = NoiseSignal::new(Noise::HOT_FILM, ChaCha8Rng::seed_from_u64(4));
        let x: Vec<f64> = (0..2_000_000).map(|_| source.sample()).collect();
        let expected = Noise::HOT_FILM.standard_deviation().powi(2);
        assert!((variance(&x) / expected - 1.0).abs() < 0.02);
        for lag in [1_usize, 20, 40] {
            let covariance =
                x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum::<f64>() / (x.len() - lag) as f64;
            let expected = 0.035_f64.powi(2) * (-(lag as f64) / 20.0).exp();
            assert!(
                (covariance - expected).abs() < 0.03 * 0.035_f64.powi(2),
                "lag {lag}: {covariance} instead of {expected}"
            );
        }
    }

    #[test]
    fn the_standard_error_is_calibrated() {
        // (mean − truth)/standard error follows Student's t with 19 degrees of freedom: 5 % of the
        // samples lie beyond 2.093.
        let truth: Vec<f64> = (0..10_000)
            .map(|k| 0.5 + 0.4 * (k as f64 * 0.01).sin())
            .collect();
        let (mut beyond, mut total, mut square) = (0_usize, 0_usize, 0.0);
        for seed in 0..20 {
            let m = Instrument::default().measure(&truth, seed).unwrap();
            for (k, &y) in truth.iter().enumerate() {
                beyond += usize::from((m.mean[k] - y).abs() > 2.093 * m.standard_error[k]);
                square += m.standard_error[k].powi(2);
                total += 1;
                assert!(m.min[k] <= m.mean[k] && m.mean[k] <= m.max[k]);
            }
        }
        let rate = beyond as f64 / total as f64;
        assert!((rate - 0.05).abs() < 0.005, "false alarms: {rate}");
        let expected = Noise::HOT_FILM.standard_deviation().powi(2) / 20.0;
        assert!((square / total as f64 / expected - 1.0).abs() < 0.03);
    }

    /// For all disturbances the scatter gives the standard error of the mean.
    #[test]
    fn unrest_has_its_size_and_the_standard_error_knows_it() {
        let truth = vec![0.5; 20_000];
        let quiet = Instrument {
            noise: Noise {
                white: 0.01,
                coloured: 0.0,
                correlation_s: 0.02,
            },
            ..Instrument::default()
        };
        let slow = Unrest {
            wander: 0.03,
            wander_s: 0.5,
            ..Unrest::default()
        };
        let tails = Unrest {
            tails: 0.03,
            ..Unrest::default()
        };
        let outliers = Unrest {
            outliers: 0.004,
            outlier_size: 0.5,
            ..Unrest::default()
        };
        for unrest in [slow, tails, outliers] {
            let instrument = Instrument { unrest, ..quiet };
            let (mut error, mut stated) = (0.0, 0.0);
            for seed in 0..10 {
                let m = instrument.measure(&truth, seed).unwrap();
                let off: Vec<f64> = m.mean.iter().map(|y| y - 0.5).collect();
                error += variance(&off) / 10.0;
                stated += variance(&m.standard_error) / 10.0;
            }
            let expected = instrument.standard_error().powi(2);
            assert!((stated / expected - 1.0).abs() < 0.15, "{unrest:?}");
            // A slow component has few independent samples per record.
            assert!((error / expected - 1.0).abs() < 0.25, "{unrest:?}");
        }
    }

    #[test]
    fn the_converter_rounds_to_its_steps_and_holds_at_its_ends() {
        let c = Converter::TWELVE_BIT;
        let step = 4.0 / 4095.0;
        assert!((c.reading(c.code(0.7213)) - 0.7213).abs() <= step / 2.0 + 1e-12);
        assert_eq!((c.code(-3.0), c.code(9.0), c.code(f64::NAN)), (0, 4095, 0));
        assert_eq!(c.reading(4095), 3.0);
    }

    #[test]
    fn measuring_repeats_bit_for_bit_and_one_repeat_is_refused() {
        let truth = [0.0, 0.5, 1.0];
        let instrument = Instrument::default();
        assert_eq!(instrument.measure(&truth, 1), instrument.measure(&truth, 1));
        assert_ne!(instrument.measure(&truth, 1), instrument.measure(&truth, 2));
        let once = Instrument {
            repeats: 1,
            ..instrument
        };
        assert_eq!(
            once.measure(&truth, 1),
            Err(InstrumentError::TooFewRepeats(1))
        );
    }
}
