//! Vorticity convected over the ramp, diffused by turbulence and partly returned by the backflow.

use super::{Flow, Published, STEP_S};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

pub(super) const PUBLISHED: Published = Published {
    name: "vorticity-transport",
    reference: "Tennekes & Lumley 1972; Ogata & Banks 1961",
    also_right: &["state-dependent-delay", "echo-path"],
    draw: |rng| Box::new(VorticityTransport::draw(rng)),
};

/// Cells along the ramp: U·Δx/D stays below 2, where central differences do not oscillate.
const CELLS: usize = 60;
const FILM: f64 = 0.6;

/// Vorticity along the ramp, in units of the ramp's length.
#[derive(Clone, Debug)]
pub struct VorticityTransport {
    passing_s: f64,
    peclet: f64,
    returned: f64,
    faster: f64,
    vorticity: Vec<f64>,
}

impl VorticityTransport {
    fn new(passing_s: f64, peclet: f64, returned: f64, faster: f64) -> Self {
        Self {
            passing_s,
            peclet,
            returned,
            faster,
            vorticity: vec![0.0; CELLS + 1],
        }
    }

    fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self::new(
            rng.random_range(0.070..0.110),
            rng.random_range(25.0..45.0),
            rng.random_range(0.1..0.3),
            rng.random_range(0.0..0.25),
        )
    }

    fn at_film(&self) -> f64 {
        self.vorticity[(FILM * CELLS as f64) as usize]
    }
}

impl Flow for VorticityTransport {
    fn step(&mut self, jet: f64) {
        let w = &mut self.vorticity;
        let mean = w.iter().sum::<f64>() / w.len() as f64;
        let cells = CELLS as f64;
        let carried = STEP_S / self.passing_s * (1.0 + self.faster * mean) * cells / 2.0;
        let spread = STEP_S / (self.passing_s * self.peclet) * cells * cells;
        w[0] = jet - self.returned * w[CELLS];
        let mut before = w[0];
        for i in 1..CELLS {
            let (left, own, right) = (before, w[i], w[i + 1]);
            w[i] = own - carried * (right - left) + spread * (left - 2.0 * own + right);
            before = own;
        }
        // At the end of the ramp the gradient is 0.
        w[CELLS] = w[CELLS - 1];
    }

    fn reading(&self) -> f64 {
        self.at_film() * (1.0 + self.returned)
    }

    fn coefficients(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("passing_s", self.passing_s),
            ("peclet", self.peclet),
            ("returned", self.returned),
            ("faster", self.faster),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Complementary error function, to 1.2e-7 (Abramowitz and Stegun 7.1.26 has 1.5e-7).
    fn erfc(x: f64) -> f64 {
        let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
        let terms = [
            0.254_829_592,
            -0.284_496_736,
            1.421_413_741,
            -1.453_152_027,
            1.061_405_429,
        ];
        let sum = terms.iter().rev().fold(0.0, |sum, a| (sum + a) * t);
        let tail = sum * (-x * x).exp();
        if x < 0.0 { 2.0 - tail } else { tail }
    }

    /// ω/ω₀ = ½·erfc((x − Ut)/(2√(Dt))) + ½·exp(Ux/D)·erfc((x + Ut)/(2√(Dt))).
    #[test]
    fn a_step_spreads_as_ogata_and_banks_have_it() {
        let (passing, peclet) = (0.1, 40.0);
        let mut flow = VorticityTransport::new(passing, peclet, 0.0, 0.0);
        let mut k = 0;
        for time in [0.045, 0.060, 0.075] {
            while f64::from(k) * STEP_S < time {
                flow.step(1.0);
                k += 1;
            }
            // Lengths are in ramp lengths and times in passage times, so U = 1 and D = 1/peclet.
            let t = time / passing;
            let wide = 2.0 * (t / peclet).sqrt();
            let exact = 0.5 * erfc((FILM - t) / wide)
                + 0.5 * (FILM * peclet).exp() * erfc((FILM + t) / wide);
            let found = flow.at_film();
            assert!(
                (found - exact).abs() < 0.01,
                "{time} s: {found} for {exact}"
            );
        }
    }
}
