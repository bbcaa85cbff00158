//! MATLAB: one function file that GNU Octave runs too.

use super::common::{self, Ports, lines};
use super::piece::{Function, Tapped, Tongue};
use super::plain::matlab_string;
use super::sheet::Sheet;
use super::template::Holes;
use crate::model::Law;
use crate::user_effect::program::Signal;
use model_core::recursion::Grading;

struct Matlab;

impl Tongue for Matlab {
    fn number(&self, value: f64) -> String {
        format!("{value:?}")
    }
    fn call(&self, function: Function, arguments: &[String]) -> String {
        let arguments = arguments.join(", ");
        match function {
            Function::Abs => format!("abs({arguments})"),
            Function::Sqrt => format!("sqrt(max({arguments}, 0))"),
            Function::Exp => format!("exp({arguments})"),
            Function::Cbrt => format!("nthroot({arguments}, 3)"),
            Function::Sin => format!("sin({arguments})"),
            Function::Cos => format!("cos({arguments})"),
            Function::Min => format!("min({arguments})"),
            Function::Max => format!("max({arguments})"),
        }
    }
    fn quotient(&self, _dividend: &str, _divisor: &str) -> Option<String> {
        None
    }
    fn select(&self, condition: &str, then: &str, otherwise: &str) -> String {
        format!("pick({condition}, {then}, {otherwise})")
    }
    fn logic(&self) -> [&'static str; 4] {
        ["&&", "||", "~", "~="]
    }
    fn signal(&self, signal: Signal, channel: usize) -> String {
        match signal {
            Signal::Own => "signal".into(),
            Signal::Command => "u".into(),
            Signal::Flow => "now".into(),
            Signal::Arrived => "arrived".into(),
            Signal::Present => "present".into(),
            Signal::Relaxation => "relaxation".into(),
            Signal::Before => "s.y(2)".into(),
            Signal::Next => "next_y".into(),
            Signal::Released => "released".into(),
            Signal::Channel => format!("channels({})", channel + 1),
            Signal::Time => "((s.lived - 1) * PERIOD)".into(),
            Signal::SinceEdge => "(s.since_edge * PERIOD)".into(),
        }
    }
    fn state(&self, name: &str) -> String {
        format!("s.{name}")
    }
    fn local(&self, name: &str, value: &str) -> String {
        format!("{name} = {value};")
    }
    fn assign(&self, state: &str, value: &str) -> String {
        format!("s.{state} = {value};")
    }
    fn push(&self, line: &str, value: &str) -> String {
        format!("s.{line} = [{value}; s.{line}(1:end-1)];")
    }
    fn read(&self, line: &str, samples: Tapped<'_>) -> String {
        match samples {
            Tapped::Fixed { whole, fraction } => {
                let (newer, older) = (whole + 1, whole + 2);
                format!(
                    "(s.{line}({newer}) + {fraction:?} * (s.{line}({older}) - s.{line}({newer})))"
                )
            }
            Tapped::Varying(samples) => format!("ago(s.{line}, {samples})"),
        }
    }
    fn heading(&self, text: &str) -> String {
        format!("% {text}\n")
    }
    fn define(&self, name: &str, value: &str, remark: &str) -> String {
        let gap = if remark.is_empty() { "" } else { " % " };
        format!("{name} = {value};{gap}{remark}")
    }
    fn length(&self, _line: &str, _samples: usize) -> Option<String> {
        None
    }
    fn law_name(&self, name: &str) -> String {
        format!("c.{name}")
    }
    fn block(&self, name: &str, statements: &[String]) -> String {
        format!("% {name}\n{}", lines(statements))
    }
}

pub(super) fn write(sheet: &Sheet<'_>, name: &str) -> String {
    let mut text = holes(sheet, name).fill(include_str!("model.m"));
    text += match sheet.law() {
        None => "",
        Some(Law::Track(_)) => include_str!("law.m"),
        Some(Law::Maximise(_)) => include_str!("pulses.m"),
    };
    for helper in include_str!("core.m").split("%:") {
        let Some((name, helper)) = helper.split_once('\n') else {
            continue;
        };
        if text.contains(&format!(" {name}(")) || text.contains(&format!("({name}(")) {
            text.push_str(helper);
        }
    }
    text
}

/// The texts of `model.m`.
fn holes(sheet: &Sheet<'_>, name: &str) -> Holes {
    let model = sheet.model;
    let window = model.averaging.window;
    let signal = if model.averaging.averaged_model {
        "max(now, 0)".to_owned()
    } else {
        format!("max(s.sum / {window}, 0)")
    };
    let ports = Ports {
        jet: ["jet", "jet = {};"],
        delay: [&signal, "delay = {};"],
        sensor: ["reading", "reading = {};"],
        flow: ["now", "added = added + ({});"],
    };
    let mut holes = common::holes::<f64>(sheet, &Matlab, &ports);
    common::recursion(&mut holes, sheet, &Matlab, product);
    let jet = |u: &str| {
        let range = model.command;
        if range.is_unit() {
            u.to_owned()
        } else {
            format!("({u} - ({:?})) / ({:?})", range.off, range.full - range.off)
        }
    };
    let channels = &sheet.memory.channels;
    let usual = if channels.is_empty() {
        "zeros(1, 0)".to_owned()
    } else {
        row(channels.iter().map(|c| format!("{:?}", c.reference)))
    };
    let names: Vec<String> = channels.iter().map(|c| matlab_string(&c.name)).collect();
    let memories = common::memories(
        sheet,
        |state, start| format!("s.{state} = {start:?};"),
        |line, samples| format!("s.{line} = zeros({samples}, 1);"),
    );
    let share = match model.grading {
        Grading::Proportional | Grading::Interpolated => "arrived",
        Grading::Switched => "min(max(0.5 + (arrived - 0.5) * 50, 0), 1)",
    };
    holes
        // A space follows `%`, because `%{` would begin a block comment.
        .set(
            "header",
            lines(sheet.header.iter().map(|line| format!("% {line}"))),
        )
        .set("name", name)
        .set("usual", usual)
        .set("channel_names", names.join(", "))
        .set("jet", jet("u"))
        .set("jet_k", jet("u(k)"))
        .set("memories", memories)
        .set("oldest", sheet.memory.jets - 2)
        .set("block", window.saturating_sub(1))
        .set("share", share);
    if let Some(Law::Maximise(law)) = sheet.law() {
        holes
            .set("law_first", row(law.pulses.iter().map(|p| p.0.to_string())))
            .set(
                "law_length",
                row(law.pulses.iter().map(|p| p.1.to_string())),
            );
    }
    holes
}

fn row(values: impl Iterator<Item = String>) -> String {
    format!("[{}]", values.collect::<Vec<_>>().join(", "))
}

/// Coefficients times the past.
fn product(coefficients: &[f64], back: &[usize]) -> String {
    if back.is_empty() {
        return "0".into();
    }
    let coefficients = row(coefficients.iter().map(|c| format!("{c:?}")));
    format!(
        "{coefficients} * s.y({})",
        row(back.iter().map(|lag| (lag + 1).to_string()))
    )
}
