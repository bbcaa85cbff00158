//! Python: a class with `step` and `simulate`, for NumPy.

use super::common::{self, Ports, lines};
use super::piece::{Function, Tapped, Tongue};
use super::plain::python_string;
use super::sheet::Sheet;
use super::template::Holes;
use crate::model::Law;
use crate::user_effect::program::Signal;
use model_core::recursion::Grading;

struct Python;

impl Tongue for Python {
    fn number(&self, value: f64) -> String {
        format!("{value:?}")
    }
    fn call(&self, function: Function, arguments: &[String]) -> String {
        let name = match function {
            Function::Abs => "abs",
            Function::Sqrt => "_sqrt",
            Function::Exp => "_exp",
            Function::Cbrt => "_cbrt",
            Function::Sin => "_sin",
            Function::Cos => "_cos",
            Function::Min => "min",
            Function::Max => "max",
        };
        format!("{name}({})", arguments.join(", "))
    }
    fn quotient(&self, dividend: &str, divisor: &str) -> Option<String> {
        Some(format!("_divided({dividend}, {divisor})"))
    }
    fn select(&self, condition: &str, then: &str, otherwise: &str) -> String {
        format!("({then} if {condition} else {otherwise})")
    }
    fn logic(&self) -> [&'static str; 4] {
        ["and", "or", "not ", "!="]
    }
    fn signal(&self, signal: Signal, channel: usize) -> String {
        match signal {
            Signal::Own => "signal".into(),
            Signal::Command => "u".into(),
            Signal::Flow => "now".into(),
            Signal::Arrived => "arrived".into(),
            Signal::Present => "present".into(),
            Signal::Relaxation => "relaxation".into(),
            Signal::Before => "y[-2]".into(),
            Signal::Next => "next_y".into(),
            Signal::Released => "released".into(),
            Signal::Channel => format!("channels[{channel}]"),
            Signal::Time => "((self.lived - 1) * PERIOD)".into(),
            Signal::SinceEdge => "(self.since_edge * PERIOD)".into(),
        }
    }
    fn state(&self, name: &str) -> String {
        format!("self.{name}")
    }
    fn local(&self, name: &str, value: &str) -> String {
        format!("{name} = {value}")
    }
    fn assign(&self, state: &str, value: &str) -> String {
        format!("self.{state} = {value}")
    }
    fn push(&self, line: &str, value: &str) -> String {
        format!(
            "_push(self.{line}, {value}, {}_LENGTH)",
            line.to_uppercase()
        )
    }
    fn read(&self, line: &str, samples: Tapped<'_>) -> String {
        match samples {
            Tapped::Fixed { whole, fraction } => {
                let (newer, older) = (whole + 1, whole + 2);
                format!(
                    "(self.{line}[-{newer}] + {fraction:?} * (self.{line}[-{older}] - self.{line}[-{newer}]))"
                )
            }
            Tapped::Varying(samples) => format!("_ago(self.{line}, {samples})"),
        }
    }
    fn heading(&self, text: &str) -> String {
        format!("\n# {text}\n")
    }
    fn define(&self, name: &str, value: &str, remark: &str) -> String {
        let gap = if remark.is_empty() { "" } else { "  # " };
        format!("{name} = {value}{gap}{remark}")
    }
    fn length(&self, line: &str, samples: usize) -> Option<String> {
        let name = format!("{}_LENGTH", line.to_uppercase());
        Some(self.define(&name, &samples.to_string(), "samples"))
    }
    fn block(&self, name: &str, statements: &[String]) -> String {
        format!("# {name}\n{}", lines(statements))
    }
}

pub(super) fn write(sheet: &Sheet<'_>) -> String {
    let law = match sheet.law() {
        None => "",
        Some(Law::Track(_)) => include_str!("law.py"),
        Some(Law::Maximise(_)) => include_str!("pulses.py"),
    };
    let body = format!("{}{law}", holes(sheet).fill(include_str!("model.py")));
    let core = include_str!("core.py")
        .split("#:")
        .filter_map(|part| part.split_once('\n'));
    let helpers = core.filter(|(name, _)| body.contains(&format!("{name}(")));
    let helpers: String = helpers.map(|(_, text)| text).collect();
    let header = lines(sheet.header.iter().map(|line| format!("# {line}")));
    format!(
        "\"\"\"An identified model: `Model().simulate(u)` computes a free run, `step` one sample.\"\"\"\n\n{header}\n\
         import copy\nimport math\n\nimport numpy as np\n\n\n{helpers}{body}"
    )
}

/// The texts of `model.py`.
fn holes(sheet: &Sheet<'_>) -> Holes {
    let model = sheet.model;
    let signal = if model.averaging.averaged_model {
        "max(now, 0.0)"
    } else {
        "max(self.sum / WINDOW, 0.0)  # the mean of the preceding flow states, eq. (1)"
    };
    let ports = Ports {
        jet: ["jet", "jet = {}"],
        delay: [signal, "delay = {}"],
        sensor: ["reading", "reading = {}"],
        flow: ["now", "added += {}"],
    };
    let mut holes = common::holes::<f64>(sheet, &Python, &ports);
    common::recursion(&mut holes, sheet, &Python, sum);
    let channels = &sheet.memory.channels;
    let memories = common::memories(
        sheet,
        |state, start| format!("self.{state} = {start:?}"),
        |line, _| format!("self.{line} = [0.0] * {}_LENGTH", line.to_uppercase()),
    );
    let share = match model.grading {
        Grading::Proportional | Grading::Interpolated => "arrived",
        Grading::Switched => "min(max(0.5 + (arrived - 0.5) * 50.0, 0.0), 1.0)",
    };
    holes
        .set("off", Python.number(model.command.off))
        .set("full", Python.number(model.command.full))
        .set(
            "channel_names",
            tuple(channels.iter().map(|c| python_string(&c.name))),
        )
        .set(
            "usual",
            tuple(channels.iter().map(|c| Python.number(c.reference))),
        )
        .set("memories", memories)
        .set("share", share)
        .set(
            "jet",
            if model.command.is_unit() {
                "float(command)"
            } else {
                "(command - COMMAND_OFF) / (COMMAND_FULL - COMMAND_OFF)"
            },
        );
    if let Some(Law::Maximise(law)) = sheet.law() {
        let pulses = law.pulses.iter();
        holes.set(
            "law_pulses",
            tuple(pulses.map(|(first, length)| format!("({first}, {length})"))),
        );
    }
    holes
}

fn tuple(values: impl Iterator<Item = String>) -> String {
    let values: Vec<String> = values.collect();
    let end = if values.is_empty() { "" } else { "," };
    format!("({}{end})", values.join(", "))
}

/// A sum over past values, as a Python expression.
fn sum(coefficients: &[f64], back: &[usize]) -> String {
    let mut text = String::new();
    for (i, (coefficient, lag)) in coefficients.iter().zip(back).enumerate() {
        let plus = if i % 4 == 3 {
            "\n            + "
        } else {
            " + "
        };
        text += &format!("{plus}{coefficient:?} * y[-{}]", lag + 1);
    }
    text
}
