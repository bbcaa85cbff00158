//! Rust for the board from a user's effect: the interpreter's operations in
//! the interpreter's order, one a line.

use super::interpreter::LONGEST_DELAY;
use super::program::{Binary, Op, Register, Signal, Unary};
use super::{Definition, UserEffect};
use model_core::effect::{Place, Setting};
use std::fmt::Write as _;

/// Name of the module that [`rust_source`] writes: `user_` and the effect's name.
#[must_use]
pub fn module_name(effect: &str) -> String {
    format!("user_{}", effect.replace('-', "_"))
}

/// Name of the type in that module: the effect's name in camel case.
#[must_use]
pub fn type_name(effect: &str) -> String {
    let words = effect.split('-').map(|word| {
        let mut letters = word.chars();
        let first = letters.next().map(|c| c.to_ascii_uppercase());
        first.into_iter().chain(letters).collect::<String>()
    });
    words.collect()
}

/// A module with a type that implements `model_core::Effect<f32>`, made by
/// `new(&[f32; P], &Setting<f32>)`.
///
/// Memories of delayed signals are as long as `parameters` (the definition's
/// order and units) need them at `setting`'s sample period, so constants and
/// module belong together. The text compiles in a `no_std` crate that depends
/// on `model-core` only, and is laid out as rustfmt would.
#[must_use]
pub fn rust_source(
    definition: &'static Definition,
    parameters: &[f64],
    setting: &Setting<f32>,
) -> String {
    let values: Vec<f32> = parameters.iter().map(|value| *value as f32).collect();
    let lengths = UserEffect::new(definition, &values, setting).line_lengths();
    let writer = Writer {
        definition,
        lengths,
    };
    writer.module()
}

/// A struct's value as the last line of a function; short ones on one line.
fn literal(out: &mut String, name: &str, entries: &[String]) {
    const LONGEST_ON_A_LINE: usize = 18;
    let joined = entries.join(", ");
    if entries.is_empty() {
        let _ = writeln!(out, "            {name} {{}}");
    } else if joined.chars().count() <= LONGEST_ON_A_LINE {
        let _ = writeln!(out, "            {name} {{ {joined} }}");
    } else {
        let _ = writeln!(out, "            {name} {{");
        for entry in entries {
            let _ = writeln!(out, "                {entry},");
        }
        out.push_str("            }\n");
    }
}

struct Writer {
    definition: &'static Definition,
    lengths: Vec<usize>,
}

impl Writer {
    fn ops(&self) -> impl Iterator<Item = (Register, &Op, bool)> {
        let program = &self.definition.program;
        let each = program.ops.iter().zip(&program.once).enumerate();
        each.map(|(register, (op, once))| (register, op, *once))
    }

    fn op(&self, register: Register) -> Op {
        let op = self.definition.program.ops.get(register);
        op.copied().unwrap_or(Op::Number(0.0))
    }

    fn is_condition(&self, register: Register) -> bool {
        match self.op(register) {
            Op::Unary(Unary::Not, _) => true,
            Op::Binary(f, ..) => f.compares() || matches!(f, Binary::And | Binary::Or),
            Op::Select { then, .. } => self.is_condition(then),
            _ => false,
        }
    }

    fn is_once(&self, register: Register) -> bool {
        let once = self.definition.program.once.get(register);
        once.copied().unwrap_or(false)
    }

    /// What an operation says at the place where it is used.
    fn operand(&self, register: Register, preparing: bool) -> String {
        let field = |name: String| {
            if preparing {
                name
            } else {
                format!("self.{name}")
            }
        };
        match self.op(register) {
            Op::Number(value) => format!("{:?}_f32", value as f32),
            Op::Parameter(index) => field(self.parameter(index)),
            Op::Period if preparing => "setting.period".to_owned(),
            Op::Period => "self.period".to_owned(),
            Op::Reference if preparing => "setting.reference".to_owned(),
            Op::Reference => "self.reference".to_owned(),
            _ if self.is_once(register) => field(format!("k{register}")),
            _ => format!("v{register}"),
        }
    }

    fn parameter(&self, index: usize) -> String {
        let parameter = self.definition.spec.parameters.get(index);
        format!("p_{}", parameter.map_or("", |parameter| parameter.name))
    }

