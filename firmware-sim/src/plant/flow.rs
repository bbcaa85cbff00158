//! The separated flow: friction driven by the arriving jet, with the effects that live in the flow.

use super::SAMPLE_PERIOD_S;
use super::base::{BasePlant, RateLaw};
use super::effect::Effect;

#[derive(Debug, Clone, Copy)]
struct Relay {
    upper: f64,
    lower: f64,
    gain: f64,
    attached: bool,
}

#[derive(Debug, Clone, Copy)]
struct BoucWen {
    stiffness: f64,
    beta: f64,
    gamma: f64,
    alpha: f64,
}

#[derive(Debug, Clone, Copy)]
struct Shedding {
    /// ω (rad/s)
    omega: f64,
    damping_ratio: f64,
    gain: f64,
    q: f64,
    q_dot: f64,
}

/// Friction s and the memories beside it.
#[derive(Debug, Clone)]
pub(crate) struct Flow {
    rate_on: f64,
    rate_off: f64,
    gain: f64,
    rate_law: RateLaw,
    relay: Option<Relay>,
    cubic: f64,
    /// F as a rate (y/s).
    dry_friction: f64,
    /// d for ṡ in y/s instead of y per sample (s/y).
    quadratic_drag: f64,
    bouc_wen: Option<BoucWen>,
    shedding: Option<Shedding>,
    friction: f64,
    hysteretic: f64,
    jet: f64,
}

impl Flow {
    pub(crate) fn new(base: &BasePlant, effects: &[Effect]) -> Self {
        let mut flow = Self {
            rate_on: 1.0 / base.attach_s,
            rate_off: 1.0 / base.separate_s,
            gain: base.gain,
            rate_law: base.rate_law,
            relay: None,
            cubic: 0.0,
            dry_friction: 0.0,
            quadratic_drag: 0.0,
            bouc_wen: None,
            shedding: None,
            friction: 0.0,
            hysteretic: 0.0,
            jet: 0.0,
        };
        for effect in effects {
            match *effect {
                Effect::AttachmentHysteresis {
                    upper_threshold,
                    lower_threshold,
                    gain,
                } => {
                    flow.relay = Some(Relay {
                        upper: upper_threshold,
                        lower: lower_threshold,
                        gain,
                        attached: false,
                    });
                }
                Effect::AmplitudeSaturation { cubic } => flow.cubic = cubic,
                Effect::DryFriction { level } => flow.dry_friction = level / SAMPLE_PERIOD_S,
                Effect::QuadraticDrag { coefficient } => {
                    flow.quadratic_drag = coefficient * SAMPLE_PERIOD_S;
                }
                Effect::BoucWenHysteresis {
                    stiffness,
                    beta,
                    gamma,
                    alpha,
                } => {
                    flow.bouc_wen = Some(BoucWen {
                        stiffness,
                        beta,
                        gamma,
                        alpha,
                    });
                }
                Effect::VortexShedding {
                    frequency,
                    damping_ratio,
                    gain,
                } => {
                    flow.shedding = Some(Shedding {
                        omega: std::f64::consts::TAU * frequency,
                        damping_ratio,
                        gain,
                        q: 0.0,
                        q_dot: 0.0,
                    });
                }
                _ => {}
            }
        }
        flow
    }

    /// The friction s (y).
    pub(crate) fn friction(&self) -> f64 {
        self.friction
    }

    /// What the film feels: friction with the shedding superposed (y).
    pub(crate) fn at_the_film(&self) -> f64 {
        self.friction + self.shedding.map_or(0.0, |w| w.gain * (w.q - self.jet))
    }

    /// ṡ and ż at friction `s`, hysteretic memory `z`, arriving jet `j`.
    fn velocity(&self, s: f64, z: f64, j: f64) -> (f64, f64) {
        let extra = self
            .relay
            .map_or(0.0, |r| if r.attached { r.gain } else { 0.0 })
            - self.cubic * s * s * s
            - self.bouc_wen.map_or(0.0, |b| b.alpha * z);
        let push = match self.rate_law {
            RateLaw::Switched => {
                let rate = if j >= 0.5 {
                    self.rate_on
                } else {
                    self.rate_off
                };
                rate * (self.gain * j + extra - s)
            }
            RateLaw::Interpolated => {
                let share = j.clamp(0.0, 1.0);
                let rate = self.rate_off + (self.rate_on - self.rate_off) * share;
                rate * (self.gain * j + extra - s)
            }
            RateLaw::Bilinear => {
                let share = j.clamp(0.0, 1.0);
                let rate = self.rate_off + (self.rate_on - self.rate_off) * share;
                (1.0 - j) * self.rate_off * (0.0 - s)
                    + j * self.rate_on * (self.gain - s)
                    + rate * extra
            }
        };
        let s_dot = self.resisted(push);
        let z_dot = self.bouc_wen.map_or(0.0, |b| {
            b.stiffness * s_dot - b.beta * s_dot.abs() * z - b.gamma * s_dot * z.abs()
        });
        (s_dot, z_dot)
    }

