//! The catalogue in the language of user effects, from which code in other languages is generated.

use super::expression::{Compiler, Fault, Kind, Meaning, Typed};
use super::program::{Carried, Op, Program, Signal};
use model_core::effect::{Place, Spec};
use model_core::effects::{LAWS, NUISANCES, SPECS};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// States and value of an effect as written in `forms.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    expression: String,
    /// The command after a delay law that delays edges separately.
    command: Option<String>,
    #[serde(default)]
    state: Vec<WrittenState>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenState {
    name: String,
    #[serde(default)]
    start: f64,
    update: String,
}

/// An effect of the catalogue as programs.
#[derive(Debug)]
pub(crate) struct Form {
    pub(crate) name: &'static str,
    /// Value of the effect: a jet strength, a drive or a reading; for a delay law the delay in samples.
    pub(crate) value: Program,
    /// The command after a delay law that delays edges separately.
    pub(crate) command: Option<Program>,
}

/// The form of an effect or delay law of the catalogue.
pub(crate) fn form(name: &str) -> Option<&'static Form> {
    static FORMS: OnceLock<Vec<Form>> = OnceLock::new();
    let forms = FORMS.get_or_init(|| {
        // A test checks that all forms compile; a form that does not compile counts as missing.
        let written: BTreeMap<String, Written> =
            toml::from_str(include_str!("forms.toml")).unwrap_or_default();
        let specs = SPECS.iter().chain(NUISANCES).chain(LAWS);
        specs
            .filter_map(|spec| compile(spec, written.get(spec.name)?).ok())
            .collect()
    });
    forms.iter().find(|form| form.name == name)
}

fn compile(spec: &Spec, written: &Written) -> Result<Form, Fault> {
    Ok(Form {
        name: spec.name,
        value: program(spec, written, &written.expression)?,
        command: match &written.command {
            Some(text) => Some(program(spec, written, text)?),
            None => None,
        },
    })
}

