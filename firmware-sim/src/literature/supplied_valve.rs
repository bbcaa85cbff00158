//! A flow that switches at first order behind a valve with dead times, a chamber that fills, and a supply line.
//!
//! Flow: A. Darabi and I. Wygnanski, Active management of naturally separated flow over a solid surface, Journal of
//! Fluid Mechanics 510 (2004), 105–144: attachment and separation have different times. Valve: ISO 12238:2001,
//! switching times of directional control valves: the outlet follows after a dead time, another one for closing.
//! Line: E. B. Wylie and V. L. Streeter, Fluid transients in systems, Prentice Hall 1993, chapter 3: pressure waves
//! travel at the speed of sound a; a flow that stops raises the pressure by Z·Δq (Joukowsky), and a line of length L
//! between reservoir and valve rings with the period 4·L/a.
//!
//! T·ṡ = j − s with T for attachment or separation;  ṗ = (p_line − p)/τ_fill open, −p/τ_vent closed;  j = √p
//!
//! From the publication: the wave equation's characteristics and a = 343 m/s. Our choice: all times, L of 1–2.5 m,
//! an impedance of 0.05–0.12 of the supply pressure per full flow, and a factor of 0.8 on a wave that travels to
//! the reservoir and back.

use super::{Flow, Published, STEP_S};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;

pub(super) const PUBLISHED: Published = Published {
    name: "supplied-valve",
    reference: "Darabi & Wygnanski 2004; ISO 12238:2001; Wylie & Streeter 1993",
    also_right: &["valve-lag", "edge-dependent-delay"],
    draw: |rng| Box::new(SuppliedValve::draw(rng)),
};

const SOUND_M_PER_S: f64 = 343.0;
const KEPT: f64 = 0.8;

/// Pressure at the valve's end of a line behind a reservoir, 0 at rest.
#[derive(Clone, Debug)]
struct Line {
    impedance: f64,
    /// Waves travelling to the reservoir and back.
    travelling: VecDeque<f64>,
    pressure: f64,
}

impl Line {
    fn new(length_m: f64, impedance: f64) -> Self {
        let there_and_back = 2.0 * length_m / SOUND_M_PER_S;
        Self {
            impedance,
            travelling: VecDeque::from(vec![0.0; (there_and_back / STEP_S).round() as usize]),
            pressure: 0.0,
        }
    }

    fn step(&mut self, flow: f64) {
        // A reservoir reflects a wave with opposite sign.
        let coming = -KEPT * self.travelling.pop_front().unwrap_or(0.0);
        self.pressure = 2.0 * coming - self.impedance * flow;
        self.travelling.push_back(coming - self.impedance * flow);
    }
}

/// The rig from the valve's coil to the friction.
#[derive(Clone, Debug)]
pub struct SuppliedValve {
    attaching_s: f64,
    separating_s: f64,
    opens_after_s: f64,
    closes_after_s: f64,
    filling_s: f64,
    emptying_s: f64,
    line_m: f64,
    line: Line,
    delayed: VecDeque<f64>,
    /// Commands of the last steps, the newest first, as far back as the longer dead time.
    told: VecDeque<f64>,
    chamber: f64,
    friction: f64,
}

impl SuppliedValve {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        let line_m = rng.random_range(1.0..2.5);
        let passage_s: f64 = rng.random_range(0.025..0.050);
        let [attaching_s, separating_s] =
            [0.040..0.080, 0.080..0.130].map(|range| rng.random_range(range));
        let [opens_after_s, closes_after_s] =
            [0.002..0.005, 0.003..0.008].map(|range| rng.random_range(range));
        let longest = f64::max(opens_after_s, closes_after_s);
        Self {
            attaching_s,
            separating_s,
            opens_after_s,
            closes_after_s,
            filling_s: rng.random_range(0.004..0.012),
            emptying_s: rng.random_range(0.010..0.025),
            line_m,
            line: Line::new(line_m, rng.random_range(0.05..0.12)),
            delayed: VecDeque::from(vec![0.0; (passage_s / STEP_S).round() as usize]),
            told: VecDeque::from(vec![0.0; (longest / STEP_S).round() as usize + 1]),
            chamber: 0.0,
            friction: 0.0,
        }
    }
}

impl Flow for SuppliedValve {
    fn step(&mut self, jet: f64) {
        // The outlet repeats the command after the dead time of the direction in which it is switched. A command of
        // changing strength is repeated as well.
        self.told.pop_back();
        self.told.push_front(jet);
        let dead_s = if jet > 0.5 {
            self.opens_after_s
        } else {
            self.closes_after_s
        };
        let open = self.told.get((dead_s / STEP_S).round() as usize);
        let open = open.copied().unwrap_or(0.0).max(0.0);
        let flowing = open * self.chamber.max(0.0).sqrt();
        self.line.step(flowing);
        let (target, time) = if open > 0.0 {
            (open * (1.0 + self.line.pressure), self.filling_s)
        } else {
            (0.0, self.emptying_s)
        };
        self.chamber += STEP_S / time * (target - self.chamber);
        self.delayed.push_back(self.chamber.max(0.0).sqrt());
        let j = self.delayed.pop_front().unwrap_or(0.0);
        // Under a jet the flow attaches in proportion to the jet; without one it separates.
        let time = self.separating_s + (self.attaching_s - self.separating_s) * j.min(1.0);
        self.friction += STEP_S / time * (j - self.friction);
    }

    fn reading(&self) -> f64 {
        self.friction / self.steady()
    }

    fn coefficients(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("attaching_s", self.attaching_s),
            ("separating_s", self.separating_s),
            ("opens_after_s", self.opens_after_s),
            ("closes_after_s", self.closes_after_s),
            ("filling_s", self.filling_s),
            ("emptying_s", self.emptying_s),
            ("line_m", self.line_m),
            ("impedance", self.line.impedance),
        ]
    }
}

impl SuppliedValve {
    /// Jet strength in steady blowing: p = 1 − Z_eff·√p with the impedance of the damped line.
    fn steady(&self) -> f64 {
        let z = self.line.impedance * (1.0 - KEPT) / (1.0 + KEPT);
        // √p is the positive root of x² + z·x − 1 = 0.
        (z * z / 4.0 + 1.0).sqrt() - z / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flow that stops raises the pressure by Z·Δq, and the line rings at a/(4·L): 85.75 Hz for 1 m.
    #[test]
    fn the_line_rings_at_a_quarter_wave() {
        let mut line = Line::new(1.0, 0.1);
        (0..5000).for_each(|_| line.step(1.0));
        let before = line.pressure;
        let after: Vec<f64> = (0..500)
            .map(|_| {
                line.step(0.0);
                line.pressure
            })
            .collect();
        assert!(
            (after[0] - before - 0.1).abs() < 2e-3,
            "{}",
            after[0] - before
        );
        let rising: Vec<usize> = (1..after.len())
            .filter(|k| after[k - 1] < 0.0 && after[*k] >= 0.0)
            .collect();
        let period = (rising[2] - rising[0]) as f64 * STEP_S / 2.0;
        assert!((1.0 / period - 85.75).abs() < 1.5, "{} Hz", 1.0 / period);
    }
}
