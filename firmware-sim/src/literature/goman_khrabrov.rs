//! A separation point that lags the effective incidence, with Kirchhoff's lift.
//!
//! M. Goman and A. Khrabrov, State-space representation of aerodynamic characteristics of an aircraft at high
//! angles of attack, Journal of Aircraft 31 (1994), 1109–1115. With x the attached share of the chord:
//!
//! τ₁·ẋ + x = x₀(α_e), x₀(α) = 1/(1 + exp((α − α*)/σ)), C_N = (π/2)·sin α·(1 + √x)²
//!
//! and τ₂·α̇_e = α − Δα·j − α_e: jets of strength j lower the effective incidence.
//!
//! From the publication: the form of the equations and the order of the times for a thick symmetric section (τ₁
//! near 0.5 c/V, τ₂ near 4.5 c/V). Our choice: the static curve (α* = 15°, σ = 1.5°), an incidence of 18°, a
//! reduction by the jets of 6°, c/V of 18–30 ms, and the transport of the jets: they travel from the slot at a
//! speed that increases with x.

use super::{Flow, Published, STEP_S};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI};

pub(super) const PUBLISHED: Published = Published {
    name: "goman-khrabrov",
    reference: "Goman & Khrabrov 1994, J. Aircraft 31, 1109",
    also_right: &["state-dependent-delay"],
    draw: |rng| Box::new(GomanKhrabrov::draw(rng)),
};

const DEGREE: f64 = PI / 180.0;
const INCIDENCE: f64 = 18.0 * DEGREE;
const STALL: f64 = 15.0 * DEGREE;
const WIDTH: f64 = 1.5 * DEGREE;
const JET_WORTH: f64 = 6.0 * DEGREE;

/// The static curve: the attached share at a steady incidence (rad).
fn attached(incidence: f64) -> f64 {
    1.0 / (1.0 + ((incidence - STALL) / WIDTH).exp())
}

/// Kirchhoff's normal force of a flat plate with attached share `x` at `incidence` (rad).
fn normal_force(incidence: f64, x: f64) -> f64 {
    FRAC_PI_2 * incidence.sin() * (1.0 + x.sqrt()).powi(2)
}

/// The flow of Goman and Khrabrov behind a slot with jets.
#[derive(Clone, Debug)]
pub struct GomanKhrabrov {
    chord_time_s: f64,
    carrying_s: f64,
    faster: f64,
    incidence: f64,
    x: f64,
    way: f64,
    on_their_way: VecDeque<(f64, f64)>,
    arrived: f64,
}

impl GomanKhrabrov {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self {
            chord_time_s: rng.random_range(0.018..0.030),
            carrying_s: rng.random_range(0.040..0.060),
            faster: rng.random_range(0.2..0.5),
            incidence: INCIDENCE,
            x: attached(INCIDENCE),
            way: 0.0,
            on_their_way: VecDeque::new(),
            arrived: 0.0,
        }
    }
}

impl Flow for GomanKhrabrov {
    fn step(&mut self, jet: f64) {
        // The distance from the slot to the separated flow is 1.
        self.way += STEP_S / self.carrying_s * (1.0 + self.faster * self.x);
        self.on_their_way.push_back((self.way, jet));
        while let Some(&(begun, strength)) = self.on_their_way.front()
            && begun + 1.0 <= self.way
        {
            self.arrived = strength;
            self.on_their_way.pop_front();
        }
        let (tau_1, tau_2) = (0.5 * self.chord_time_s, 4.5 * self.chord_time_s);
        let target = INCIDENCE - JET_WORTH * self.arrived;
        self.incidence += STEP_S / tau_2 * (target - self.incidence);
        self.x += STEP_S / tau_1 * (attached(self.incidence) - self.x);
    }

    fn reading(&self) -> f64 {
        let at = |x: f64| normal_force(INCIDENCE, x);
        let rest = at(attached(INCIDENCE));
        (at(self.x) - rest) / (at(attached(INCIDENCE - JET_WORTH)) - rest)
    }

    fn coefficients(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("chord_time_s", self.chord_time_s),
            ("carrying_s", self.carrying_s),
            ("faster_when_attached", self.faster),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kirchhoff's slope: 2π per radian for attached flow, a quarter of 2π for separated flow.
    #[test]
    fn the_normal_force_is_kirchhoffs() {
        let slope = |x: f64| normal_force(1e-4, x) / 1e-4;
        assert!((slope(1.0) - 2.0 * PI).abs() < 1e-4);
        assert!((slope(0.0) - 2.0 * PI / 4.0).abs() < 1e-4);
        assert!((attached(STALL) - 0.5).abs() < 1e-12);
    }
}