    /// Velocity v that a push f leaves against v + F·sign(v) + d·v·|v| = f; 0 while friction sticks.
    fn resisted(&self, push: f64) -> f64 {
        let free = push.abs() - self.dry_friction;
        if free <= 0.0 && self.dry_friction > 0.0 {
            return 0.0;
        }
        let d = self.quadratic_drag;
        if d == 0.0 {
            return free * push.signum();
        }
        // 2f/(1 + √(1 + 4df)) is the root of v + d·v² = f without cancellation.
        2.0 * free / (1.0 + (1.0 + 4.0 * d * free).sqrt()) * push.signum()
    }

    /// Lets `dt` pass while the arriving jet goes in a straight line from `j0` to `j1`; returns the area under the friction.
    pub(crate) fn advance(&mut self, dt: f64, j0: f64, j1: f64) -> f64 {
        let jm = 0.5 * (j0 + j1);
        let (s, z) = (self.friction, self.hysteretic);
        let (a, az) = self.velocity(s, z, j0);
        let (b, bz) = self.velocity(s + 0.5 * dt * a, z + 0.5 * dt * az, jm);
        let (c, cz) = self.velocity(s + 0.5 * dt * b, z + 0.5 * dt * bz, jm);
        let (d, dz) = self.velocity(s + dt * c, z + dt * cz, j1);
        self.friction = s + dt / 6.0 * (a + 2.0 * (b + c) + d);
        self.hysteretic = z + dt / 6.0 * (az + 2.0 * (bz + cz) + dz);
        self.jet = j1;
        if let Some(r) = &mut self.relay {
            if self.friction > r.upper {
                r.attached = true;
            } else if self.friction < r.lower {
                r.attached = false;
            }
        }
        if let Some(w) = &mut self.shedding {
            let pull =
                |q: f64, v: f64, j: f64| w.omega * (w.omega * (j - q) - 2.0 * w.damping_ratio * v);
            let (q, v) = (w.q, w.q_dot);
            let k1 = (v, pull(q, v, j0));
            let k2 = (
                v + 0.5 * dt * k1.1,
                pull(q + 0.5 * dt * k1.0, v + 0.5 * dt * k1.1, jm),
            );
            let k3 = (
                v + 0.5 * dt * k2.1,
                pull(q + 0.5 * dt * k2.0, v + 0.5 * dt * k2.1, jm),
            );
            let k4 = (v + dt * k3.1, pull(q + dt * k3.0, v + dt * k3.1, j1));
            w.q = q + dt / 6.0 * (k1.0 + 2.0 * (k2.0 + k3.0) + k4.0);
            w.q_dot = v + dt / 6.0 * (k1.1 + 2.0 * (k2.1 + k3.1) + k4.1);
        }
        0.5 * dt * (s + self.friction)
    }