    /// The right side of `let` for an operation on others.
    fn right_side(&self, op: &Op, preparing: bool) -> String {
        let of = |register: Register| self.operand(register, preparing);
        match *op {
            Op::Unary(f, x) => {
                let x = of(x);
                match f {
                    Unary::Negative => format!("-{x}"),
                    Unary::Not => format!("!{x}"),
                    Unary::Abs => format!("Real::abs({x})"),
                    Unary::Sqrt => format!("Real::sqrt({x})"),
                    Unary::Exp => format!("Real::exp({x})"),
                    Unary::Cbrt => format!("Real::cbrt({x})"),
                    Unary::Sin => format!("Real::sin({x})"),
                    Unary::Cos => format!("Real::cos({x})"),
                }
            }
            Op::Binary(f, x, y) => {
                let (x, y) = (of(x), of(y));
                let sign = match f {
                    Binary::Min => return format!("Real::at_most({x}, {y})"),
                    Binary::Max => return format!("Real::at_least({x}, {y})"),
                    Binary::Add => "+",
                    Binary::Subtract => "-",
                    Binary::Multiply => "*",
                    Binary::Divide => "/",
                    Binary::Less => "<",
                    Binary::LessOrEqual => "<=",
                    Binary::Greater => ">",
                    Binary::GreaterOrEqual => ">=",
                    Binary::Equal => "==",
                    Binary::Unequal => "!=",
                    Binary::And => "&&",
                    Binary::Or => "||",
                };
                format!("{x} {sign} {y}")
            }
            Op::Select {
                condition,
                then,
                otherwise,
            } => format!(
                "if {} {{ {} }} else {{ {} }}",
                of(condition),
                of(then),
                of(otherwise)
            ),
            Op::State(index) => {
                let state = self.definition.program.states.get(index);
                format!("state.s_{}", state.map_or("", |state| state.name.as_str()))
            }
            Op::Signal(signal) => match signal {
                Signal::Own => "signal".to_owned(),
                Signal::Command => "at.command".to_owned(),
                Signal::Flow => "at.flow".to_owned(),
                Signal::Arrived => "at.arrived".to_owned(),
                Signal::Relaxation => "flow.relaxation".to_owned(),
                Signal::Channel => "channel.copied().unwrap_or(self.reference)".to_owned(),
                Signal::Time => "state.clock.time(self.period)".to_owned(),
                Signal::SinceEdge => "state.clock.since_edge(self.period)".to_owned(),
            },
            Op::Delayed { line, .. } => format!("self.tap{line}.read(&state.line{line})"),
            Op::Number(_) | Op::Parameter(_) | Op::Period | Op::Reference => String::new(),
        }
    }

    /// Whether the value is the very last thing computed: it is then returned
    /// without a name.
    fn is_last(&self, register: Register) -> bool {
        let program = &self.definition.program;
        let last = self.ops().filter(|(_, _, once)| !once).last();
        register == program.value
            && program.states.is_empty()
            && last.is_some_and(|(last, ..)| last == register)
    }

    fn result(&self, out: &mut String, register: Register, op: &Op) {
        if self.is_last(register) {
            self.line(out, "", op, "", false);
        } else {
            self.line(out, &format!("let v{register} = "), op, ";", false);
        }
    }

