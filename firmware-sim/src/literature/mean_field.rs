//! A global mode that shifts the mean flow by its own Reynolds stress; jets reduce its growth rate.

use super::{Flow, Published, STEP_S};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;
use std::f64::consts::TAU;

pub(super) const PUBLISHED: Published = Published {
    name: "mean-field",
    reference: "Noack et al. 2003, J. Fluid Mech. 497, 335",
    // The shift of the mean follows the square of the amplitude with a lag of its own.
    also_right: &["flow-lag"],
    draw: |rng| Box::new(MeanField::draw(rng)),
};

/// The mode's two phases and the shift of the mean.
#[derive(Clone, Debug)]
pub struct MeanField {
    growth: f64,
    taken: f64,
    frequency_hz: f64,
    delay_s: f64,
    delayed: VecDeque<f64>,
    state: [f64; 3],
}

/// The right-hand sides, in units of 1/ω.
fn slope([u, v, w]: [f64; 3], growth: f64) -> [f64; 3] {
    [
        growth * u - v - u * w,
        growth * v + u - v * w,
        -w + u * u + v * v,
    ]
}

/// One step of the classical Runge–Kutta method.
fn advance(state: [f64; 3], growth: f64, step: f64) -> [f64; 3] {
    let moved = |by: [f64; 3], h: f64| [0, 1, 2].map(|i| state[i] + h * by[i]);
    let one = slope(state, growth);
    let two = slope(moved(one, step / 2.0), growth);
    let three = slope(moved(two, step / 2.0), growth);
    let four = slope(moved(three, step), growth);
    [0, 1, 2].map(|i| state[i] + step / 6.0 * (one[i] + 2.0 * (two[i] + three[i]) + four[i]))
}

impl MeanField {
    fn new(growth: f64, taken: f64, frequency_hz: f64, delay_s: f64) -> Self {
        Self {
            growth,
            taken,
            frequency_hz,
            delay_s,
            delayed: VecDeque::from(vec![0.0; (delay_s / STEP_S).round() as usize]),
            state: [growth.sqrt(), 0.0, growth],
        }
    }

    fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self::new(
            rng.random_range(0.10..0.16),
            rng.random_range(0.5..0.67),
            rng.random_range(14.0..20.0),
            rng.random_range(0.030..0.050),
        )
    }
}

impl Flow for MeanField {
    fn step(&mut self, jet: f64) {
        self.delayed.push_back(jet);
        let j = self.delayed.pop_front().unwrap_or(jet);
        let growth = self.growth * (1.0 - self.taken * j);
        self.state = advance(self.state, growth, TAU * self.frequency_hz * STEP_S);
    }

    fn reading(&self) -> f64 {
        (self.growth - self.state[2]) / (self.growth * self.taken)
    }

    fn coefficients(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("growth", self.growth),
            ("taken_by_jets", self.taken),
            ("frequency_hz", self.frequency_hz),
            ("delay_s", self.delay_s),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From a small disturbance the mode grows at the rate μ, then moves on a circle of radius √μ
    /// around w = μ.
    #[test]
    fn the_mode_grows_at_its_rate_and_saturates_on_its_limit_cycle() {
        let growth = 0.1;
        let amplitude = |s: [f64; 3]| s[0].hypot(s[1]);
        let run = |state: [f64; 3], time: f64| {
            (0..(time / 0.01) as usize).fold(state, |s, _| advance(s, growth, 0.01))
        };
        let small = [1e-4, 0.0, 0.0];
        let grown = run(small, 20.0);
        let rate = (amplitude(grown) / 1e-4).ln() / 20.0;
        assert!((rate - growth).abs() < 1e-3, "{rate}");
        let end = run(small, 400.0);
        assert!((amplitude(end) - growth.sqrt()).abs() < 1e-3);
        assert!((end[2] - growth).abs() < 1e-3);
    }
}
