//! Interpreter of user effects on the host, in any number type.

use super::Definition;
use super::program::{Lines, Op, Program, Register, Signal, select};
use crate::ring::Ring;
use model_core::Real;
use model_core::clock::Clock;
use model_core::delay::Tap;
use model_core::effect::{Effect, Flow, Instant, Place, Setting};
use model_core::history::{Memory, Reaching as _};

/// Longest delay of a signal, samples; one older sample is kept for interpolation.
pub(super) const LONGEST_DELAY: u32 = 2046;

/// A user's effect, prepared for a sample period.
#[derive(Clone, Debug)]
pub struct UserEffect<T> {
    program: &'static Program,
    place: Place,
    setting: Setting<T>,
    /// Results that are constant; 0 for the others.
    results: Vec<T>,
    taps: Vec<Tap<T>>,
    /// Operations of every sample.
    each: Vec<(Register, Step)>,
    tables: Vec<Table<T>>,
}

/// Operations evaluated together.
#[derive(Clone, Copy, Debug)]
enum Step {
    Op(Op),
    Table(usize),
}

/// A piecewise linear table, evaluated by look-up; bit-identical to its single operations.
#[derive(Clone, Debug)]
struct Table<T> {
    x: Register,
    /// Positions beyond which a line contributes its full height.
    ends: Vec<f64>,
    lines: Vec<TableLine<T>>,
    /// The value after the last point.
    last: T,
}

#[derive(Clone, Debug)]
struct TableLine<T> {
    from: T,
    steepness: T,
    rise: T,
    /// The value at the start of the line.
    below: T,
}

/// Relative margin beyond the end of a line, so that rounding to single precision does not return into it.
const ROUNDING: f64 = 1e-5;

/// Position beyond which the line from `from` to `to` contributes its full height.
fn surely_passed(from: f64, to: f64) -> f64 {
    to + ROUNDING * (from.abs() + 2.0 * to.abs())
}

impl<T: Real> Table<T> {
    fn new(lines: &Lines, results: &[T]) -> Self {
        let ends = lines.lines.iter().map(|line| {
            let from = results[line.from].value();
            surely_passed(from, line.to)
        });
        let mut value = results[lines.first];
        let lines_of = lines.lines.iter().map(|line| {
            let below = value;
            value = value + results[line.rise];
            TableLine {
                from: results[line.from],
                steepness: results[line.steepness],
                rise: results[line.rise],
                below,
            }
        });
        Self {
            x: lines.x,
            lines: lines_of.collect(),
            ends: ends.collect(),
            last: value,
        }
    }

    fn at(&self, x: T) -> T {
        let place = x.value();
        let passed = self.ends.iter().take_while(|end| place > **end);
        let first = passed.count();
        let mut value = self.lines.get(first).map_or(self.last, |line| line.below);
        for line in &self.lines[first..] {
            if place <= line.from.value() {
                break;
            }
            let along = (x - line.from) * line.steepness;
            value = value + along.at_least(T::ZERO).at_most(T::ONE) * line.rise;
        }
        value
    }
}

/// State of a user effect.
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
    /// Additional signals of flow effects.
    flow: Option<&'a Flow<T>>,
    at: &'a Instant<'a, T>,
}

impl<T: Real> Readings<'_, T> {
    fn flow(&self, of: impl FnOnce(&Flow<T>) -> T) -> T {
        self.flow.map_or(T::ZERO, of)
    }
}

impl<T: Real> UserEffect<T> {
    /// Prepares `definition`; `parameters` are in its order and units, missing
    /// ones count as 0.
    #[must_use]
    pub fn new(definition: &'static Definition, parameters: &[T], setting: &Setting<T>) -> Self {
        Self::of(
            &definition.program,
            definition.spec.place,
            parameters,
            setting,
        )
    }

    /// Prepares a program that acts at `place`.
    pub(crate) fn of(
        program: &'static Program,
        place: Place,
        parameters: &[T],
        setting: &Setting<T>,
    ) -> Self {
        let mut results = vec![T::ZERO; program.ops.len()];
        let mut taps = vec![Tap::on(0); program.lines];
        let needed = program.needed();
        let mut each = Vec::new();
        for (register, (op, once)) in program.ops.iter().zip(&program.once).enumerate() {
            if !once && needed[register] {
                let table = program.table_at(register).map(Step::Table);
                each.push((register, table.unwrap_or(Step::Op(*op))));
            }
            results[register] = match *op {
                Op::Number(value) => T::from_f64(value),
                Op::Parameter(index) => parameters.get(index).copied().unwrap_or(T::ZERO),
                Op::Period => setting.period,
                Op::Reference => setting.reference,
                Op::Unary(f, x) if *once => f.of(results[x]),
                Op::Binary(f, x, y) if *once => f.of(results[x], results[y]),
                Op::Select(condition, then, otherwise) if *once => {
                    select(results[condition], results[then], results[otherwise])
                }
                Op::Delayed(d) => {
                    // Memory needed for a varying delay.
                    let seconds = results[d.longest.unwrap_or(d.delay)];
                    let most = T::from_count(LONGEST_DELAY);
                    let samples = (seconds / setting.period).at_most(most);
                    taps[d.line] = Tap::between(samples);
                    samples
                }
                Op::Unary(..) | Op::Binary(..) | Op::Select(..) | Op::Signal(_) | Op::State(_) => {
                    T::ZERO
                }
            };
        }
        let tables = program.tables.iter();
        Self {
            program,
            place,
            setting: *setting,
            tables: tables.map(|lines| Table::new(lines, &results)).collect(),
            results,
            taps,
            each,
        }
    }

