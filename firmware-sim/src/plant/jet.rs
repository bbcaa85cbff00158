//! From the command to the jet: valve, plenum, free stream, echo, vortices.

use std::collections::VecDeque;

use super::effect::Effect;
use super::fault::Fault;
use super::free_stream::FreeStream;
use super::{LONGEST_DELAY_S, SHORTEST_PIECE_S};
use crate::waveform::{Cursor, Waveform};

#[derive(Debug, Clone, Copy)]
struct Vortex {
    gain: f64,
    decay_s: f64,
    /// +1 is fed by a growing jet, −1 by a shrinking one; also the sign of what the flow receives.
    sign: f64,
    strength: f64,
}

impl Vortex {
    /// A sudden change of the jet.
    fn kick(&mut self, change: f64) {
        self.strength += (self.sign * change).max(0.0);
    }

    /// The jet changes in a straight line: ẇ = −w/τ + max(±dj/dt, 0), solved exactly.
    fn advance(&mut self, change: f64, dt: f64) {
        let left = (-dt / self.decay_s).exp();
        let feed = (self.sign * change / dt).max(0.0);
        self.strength = self.strength * left + feed * self.decay_s * (1.0 - left);
    }

    fn received(&self) -> f64 {
        self.sign * self.gain * self.strength
    }
}

#[derive(Debug, Clone)]
struct Echo {
    gain: f64,
    delay_s: f64,
    direct: Waveform,
    cursor: Cursor,
    /// When the jumps of the direct jet come back.
    returning: VecDeque<f64>,
}

/// The jet's own dynamics. Everything here is upstream of the transport delay and does not feel the
/// flow, so it may run ahead of it.
#[derive(Debug, Clone)]
pub(crate) struct Jet {
    lag: Option<(f64, f64)>,
    /// (recovery time, depletion rate)
    plenum: Option<(f64, f64)>,
    cubic: Option<(f64, f64)>,
    free_stream_gain: f64,
    free_stream: Option<FreeStream>,
    echo: Option<Echo>,
    vortices: Vec<Vortex>,
    missing_every: Option<u32>,
    sticking: Option<(f64, f64)>,

    /// What the coil is told.
    command: f64,
    pulses: u32,
    opened_at: f64,
    /// While the valve is jammed half open: until when.
    stuck_until: Option<f64>,
    /// Where the valve is going: 0 closed, 1 open.
    target: f64,
    opening: f64,
    pressure: f64,
    direct: f64,
    time: f64,
    /// What leaves towards the flow.
    pub(crate) out: Waveform,
}

impl Jet {
    pub(crate) fn new(
        effects: &[Effect],
        faults: &[Fault],
        free_stream: Option<FreeStream>,
    ) -> Self {
        let mut jet = Self {
            lag: None,
            plenum: None,
            cubic: None,
            free_stream_gain: 0.0,
            free_stream,
            echo: None,
            vortices: Vec::new(),
            missing_every: None,
            sticking: None,
            command: 0.0,
            pulses: 0,
            opened_at: 0.0,
            stuck_until: None,
            target: 0.0,
            opening: 0.0,
            pressure: 1.0,
            direct: 0.0,
            time: 0.0,
            out: Waveform::at_rest(0.0, LONGEST_DELAY_S),
        };
        for effect in effects {
            match *effect {
                Effect::ValveLag {
                    opening_time,
                    closing_time,
                } => jet.lag = Some((opening_time, closing_time)),
                Effect::PlenumDroop {
                    recovery_time,
                    depletion_rate,
                } => jet.plenum = Some((recovery_time, depletion_rate)),
                Effect::FreeStreamVariation { gain } => jet.free_stream_gain = gain,
                Effect::EchoPath { gain, echo_delay } => {
                    jet.echo = Some(Echo {
                        gain,
                        delay_s: echo_delay,
                        direct: Waveform::at_rest(0.0, LONGEST_DELAY_S),
                        cursor: Cursor::default(),
                        returning: VecDeque::new(),
                    });
                }
                Effect::StartingVortex { gain, decay_time } => jet.vortices.push(Vortex {
                    gain,
                    decay_s: decay_time,
                    sign: 1.0,
                    strength: 0.0,
                }),
                Effect::StoppingVortex { gain, decay_time } => jet.vortices.push(Vortex {
                    gain,
                    decay_s: decay_time,
                    sign: -1.0,
                    strength: 0.0,
                }),
                Effect::InputNonlinearity { quadratic, cubic } => {
                    jet.cubic = Some((quadratic, cubic));
                }
                _ => {}
            }
        }
        for fault in faults {
            match *fault {
                Fault::MissingPulse { every } => jet.missing_every = Some(every.max(2)),
                Fault::StickingValve {
                    after_open_s,
                    stuck_s,
                } => jet.sticking = Some((after_open_s, stuck_s)),
                Fault::FreezingSensor { .. } => {}
            }
        }
        jet
    }