    /// The arriving jet jumps.
    pub(crate) fn jump(&mut self, jet: f64) {
        self.jet = jet;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::DelayLaw;

    const DT: f64 = 5e-5;

    fn base() -> BasePlant {
        BasePlant {
            attach_s: 0.04,
            separate_s: 0.1,
            gain: 1.0,
            delay: DelayLaw::Fixed { delay_s: 0.03 },
            rate_law: RateLaw::Switched,
        }
    }

    fn hold(flow: &mut Flow, jet: f64, seconds: f64) -> f64 {
        for _ in 0..(seconds / DT).round() as usize {
            flow.advance(DT, jet, jet);
        }
        flow.friction()
    }

    #[test]
    fn attaches_and_separates_exponentially_under_every_rate_law() {
        for rate_law in [RateLaw::Switched, RateLaw::Interpolated, RateLaw::Bilinear] {
            let mut flow = Flow::new(&BasePlant { rate_law, ..base() }, &[]);
            let e = (-1.0_f64).exp();
            assert!((hold(&mut flow, 1.0, 0.04) - (1.0 - e)).abs() < 1e-9);
            let s = hold(&mut flow, 1.0, 0.5);
            assert!((hold(&mut flow, 0.0, 0.1) - s * e).abs() < 1e-9);
        }
    }

    #[test]
    fn the_relay_locks_on_and_lets_go_at_different_friction() {
        let relay = Effect::AttachmentHysteresis {
            upper_threshold: 0.7,
            lower_threshold: 0.3,
            gain: 0.2,
        };
        let mut flow = Flow::new(&base(), &[relay]);
        // Below the threshold nothing differs; a half-open jet settles at two levels.
        assert!((hold(&mut flow, 0.6, 2.0) - 0.6).abs() < 1e-6);
        assert!((hold(&mut flow, 1.0, 2.0) - 1.2).abs() < 1e-6);
        assert!((hold(&mut flow, 0.6, 2.0) - 0.8).abs() < 1e-6);
        // Without a jet it relaxes towards the gain, reaches 0.3 and lets go.
        assert!(hold(&mut flow, 0.0, 3.0).abs() < 1e-6);
    }

    #[test]
    fn the_cubic_sets_the_saturated_level() {
        let mut flow = Flow::new(&base(), &[Effect::AmplitudeSaturation { cubic: 0.3 }]);
        let s = hold(&mut flow, 1.0, 3.0);
        assert!((s + 0.3 * s * s * s - 1.0).abs() < 1e-9 && s < 0.9);
    }

    #[test]
    fn dry_friction_stops_the_flow_short_of_its_equilibrium_on_both_sides() {
        // It sticks where rate·|drive − s| = F per sample.
        let level = 0.002;
        let mut flow = Flow::new(&base(), &[Effect::DryFriction { level }]);
        let band_on = level / 0.001 * 0.04;
        assert!((hold(&mut flow, 1.0, 3.0) - (1.0 - band_on)).abs() < 1e-3);
        let band_off = level / 0.001 * 0.1;
        assert!((hold(&mut flow, 0.0, 3.0) - band_off).abs() < 1e-3);
    }

    #[test]
    fn quadratic_drag_slows_fast_changes_by_its_closed_form() {
        let flow = Flow::new(&base(), &[Effect::QuadraticDrag { coefficient: 30.0 }]);
        // First sample of a step: v + d·v² = 1/40 per sample.
        let per_sample = flow.velocity(0.0, 0.0, 1.0).0 * 0.001;
        assert!((per_sample + 30.0 * per_sample * per_sample - 0.025).abs() < 1e-12);
        let falling = flow.velocity(1.0, 0.0, 0.0).0 * 0.001;
        assert!((falling - 30.0 * falling * falling + 0.01).abs() < 1e-12);
    }

    #[test]
    fn bouc_wen_remembers_the_direction_of_travel() {
        let effect = Effect::BoucWenHysteresis {
            stiffness: 1.0,
            beta: 3.0,
            gamma: 1.0,
            alpha: 0.5,
        };
        let mut flow = Flow::new(&base(), &[effect]);
        hold(&mut flow, 1.0, 3.0);
        // Loading from rest: z = (1 − exp(−(β+γ)·s))/(β+γ).
        let s = flow.friction();
        let z = (1.0 - (-4.0 * s).exp()) / 4.0;
        assert!((flow.hysteretic - z).abs() < 1e-6);
        assert!((s + 0.5 * z - 1.0).abs() < 1e-6);
        assert!(
            hold(&mut flow, 0.0, 5.0) > 0.01,
            "it does not come back to 0"
        );
    }

    #[test]
    fn shedding_rings_at_its_frequency_around_the_arriving_jet() {
        let effect = Effect::VortexShedding {
            frequency: 12.0,
            damping_ratio: 0.1,
            gain: 0.2,
        };
        let mut flow = Flow::new(&base(), &[effect]);
        let t = 0.053_f64;
        let s = hold(&mut flow, 1.0, t);
        let omega = std::f64::consts::TAU * 12.0;
        let damped = omega * (1.0_f64 - 0.01).sqrt();
        let error = -(-0.1 * omega * t).exp()
            * ((damped * t).cos() + 0.1 * omega / damped * (damped * t).sin());
        assert!((flow.at_the_film() - s - 0.2 * error).abs() < 1e-6);
    }
}
