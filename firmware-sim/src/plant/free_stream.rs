//! Velocity and temperature of the free stream over a record.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Mean free-stream velocity of every record (m/s).
pub const MEAN_FREE_STREAM: f64 = 10.0;

/// Mean temperature of the air (°C).
pub(crate) const MEAN_TEMPERATURE: f64 = 20.0;

/// U∞(t): a mean and three slow waves, the same in every repeat of the record; and the temperature of the air,
/// which varies independently.
///
/// The mean over the sampled record is exactly [`MEAN_FREE_STREAM`], so one record and all records have the
/// same mean.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeStream {
    /// (amplitude in m/s, frequency in Hz, phase in rad)
    waves: [(f64, f64, f64); 3],
    offset: f64,
    /// (amplitude in K, frequency in Hz, phase in rad)
    warmth: [(f64, f64, f64); 2],
}

impl FreeStream {
    /// A varying free stream: waves of 0.08–0.9 Hz, together ±5–12 %, over `samples` of 1 ms.
    pub fn draw(rng: &mut ChaCha8Rng, samples: usize) -> Self {
        let size = rng.random_range(0.05..0.12) * MEAN_FREE_STREAM;
        let mut waves = [(0.0, 0.0, 0.0); 3];
        let bands = [(0.08, 0.2, 0.5), (0.2, 0.45, 0.3), (0.45, 0.9, 0.2)];
        for (wave, (low, high, share)) in waves.iter_mut().zip(bands) {
            *wave = (
                share * size,
                rng.random_range(low..high),
                rng.random_range(0.0..std::f64::consts::TAU),
            );
        }
        // The temperature has a separate random stream, so that rigs without a temperature are
        // unchanged.
        let mut own = ChaCha8Rng::seed_from_u64(waves[0].2.to_bits());
        let warmth = [(2.5, 0.12, 0.30), (1.5, 0.35, 0.80)].map(|(size, low, high)| {
            (
                size * own.random_range(0.6..1.4),
                own.random_range(low..high),
                own.random_range(0.0..std::f64::consts::TAU),
            )
        });
        let mut stream = Self {
            waves,
            offset: 0.0,
            warmth,
        };
        let sum: f64 = (0..samples)
            .map(|k| stream.velocity(k as f64 * super::SAMPLE_PERIOD_S))
            .sum();
        stream.offset = MEAN_FREE_STREAM - sum / samples.max(1) as f64;
        stream
    }

    /// U∞ at `t` seconds from the record's start (m/s).
    pub fn velocity(&self, t: f64) -> f64 {
        self.waves.iter().fold(self.offset, |v, (a, f, phase)| {
            v + a * (std::f64::consts::TAU * f * t + phase).sin()
        })
    }

    /// Temperature of the air at `t` seconds from the record's start (°C).
    pub fn temperature(&self, t: f64) -> f64 {
        self.warmth
            .iter()
            .fold(MEAN_TEMPERATURE, |v, (a, f, phase)| {
                v + a * (std::f64::consts::TAU * f * t + phase).sin()
            })
    }

    /// U∞/mean − 1 at `t`.
    pub(crate) fn relative(&self, t: f64) -> f64 {
        self.velocity(t) / MEAN_FREE_STREAM - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_mean_over_the_record_is_the_reference_and_the_waves_are_slow() {
        let stream = FreeStream::draw(&mut ChaCha8Rng::seed_from_u64(5), 10_000);
        let v: Vec<f64> = (0..10_000)
            .map(|k| stream.velocity(f64::from(k) * 1e-3))
            .collect();
        let mean = v.iter().sum::<f64>() / 10_000.0;
        assert!((mean - MEAN_FREE_STREAM).abs() < 1e-9);
        let spread = v.iter().fold(0.0_f64, |m, x| m.max((x - mean).abs()));
        assert!(spread > 0.2 && spread < 2.0, "{spread} m/s");
        assert!(v.windows(2).all(|w| (w[1] - w[0]).abs() < 0.01));
    }
}
