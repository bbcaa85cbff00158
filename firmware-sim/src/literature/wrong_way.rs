//! Lift after a pulse of jets: a fall first, then a rise, a maximum after three convective times.
//!
//! D. Williams, T. Colonius, W. Kerstens and V. Quach, Time delay in the lift response to actuation and its effect
//! on controller bandwidth, Bulletin of the American Physical Society 55 (2010), AJ.5; W. Kerstens, J. Pfeiffer,
//! D. Williams, R. King and T. Colonius, Closed-loop control of lift for longitudinal gust suppression at low
//! Reynolds numbers, AIAA Journal 49 (2011), 1721–1728: second order, a delay by convection, and a zero in the
//! right half plane.
//!
//! L(s)/j(s) = exp(−θ·s)·(1 − T_z·s)/((1 + T₁·s)·(1 + T₂·s))
//!
//! From the publication: times scale with c/U; lift reverses at once, is largest at t⁺ = t·U/c = 3 and back at rest
//! by t⁺ = 15. Our choice: coefficients with that response, θ⁺ = 0.5, T_z⁺ = 1, T₁⁺ = 4, T₂⁺ = 1, each varied by up
//! to a tenth, and c/U of 15–25 ms.

use super::{Flow, Published, STEP_S};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;

pub(super) const PUBLISHED: Published = Published {
    name: "wrong-way",
    reference: "Kerstens et al. 2011, AIAA J. 49, 1721",
    also_right: &[],
    draw: |rng| Box::new(WrongWay::draw(rng)),
};

/// Lift that falls before it rises.
#[derive(Clone, Debug)]
pub struct WrongWay {
    zero_s: f64,
    slow_s: f64,
    fast_s: f64,
    delayed: VecDeque<f64>,
    first: f64,
    second: f64,
}

impl WrongWay {
    /// Times in units of `convective_s`: delay, zero, slow and fast pole.
    fn new(convective_s: f64, [delay, zero, slow, fast]: [f64; 4]) -> Self {
        let steps = (delay * convective_s / STEP_S).round() as usize;
        Self {
            zero_s: zero * convective_s,
            slow_s: slow * convective_s,
            fast_s: fast * convective_s,
            delayed: VecDeque::from(vec![0.0; steps]),
            first: 0.0,
            second: 0.0,
        }
    }

    fn draw(rng: &mut ChaCha8Rng) -> Self {
        let convective_s = rng.random_range(0.015..0.025);
        let times = TIMES.map(|time| time * rng.random_range(0.9..1.1));
        Self::new(convective_s, times)
    }
}

/// Delay, zero, slow and fast pole in convective times.
const TIMES: [f64; 4] = [0.5, 1.0, 4.0, 1.0];

impl Flow for WrongWay {
    fn step(&mut self, jet: f64) {
        self.delayed.push_back(jet);
        let j = self.delayed.pop_front().unwrap_or(jet);
        self.first += STEP_S / self.fast_s * (j - self.first);
        self.second += STEP_S / self.slow_s * (self.first - self.second);
    }

    fn reading(&self) -> f64 {
        // With z the output of the two lags, (1 − T_z·s)·z = z − T_z·ż.
        self.second - self.zero_s / self.slow_s * (self.first - self.second)
    }

    fn coefficients(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("zero_s", self.zero_s),
            ("slow_s", self.slow_s),
            ("fast_s", self.fast_s),
            ("delay_s", self.delayed.len() as f64 * STEP_S),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The published times of a pulse: reversal first, maximum at t⁺ = 3, back by t⁺ = 15.
    #[test]
    fn lift_reverses_is_largest_after_three_convective_times_and_back_after_fifteen() {
        let convective_s = 0.02;
        let mut flow = WrongWay::new(convective_s, TIMES);
        let steps_of_one = (convective_s / STEP_S) as usize;
        let lift: Vec<f64> = (0..20 * steps_of_one)
            .map(|k| {
                flow.step(f64::from(u8::from(k < steps_of_one / 20)));
                flow.reading()
            })
            .collect();
        let largest = (0..lift.len())
            .max_by(|a, b| lift[*a].total_cmp(&lift[*b]))
            .unwrap();
        let lowest = (0..lift.len())
            .min_by(|a, b| lift[*a].total_cmp(&lift[*b]))
            .unwrap();
        let after = |k: usize| k as f64 / steps_of_one as f64;
        assert!(lift[lowest] < -0.1 * lift[largest] && after(lowest) < 1.0);
        assert!((after(largest) - 3.0).abs() < 0.15, "{}", after(largest));
        assert!(lift[15 * steps_of_one].abs() < 0.08 * lift[largest]);
    }
}
