//! The separated flow: friction driven by the arriving jet, with the effects that act on it.

use super::base::{BasePlant, RateLaw};
use super::character::Character;
use super::part::{FlowPart, Piece, Resistance};
use crate::waveform::{Cursor, Waveform};

/// Friction, states of the flow's character and memory of each part; or their derivatives.
type State = Vec<f64>;

/// Friction s and the other states.
#[derive(Debug, Clone)]
pub(crate) struct Flow {
    rate_on: f64,
    rate_off: f64,
    gain: f64,
    rate_law: RateLaw,
    character: Character,
    parts: Vec<Box<dyn FlowPart>>,
    resistance: Resistance,
    state: State,
    /// Work space of the integration: a trial state and four derivatives.
    trial: State,
    speeds: [State; 4],
    jet: f64,
    time: f64,
    /// The friction history, if the character needs it, with the read position of each term.
    past: Waveform,
    cursors: Vec<Cursor>,
}

impl Flow {
    /// The parts in the catalogue's order.
    pub(crate) fn new(
        base: &BasePlant,
        character: &Character,
        parts: Vec<Box<dyn FlowPart>>,
    ) -> Self {
        let each = parts.iter().map(|part| part.resistance());
        let resistance = each.fold(Resistance::default(), |sum, r| Resistance {
            dry: sum.dry + r.dry,
            drag: sum.drag + r.drag,
        });
        let at_rest = vec![0.0; 1 + character.states() + parts.len()];
        let terms = character.past();
        let longest = terms.iter().map(|t| t.delay_s).fold(0.0, f64::max);
        Self {
            rate_on: 1.0 / base.attach_s,
            rate_off: 1.0 / base.separate_s,
            gain: base.gain,
            rate_law: base.rate_law,
            character: character.clone(),
            parts,
            resistance,
            state: at_rest.clone(),
            trial: at_rest.clone(),
            speeds: std::array::from_fn(|_| at_rest.clone()),
            jet: 0.0,
            time: 0.0,
            past: Waveform::at_rest(0.0, longest),
            cursors: vec![Cursor::default(); terms.len()],
        }
    }

    /// The friction s (y).
    pub(crate) fn friction(&self) -> f64 {
        self.state[0]
    }

    /// Input of the film: friction with superposed contributions (y).
    pub(crate) fn at_the_film(&self) -> f64 {
        let each = self.parts.iter();
        each.fold(self.state[0], |felt, part| {
            felt + part.at_the_film(self.jet)
        })
    }

    /// Derivative of the trial state, `ahead` from now, while `j` arrives.
    fn speed(&mut self, stage: usize, ahead: f64, j: f64) {
        let speed = &mut self.speeds[stage];
        let (s, rest) = (self.trial[0], &self.trial[1..]);
        let (own, memories) = rest.split_at(self.character.states());
        let (s_dot, rest) = speed.split_at_mut(1);
        let (own_dot, memories_dot) = rest.split_at_mut(own.len());
        let extra = (self.parts.iter().zip(memories)).fold(0.0, |sum, (p, z)| sum + p.drive(s, *z));

        // Level without and with the jet, and the state that follows this level.
        let (mut off, mut on, mut follower) = (0.0, self.gain, s);
        match &self.character {
            Character::FirstOrder
            | Character::Inertia { .. }
            | Character::RateOfFriction { .. } => {}
            Character::SecondLag { .. } => follower = own[0],
            Character::Wake { pull, .. } => {
                off -= pull * own[0];
                on -= pull * own[0];
            }
            Character::Memory(terms) => {
                for (i, term) in terms.iter().enumerate() {
                    let then = self.time + ahead - term.delay_s;
                    let sharp = self.past.before(then, &mut self.cursors[i]);
                    let past = if term.smear_s > 0.0 {
                        own_dot[i] = (sharp - own[i]) / term.smear_s;
                        own[i]
                    } else {
                        sharp
                    };
                    let felt = term.felt(past);
                    off += term.gain * felt;
                    on += (term.gain - term.lost) * felt;
                }
            }
        }
        // Above full strength the separating share would be negative, and a rate that grows with the friction
        // would make the flow diverge. The dependence on the friction is therefore not applied there.
        let separation = if j > 1.0 {
            1.0
        } else {
            self.character.separation(follower)
        };
        let rate_off = self.rate_off * separation;
        let level = off + (on - off) * j;
        let share = j.clamp(0.0, 1.0);
        let between = rate_off + (self.rate_on - rate_off) * share;
        let push = match self.rate_law {
            RateLaw::Switched => {
                let rate = if j >= 0.5 { self.rate_on } else { rate_off };
                rate * (level + extra - follower)
            }
            RateLaw::Interpolated => between * (level + extra - follower),
            RateLaw::Bilinear => {
                (1.0 - j) * rate_off * (off - follower)
                    + j * self.rate_on * (on - follower)
                    + between * extra
            }
        };
        let moved = resisted(push, self.resistance);
        s_dot[0] = match self.character {
            Character::FirstOrder | Character::Memory(_) | Character::RateOfFriction { .. } => {
                moved
            }
            Character::Inertia { time_s } => {
                own_dot[0] = (moved - own[0]) / time_s;
                own[0]
            }
            Character::SecondLag { time_s } => {
                own_dot[0] = moved;
                (own[0] - s) / time_s
            }
            Character::Wake { time_s, .. } => {
                own_dot[0] = (s - own[0]) / time_s;
                moved
            }
        };
        for ((z_dot, part), z) in memories_dot.iter_mut().zip(&self.parts).zip(memories) {
            *z_dot = part.memory_rate(s, s_dot[0], *z);
        }
    }