    /// An operation, broken as rustfmt breaks a long choice.
    fn line(&self, out: &mut String, before: &str, op: &Op, after: &str, preparing: bool) {
        const LONGEST_CHOICE: usize = 50;
        let right = self.right_side(op, preparing);
        match *op {
            // As the last line of a function, a choice is always broken.
            Op::Select {
                condition,
                then,
                otherwise,
            } if right.len() > LONGEST_CHOICE || before.is_empty() => {
                let of = |register: Register| self.operand(register, preparing);
                let _ = writeln!(
                    out,
                    "            {before}if {} {{
                {}
            }} else {{
                {}
            }}{after}",
                    of(condition),
                    of(then),
                    of(otherwise)
                );
            }
            _ => {
                let _ = writeln!(out, "            {before}{right}{after}");
            }
        }
    }

    /// Whether results of `register` are needed at every sample.
    fn is_field(&self, register: Register) -> bool {
        let program = &self.definition.program;
        let used = |(_, op, once): (Register, &Op, bool)| match op {
            // Delays become taps.
            Op::Delayed { signal, .. } => *signal == register,
            op => !once && op.operands().any(|operand| operand == register),
        };
        let result = program.value == register
            || program.states.iter().any(|state| state.update == register)
            || self.ops().any(used);
        result && self.is_once(register) && !matches!(self.op(register), Op::Number(_))
    }

    fn reads(&self, signal: Signal) -> bool {
        self.definition.program.reads(Op::Signal(signal))
    }

    /// Fields of the effect: name, type, value in `new` where it differs.
    fn fields(&self) -> Vec<(String, String, Option<String>)> {
        let mut fields = Vec::new();
        let clocked = self.reads(Signal::Time) || self.reads(Signal::SinceEdge);
        let (mut period, mut reference) = (clocked, self.reads(Signal::Channel));
        for (register, op, _) in self.ops() {
            if let Op::Delayed { line, delay, .. } = op {
                let tap = format!(
                    "Tap::between(Real::at_most({} / setting.period, {LONGEST_DELAY}.0_f32))",
                    self.operand(*delay, true)
                );
                fields.push((format!("tap{line}"), "Tap<f32>".to_owned(), Some(tap)));
            }
            if !self.is_field(register) {
                continue;
            }
            match op {
                Op::Period => period = true,
                Op::Reference => reference = true,
                _ => {
                    let kind = if self.is_condition(register) {
                        "bool"
                    } else {
                        "f32"
                    };
                    fields.push((self.operand(register, true), kind.to_owned(), None));
                }
            }
        }
        let mut setting = |name: &str, kind: &str| {
            let value = Some(format!("setting.{name}"));
            fields.push((name.to_owned(), kind.to_owned(), value));
        };
        if period {
            setting("period", "f32");
        }
        if self.reads(Signal::Channel) {
            setting("channel", "usize");
        }
        if reference {
            setting("reference", "f32");
        }
        fields
    }

    fn module(&self) -> String {
        let spec = &self.definition.spec;
        let program = &self.definition.program;
        let clocked = self.reads(Signal::Time) || self.reads(Signal::SinceEdge);
        let mut out = String::new();
        let (module, own) = (module_name(spec.name), type_name(spec.name));
        let _ = writeln!(
            out,
            "/// {}: {}.",
            spec.name,
            spec.summary.trim_end_matches('.')
        );
        let _ = writeln!(out, "///\n/// `{}`", spec.equation);
        let _ = writeln!(out, "pub mod {module} {{");

        let calls = |op: &Op| {
            matches!(
                op,
                Op::Unary(
                    Unary::Abs | Unary::Sqrt | Unary::Exp | Unary::Cbrt | Unary::Sin | Unary::Cos,
                    _
                ) | Op::Binary(Binary::Min | Binary::Max, ..)
                    | Op::Delayed { .. }
            )
        };
        if program.ops.iter().any(calls) {
            out.push_str("    use model_core::Real;\n");
        }
        if clocked {
            out.push_str("    use model_core::clock::Clock;\n");
        }
        if program.lines > 0 {
            out.push_str("    use model_core::delay::Tap;\n");
        }
        out.push_str(match spec.place {
            Place::Flow => "    use model_core::effect::{Effect, Flow, Instant, Setting};\n",
            Place::Jet | Place::Delay | Place::Sensor => {
                "    use model_core::effect::{Effect, Instant, Setting};\n"
            }
        });
        if program.lines > 0 {
            out.push_str("    use model_core::history::{DelayLine, Memory};\n");
        }

        let fields = self.fields();
        out.push_str("\n    /// Prepared for a sample period.\n");
        out.push_str("    #[derive(Clone, Copy, Debug, PartialEq)]\n");
        if fields.is_empty() {
            let _ = writeln!(out, "    pub struct {own} {{}}");
        } else {
            let _ = writeln!(out, "    pub struct {own} {{");
            for (name, kind, _) in &fields {
                let _ = writeln!(out, "        {name}: {kind},");
            }
            out.push_str("    }\n");
        }

        let mut memory: Vec<(String, String, String)> = Vec::new();
        if clocked {
            let new = "Clock::new()".to_owned();
            memory.push(("clock".to_owned(), "Clock<f32>".to_owned(), new));
        }
        for state in &program.states {
            let start = format!("{:?}", state.start as f32);
            memory.push((format!("s_{}", state.name), "f32".to_owned(), start));
        }
        for (line, length) in self.lengths.iter().enumerate() {
            let kind = format!("DelayLine<f32, {length}>");
            memory.push((format!("line{line}"), kind, "DelayLine::new()".to_owned()));
        }
        out.push_str("\n    /// What it remembers.\n");
        out.push_str("    #[derive(Clone, Copy, Debug, PartialEq)]\n");
        if memory.is_empty() {
            out.push_str("    pub struct State {}\n");
        } else {
            out.push_str("    pub struct State {\n");
            for (name, kind, _) in &memory {
                let _ = writeln!(out, "        {name}: {kind},");
            }
            out.push_str("    }\n");
        }
        self.constructor(&mut out, &own, &fields);
        self.effect(&mut out, &own, &memory, clocked);
        out.push_str("}\n");
        out
    }

    fn constructor(
        &self,
        out: &mut String,
        own: &str,
        fields: &[(String, String, Option<String>)],
    ) {
        let parameters = self.definition.spec.parameters;
        let names: Vec<String> = (0..parameters.len()).map(|i| self.parameter(i)).collect();
        // What is used only to prepare other results is not a field.
        let is_prepared = |op: &Op, once: bool| {
            once && !matches!(
                op,
                Op::Number(_) | Op::Parameter(_) | Op::Period | Op::Reference
            )
        };
        let reads_setting = fields
            .iter()
            .any(|(_, _, value)| value.as_ref().is_some_and(|v| v.contains("setting.")))
            || self.ops().any(|(_, op, once)| {
                is_prepared(op, once)
                    && op
                        .operands()
                        .any(|r| matches!(self.op(r), Op::Period | Op::Reference))
            });
        let setting = if reads_setting { "setting" } else { "_setting" };
        let first = if names.is_empty() {
            "_parameters"
        } else {
            "parameters"
        };
        let _ = write!(
            out,
            "
    impl {own} {{
        /// Prepares the effect.
        #[must_use]
        pub fn new({first}: &[f32; {}], {setting}: &Setting<f32>) -> Self {{
",
            names.len()
        );
        if !names.is_empty() {
            let line = format!("            let [{}] = *parameters;", names.join(", "));
            if line.len() <= 100 {
                let _ = writeln!(out, "{line}");
            } else {
                out.push_str("            let [\n");
                for name in &names {
                    let _ = writeln!(out, "                {name},");
                }
                out.push_str("            ] = *parameters;\n");
            }
        }
        for (register, op, once) in self.ops() {
            if is_prepared(op, once) {
                self.line(out, &format!("let k{register} = "), op, ";", true);
            }
        }
        let entries: Vec<String> = fields
            .iter()
            .map(|(name, _, value)| match value {
                Some(value) => format!("{name}: {value}"),
                None => name.clone(),
            })
            .collect();
        literal(out, "Self", &entries);
        out.push_str("        }\n    }\n");
    }

    fn effect(
        &self,
        out: &mut String,
        own: &str,
        memory: &[(String, String, String)],
        clocked: bool,
    ) {
        let spec = &self.definition.spec;
        let program = &self.definition.program;
        let _ = write!(
            out,
            "
    impl Effect<f32> for {own} {{
        type State = State;

        fn start(&self) -> State {{
"
        );
        let entries: Vec<String> = memory
            .iter()
            .map(|(name, _, start)| format!("{name}: {start}"))
            .collect();
        literal(out, "State", &entries);
        out.push_str("        }\n\n");
        let state = if memory.is_empty() { "_state" } else { "state" };
        let signals = [
            Signal::Command,
            Signal::Flow,
            Signal::Arrived,
            Signal::Channel,
        ];
        let at = if clocked || signals.iter().any(|signal| self.reads(*signal)) {
            "at"
        } else {
            "_at"
        };
        let own_signal = if self.reads(Signal::Own) {
            "signal"
        } else {
            "_signal"
        };
        let _ = match spec.place {
            Place::Flow => {
                let flow = if self.reads(Signal::Relaxation) {
                    "flow"
                } else {
                    "_flow"
                };
                write!(
                    out,
                    "        fn drives(&self) -> bool {{
            true
        }}

        fn drive(&self, {state}: &mut State, {flow}: &Flow<f32>, {at}: &Instant<'_, f32>) -> f32 {{
"
                )
            }
            Place::Jet => writeln!(
                out,
                "        fn jet(&self, {state}: &mut State, {own_signal}: f32, {at}: &Instant<'_, f32>) -> f32 {{"
            ),
            Place::Sensor | Place::Delay => writeln!(
                out,
                "        fn sense(&self, {state}: &mut State, {own_signal}: f32, {at}: &Instant<'_, f32>) -> f32 {{"
            ),
        };
        if clocked {
            out.push_str("            state.clock.tick(at.command);\n");
        }
        for (register, op, once) in self.ops() {
            if once {
                continue;
            }
            match op {
                Op::Delayed { line, signal, .. } => {
                    let signal = self.operand(*signal, false);
                    let _ = writeln!(out, "            state.line{line}.push({signal});");
                }
                Op::Signal(Signal::Channel) => {
                    out.push_str("            let channel = at.channels.get(self.channel);\n");
                }
                _ => {}
            }
            self.result(out, register, op);
        }
        for state in &program.states {
            let value = self.operand(state.update, false);
            let _ = writeln!(out, "            state.s_{} = {value};", state.name);
        }
        if !self.is_last(program.value) {
            let _ = writeln!(out, "            {}", self.operand(program.value, false));
        }
        out.push_str("        }\n    }\n");
    }
}
