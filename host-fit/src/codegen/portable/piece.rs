//! An effect or a delay law as statements in any language with numbers and names.

use crate::user_effect::UserEffect;
use crate::user_effect::program::{Binary, Op, Program, Register, Signal, Unary};
use model_core::Real;
use model_core::effect::{Place, Setting};

/// Precedence of an operator; an operand of lower precedence is put in parentheses.
const ATOM: u8 = 10;
const SIGN: u8 = 8;
const PRODUCT: u8 = 6;
const SUM: u8 = 5;
const COMPARISON: u8 = 4;
const LOOSEST: u8 = 0;

/// An expression with its precedence.
#[derive(Clone, Debug)]
pub(super) struct Text(pub(super) String, u8);

impl Text {
    pub(super) fn atom(text: impl Into<String>) -> Self {
        Self(text.into(), ATOM)
    }

    fn within(&self, least: u8) -> String {
        if self.1 < least {
            format!("({})", self.0)
        } else {
            self.0.clone()
        }
    }
}

/// The syntax in which the languages differ.
pub(super) trait Tongue {
    /// A number.
    fn number(&self, value: f64) -> String;
    /// A function of numbers.
    fn call(&self, function: Function, arguments: &[String]) -> String;
    /// A quotient whose divisor may be 0.
    fn quotient(&self, dividend: &str, divisor: &str) -> Option<String>;
    /// `then` where `condition` holds.
    fn select(&self, condition: &str, then: &str, otherwise: &str) -> String;
    /// and, or, not, unequal.
    fn logic(&self) -> [&'static str; 4];
    /// A signal; `channel` is the number of the piece's own channel.
    fn signal(&self, signal: Signal, channel: usize) -> String;
    /// A variable of the model's state.
    fn state(&self, name: &str) -> String;
    /// A statement that names a result.
    fn local(&self, name: &str, value: &str) -> String;
    /// A statement that assigns a value to a state.
    fn assign(&self, state: &str, value: &str) -> String;
    /// A statement that stores `value` as the newest sample of a memory.
    fn push(&self, line: &str, value: &str) -> String;
    /// The value of a memory this many samples back, interpolated between that sample and the preceding one.
    fn read(&self, line: &str, samples: Tapped<'_>) -> String;
    /// A comment above constants.
    fn heading(&self, text: &str) -> String;
    /// The definition of a constant, with an explanation if `remark` is not empty.
    fn define(&self, name: &str, value: &str, remark: &str) -> String;
    /// A number as the value of a constant.
    fn constant(&self, value: f64) -> String {
        self.number(value)
    }
    /// A whole number as the value of a constant.
    fn whole(&self, value: u32) -> String {
        value.to_string()
    }
    /// The definition of a constant that follows from others.
    fn derived(&self, constant: &Constant) -> String {
        self.define(&constant.name, &constant.formula, "")
    }
    /// The definition of the length of a memory, if the language needs one.
    fn length(&self, line: &str, samples: usize) -> Option<String>;
    /// The name of a constant of the law.
    fn law_name(&self, name: &str) -> String {
        name.to_owned()
    }
    /// The statements of an effect with its name.
    fn block(&self, name: &str, statements: &[String]) -> String;
}

/// Where a memory is read.
pub(super) enum Tapped<'a> {
    Fixed {
        whole: usize,
        fraction: f64,
    },
    /// A varying number of samples back, as an expression.
    Varying(&'a str),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Abs,
    Sqrt,
    Exp,
    Cbrt,
    Sin,
    Cos,
    Min,
    Max,
}

/// An effect or a delay law with its names.
pub(super) struct Piece {
    pub(super) program: &'static Program,
    /// Prefix of the names of constants, for example `FX1`; states have it in lower case.
    prefix: String,
    /// Prefix of the names of parameters.
    owner: String,
    parameters: Vec<String>,
    channel: usize,
    /// Constant results, evaluated as on the host.
    values: Vec<f64>,
    taps: Vec<(usize, f64)>,
    lengths: Vec<usize>,
    /// How often a result is used.
    uses: Vec<usize>,
    /// Constant results that have a name, numbered.
    constants: Vec<Register>,
}

/// A constant that a piece needs.
pub(super) struct Constant {
    pub(super) name: String,
    pub(super) value: f64,
    /// Formula of the constant in the parameters.
    pub(super) formula: String,
}

/// The effect or law that a piece is generated for.
pub(super) struct Made<'a> {
    pub(super) prefix: &'a str,
    pub(super) owner: &'a str,
    pub(super) names: Vec<String>,
    pub(super) values: &'a [f64],
    pub(super) period_s: f64,
    pub(super) channel: usize,
    pub(super) reference: f64,
}

impl Piece {
    /// Evaluates the constant results in numbers of type `T`.
    pub(super) fn new<T: Real>(program: &'static Program, made: &Made<'_>) -> Self {
        let parameters: Vec<T> = made.values.iter().map(|v| T::from_f64(*v)).collect();
        let setting = Setting {
            period: T::from_f64(made.period_s),
            channel: made.channel,
            reference: T::from_f64(made.reference),
        };
        // The place has no influence here: it determines only the hook that would run the program.
        let host = UserEffect::of(program, Place::Jet, &parameters, &setting);
        let values = (0..program.ops.len()).map(|r| host.constant(r).value());
        let taps = (0..program.lines).map(|line| {
            let tap = host.tap(line);
            (tap.whole, tap.fraction.value())
        });
        let mut piece = Self {
            program,
            prefix: made.prefix.to_owned(),
            owner: made.owner.to_owned(),
            parameters: made.names.iter().map(|n| n.to_uppercase()).collect(),
            channel: made.channel,
            values: values.collect(),
            taps: taps.collect(),
            lengths: host.line_lengths(),
            uses: vec![0; program.ops.len()],
            constants: Vec::new(),
        };
        piece.count();
        piece
    }