    /// The coil is told `level` now.
    pub(crate) fn command(&mut self, level: f64) {
        if level == self.command {
            return;
        }
        let rising = level > self.command;
        self.command = level;
        self.stuck_until = None;
        let mut target = level;
        if rising {
            self.pulses = self.pulses.wrapping_add(1);
            self.opened_at = self.time;
            if self
                .missing_every
                .is_some_and(|n| self.pulses.is_multiple_of(n))
            {
                target = 0.0;
            }
        } else if let Some((after_open_s, stuck_s)) = self.sticking
            && self.time - self.opened_at >= after_open_s
        {
            self.stuck_until = Some(self.time + stuck_s);
            target = 0.5 * (self.target + level);
        }
        self.move_to(target);
    }

    fn move_to(&mut self, target: f64) {
        self.target = target;
        if self.lag.is_none() {
            self.opening = target;
            self.jump();
        }
    }

    /// Jet before the echo returns and before the vortices.
    fn direct_now(&self) -> f64 {
        let v = self.opening;
        let v = self
            .cubic
            .map_or(v, |(g2, g3)| v * (1.0 + v * (g2 + v * g3)));
        let stream = self
            .free_stream
            .as_ref()
            .map_or(0.0, |u| self.free_stream_gain * u.relative(self.time));
        v * self.pressure * (1.0 + stream)
    }

    fn with_echo(&mut self, direct: f64) -> f64 {
        match &mut self.echo {
            Some(e) => {
                direct
                    + e.gain
                        * e.direct
                            .at(self.time - e.delay_s + RETURN_SLACK_S, &mut e.cursor)
            }
            None => direct,
        }
    }

    fn received(&self, jet: f64) -> f64 {
        self.vortices.iter().fold(jet, |sum, w| sum + w.received())
    }

    /// Something upstream changed without taking time.
    fn jump(&mut self) {
        let direct = self.direct_now();
        if let Some(e) = &mut self.echo
            && direct != e.direct.before(f64::INFINITY, &mut e.cursor)
        {
            e.direct.jump_to(direct);
            e.returning.push_back(self.time + e.delay_s);
        }
        let jet = self.with_echo(direct);
        for w in &mut self.vortices {
            w.kick(jet - self.direct);
        }
        self.direct = jet;
        let received = self.received(jet);
        self.out.jump_to(received);
    }

    /// Lets time pass until `to`, in pieces no longer than the caller's sub-step.
    pub(crate) fn advance(&mut self, to: f64) {
        while to - self.time > SHORTEST_PIECE_S {
            let mut stop = to;
            if let Some(t) = self.stuck_until {
                stop = stop.min(t.max(self.time));
            }
            let returning = self
                .echo
                .as_ref()
                .and_then(|e| e.returning.front().copied());
            if let Some(t) = returning {
                stop = stop.min(t.max(self.time));
            }
            if stop - self.time > SHORTEST_PIECE_S {
                self.piece(stop - self.time, stop);
            }
            if self.stuck_until.is_some_and(|t| t <= stop) {
                self.stuck_until = None;
                self.move_to(self.command);
            }
            if let Some(e) = &mut self.echo
                && e.returning.front().is_some_and(|t| *t <= stop)
            {
                e.returning.pop_front();
                self.jump();
            }
        }
    }

    /// One piece of time in which nothing jumps.
    fn piece(&mut self, dt: f64, to: f64) {
        let start = self.opening;
        if let Some((opening, closing)) = self.lag {
            let tau = if self.target > start {
                opening
            } else {
                closing
            };
            self.opening = self.target + (start - self.target) * (-dt / tau).exp();
        }
        if let Some((recovery, depletion)) = self.plenum {
            let v = 0.5 * (start + self.opening);
            let rate = 1.0 / recovery + depletion * v;
            let rest = 1.0 / (recovery * rate);
            self.pressure = rest + (self.pressure - rest) * (-rate * dt).exp();
        }
        self.time = to;
        let direct = self.direct_now();
        let jet = match &mut self.echo {
            Some(e) => {
                e.direct.line_to(to, direct);
                direct
                    + e.gain
                        * e.direct
                            .before(to - e.delay_s - RETURN_SLACK_S, &mut e.cursor)
            }
            None => direct,
        };
        for w in &mut self.vortices {
            w.advance(jet - self.direct, dt);
        }
        self.direct = jet;
        let received = self.received(jet);
        self.out.line_to(to, received);
    }
}

/// (t + d) − d may round to either side of t; the echo of a jump must be read from the right one (s).
const RETURN_SLACK_S: f64 = SHORTEST_PIECE_S;

#[cfg(test)]
mod tests {
    use super::*;

    fn run(jet: &mut Jet, until: f64) -> f64 {
        while until - jet.time > SHORTEST_PIECE_S {
            jet.advance((jet.time + 5e-5).min(until));
        }
        let mut c = Cursor::default();
        jet.out.at(until, &mut c)
    }

    fn with(effect: Effect) -> Jet {
        Jet::new(&[effect], &[], None)
    }

