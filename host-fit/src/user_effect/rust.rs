//! Generation of Rust for the board from a user effect: the interpreter's operations in the same order, one
//! per line.

use super::interpreter::LONGEST_DELAY;
use super::program::{Binary, Delayed, Op, Register, Signal, Unary};
use super::{Definition, UserEffect};
use model_core::effect::{Place, Setting};
use proc_macro2::{Ident, Literal, Punct, Spacing, TokenStream, TokenTree};
use quote::{TokenStreamExt as _, format_ident, quote};

/// Name of the module that is generated for an effect: `user_` and its name.
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

/// The `f32` nearest to `value`, in its shortest form.
pub(crate) fn number(value: f64, suffix: &str) -> TokenStream {
    let value = value as f32;
    let mut tokens = TokenStream::new();
    if value.is_sign_negative() {
        tokens.append(Punct::new('-', Spacing::Alone));
    }
    let text = format!("{:?}{suffix}", value.abs());
    // Non-finite numbers have no literal; they are rejected before.
    let literal = text.parse().unwrap_or_else(|_| Literal::f32_suffixed(0.0));
    tokens.append(literal);
    tokens
}

/// A module with a type that implements `model_core::Effect<f32>`, made by
/// `new(&[f32; P], &Setting<f32>)`.
///
/// Memories of delayed signals are as long as `parameters` (the definition's
/// order and units) need them at `setting`'s sample period, so constants and
/// module belong together. It compiles in a `no_std` crate that depends on
/// `model-core` only.
pub(crate) fn rust_module(
    definition: &'static Definition,
    parameters: &[f64],
    setting: &Setting<f32>,
) -> TokenStream {
    let writer = Writer {
        definition,
        lengths: line_lengths(definition, parameters, setting),
    };
    writer.module()
}

/// Memory length of each delayed signal, samples.
pub(crate) fn line_lengths(
    definition: &'static Definition,
    parameters: &[f64],
    setting: &Setting<f32>,
) -> Vec<usize> {
    let values: Vec<f32> = parameters.iter().map(|value| *value as f32).collect();
    UserEffect::new(definition, &values, setting).line_lengths()
}

struct Writer {
    definition: &'static Definition,
    lengths: Vec<usize>,
}

/// A field of the effect or of its memory.
struct Field {
    name: Ident,
    kind: TokenStream,
    /// Initial value of the field; `None` if the value is a variable with the field's name.
    value: Option<TokenStream>,
}