    /// Sets the trial state to `dt` ahead along the derivative of a stage.
    fn try_ahead(&mut self, stage: usize, dt: f64) {
        let now = self.state.iter().zip(&self.speeds[stage]);
        for (trial, (x, speed)) in self.trial.iter_mut().zip(now) {
            *trial = x + dt * speed;
        }
    }

    /// Advances by `dt` while the arriving jet changes linearly from `j0` to `j1`; returns the integral of
    /// the friction. Runge–Kutta of order 4.
    pub(crate) fn advance(&mut self, dt: f64, j0: f64, j1: f64) -> f64 {
        let jm = 0.5 * (j0 + j1);
        let before = self.state[0];
        self.trial.copy_from_slice(&self.state);
        self.speed(0, 0.0, j0);
        self.try_ahead(0, 0.5 * dt);
        self.speed(1, 0.5 * dt, jm);
        self.try_ahead(1, 0.5 * dt);
        self.speed(2, 0.5 * dt, jm);
        self.try_ahead(2, dt);
        self.speed(3, dt, j1);
        let [a, b, c, d] = &self.speeds;
        for (i, x) in self.state.iter_mut().enumerate() {
            *x += dt / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
        }
        self.time += dt;
        if !self.cursors.is_empty() {
            self.past.line_to(self.time, self.state[0]);
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

    /// A jump of the arriving jet.
    pub(crate) fn jump(&mut self, jet: f64) {
        self.jet = jet;
        for part in &mut self.parts {
            part.arrives(jet);
        }
    }
}

/// Speed under a push against a resistance; 0 while sticking.
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

/// Access for the tests of parts.
#[cfg(test)]
pub(crate) mod bench {
    use super::*;
    use crate::plant::FlowDelay;
    use crate::plant::part::Part;
    use crate::plant::rig::bench::base;

    const DT: f64 = 5e-5;

    /// A flow that attaches in 40 ms and separates in 100 ms, with gain 1.
    pub(crate) fn flow(parts: impl IntoIterator<Item = Part>) -> Flow {
        let parts = parts.into_iter().map(|part| match part {
            Part::Flow(part) => part,
            _ => panic!("it does not act in the flow"),
        });
        let base = base(FlowDelay::Fixed { delay_s: 0.03 });
        Flow::new(&base, &Character::FirstOrder, parts.collect())
    }

    /// The friction after a constant jet for some time.
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
    use crate::plant::character::PastTerm;
    use crate::plant::{FlowDelay, rig};

    fn base() -> BasePlant {
        rig::bench::base(FlowDelay::Fixed { delay_s: 0.03 })
    }

    fn flow_of(character: Character) -> Flow {
        Flow::new(&base(), &character, Vec::new())
    }

    #[test]
    fn attaches_and_separates_exponentially_under_every_rate_law() {
        for rate_law in [RateLaw::Switched, RateLaw::Interpolated, RateLaw::Bilinear] {
            let base = BasePlant { rate_law, ..base() };
            let mut flow = Flow::new(&base, &Character::FirstOrder, Vec::new());
            let e = (-1.0_f64).exp();
            assert!((hold(&mut flow, 1.0, 0.04) - (1.0 - e)).abs() < 1e-9);
            let s = hold(&mut flow, 1.0, 0.5);
            assert!((hold(&mut flow, 0.0, 0.1) - s * e).abs() < 1e-9);
        }
    }

    /// ṡ = r·(g + k·s(t − T) − s), compared with the method of steps.
    #[test]
    fn memory_follows_its_solution_by_steps() {
        let (delay_s, gain, lost) = (0.15, -0.1, 0.2);
        let mut flow = flow_of(Character::Memory(vec![PastTerm::new(delay_s, gain, lost)]));
        let rate = 1.0 / 0.04;
        let first = |t: f64| 1.0 - (-rate * t).exp();
        assert!((hold(&mut flow, 1.0, delay_s) - first(delay_s)).abs() < 1e-9);
        let (k, t) = (gain - lost, 0.1);
        let level = 1.0 + k;
        let e = (-rate * t).exp();
        let expected = level + (first(delay_s) - level) * e - rate * k * t * e;
        let s = hold(&mut flow, 1.0, t);
        assert!((s - expected).abs() < 1e-7, "{s} {expected}");
        assert!((hold(&mut flow, 1.0, 5.0) - 1.0 / (1.0 - k)).abs() < 1e-9);
        // Without the jet the level is gain·s(t − delay), and the flow returns to rest.
        let s = hold(&mut flow, 0.0, 0.1);
        let blown = 1.0 / (1.0 - k);
        let level = gain * blown;
        let expected = level + (blown - level) * (-1.0_f64).exp();
        assert!((s - expected).abs() < 1e-7, "{s} {expected}");
        assert!(hold(&mut flow, 0.0, 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_smeared_or_bounded_memory_settles_where_it_says() {
        let smeared = PastTerm {
            smear_s: 0.03,
            ..PastTerm::new(0.2, -0.1, 0.2)
        };
        let mut flow = flow_of(Character::Memory(vec![smeared]));
        assert!((hold(&mut flow, 1.0, 8.0) - 1.0 / 1.3).abs() < 1e-9);
        let bounded = PastTerm {
            limit: 0.5,
            ..PastTerm::new(0.2, -0.1, 0.2)
        };
        let mut flow = flow_of(Character::Memory(vec![bounded]));
        let s = hold(&mut flow, 1.0, 8.0);
        assert!((s - 1.0 + 0.3 * 0.5 * (s / 0.5).tanh()).abs() < 1e-9);
    }

    /// Two different poles: the response to a step is 1 − (τ₁e^(−t/τ₁) − τ₂e^(−t/τ₂))/(τ₁ − τ₂).
    #[test]
    fn inertia_and_a_second_lag_have_their_poles() {
        let mut flow = flow_of(Character::SecondLag { time_s: 0.01 });
        let t = 0.05_f64;
        let response = |a: f64, b: f64| 1.0 - (a * (-t / a).exp() - b * (-t / b).exp()) / (a - b);
        assert!((hold(&mut flow, 1.0, t) - response(0.04, 0.01)).abs() < 1e-9);
        // The poles of the flow with inertia are the roots of time·s² + s + rate.
        let time_s = 0.008;
        let mut flow = flow_of(Character::Inertia { time_s });
        let root = (1.0_f64 - 4.0 * time_s / 0.04).sqrt();
        let (a, b) = (2.0 * time_s / (1.0 - root), 2.0 * time_s / (1.0 + root));
        assert!((hold(&mut flow, 1.0, t) - response(a, b)).abs() < 1e-9);
    }

    #[test]
    fn the_wake_pulls_back_later_and_the_separation_rate_follows_the_friction() {
        let (time_s, pull) = (0.5, 0.25);
        let mut flow = flow_of(Character::Wake { time_s, pull });
        let early = hold(&mut flow, 1.0, 0.2);
        assert!(early > 0.9, "hardly felt yet: {early}");
        assert!((hold(&mut flow, 1.0, 10.0) - 0.8).abs() < 1e-6);

        let mut flow = flow_of(Character::RateOfFriction { slope: 0.8 });
        let s = hold(&mut flow, 1.0, 2.0);
        // ṡ = −r·s·(1 + κ·s): s = s₀e/(1 + κ·s₀·(1 − e)), e = exp(−r·t).
        let e = (-0.5_f64).exp();
        let expected = s * e / (1.0 + 0.8 * s * (1.0 - e));
        assert!((hold(&mut flow, 0.0, 0.05) - expected).abs() < 1e-9);
    }
}