    #[test]
    fn the_valve_opens_and_closes_with_its_own_time_constants() {
        let mut jet = with(Effect::ValveLag {
            opening_time: 0.01,
            closing_time: 0.03,
        });
        jet.command(1.0);
        assert!((run(&mut jet, 0.01) - (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
        let open = run(&mut jet, 0.2);
        jet.command(0.0);
        assert!((run(&mut jet, 0.23) - open * (-1.0_f64).exp()).abs() < 1e-9);
    }

    #[test]
    fn the_plenum_settles_where_supply_meets_demand_and_recovers() {
        let (recovery, depletion) = (0.5, 0.8);
        let mut jet = with(Effect::PlenumDroop {
            recovery_time: recovery,
            depletion_rate: depletion,
        });
        jet.command(1.0);
        let rest = 1.0 / (1.0 + recovery * depletion);
        assert!((run(&mut jet, 10.0) - rest).abs() < 1e-9);
        jet.command(0.0);
        assert_eq!(run(&mut jet, 10.5), 0.0, "a closed valve blows nothing");
        let recovered = 1.0 - (1.0 - rest) * (-1.0_f64).exp();
        assert!((jet.pressure - recovered).abs() < 1e-9);
    }

    #[test]
    fn the_echo_returns_after_exactly_its_delay() {
        let mut jet = with(Effect::EchoPath {
            gain: -0.3,
            echo_delay: 0.080_013,
        });
        jet.command(1.0);
        assert_eq!(run(&mut jet, 0.0800), 1.0);
        assert!((run(&mut jet, 0.0801) - 0.7).abs() < 1e-12);
        let mut c = Cursor::default();
        let (t, before, after) = jet.out.jump_inside(0.0, 1.0, &mut c).unwrap();
        assert!((t - 0.080_013).abs() < 1e-9 && before == 1.0 && (after - 0.7).abs() < 1e-12);
        jet.command(0.0);
        assert!(
            (run(&mut jet, 0.1) + 0.3).abs() < 1e-12,
            "only the echo is left"
        );
        assert!(run(&mut jet, 0.2).abs() < 1e-12);
    }

    #[test]
    fn vortices_follow_their_own_edge_only_and_decay() {
        let mut start = with(Effect::StartingVortex {
            gain: 0.8,
            decay_time: 0.02,
        });
        start.command(1.0);
        assert!((run(&mut start, 0.02) - (1.0 + 0.8 * (-1.0_f64).exp())).abs() < 1e-9);
        run(&mut start, 1.0);
        start.command(0.0);
        assert!(
            run(&mut start, 1.001).abs() < 1e-9,
            "switching off sheds nothing"
        );

        let mut stop = with(Effect::StoppingVortex {
            gain: 0.5,
            decay_time: 0.04,
        });
        stop.command(1.0);
        assert_eq!(run(&mut stop, 0.3), 1.0);
        stop.command(0.0);
        assert!((run(&mut stop, 0.34) + 0.5 * (-1.0_f64).exp()).abs() < 1e-9);
    }

    #[test]
    fn a_lagging_valve_feeds_the_starting_vortex_more_slowly() {
        // ẇ = −w/τ + v̇ with v = 1 − exp(−t/τo): w = τ/(τ − τo)·(exp(−t/τ) − exp(−t/τo)).
        let (tau, opening) = (0.03, 0.01);
        let mut jet = Jet::new(
            &[
                Effect::ValveLag {
                    opening_time: opening,
                    closing_time: 0.01,
                },
                Effect::StartingVortex {
                    gain: 1.0,
                    decay_time: tau,
                },
            ],
            &[],
            None,
        );
        jet.command(1.0);
        let t = 0.025_f64;
        let v = 1.0 - (-t / opening).exp();
        let w = tau / (tau - opening) * ((-t / tau).exp() - (-t / opening).exp());
        assert!((run(&mut jet, t) - v - w).abs() < 1e-5);
    }

    #[test]
    fn levels_go_through_the_cubic() {
        let mut jet = with(Effect::InputNonlinearity {
            quadratic: 0.4,
            cubic: -0.2,
        });
        jet.command(0.5);
        assert!((run(&mut jet, 0.01) - (0.5 + 0.1 - 0.025)).abs() < 1e-12);
    }

    #[test]
    fn every_third_pulse_is_missing() {
        let mut jet = Jet::new(&[], &[Fault::MissingPulse { every: 3 }], None);
        let mut seen = Vec::new();
        for pulse in 0..6 {
            let t = f64::from(pulse) * 0.1;
            jet.command(1.0);
            seen.push(run(&mut jet, t + 0.05));
            jet.command(0.0);
            run(&mut jet, t + 0.1);
        }
        assert_eq!(seen, [1.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn the_valve_sticks_half_open_after_long_pulses_only() {
        let fault = Fault::StickingValve {
            after_open_s: 0.1,
            stuck_s: 0.06,
        };
        let mut jet = Jet::new(&[], &[fault], None);
        jet.command(1.0);
        run(&mut jet, 0.05);
        jet.command(0.0);
        assert_eq!(run(&mut jet, 0.051), 0.0);
        jet.command(1.0);
        run(&mut jet, 0.2);
        jet.command(0.0);
        assert_eq!(run(&mut jet, 0.259), 0.5);
        assert_eq!(run(&mut jet, 0.261), 0.0);
    }
}