impl Field {
    fn declared(&self) -> TokenStream {
        let Self { name, kind, .. } = self;
        quote!(#name: #kind)
    }

    fn made(&self) -> TokenStream {
        let name = &self.name;
        match &self.value {
            Some(value) => quote!(#name: #value),
            None => quote!(#name),
        }
    }
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
            Op::Select(_, then, _) => self.is_condition(then),
            _ => false,
        }
    }

    fn is_once(&self, register: Register) -> bool {
        let once = self.definition.program.once.get(register);
        once.copied().unwrap_or(false)
    }

    /// An operation's text at its place of use.
    fn operand(&self, register: Register, preparing: bool) -> TokenStream {
        let field = |name: Ident| {
            if preparing {
                quote!(#name)
            } else {
                quote!(self.#name)
            }
        };
        match self.op(register) {
            Op::Number(value) => number(value, "_f32"),
            Op::Parameter(index) => field(self.parameter(index)),
            Op::Period if preparing => quote!(setting.period),
            Op::Period => quote!(self.period),
            Op::Reference if preparing => quote!(setting.reference),
            Op::Reference => quote!(self.reference),
            _ if self.is_once(register) => field(format_ident!("k{register}")),
            _ => {
                let name = format_ident!("v{register}");
                quote!(#name)
            }
        }
    }

    fn parameter(&self, index: usize) -> Ident {
        let parameter = self.definition.spec.parameters.get(index);
        format_ident!("p_{}", parameter.map_or("", |parameter| parameter.name))
    }

    /// The right side of `let` for an operation on others.
    fn right_side(&self, op: &Op, preparing: bool) -> TokenStream {
        let of = |register: Register| self.operand(register, preparing);
        match *op {
            Op::Unary(f, x) => {
                let x = of(x);
                match f {
                    Unary::Negative => quote!(-#x),
                    Unary::Not => quote!(!#x),
                    Unary::Abs => quote!(Real::abs(#x)),
                    Unary::Sqrt => quote!(Real::sqrt(#x)),
                    Unary::Exp => quote!(Real::exp(#x)),
                    Unary::Cbrt => quote!(Real::cbrt(#x)),
                    Unary::Sin => quote!(Real::sin(#x)),
                    Unary::Cos => quote!(Real::cos(#x)),
                }
            }
            Op::Binary(f, x, y) => {
                let (x, y) = (of(x), of(y));
                match f {
                    Binary::Min => quote!(Real::at_most(#x, #y)),
                    Binary::Max => quote!(Real::at_least(#x, #y)),
                    Binary::Add => quote!(#x + #y),
                    Binary::Subtract => quote!(#x - #y),
                    Binary::Multiply => quote!(#x * #y),
                    Binary::Divide => quote!(#x / #y),
                    Binary::Less => quote!(#x < #y),
                    Binary::LessOrEqual => quote!(#x <= #y),
                    Binary::Greater => quote!(#x > #y),
                    Binary::GreaterOrEqual => quote!(#x >= #y),
                    Binary::Equal => quote!(#x == #y),
                    Binary::Unequal => quote!(#x != #y),
                    Binary::And => quote!(#x && #y),
                    Binary::Or => quote!(#x || #y),
                }
            }
            Op::Select(condition, then, otherwise) => {
                let (condition, then, otherwise) = (of(condition), of(then), of(otherwise));
                quote!(if #condition { #then } else { #otherwise })
            }
            Op::State(index) => {
                let name = self.state(index);
                quote!(state.#name)
            }
            Op::Signal(signal) => match signal {
                Signal::Own => quote!(signal),
                Signal::Command => quote!(at.command),
                Signal::Flow => quote!(at.flow),
                Signal::Arrived => quote!(at.arrived),
                Signal::Relaxation => quote!(flow.relaxation),
                Signal::Before => quote!(flow.before),
                Signal::Next => quote!(flow.next),
                Signal::Released => quote!(flow.released),
                Signal::Present => quote!(at.present),
                Signal::Channel => {
                    quote!(
                        at.channels
                            .get(self.channel)
                            .copied()
                            .unwrap_or(self.reference)
                    )
                }
                Signal::Time => quote!(state.clock.time(self.period)),
                Signal::SinceEdge => quote!(state.clock.since_edge(self.period)),
            },
            Op::Delayed(d) if d.longest.is_some() => {
                let most = format_ident!("longest{}", d.line);
                let line = format_ident!("line{}", d.line);
                let delay = self.operand(d.delay, false);
                quote!(
                    Tap::between(Real::at_most(#delay / self.period, self.#most)).read(&state.#line)
                )
            }
            Op::Delayed(Delayed { line, .. }) => {
                let (tap, line) = (format_ident!("tap{line}"), format_ident!("line{line}"));
                quote!(self.#tap.read(&state.#line))
            }
            Op::Number(_) | Op::Parameter(_) | Op::Period | Op::Reference => TokenStream::new(),
        }
    }

    fn state(&self, index: usize) -> Ident {
        let state = self.definition.program.states.get(index);
        format_ident!("s_{}", state.map_or("", |state| state.name.as_str()))
    }

    /// Whether the value is computed last: it is then returned without a name.
    fn is_last(&self, register: Register) -> bool {
        let program = &self.definition.program;
        let last = self.ops().filter(|(_, _, once)| !once).last();
        register == program.value
            && program.states.is_empty()
            && last.is_some_and(|(last, ..)| last == register)
    }

    /// Whether results of `register` are needed at every sample.
    fn is_field(&self, register: Register) -> bool {
        let program = &self.definition.program;
        let used = |(_, op, once): (Register, &Op, bool)| match op {
            // Delays become taps.
            Op::Delayed(d) if d.longest.is_none() => d.signal == register,
            Op::Delayed(d) => [d.signal, d.delay].contains(&register),
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

    fn is_clocked(&self) -> bool {
        self.reads(Signal::Time) || self.reads(Signal::SinceEdge)
    }

    /// Fields of the effect.
    fn fields(&self) -> Vec<Field> {
        let mut fields = Vec::new();
        let varying =
            |(_, op, _): (Register, &Op, bool)| matches!(op, Op::Delayed(d) if d.longest.is_some());
        let mut period = self.is_clocked() || self.ops().any(varying);
        let mut reference = self.reads(Signal::Channel);
        for (register, op, _) in self.ops() {
            if let Op::Delayed(Delayed {
                line,
                delay,
                longest,
                ..
            }) = op
            {
                let seconds = self.operand(longest.unwrap_or(*delay), true);
                let most = number(f64::from(LONGEST_DELAY), "_f32");
                let samples = quote!(Real::at_most(#seconds / setting.period, #most));
                fields.push(if longest.is_some() {
                    Field {
                        name: format_ident!("longest{line}"),
                        kind: quote!(f32),
                        value: Some(samples),
                    }
                } else {
                    Field {
                        name: format_ident!("tap{line}"),
                        kind: quote!(Tap<f32>),
                        value: Some(quote!(Tap::between(#samples))),
                    }
                });
            }
            if !self.is_field(register) {
                continue;
            }
            let kind = if self.is_condition(register) {
                quote!(bool)
            } else {
                quote!(f32)
            };
            let name = match op {
                Op::Period => {
                    period = true;
                    continue;
                }
                Op::Reference => {
                    reference = true;
                    continue;
                }
                Op::Parameter(index) => self.parameter(*index),
                _ => format_ident!("k{register}"),
            };
            fields.push(Field {
                name,
                kind,
                value: None,
            });
        }
        let mut setting = |name: &str, kind: TokenStream| {
            let name = format_ident!("{name}");
            let value = Some(quote!(setting.#name));
            fields.push(Field { name, kind, value });
        };
        if period {
            setting("period", quote!(f32));
        }
        if self.reads(Signal::Channel) {
            setting("channel", quote!(usize));
        }
        if reference {
            setting("reference", quote!(f32));
        }
        fields
    }

    /// The state of the effect.
    fn memory(&self) -> Vec<Field> {
        let mut memory = Vec::new();
        if self.is_clocked() {
            memory.push(Field {
                name: format_ident!("clock"),
                kind: quote!(Clock<f32>),
                value: Some(quote!(Clock::new())),
            });
        }
        for (index, state) in self.definition.program.states.iter().enumerate() {
            memory.push(Field {
                name: self.state(index),
                kind: quote!(f32),
                value: Some(number(state.start, "")),
            });
        }
        for (line, length) in self.lengths.iter().enumerate() {
            let length = Literal::usize_unsuffixed(*length);
            memory.push(Field {
                name: format_ident!("line{line}"),
                kind: quote!(DelayLine<f32, #length>),
                value: Some(quote!(DelayLine::new())),
            });
        }
        memory
    }

    fn module(&self) -> TokenStream {
        let spec = &self.definition.spec;
        let summary = format!(" {}: {}.", spec.name, spec.summary.trim_end_matches('.'));
        let equation = format!(" `{}`", spec.equation);
        let module = format_ident!("{}", module_name(spec.name));
        let own = format_ident!("{}", type_name(spec.name));
        let imports = self.imports();
        let (fields, memory) = (self.fields(), self.memory());
        let declared = fields.iter().map(Field::declared);
        let remembered = memory.iter().map(Field::declared);
        let constructor = self.constructor(&own, &fields);
        let effect = self.effect(&own, &memory);
        quote! {
            #[doc = #summary]
            #[doc = ""]
            #[doc = #equation]
            pub mod #module {
                #imports

                /// Prepared for a sample period.
                #[derive(Clone, Copy, Debug, PartialEq)]
                pub struct #own { #(#declared),* }

                /// The state of the effect.
                #[derive(Clone, Copy, Debug, PartialEq)]
                pub struct State { #(#remembered),* }

                #constructor
                #effect
            }
        }
    }

    fn imports(&self) -> TokenStream {
        let program = &self.definition.program;
        let calls = |op: &Op| {
            matches!(
                op,
                Op::Unary(
                    Unary::Abs | Unary::Sqrt | Unary::Exp | Unary::Cbrt | Unary::Sin | Unary::Cos,
                    _
                ) | Op::Binary(Binary::Min | Binary::Max, ..)
                    | Op::Delayed(_)
            )
        };
        let real = (program.ops.iter().any(calls)).then(|| {
            quote!(
                use model_core::Real;
            )
        });
        let clock = self.is_clocked().then(|| {
            quote!(
                use model_core::clock::Clock;
            )
        });
        let (tap, line) = if program.lines > 0 {
            (
                quote!(
                    use model_core::delay::Tap;
                ),
                quote!(
                    use model_core::history::{DelayLine, Memory};
                ),
            )
        } else {
            Default::default()
        };
        let flow = (self.definition.spec.place == Place::Flow).then(|| quote!(Flow,));
        quote! {
            #real
            #clock
            #tap
            use model_core::effect::{Effect, #flow Instant, Setting};
            #line
        }
    }

    fn constructor(&self, own: &Ident, fields: &[Field]) -> TokenStream {
        let count = self.definition.spec.parameters.len();
        let names: Vec<Ident> = (0..count).map(|i| self.parameter(i)).collect();
        let taken = (count > 0).then(|| quote!(let [#(#names),*] = *parameters;));
        let prepared = self.ops().filter(|(_, op, once)| {
            *once
                && !matches!(
                    op,
                    Op::Number(_) | Op::Parameter(_) | Op::Period | Op::Reference
                )
        });
        let prepared = prepared.map(|(register, op, _)| {
            let (name, value) = (format_ident!("k{register}"), self.right_side(op, true));
            quote!(let #name = #value;)
        });
        let made = fields.iter().map(Field::made);
        let body = quote! {
            #taken
            #(#prepared)*
            Self { #(#made),* }
        };
        let setting = named_if_used("setting", &body);
        let parameters = named_if_used("parameters", &body);
        let count = Literal::usize_unsuffixed(count);
        quote! {
            impl #own {
                /// Prepares the effect.
                #[must_use]
                pub fn new(#parameters: &[f32; #count], #setting: &Setting<f32>) -> Self {
                    #body
                }
            }
        }
    }

    fn effect(&self, own: &Ident, memory: &[Field]) -> TokenStream {
        let program = &self.definition.program;
        let remembered = memory.iter().map(Field::made);
        let clock = self
            .is_clocked()
            .then(|| quote!(state.clock.tick(at.command);));
        let each = self.ops().filter(|(_, _, once)| !once);
        let each = each.map(|(register, op, _)| {
            let pushed = match op {
                Op::Delayed(d) => {
                    let line = format_ident!("line{}", d.line);
                    let signal = self.operand(d.signal, false);
                    Some(quote!(state.#line.push(#signal);))
                }
                _ => None,
            };
            let value = self.right_side(op, false);
            let result = if self.is_last(register) {
                value
            } else {
                let name = format_ident!("v{register}");
                quote!(let #name = #value;)
            };
            quote!(#pushed #result)
        });
        let updates = program.states.iter().enumerate().map(|(index, state)| {
            let (name, value) = (self.state(index), self.operand(state.update, false));
            quote!(state.#name = #value;)
        });
        let value = (!self.is_last(program.value)).then(|| self.operand(program.value, false));
        let body = quote! {
            #clock
            #(#each)*
            #(#updates)*
            #value
        };
        let state = named_if_used("state", &body);
        let at = named_if_used("at", &body);
        let hook = match self.definition.spec.place {
            Place::Flow => {
                let flow = named_if_used("flow", &body);
                quote! {
                    fn drives(&self) -> bool {
                        true
                    }
                    fn drive(
                        &self,
                        #state: &mut State,
                        #flow: &Flow<f32>,
                        #at: &Instant<'_, f32>,
                    ) -> f32 {
                        #body
                    }
                }
            }
            place @ (Place::Jet | Place::Sensor | Place::Delay) => {
                let hook = format_ident!("{}", if place == Place::Jet { "jet" } else { "sense" });
                let signal = named_if_used("signal", &body);
                quote! {
                    fn #hook(
                        &self,
                        #state: &mut State,
                        #signal: f32,
                        #at: &Instant<'_, f32>,
                    ) -> f32 {
                        #body
                    }
                }
            }
        };
        quote! {
            impl Effect<f32> for #own {
                type State = State;
                fn start(&self) -> State {
                    State { #(#remembered),* }
                }
                #hook
            }
        }
    }
}

/// An argument's name, prefixed by `_` if `body` does not use it.
fn named_if_used(name: &str, body: &TokenStream) -> Ident {
    fn uses(body: &TokenStream, name: &str) -> bool {
        let mut before = None;
        body.clone().into_iter().any(|token| {
            let found = match &token {
                // A field of that name has another meaning.
                TokenTree::Ident(ident) => ident == name && before != Some('.'),
                TokenTree::Group(group) => uses(&group.stream(), name),
                _ => false,
            };
            before = match &token {
                TokenTree::Punct(punct) => Some(punct.as_char()),
                _ => None,
            };
            found
        })
    }
    if uses(body, name) {
        format_ident!("{name}")
    } else {
        format_ident!("_{name}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers read back as the nearest f32, small ones included.
    #[test]
    fn numbers_survive_their_text() {
        for value in [0.1, -0.0049, 1e-7, 3.2e-38, 1.0 / 3.0, -0.0, 16_777_217.0] {
            let text = number(value, "").to_string().replace(' ', "");
            let read: f32 = text.parse().expect("a number");
            assert_eq!(read.to_bits(), (value as f32).to_bits(), "{text}");
            assert!(text.contains(['.', 'e']), "{text} is no float literal");
        }
    }

    #[test]
    fn an_argument_is_named_where_it_is_used() {
        let body = quote!({ other.at + f(flow) });
        assert_eq!(named_if_used("at", &body), "_at");
        assert_eq!(named_if_used("flow", &body), "flow");
    }
}
