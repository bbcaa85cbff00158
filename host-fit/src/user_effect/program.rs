//! An expression as a list of operations. The interpreter and the generated Rust use it, so both compute the same
//! operations in the same order.

use model_core::Real;
use std::cmp::Ordering;

/// Index of an operation's result.
pub(crate) type Register = usize;

/// A signal an expression can read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    /// The signal that the effect changes: jet strength or sensor reading.
    Own,
    /// u.
    Command,
    /// y, the friction of the flow.
    Flow,
    /// The jet strength that arrives at the flow.
    Arrived,
    /// 1 − Σa − Σc·j of the recursion.
    Relaxation,
    /// The flow one sample before; this and the next three are for effects of the catalogue only.
    Before,
    /// The flow at the next sample without this effect.
    Next,
    /// Share of the separated flow in the motion.
    Released,
    /// The jet strength at the flow at this instant.
    Present,
    /// The measured channel.
    Channel,
    /// Time in the record, s.
    Time,
    /// Time since the last edge, s.
    SinceEdge,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unary {
    Negative,
    Abs,
    Sqrt,
    Exp,
    Cbrt,
    Sin,
    Cos,
    Not,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Min,
    Max,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Unequal,
    And,
    Or,
}

impl Binary {
    pub(crate) fn compares(self) -> bool {
        matches!(
            self,
            Self::Less
                | Self::LessOrEqual
                | Self::Greater
                | Self::GreaterOrEqual
                | Self::Equal
                | Self::Unequal
        )
    }
}

/// One operation; operands are results of earlier ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Op {
    Number(f64),
    Parameter(usize),
    Period,
    Reference,
    Signal(Signal),
    /// A state after the last sample.
    State(usize),
    Delayed(Delayed),
    Unary(Unary, Register),
    Binary(Binary, Register, Register),
    /// The condition, the value where it holds, and the value elsewhere.
    Select(Register, Register, Register),
}

/// `signal` delayed by `delay` seconds; `line` numbers the memories. A varying delay is at most `longest` seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Delayed {
    pub(crate) line: usize,
    pub(crate) signal: Register,
    pub(crate) delay: Register,
    pub(crate) longest: Option<Register>,
}

impl Op {
    pub(crate) fn operands(&self) -> impl Iterator<Item = Register> + use<> {
        let all = match *self {
            Self::Number(_)
            | Self::Parameter(_)
            | Self::Period
            | Self::Reference
            | Self::Signal(_)
            | Self::State(_) => [None; 3],
            Self::Delayed(d) => [Some(d.signal), Some(d.delay), d.longest],
            Self::Unary(_, x) => [Some(x), None, None],
            Self::Binary(_, x, y) => [Some(x), Some(y), None],
            Self::Select(condition, then, otherwise) => {
                [Some(condition), Some(then), Some(otherwise)]
            }
        };
        all.into_iter().flatten()
    }

    fn with_operands(self, to: impl Fn(Register) -> Register + Copy) -> Self {
        match self {
            Self::Delayed(d) => Self::Delayed(Delayed {
                signal: to(d.signal),
                delay: to(d.delay),
                longest: d.longest.map(to),
                ..d
            }),
            Self::Unary(f, x) => Self::Unary(f, to(x)),
            Self::Binary(f, x, y) => Self::Binary(f, to(x), to(y)),
            Self::Select(x, y, z) => Self::Select(to(x), to(y), to(z)),
            Self::Number(_)
            | Self::Parameter(_)
            | Self::Period
            | Self::Reference
            | Self::Signal(_)
            | Self::State(_) => self,
        }
    }
}

/// Operations that form a piecewise linear table with constant points: only the lines around x are evaluated,
/// and the sum before them is precomputed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lines {
    pub(crate) x: Register,
    /// The value before the first point.
    pub(crate) first: Register,
    pub(crate) lines: Vec<Line>,
}

/// A line from one point to the next, `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    pub(crate) from: Register,
    pub(crate) to: f64,
    pub(crate) steepness: Register,
    pub(crate) rise: Register,
    /// The sum up to and including this line.
    pub(crate) value: Register,
}

impl Lines {
    /// The operation whose result is the value.
    pub(crate) fn value(&self) -> Register {
        self.lines.last().map_or(self.first, |line| line.value)
    }