    fn once(&self, register: Register) -> bool {
        self.program.once.get(register).copied().unwrap_or(false)
    }

    /// Operands of an operation at its place of use.
    fn operands(op: &Op) -> Vec<Register> {
        match op {
            // A constant delay is a fixed position in the memory.
            Op::Delayed(d) if d.longest.is_none() => vec![d.signal],
            Op::Delayed(d) => vec![d.signal, d.delay],
            op => op.operands().collect(),
        }
    }

    fn count(&mut self) {
        let program = self.program;
        let mut varying = vec![false; program.ops.len()];
        for (register, op) in program.ops.iter().enumerate() {
            for operand in Self::operands(op) {
                self.uses[operand] += 1;
                varying[operand] |= !self.once(register);
            }
        }
        for register in program
            .states
            .iter()
            .map(|s| s.update)
            .chain([program.value])
        {
            self.uses[register] += 1;
            varying[register] = true;
        }
        // The operations are visited from the last to the first, because a constant is needed if a
        // needed constant depends on it.
        let plain = |op: &Op| {
            matches!(
                op,
                Op::Number(_) | Op::Parameter(_) | Op::Period | Op::Reference
            )
        };
        let named = |r: Register| {
            let op = &program.ops[r];
            self.once(r) && !plain(op) && (varying[r] || self.uses[r] > 1)
        };
        self.constants = (0..program.ops.len()).filter(|r| named(*r)).collect();
    }

    fn constant_name(&self, register: Register) -> Option<String> {
        let number = self.constants.iter().position(|r| *r == register)?;
        Some(format!("{}K{}", self.prefix, number + 1))
    }

    fn parameter(&self, index: usize) -> String {
        let name = self.parameters.get(index).map_or("", String::as_str);
        format!("{}_{name}", self.owner)
    }

    fn state(&self, index: usize) -> String {
        let state = self.program.states.get(index);
        let name = state.map_or("", |state| state.name.as_str());
        format!("{}_{name}", self.prefix.to_lowercase())
    }