fn program(spec: &Spec, written: &Written, text: &str) -> Result<Program, Fault> {
    let mut compiler = Compiler::default();
    let mut know = |name: &str, op: Op| {
        let known = (name.to_owned(), Meaning::Read(op));
        compiler.names.push(known);
    };
    know("period", Op::Period);
    know("u", Op::Signal(Signal::Command));
    know("y", Op::Signal(Signal::Flow));
    know("arrived", Op::Signal(Signal::Arrived));
    know("present", Op::Signal(Signal::Present));
    match spec.place {
        Place::Jet => know("jet", Op::Signal(Signal::Own)),
        Place::Sensor => know("reading", Op::Signal(Signal::Own)),
        Place::Flow => {
            know("relaxation", Op::Signal(Signal::Relaxation));
            know("before", Op::Signal(Signal::Before));
            know("next", Op::Signal(Signal::Next));
            know("released", Op::Signal(Signal::Released));
        }
        Place::Delay => {
            know("output", Op::Signal(Signal::Own));
            know("command", Op::Signal(Signal::Own));
        }
    }
    know("reference", Op::Reference);
    if let Some(channel) = spec.channel {
        know(channel, Op::Signal(Signal::Channel));
    }
    for (index, parameter) in spec.parameters.iter().enumerate() {
        know(parameter.name, Op::Parameter(index));
    }
    for (index, state) in written.state.iter().enumerate() {
        know(&state.name, Op::State(index));
    }
    let mut states = Vec::with_capacity(written.state.len());
    for state in &written.state {
        let update = compiler.number(&state.update)?;
        let value = Meaning::Value(Typed {
            register: update,
            kind: Kind::Number,
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
    let value = compiler.number(text)?;
    Ok(compiler.builder.finish(value, states))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ring::Ring;
    use crate::user_effect::UserEffect;
    use model_core::Real;
    use model_core::delay::Transport;
    use model_core::effect::{Effect, Flow, Instant, Setting};
    use model_core::effects::{AnyEffect, AnyTransport};

    fn middle<T: Real>(spec: &Spec) -> Vec<T> {
        let each = spec.parameters.iter();
        each.map(|p| T::from_f64(p.starts[p.starts.len() / 2]))
            .collect()
    }

    fn setting<T: Real>() -> Setting<T> {
        Setting {
            period: T::from_f64(0.001),
            channel: 0,
            reference: T::from_f64(0.9),
        }
    }

    /// The results of all functions of an effect, for signals that reach every branch.
    fn run<T: Real>(effect: &impl Effect<T>) -> Vec<f64> {
        let number = T::from_f64;
        let mut state = effect.start();
        let each = (0..2000_usize).map(|k| {
            let level = [0.0, 1.0, 0.0, 0.6, -0.4, 0.3][k / 90 % 6];
            let now = |k: usize| 0.5 - 0.7 * (k as f64 * 0.02).cos();
            let channels = [number(10.0 + (k as f64 * 0.01).sin())];
            let at = Instant {
                command: number(level),
                flow: number(now(k)),
                arrived: number(level),
                present: number(0.9 * level),
                channels: &channels,
            };
            let flow = Flow {
                now: at.flow,
                before: number(now(k.saturating_sub(1))),
                next: number(now(k + 1)),
                relaxation: number(0.03),
                separated: number(1.0 - level),
                released: number((1.0 - level) * (now(k + 1) - now(k))),
            };
            let shaped = effect.jet(&mut state, at.command, &at);
            let driven = if effect.drives() {
                effect.drive(&mut state, &flow, &at)
            } else {
                T::ZERO
            };
            let shown = effect.sense(&mut state, at.flow, &at);
            [shaped, driven, shown].map(Real::value)
        });
        each.flatten().collect()
    }

    /// Parameters at three quarters of each range, where other branches apply than at the starting
    /// values.
    fn far<T: Real>(spec: &Spec) -> Vec<T> {
        let each = spec.parameters.iter();
        each.map(|p| T::from_f64(p.low + 0.75 * (p.high - p.low)))
            .collect()
    }

    fn agree<T: Real>(spec: &'static Spec, parameters: &[T]) {
        let own = AnyEffect::<T, Ring<T>>::new(spec.name, parameters, &setting())
            .expect("in the catalogue");
        let form = form(spec.name).unwrap_or_else(|| panic!("{} has no form", spec.name));
        let written = UserEffect::of(&form.value, spec.place, parameters, &setting());
        let (own, written) = (run(&own), run(&written));
        for (i, (own, written)) in own.iter().zip(&written).enumerate() {
            let equal = own == written || own.is_nan() && written.is_nan();
            assert!(equal, "{} at {i}: {own} {written}", spec.name);
        }
    }

    #[test]
    fn every_form_is_its_effect_bit_for_bit() {
        for spec in SPECS.iter().chain(NUISANCES) {
            if spec.place != Place::Delay {
                for parameters in [middle::<f64>(spec), far(spec)] {
                    agree(spec, &parameters);
                }
                for parameters in [middle::<f32>(spec), far(spec)] {
                    agree(spec, &parameters);
                }
            }
        }
    }

    #[test]
    fn every_form_compiles() {
        let written: BTreeMap<String, Written> =
            toml::from_str(include_str!("forms.toml")).expect("the file");
        let specs: Vec<&Spec> = SPECS.iter().chain(NUISANCES).chain(LAWS).collect();
        for (name, written) in &written {
            let spec = specs.iter().find(|spec| spec.name == *name);
            let spec = spec.unwrap_or_else(|| panic!("{name} is in no catalogue"));
            compile(spec, written).unwrap_or_else(|fault| panic!("{name}: {fault:?}"));
        }
    }

    fn laws_agree<T: Real>(spec: &'static Spec) {
        let parameters = middle::<T>(spec);
        let own = AnyTransport::new(spec.name, &parameters, &setting()).expect("a law");
        let form = form(spec.name).unwrap_or_else(|| panic!("{} has no form", spec.name));
        // Forms are run as effects of the jets, whose own signal is the input.
        let delay = UserEffect::of(&form.value, Place::Jet, &parameters, &setting());
        let command = form.command.as_ref();
        let command = command.map(|c| UserEffect::of(c, Place::Jet, &parameters, &setting()));
        let mut states = (own.start(), delay.start());
        let mut shaped = command.as_ref().map(Effect::start);
        for k in 0..3000_usize {
            let u = T::from_f64([0.0, 1.0, 0.0, 0.6][(k / 7 + k / 90) % 4]);
            let at = Instant {
                command: u,
                flow: T::ZERO,
                arrived: T::ZERO,
                present: T::ZERO,
                channels: &[],
            };
            let y = T::from_f64(0.5 - 0.5 * (k as f64 * 0.02).cos());
            assert_eq!(own.delay(y), delay.jet(&mut states.1, y, &at));
            let written = match (&command, &mut shaped) {
                (Some(command), Some(state)) => command.jet(state, u, &at),
                _ => u,
            };
            assert_eq!(own.command(&mut states.0, u), written, "{} {k}", spec.name);
        }
    }

    #[test]
    fn every_delay_law_has_its_form() {
        for spec in LAWS {
            laws_agree::<f64>(spec);
            laws_agree::<f32>(spec);
        }
    }
}