    fn with_registers(&self, to: impl Fn(Register) -> Register) -> Self {
        let lines = self.lines.iter().map(|line| Line {
            from: to(line.from),
            to: line.to,
            steepness: to(line.steepness),
            rise: to(line.rise),
            value: to(line.value),
        });
        Self {
            x: to(self.x),
            first: to(self.first),
            lines: lines.collect(),
        }
    }
}

/// A state variable.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Carried {
    pub(crate) name: String,
    pub(crate) start: f64,
    /// Next value of the state.
    pub(crate) update: Register,
}

/// Operations of an effect at a sample.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Program {
    pub(crate) ops: Vec<Op>,
    /// Whether each operation's result is constant.
    pub(crate) once: Vec<bool>,
    pub(crate) states: Vec<Carried>,
    /// Memories for delayed signals.
    pub(crate) lines: usize,
    /// Operations that form tables.
    pub(crate) tables: Vec<Lines>,
    pub(crate) value: Register,
}

/// Appends operations without duplicates.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    ops: Vec<Op>,
    tables: Vec<Lines>,
}

impl Builder {
    pub(crate) fn push(&mut self, op: Op) -> Register {
        if let Some(same) = self.ops.iter().position(|known| *known == op) {
            return same;
        }
        self.ops.push(op);
        self.ops.len() - 1
    }

    pub(crate) fn delayed(
        &mut self,
        signal: Register,
        delay: Register,
        longest: Option<Register>,
    ) -> Register {
        let mut lines = self.ops.iter().filter_map(|op| match op {
            Op::Delayed(d) if (d.signal, d.delay, d.longest) == (signal, delay, longest) => {
                Some(d.line)
            }
            _ => None,
        });
        let known = lines.next_back();
        let count = self
            .ops
            .iter()
            .filter(|op| matches!(op, Op::Delayed(_)))
            .count();
        self.push(Op::Delayed(Delayed {
            line: known.unwrap_or(count),
            signal,
            delay,
            longest,
        }))
    }

    pub(crate) fn is_once(&self, register: Register) -> bool {
        once(&self.ops).get(register).copied().unwrap_or(false)
    }

    /// Marks operations as a table.
    pub(crate) fn is_table(&mut self, table: Lines) {
        let steady = |r: Register| self.is_once(r);
        if steady(table.first) && table.lines.iter().all(|line| steady(line.rise)) {
            self.tables.push(table);
        }
    }

    /// The number in a register, if it is a literal.
    pub(crate) fn number(&self, register: Register) -> Option<f64> {
        match self.ops.get(register)? {
            Op::Number(value) => Some(*value),
            Op::Unary(Unary::Negative, x) => self.number(*x).map(|x| -x),
            _ => None,
        }
    }

    pub(crate) fn is_number(&self, register: Register) -> bool {
        self.number(register).is_some()
    }

    /// Removes operations that do not influence `value`, and renumbers the others.
    pub(crate) fn finish(self, value: Register, states: Vec<Carried>) -> Program {
        let mut alive = vec![false; self.ops.len()];
        let mut pending = vec![value];
        while let Some(register) = pending.pop() {
            let (Some(seen), Some(op)) = (alive.get_mut(register), self.ops.get(register)) else {
                continue;
            };
            if std::mem::replace(seen, true) {
                continue;
            }
            pending.extend(op.operands());
            if let Op::State(index) = op {
                pending.extend(states.get(*index).map(|state| state.update));
            }
        }
        let renumbered = |kept: &dyn Fn(usize) -> bool, count: usize| -> Vec<usize> {
            let mut next = 0;
            let number = |i| {
                let own = next;
                next += usize::from(kept(i));
                own
            };
            (0..count).map(number).collect()
        };
        let registers = renumbered(&|r| alive[r], self.ops.len());
        let carried = |index: usize| {
            let read = Op::State(index);
            self.ops
                .iter()
                .zip(&alive)
                .any(|(op, alive)| *alive && *op == read)
        };
        let state_numbers = renumbered(&carried, states.len());
        let line_alive = |line: usize| {
            self.ops
                .iter()
                .zip(&alive)
                .any(|(op, alive)| *alive && matches!(op, Op::Delayed(d) if d.line == line))
        };
        let line_numbers = renumbered(&line_alive, self.ops.len());
        let ops: Vec<Op> = self
            .ops
            .iter()
            .zip(&alive)
            .filter(|(_, alive)| **alive)
            .map(|(op, _)| match op.with_operands(|r| registers[r]) {
                Op::State(index) => Op::State(state_numbers[index]),
                Op::Delayed(d) => Op::Delayed(Delayed {
                    line: line_numbers[d.line],
                    ..d
                }),
                op => op,
            })
            .collect();
        let kept = states.into_iter().enumerate().filter(|(i, _)| carried(*i));
        let states = kept
            .map(|(_, state)| Carried {
                update: registers[state.update],
                ..state
            })
            .collect();
        let tables = self.tables.iter().filter(|table| alive[table.value()]);
        let tables = tables.map(|table| table.with_registers(|r| registers[r]));
        Program {
            tables: tables.collect(),
            once: once(&ops),
            lines: ops.iter().filter(|op| matches!(op, Op::Delayed(_))).count(),
            value: registers[value],
            ops,
            states,
        }
    }
}