    fn line(&self, line: usize) -> String {
        format!("{}_line{line}", self.prefix.to_lowercase())
    }

    fn local(&self, register: Register) -> String {
        format!("{}v{register}", self.prefix.to_lowercase())
    }

    /// Prefix of the names of the piece's parameters.
    pub(super) fn owner(&self) -> &str {
        &self.owner
    }

    /// States with their values at rest.
    pub(super) fn states(&self) -> Vec<(String, f64)> {
        let each = self.program.states.iter().enumerate();
        each.map(|(i, state)| (self.state(i), state.start))
            .collect()
    }

    /// Memories with their lengths.
    pub(super) fn lines(&self) -> Vec<(String, usize)> {
        let each = self.lengths.iter().enumerate();
        each.map(|(i, length)| (self.line(i), *length)).collect()
    }

    pub(super) fn reads(&self, signal: Signal) -> bool {
        self.program.reads(Op::Signal(signal))
    }

    pub(super) fn reads_reference(&self) -> bool {
        self.program.reads(Op::Reference) || self.reads(Signal::Channel)
    }

    /// The constants that the piece needs.
    pub(super) fn constants(&self, tongue: &dyn Tongue) -> Vec<Constant> {
        let each = self.constants.iter().filter_map(|register| {
            Some(Constant {
                name: self.constant_name(*register)?,
                value: self.values[*register],
                formula: self.right_side(*register, tongue).0,
            })
        });
        each.collect()
    }

    fn text(&self, register: Register, tongue: &dyn Tongue) -> Text {
        if let Some(name) = self.constant_name(register) {
            return Text::atom(name);
        }
        let named = !self.once(register)
            && (self.uses[register] > 1 || matches!(self.program.ops[register], Op::Delayed(_)));
        let simple = matches!(
            self.program.ops[register],
            Op::Signal(
                Signal::Own
                    | Signal::Command
                    | Signal::Flow
                    | Signal::Arrived
                    | Signal::Relaxation
                    | Signal::Before
                    | Signal::Next
                    | Signal::Released
                    | Signal::Present
            ) | Op::State(_)
        );
        if named && !simple {
            return Text::atom(self.local(register));
        }
        self.right_side(register, tongue)
    }

