//! A user's effect run on the host, in any number type.

use super::Definition;
use super::program::{Op, Program, Register, Signal, select};
use crate::ring::Ring;
use model_core::Real;
use model_core::clock::Clock;
use model_core::delay::Tap;
use model_core::effect::{Effect, Flow, Instant, Place, Setting};
use model_core::effects::LONGEST_BUFFER;
use model_core::history::Memory;

/// Longest delay of a signal, samples; the next older sample is kept too.
pub(super) const LONGEST_DELAY: u32 = LONGEST_BUFFER as u32 - 2;

/// A user's effect, prepared for a sample period.
#[derive(Clone, Debug)]
pub struct UserEffect<T> {
    program: &'static Program,
    place: Place,
    setting: Setting<T>,
    /// Results that are the same at every sample; 0 for the others.
    results: Vec<T>,
    taps: Vec<Tap<T>>,
    /// What is computed at every sample.
    each: Vec<(Register, Op)>,
}

/// What a user's effect remembers.
#[derive(Clone, Debug)]
pub struct UserState<T> {
    results: Vec<T>,
    states: Vec<T>,
    lines: Vec<Ring<T>>,
    clock: Clock<T>,
}

/// The signals of a sample.
struct Readings<'a, T> {
    own: T,
    relaxation: T,
    at: &'a Instant<'a, T>,
}

impl<T: Real> UserEffect<T> {
    /// Prepares `definition`; `parameters` are in its order and units, missing
    /// ones count as 0.
    #[must_use]
    pub fn new(definition: &'static Definition, parameters: &[T], setting: &Setting<T>) -> Self {
        let program = &definition.program;
        let mut results = vec![T::ZERO; program.ops.len()];
        let mut taps = vec![Tap::on(0); program.lines];
        let mut each = Vec::new();
        for (register, (op, once)) in program.ops.iter().zip(&program.once).enumerate() {
            if !once {
                each.push((register, *op));
            }
            results[register] = match *op {
                Op::Number(value) => T::from_f64(value),
                Op::Parameter(index) => parameters.get(index).copied().unwrap_or(T::ZERO),
                Op::Period => setting.period,
                Op::Reference => setting.reference,
                Op::Unary(f, x) if *once => f.of(results[x]),
                Op::Binary(f, x, y) if *once => f.of(results[x], results[y]),
                Op::Select {
                    condition,
                    then,
                    otherwise,
                } if *once => select(results[condition], results[then], results[otherwise]),
                Op::Delayed {
                    line,
                    delay,
                    longest,
                    ..
                } => {
                    // What must be remembered where the delay changes.
                    let seconds = results[longest.unwrap_or(delay)];
                    let most = T::from_count(LONGEST_DELAY);
                    let samples = (seconds / setting.period).at_most(most);
                    taps[line] = Tap::between(samples);
                    samples
                }
                Op::Unary(..)
                | Op::Binary(..)
                | Op::Select { .. }
                | Op::Signal(_)
                | Op::State(_) => T::ZERO,
            };
        }
        Self {
            program,
            place: definition.spec().place,
            setting: *setting,
            results,
            taps,
            each,
        }
    }

    /// Samples that each memory of a delayed signal must hold.
    pub(super) fn line_lengths(&self) -> Vec<usize> {
        self.taps.iter().map(|tap| tap.whole + 2).collect()
    }

    fn run(&self, state: &mut UserState<T>, signals: &Readings<'_, T>) -> T {
        let UserState {
            results,
            states,
            lines,
            clock,
        } = state;
        let at = signals.at;
        clock.tick(at.command);
        for (register, op) in &self.each {
            results[*register] = match *op {
                Op::Unary(f, x) => f.of(results[x]),
                Op::Binary(f, x, y) => f.of(results[x], results[y]),
                Op::Select {
                    condition,
                    then,
                    otherwise,
                } => select(results[condition], results[then], results[otherwise]),
                Op::State(index) => states[index],
                Op::Delayed {
                    line,
                    signal,
                    delay,
                    longest,
                } => {
                    let memory = &mut lines[line];
                    memory.push(results[signal]);
                    if longest.is_some() {
                        let samples = results[delay] / self.setting.period;
                        Tap::between(samples.at_most(self.results[*register])).read(memory)
                    } else {
                        self.taps[line].read(memory)
                    }
                }
                Op::Signal(signal) => match signal {
                    Signal::Own => signals.own,
                    Signal::Command => at.command,
                    Signal::Flow => at.flow,
                    Signal::Arrived => at.arrived,
                    Signal::Relaxation => signals.relaxation,
                    Signal::Channel => {
                        let channel = at.channels.get(self.setting.channel);
                        // A channel that is not connected counts as being at its reference.
                        channel.copied().unwrap_or(self.setting.reference)
                    }
                    Signal::Time => clock.time(self.setting.period),
                    Signal::SinceEdge => clock.since_edge(self.setting.period),
                },
                Op::Number(_) | Op::Parameter(_) | Op::Period | Op::Reference => results[*register],
            };
        }
        for (slot, carried) in states.iter_mut().zip(&self.program.states) {
            *slot = results[carried.update];
        }
        results[self.program.value]
    }
}

impl<T: Real> Effect<T> for UserEffect<T> {
    type State = UserState<T>;

    fn start(&self) -> UserState<T> {
        let starts = self.program.states.iter();
        UserState {
            results: self.results.clone(),
            states: starts.map(|state| T::from_f64(state.start)).collect(),
            lines: self
                .line_lengths()
                .into_iter()
                .map(Ring::reaching)
                .collect(),
            clock: Clock::new(),
        }
    }

    fn jet(&self, state: &mut UserState<T>, jet: T, at: &Instant<'_, T>) -> T {
        if self.place != Place::Jet {
            return jet;
        }
        let signals = Readings {
            own: jet,
            relaxation: T::ZERO,
            at,
        };
        self.run(state, &signals)
    }

    fn drives(&self) -> bool {
        self.place == Place::Flow
    }

    fn drive(&self, state: &mut UserState<T>, flow: &Flow<T>, at: &Instant<'_, T>) -> T {
        if self.place != Place::Flow {
            return T::ZERO;
        }
        let signals = Readings {
            own: flow.now,
            relaxation: flow.relaxation,
            at,
        };
        self.run(state, &signals)
    }

    fn sense(&self, state: &mut UserState<T>, signal: T, at: &Instant<'_, T>) -> T {
        if self.place != Place::Sensor {
            return signal;
        }
        let signals = Readings {
            own: signal,
            relaxation: T::ZERO,
            at,
        };
        self.run(state, &signals)
    }
}