fn once(ops: &[Op]) -> Vec<bool> {
    let mut once: Vec<bool> = Vec::with_capacity(ops.len());
    for op in ops {
        let varies = matches!(op, Op::Signal(_) | Op::State(_) | Op::Delayed(_));
        let steady = |r: Register| once.get(r).copied().unwrap_or(false);
        let own = !varies && op.operands().all(steady);
        once.push(own);
    }
    once
}

impl Program {
    /// Operations needed at every sample if tables are looked up.
    pub(crate) fn needed(&self) -> Vec<bool> {
        let mut needed = vec![false; self.ops.len()];
        let updates = self.states.iter().map(|state| state.update);
        let mut pending: Vec<Register> = updates.chain([self.value]).collect();
        while let Some(register) = pending.pop() {
            if std::mem::replace(&mut needed[register], true) {
                continue;
            }
            match self.table_at(register) {
                Some(table) => pending.push(self.tables[table].x),
                None => pending.extend(self.ops[register].operands()),
            }
        }
        needed
    }

    /// The table whose value an operation is.
    pub(crate) fn table_at(&self, register: Register) -> Option<usize> {
        let mut tables = self.tables.iter();
        tables.position(|table| table.value() == register)
    }

    pub(crate) fn reads(&self, op: Op) -> bool {
        self.ops.contains(&op)
    }

    /// Whether parameter `index` enters a comparison (not through a state): the output then changes in steps
    /// with it.
    pub(crate) fn is_compared(&self, index: usize) -> bool {
        let mut depends = vec![false; self.ops.len()];
        for (register, op) in self.ops.iter().enumerate() {
            depends[register] =
                *op == Op::Parameter(index) || op.operands().any(|operand| depends[operand]);
            if let Op::Binary(f, _, _) = op
                && f.compares()
                && depends[register]
            {
                return true;
            }
        }
        false
    }
}

/// A truth value as a number.
fn truth<T: Real>(truth: bool) -> T {
    if truth { T::ONE } else { T::ZERO }
}

fn holds<T: Real>(x: T) -> bool {
    x.value() > 0.5
}

impl Unary {
    #[inline]
    pub(crate) fn of<T: Real>(self, x: T) -> T {
        match self {
            Self::Negative => -x,
            Self::Abs => x.abs(),
            Self::Sqrt => x.sqrt(),
            Self::Exp => x.exp(),
            Self::Cbrt => x.cbrt(),
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Not => truth(!holds(x)),
        }
    }
}

impl Binary {
    #[inline]
    pub(crate) fn of<T: Real>(self, x: T, y: T) -> T {
        // `partial_cmp` ignores derivatives, while `==` of dual numbers compares them too.
        let equal = || x.partial_cmp(&y) == Some(Ordering::Equal);
        match self {
            Self::Add => x + y,
            Self::Subtract => x - y,
            Self::Multiply => x * y,
            Self::Divide => x / y,
            Self::Min => x.at_most(y),
            Self::Max => x.at_least(y),
            Self::Less => truth(x < y),
            Self::LessOrEqual => truth(x <= y),
            Self::Greater => truth(x > y),
            Self::GreaterOrEqual => truth(x >= y),
            Self::Equal => truth(equal()),
            Self::Unequal => truth(!equal()),
            Self::And => truth(holds(x) && holds(y)),
            Self::Or => truth(holds(x) || holds(y)),
        }
    }
}

/// `then` where `condition` holds.
#[inline]
pub(crate) fn select<T: Real>(condition: T, then: T, otherwise: T) -> T {
    if holds(condition) { then } else { otherwise }
}
