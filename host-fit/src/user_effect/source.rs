//! Contents of an effect file, and its checks.

use super::expression::{Compiler, Fault, Kind, Meaning, Typed};
use super::program::{Carried, Op, Program, Signal};
use super::{module_name, type_name};
use model_core::effect::{Parameter, Place, RustType, Spec, Turn, Unit};
use serde::{Deserialize, Serialize};

/// Contents of an effect file, as stored in a model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Source {
    pub(crate) name: String,
    place: SourcePlace,
    pub(super) summary: String,
    #[serde(default, rename = "source", skip_serializing_if = "Option::is_none")]
    reference: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    channel: Option<String>,
    /// Whether no number in the expressions has a unit of y or time, so that it is also valid in other units.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) scales: bool,
    /// The parameter that is a dead time of the jets, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dead_time: Option<String>,
    expression: String,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    state: Vec<SourceState>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    parameter: Vec<SourceParameter>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum SourcePlace {
    Jet,
    Flow,
    Sensor,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SourceState {
    name: String,
    #[serde(default)]
    start: f64,
    update: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SourceParameter {
    name: String,
    unit: String,
    low: f64,
    high: f64,
    starts: Vec<f64>,
}

/// Why a source was rejected: the key, and the problem with its value or expression.
pub(super) enum Refusal {
    Key(String, String),
    Expression(String, Fault),
}

/// The unit of a parameter that is a reading with the sensor's offset, in files.
const READING: &str = "reading";

/// A name of a signal, state or parameter.
fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.len() <= 40
        && name
            .chars()
            .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && syn::parse_str::<syn::Ident>(name).is_ok()
}

/// The channel in expressions, whatever its own name is.
const CHANNEL: &str = "channel";
/// The mean of the channel, in expressions.
const REFERENCE: &str = "reference";

impl SourcePlace {
    /// The names of the signals in expressions of this place.
    fn signals(self) -> Vec<(&'static str, Op)> {
        let mut signals = vec![
            ("u", Op::Signal(Signal::Command)),
            ("y", Op::Signal(Signal::Flow)),
            ("t", Op::Signal(Signal::Time)),
            ("since_edge", Op::Signal(Signal::SinceEdge)),
            ("period", Op::Period),
        ];
        match self {
            Self::Jet => signals.push(("jet", Op::Signal(Signal::Own))),
            Self::Flow => signals.extend([
                ("arrived", Op::Signal(Signal::Arrived)),
                ("relaxation", Op::Signal(Signal::Relaxation)),
            ]),
            Self::Sensor => signals.extend([
                ("reading", Op::Signal(Signal::Own)),
                ("arrived", Op::Signal(Signal::Arrived)),
            ]),
        }
        signals
    }
}

/// A name of an effect: words of small letters and digits joined by hyphens.
fn is_effect_name(name: &str) -> bool {
    let word = |word: &str| {
        !word.is_empty()
            && word
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
    };
    name.len() <= 40
        && name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.split('-').all(word)
}

impl Source {
    /// Whether the effect stores anything from sample to sample.
    pub(super) fn has_states(&self) -> bool {
        !self.state.is_empty()
    }

    fn place(&self) -> Place {
        match self.place {
            SourcePlace::Jet => Place::Jet,
            SourcePlace::Flow => Place::Flow,
            SourcePlace::Sensor => Place::Sensor,
        }
    }

    /// Whether a parameter or a state has this name.
    fn defines(&self, name: &str) -> bool {
        self.parameter
            .iter()
            .any(|parameter| parameter.name == name)
            || self.state.iter().any(|state| state.name == name)
    }

    pub(super) fn compile(&self) -> Result<Program, Refusal> {
        let key = |key: &str, problem: String| Err(Refusal::Key(key.to_owned(), problem));
        if !is_effect_name(&self.name) {
            let problem = format!(
                "`{}` is not a valid effect name: use at most 40 small letters and digits, words joined by `-`",
                self.name
            );
            return key("name", problem);
        }
        if model_core::effects::spec(&self.name).is_some() {
            let problem = format!(
                "`{}` is already in the catalogue; choose another name",
                self.name
            );
            return key("name", problem);
        }
        if self.summary.trim().is_empty() || self.summary.contains(['\n', '\r']) {
            return key("summary", "describe the effect in one line".to_owned());
        }
        let mut compiler = Compiler::default();
        let mut signals: Vec<(&str, Op)> = self.place.signals();
        if let Some(channel) = &self.channel {
            signals.push((CHANNEL, Op::Signal(Signal::Channel)));
            signals.push((REFERENCE, Op::Reference));
            // Its own name, if that is free.
            let is_signal = signals.iter().any(|(known, _)| known == channel);
            if is_identifier(channel) && !is_signal && !self.defines(channel) {
                signals.push((channel, Op::Signal(Signal::Channel)));
            }
        }
        let mut name = |label: String, name: &str, op: Op| {
            if !is_identifier(name) {
                let problem = format!(
                    "`{name}` is not a valid name: use at most 40 small letters, digits and `_`, and no keyword of Rust"
                );
                return Err(Refusal::Key(label, problem));
            }
            if compiler.names.iter().any(|(known, _)| known == name) {
                let problem = format!("`{name}` is already defined; choose another name");
                return Err(Refusal::Key(label, problem));
            }
            compiler.names.push((name.to_owned(), Meaning::Read(op)));
            Ok(())
        };
        for (signal, op) in signals {
            name("channel".to_owned(), signal, op)?;
        }
        for (index, parameter) in self.parameter.iter().enumerate() {
            let label = format!("parameter.{}", parameter.name);
            name(label.clone(), &parameter.name, Op::Parameter(index))?;
            parameter
                .check()
                .map_err(|problem| Refusal::Key(label, problem))?;
        }
        for (index, state) in self.state.iter().enumerate() {
            let label = format!("state.{}", state.name);
            name(label.clone(), &state.name, Op::State(index))?;
            if !(state.start as f32).is_finite() {
                return key(&label, "`start` is not a finite number".to_owned());
            }
        }
        if let Some(name) = &self.dead_time {
            let own = self
                .parameter
                .iter()
                .find(|parameter| parameter.name == *name);
            if self.place != SourcePlace::Jet || own.is_none_or(|own| own.unit() != Unit::Second) {
                let problem =
                    "`dead_time` must be the name of a parameter in s, of an effect at the jet";
                return key("dead_time", problem.to_owned());
            }
        }
        let mut states = Vec::with_capacity(self.state.len());
        for state in &self.state {
            let update = compiler.number(&state.update).map_err(|fault| {
                Refusal::Expression(format!("state.{}.update", state.name), fault)
            })?;
            // From here on the name means the state's new value.
            let kind = Kind::Number;
            let value = Meaning::Value(Typed {
                register: update,
                kind,
            });
            for (known, meaning) in &mut compiler.names {
                if *known == state.name {
                    *meaning = value;
                }
            }
            states.push(Carried {
                name: state.name.clone(),
                start: state.start,
                update,
            });
        }
        let value = compiler
            .number(&self.expression)
            .map_err(|fault| Refusal::Expression("expression".to_owned(), fault))?;
        let program = compiler.builder.finish(value, states);
        for (index, parameter) in self.parameter.iter().enumerate() {
            if !program.reads(Op::Parameter(index)) {
                let problem =
                    "it has no influence; use it in the expression or remove it".to_owned();
                return key(&format!("parameter.{}", parameter.name), problem);
            }
        }
        if self.channel.is_some() && !program.reads(Op::Signal(Signal::Channel)) {
            let problem = "the channel has no influence; use it in the expression or remove it";
            return key("channel", problem.to_owned());
        }
        Ok(program)
    }

    pub(super) fn spec(&self, program: &Program) -> Spec {
        let parameters = self.parameter.iter().enumerate().map(|(index, parameter)| {
            let card = Parameter::new(
                keep(&parameter.name),
                parameter.unit(),
                [parameter.low, parameter.high],
                Vec::leak(parameter.starts.clone()),
            );
            if program.is_compared(index) {
                card.stepwise()
            } else {
                card
            }
        });
        let parameters: Vec<Parameter> = parameters.collect();
        let reads_offset = parameters.iter().any(|card| card.unit == Unit::Reading);
        Spec {
            name: keep(&self.name),
            rust: keep(&format!(
                "{}::{}",
                module_name(&self.name),
                type_name(&self.name)
            )),
            rust_type: RustType::Plain,
            place: self.place(),
            summary: keep(&self.summary),
            equation: keep(&self.equation()),
            parameters: Vec::leak(parameters),
            channel: self.channel.as_deref().map(keep),
            dead_time: self.dead_time.as_deref().map(keep),
            turn: match reads_offset {
                true => Turn::Last,
                false => Turn::InOrder,
            },
            source: keep(self.reference.as_deref().unwrap_or("the user's own effect")),
            ..Spec::PLAIN
        }
    }

    /// States and value on one line.
    fn equation(&self) -> String {
        let flat = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let mut parts: Vec<String> = self
            .state
            .iter()
            .map(|state| format!("{} ← {}", state.name, flat(&state.update)))
            .collect();
        let value = flat(&self.expression);
        parts.push(match self.place {
            SourcePlace::Jet => format!("j = {value}"),
            SourcePlace::Flow => format!("adds {value}"),
            SourcePlace::Sensor => format!("y = {value}"),
        });
        parts.join("; ")
    }
}

/// Text for a card, which lives as long as the program.
fn keep(text: &str) -> &'static str {
    String::leak(text.to_owned())
}