    fn right_side(&self, register: Register, tongue: &dyn Tongue) -> Text {
        let of = |r: Register| self.text(r, tongue);
        let [and, or, not, unequal] = tongue.logic();
        let infix = |x: Register, sign: &str, y: Register, binds: u8| {
            let (x, y) = (of(x).within(binds), of(y).within(binds + 1));
            Text(format!("{x} {sign} {y}"), binds)
        };
        let call = |function: Function, operands: &[Register]| {
            let operands: Vec<String> = operands.iter().map(|r| of(*r).0).collect();
            Text::atom(tongue.call(function, &operands))
        };
        match self.program.ops[register] {
            Op::Number(value) => Text::atom(tongue.number(value)),
            Op::Parameter(index) => Text::atom(self.parameter(index)),
            Op::Period => Text::atom("PERIOD"),
            Op::Reference => Text::atom(format!("{}_REFERENCE", self.owner)),
            Op::Signal(signal) => Text::atom(tongue.signal(signal, self.channel)),
            Op::State(index) => Text::atom(tongue.state(&self.state(index))),
            Op::Unary(f, x) => match f {
                Unary::Negative => Text(format!("-{}", of(x).within(SIGN + 1)), SIGN),
                Unary::Not => Text::atom(format!("({not}({}))", of(x).0)),
                Unary::Abs => call(Function::Abs, &[x]),
                Unary::Sqrt => call(Function::Sqrt, &[x]),
                Unary::Exp => call(Function::Exp, &[x]),
                Unary::Cbrt => call(Function::Cbrt, &[x]),
                Unary::Sin => call(Function::Sin, &[x]),
                Unary::Cos => call(Function::Cos, &[x]),
            },
            Op::Binary(f, x, y) => match f {
                Binary::Add => infix(x, "+", y, SUM),
                Binary::Subtract => infix(x, "-", y, SUM),
                Binary::Multiply => infix(x, "*", y, PRODUCT),
                Binary::Divide => {
                    let safe = self.once(y) && self.values[y] != 0.0;
                    let quotient = tongue.quotient(&of(x).0, &of(y).0);
                    match quotient.filter(|_| !safe) {
                        Some(text) => Text::atom(text),
                        None => infix(x, "/", y, PRODUCT),
                    }
                }
                Binary::Min => call(Function::Min, &[x, y]),
                Binary::Max => call(Function::Max, &[x, y]),
                Binary::Less => infix(x, "<", y, COMPARISON),
                Binary::LessOrEqual => infix(x, "<=", y, COMPARISON),
                Binary::Greater => infix(x, ">", y, COMPARISON),
                Binary::GreaterOrEqual => infix(x, ">=", y, COMPARISON),
                Binary::Equal => infix(x, "==", y, COMPARISON),
                Binary::Unequal => infix(x, unequal, y, COMPARISON),
                // Parentheses are written, because the languages differ in precedence.
                Binary::And => Text::atom(format!("(({}) {and} ({}))", of(x).0, of(y).0)),
                Binary::Or => Text::atom(format!("(({}) {or} ({}))", of(x).0, of(y).0)),
            },
            Op::Select(condition, then, otherwise) => {
                let (condition, then) = (of(condition).0, of(then).within(LOOSEST));
                Text::atom(tongue.select(&condition, &then, &of(otherwise).0))
            }
            Op::Delayed(d) => {
                let (whole, fraction) = self.taps.get(d.line).copied().unwrap_or_default();
                let name = self.line(d.line);
                Text::atom(if d.longest.is_some() {
                    let quotient = format!("{} / PERIOD", of(d.delay).within(PRODUCT));
                    let most = tongue.number(self.values[register]);
                    let samples = tongue.call(Function::Min, &[quotient, most]);
                    tongue.read(&name, Tapped::Varying(&samples))
                } else {
                    tongue.read(&name, Tapped::Fixed { whole, fraction })
                })
            }
        }
    }

    /// The statements of a sample, and the resulting value.
    pub(super) fn statements(&self, tongue: &dyn Tongue) -> (Vec<String>, String) {
        let program = self.program;
        let mut lines = Vec::new();
        for (register, op) in program.ops.iter().enumerate() {
            if self.once(register) {
                continue;
            }
            if let Op::Delayed(d) = op {
                let signal = self.text(d.signal, tongue).0;
                lines.push(tongue.push(&self.line(d.line), &signal));
            }
            let name = self.local(register);
            if self.text(register, tongue).0 == name {
                let value = self.right_side(register, tongue).0;
                lines.push(tongue.local(&name, &value));
            }
        }
        let mut value = self.text(program.value, tongue).0;
        if program.states.is_empty() {
            return (lines, value);
        }
        // All states change at once, so values that are read are copied before.
        let kept = |register: Register| {
            self.once(register) || self.text(register, tongue).0 == self.local(register)
        };
        if !kept(program.value) {
            let name = format!("{}value", self.prefix.to_lowercase());
            lines.push(tongue.local(&name, &value));
            value = name;
        }
        let updates: Vec<String> = program
            .states
            .iter()
            .enumerate()
            .map(|(i, state)| {
                let text = self.text(state.update, tongue).0;
                if kept(state.update) || program.states.len() == 1 {
                    return text;
                }
                let name = format!("{}new{i}", self.prefix.to_lowercase());
                lines.push(tongue.local(&name, &text));
                name
            })
            .collect();
        for (i, update) in updates.iter().enumerate() {
            lines.push(tongue.assign(&self.state(i), update));
        }
        (lines, value)
    }
}
