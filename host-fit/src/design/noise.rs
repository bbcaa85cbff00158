//! Sensor noise added to a simulated flow.

use super::rules::RULES;
use closed_loop::Controlled;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A flow whose reading has noise, white and coloured, repeatable by its seed.
#[derive(Clone)]
pub(super) struct Noisy<F> {
    flow: F,
    /// Part of the sensor's offset that counts as friction, y.
    zero: f64,
    /// Standard deviations of the white and the coloured part, y.
    sizes: [f64; 2],
    /// Pole of the coloured part.
    kept: f64,
    coloured: f64,
    rng: ChaCha8Rng,
}

impl<F> Noisy<F> {
    /// `size` 1 is a typical hot film for friction of order one.
    pub(super) fn new(flow: F, size: f64, seed: u64) -> Self {
        Self {
            flow,
            zero: 0.0,
            sizes: [RULES.white_noise, RULES.coloured_noise].map(|noise| size * noise),
            kept: (-1.0 / RULES.noise_memory).exp(),
            coloured: 0.0,
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// The flow on a rig whose sensor has an offset that is larger by `zero` than the law assumes. Without a reading at
    /// rest it is not distinguishable from friction, so it counts as friction.
    pub(super) fn with_zero(self, zero: f64) -> Self {
        Self { zero, ..self }
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }
}

impl<F: Controlled> Controlled for Noisy<F> {
    fn sample_period_s(&self) -> f64 {
        self.flow.sample_period_s()
    }
    fn step(&mut self, command: bool) -> Option<f64> {
        let reading = self.flow.step(command);
        let [white, coloured] = self.sizes;
        let fresh = (1.0 - self.kept * self.kept).sqrt() * coloured;
        self.coloured = self.kept * self.coloured + fresh * self.normal();
        let noise = white * self.normal() + self.coloured;
        Some(reading? + noise)
    }
    fn friction(&self) -> f64 {
        self.flow.friction() + self.zero
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone)]
    struct Still;
    impl Controlled for Still {
        fn sample_period_s(&self) -> f64 {
            0.001
        }
        fn step(&mut self, _: bool) -> Option<f64> {
            Some(0.0)
        }
        fn friction(&self) -> f64 {
            0.0
        }
    }

    #[test]
    fn noise_has_its_size_and_its_memory() {
        let mut noisy = Noisy::new(Still, 2.0, 3);
        let y: Vec<f64> = (0..50_000).filter_map(|_| noisy.step(false)).collect();
        let lagged = |lag: usize| {
            let pairs = y.iter().zip(&y[lag..]).map(|(a, b)| a * b);
            pairs.sum::<f64>() / (y.len() - lag) as f64
        };
        let coloured = 4.0 * RULES.coloured_noise.powi(2);
        let all = coloured + 4.0 * RULES.white_noise.powi(2);
        assert!((lagged(0) / all - 1.0).abs() < 0.05, "{}", lagged(0));
        let later = coloured * (-10.0 / RULES.noise_memory).exp();
        assert!((lagged(10) / later - 1.0).abs() < 0.1, "{}", lagged(10));
    }
}