impl SourceParameter {
    /// The unit; [`READING`] is that of a reading with the sensor's offset.
    fn unit(&self) -> Unit {
        match self.unit.as_str() {
            READING => Unit::Reading,
            other => Unit::of(keep(other)),
        }
    }

    fn check(&self) -> Result<(), String> {
        let finite = |value: &f64| (*value as f32).is_finite();
        if !(finite(&self.low) && finite(&self.high) && self.low < self.high) {
            return Err("`low` and `high` must be finite, and `low` below `high`".to_owned());
        }
        if self.starts.is_empty()
            || !self
                .starts
                .iter()
                .all(|s| (self.low..=self.high).contains(s))
        {
            return Err(
                "`starts` needs at least one value, all of them from `low` to `high`".to_owned(),
            );
        }
        if self.unit.trim().is_empty() || self.unit.contains(['\n', '\r']) {
            return Err("`unit` must be a unit in words, or `-` for none".to_owned());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::user_effect::Definition;

    /// Only a parameter in s of an effect at the jet is a dead time in series with the model's own.
    #[test]
    fn a_dead_time_is_a_time_of_the_jets() {
        let echo = |place: &str, own: &str, dead_time: &str| {
            let text = format!(
                r#"name = "own-echo"
place = "{place}"
summary = "it comes a second time, later"
dead_time = "{dead_time}"
expression = "{own} + gain * delayed({own}, echo_delay)"
parameter = [
    {{ name = "gain", unit = "-", low = -1.0, high = 1.0, starts = [0.2] }},
    {{ name = "echo_delay", unit = "s", low = 0.02, high = 0.5, starts = [0.05] }},
]"#
            );
            Definition::from_toml(&text, "own.toml").map(|own| own.spec().dead_time)
        };
        for (place, own, name) in [
            ("jet", "jet", "gain"),
            ("jet", "jet", "delay"),
            ("sensor", "reading", "echo_delay"),
        ] {
            let error = echo(place, own, name).expect_err(name).to_string();
            assert!(error.contains("`dead_time` must be"), "{error}");
        }
        let own = echo("jet", "jet", "echo_delay").expect("a time of the jets");
        assert_eq!(own, Some("echo_delay"));
    }
}
