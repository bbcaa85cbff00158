//! The separated flow: friction driven by the arriving jet, with the parts that act in it.

use super::base::{BasePlant, RateLaw};
use super::part::{FlowPart, Piece, Resistance};

/// Friction and the memory of each part at one instant, or their speeds.
type State = Vec<f64>;

/// Friction s and the memories beside it.
#[derive(Debug, Clone)]
pub(crate) struct Flow {
    rate_on: f64,
    rate_off: f64,
    gain: f64,
    rate_law: RateLaw,
    parts: Vec<Box<dyn FlowPart>>,
    resistance: Resistance,
    /// s, then the memory of each part.
    state: State,
    /// Where the integration works: a trial state and the four speeds.
    trial: State,
    speeds: [State; 4],
    jet: f64,
}

impl Flow {
    /// The parts in the catalogue's order.
    pub(crate) fn new(base: &BasePlant, parts: Vec<Box<dyn FlowPart>>) -> Self {
        let each = parts.iter().map(|part| part.resistance());
        let resistance = each.fold(Resistance::default(), |sum, r| Resistance {
            dry: sum.dry + r.dry,
            drag: sum.drag + r.drag,
        });
        let at_rest = vec![0.0; parts.len() + 1];
        Self {
            rate_on: 1.0 / base.attach_s,
            rate_off: 1.0 / base.separate_s,
            gain: base.gain,
            rate_law: base.rate_law,
            parts,
            resistance,
            state: at_rest.clone(),
            trial: at_rest.clone(),
            speeds: std::array::from_fn(|_| at_rest.clone()),
            jet: 0.0,
        }
    }

    /// The friction s (y).
    pub(crate) fn friction(&self) -> f64 {
        self.state[0]
    }

    /// What the film feels: friction with what the parts superpose (y).
    pub(crate) fn at_the_film(&self) -> f64 {
        let each = self.parts.iter();
        each.fold(self.state[0], |felt, part| {
            felt + part.at_the_film(self.jet)
        })
    }

    /// How fast friction and memories change at the trial state while `j` arrives.
    fn speed(&mut self, stage: usize, j: f64) {
        let s = self.trial[0];
        let memories = &self.trial[1..];
        let extra = (self.parts.iter().zip(memories)).fold(0.0, |sum, (p, z)| sum + p.drive(s, *z));
        let share = j.clamp(0.0, 1.0);
        let between = self.rate_off + (self.rate_on - self.rate_off) * share;
        let push = match self.rate_law {
            RateLaw::Switched => {
                let rate = if j >= 0.5 {
                    self.rate_on
                } else {
                    self.rate_off
                };
                rate * (self.gain * j + extra - s)
            }
            RateLaw::Interpolated => between * (self.gain * j + extra - s),
            RateLaw::Bilinear => {
                (1.0 - j) * self.rate_off * (0.0 - s)
                    + j * self.rate_on * (self.gain - s)
                    + between * extra
            }
        };
        let s_dot = resisted(push, self.resistance);
        let speed = &mut self.speeds[stage];
        speed[0] = s_dot;
        for ((z_dot, part), z) in speed[1..].iter_mut().zip(&self.parts).zip(memories) {
            *z_dot = part.memory_rate(s, s_dot, *z);
        }
    }

    /// Puts the trial state `dt` ahead along the speeds of a stage.
    fn try_ahead(&mut self, stage: usize, dt: f64) {
        let now = self.state.iter().zip(&self.speeds[stage]);
        for (trial, (x, speed)) in self.trial.iter_mut().zip(now) {
            *trial = x + dt * speed;
        }
    }

    /// Lets `dt` pass while the arriving jet goes in a straight line from `j0` to `j1`; returns the area
    /// under the friction. Runge–Kutta of order 4.
    pub(crate) fn advance(&mut self, dt: f64, j0: f64, j1: f64) -> f64 {
        let jm = 0.5 * (j0 + j1);
        let before = self.state[0];
        self.trial.copy_from_slice(&self.state);
        self.speed(0, j0);
        self.try_ahead(0, 0.5 * dt);
        self.speed(1, jm);
        self.try_ahead(1, 0.5 * dt);
        self.speed(2, jm);
        self.try_ahead(2, dt);
        self.speed(3, j1);
        let [a, b, c, d] = &self.speeds;
        for (i, x) in self.state.iter_mut().enumerate() {
            *x += dt / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
        }
        self.jet = j1;
        let jet = Piece {
            dt,
            from: j0,
            to: j1,
        };
        for part in &mut self.parts {
            part.passed(&jet, self.state[0]);
        }
        0.5 * dt * (before + self.state[0])
    }

    /// The arriving jet jumps.
    pub(crate) fn jump(&mut self, jet: f64) {
        self.jet = jet;
    }
}

/// Speed that a push leaves against what resists; 0 while the flow sticks.
fn resisted(push: f64, resistance: Resistance) -> f64 {
    let Resistance { dry, drag } = resistance;
    let free = push.abs() - dry;
    if free <= 0.0 && dry > 0.0 {
        return 0.0;
    }
    if drag == 0.0 {
        return free * push.signum();
    }
    // 2f/(1 + √(1 + 4df)) is the root of v + d·v² = f without cancellation.
    2.0 * free / (1.0 + (1.0 + 4.0 * drag * free).sqrt()) * push.signum()
}

/// For the tests of parts.
#[cfg(test)]
pub(crate) mod bench {
    use super::*;
    use crate::plant::DelayLaw;
    use crate::plant::effects::Effect;
    use crate::plant::part::{Part, Surroundings};
    use crate::plant::rig::bench::base;

    const DT: f64 = 5e-5;

    /// Attaches in 40 ms, separates in 100 ms, gain 1.
    pub(crate) fn flow(effects: &[Effect]) -> Flow {
        let parts = Effect::in_order(effects).into_iter().map(|effect| {
            match effect.part(&Surroundings::default()) {
                Part::Flow(part) => part,
                _ => panic!("{} does not act in the flow", effect.name()),
            }
        });
        Flow::new(&base(DelayLaw::Fixed { delay_s: 0.03 }), parts.collect())
    }

    /// The friction after the jet has arrived at one level for a while.
    pub(crate) fn hold(flow: &mut Flow, jet: f64, seconds: f64) -> f64 {
        for _ in 0..(seconds / DT).round() as usize {
            flow.advance(DT, jet, jet);
        }
        flow.friction()
    }
}

#[cfg(test)]
mod tests {
    use super::bench::hold;
    use super::*;
    use crate::plant::DelayLaw;
    use crate::plant::rig::bench::base;

    #[test]
    fn attaches_and_separates_exponentially_under_every_rate_law() {
        for rate_law in [RateLaw::Switched, RateLaw::Interpolated, RateLaw::Bilinear] {
            let mut flow = Flow::new(
                &BasePlant {
                    rate_law,
                    ..base(DelayLaw::Fixed { delay_s: 0.03 })
                },
                Vec::new(),
            );
            let e = (-1.0_f64).exp();
            assert!((hold(&mut flow, 1.0, 0.04) - (1.0 - e)).abs() < 1e-9);
            let s = hold(&mut flow, 1.0, 0.5);
            assert!((hold(&mut flow, 0.0, 0.1) - s * e).abs() < 1e-9);
        }
    }
}