    /// The result of a constant operation; for a delayed signal its longest delay, samples.
    pub(crate) fn constant(&self, register: Register) -> T {
        self.results.get(register).copied().unwrap_or(T::ZERO)
    }

    /// Read position of memory `line` for a constant delay.
    pub(crate) fn tap(&self, line: usize) -> Tap<T> {
        self.taps.get(line).copied().unwrap_or(Tap::on(0))
    }

    /// Samples that each memory of a delayed signal must hold.
    pub(crate) fn line_lengths(&self) -> Vec<usize> {
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
        for (register, step) in &self.each {
            let op = match step {
                Step::Op(op) => *op,
                Step::Table(index) => {
                    let table = &self.tables[*index];
                    results[*register] = table.at(results[table.x]);
                    continue;
                }
            };
            results[*register] = match op {
                Op::Unary(f, x) => f.of(results[x]),
                Op::Binary(f, x, y) => f.of(results[x], results[y]),
                Op::Select(condition, then, otherwise) => {
                    select(results[condition], results[then], results[otherwise])
                }
                Op::State(index) => states[index],
                Op::Delayed(d) => {
                    let memory = &mut lines[d.line];
                    memory.push(results[d.signal]);
                    if d.longest.is_some() {
                        let samples = results[d.delay] / self.setting.period;
                        Tap::between(samples.at_most(self.results[*register])).read(memory)
                    } else {
                        self.taps[d.line].read(memory)
                    }
                }
                Op::Signal(signal) => match signal {
                    Signal::Own => signals.own,
                    Signal::Command => at.command,
                    Signal::Flow => at.flow,
                    Signal::Arrived => at.arrived,
                    Signal::Relaxation => signals.flow(|flow| flow.relaxation),
                    Signal::Before => signals.flow(|flow| flow.before),
                    Signal::Next => signals.flow(|flow| flow.next),
                    Signal::Released => signals.flow(|flow| flow.released),
                    Signal::Present => at.present,
                    Signal::Channel => {
                        let channel = at.channels.get(self.setting.channel);
                        // Without a channel, its reference is used.
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

impl<T: Real> UserEffect<T> {
    /// Where it acts.
    pub(crate) fn place(&self) -> Place {
        self.place
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
            flow: None,
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
            flow: Some(flow),
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
            flow: None,
            at,
        };
        self.run(state, &signals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The board's computation: every line, one after the other.
    fn one_after_the_other(table: &Table<f32>, x: f32) -> f32 {
        let first = table.lines[0].below;
        table.lines.iter().fold(first, |value, line| {
            let along = (x - line.from) * line.steepness;
            value + along.at_least(0.0).at_most(1.0) * line.rise
        })
    }

    proptest! {
        #[test]
        fn a_table_is_looked_up_to_the_bit(
            start in -100.0_f64..100.0,
            points in prop::collection::vec((1e-4_f64..10.0, -3.0_f32..3.0), 2..9),
            x in -150.0_f32..150.0,
            nearest in 0_usize..8,
        ) {
            let mut table = Table { x: 0, ends: Vec::new(), lines: Vec::new(), last: 0.25_f32 };
            let (mut from, mut corners) = (start, Vec::new());
            for (width, rise) in points {
                let to = from + width;
                table.ends.push(surely_passed(from, to));
                table.lines.push(TableLine {
                    from: from as f32,
                    steepness: (1.0 / width) as f32,
                    rise,
                    below: table.last,
                });
                corners.push(to as f32);
                (from, table.last) = (to, table.last + rise);
            }
            let corner = corners[nearest % corners.len()];
            for x in [x, corner, corner.next_up(), corner.next_down(), f32::INFINITY, f32::NEG_INFINITY] {
                let (told, board) = (table.at(x), one_after_the_other(&table, x));
                prop_assert_eq!(told.to_bits(), board.to_bits(), "at {}", x);
            }
        }
    }
}
