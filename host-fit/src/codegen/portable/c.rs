//! C99: one file without a heap, static state, the host's bits in its precision.

use super::Precision;
use super::common::{self, Ports, lines};
use super::piece::{Constant, Function, Piece, Tapped, Tongue};
use super::plain::{c_string, comment};
use super::sheet::Sheet;
use super::template::Holes;
use crate::model::{Delay, Law};
use crate::user_effect::program::Signal;
use model_core::Real;
use model_core::recursion::Grading;

/// Lags of at least this many samples are summed first when the law predicts, as in `model-core`.
const NEAR: usize = 64;

pub(super) struct C {
    pub(super) precision: Precision,
}

impl Tongue for C {
    fn number(&self, value: f64) -> String {
        match self.precision {
            Precision::Single => format!("{:?}f", value as f32),
            Precision::Double => format!("{value:?}"),
        }
    }
    fn call(&self, function: Function, arguments: &[String]) -> String {
        let arguments = arguments.join(", ");
        match function {
            Function::Abs => format!("magnitude({arguments})"),
            Function::Sqrt => format!("root({arguments})"),
            Function::Exp => format!("exponential({arguments})"),
            Function::Cbrt => format!("cube_root({arguments})"),
            Function::Sin => format!("sine_of({arguments}, 0u)"),
            Function::Cos => format!("sine_of({arguments}, 1u)"),
            Function::Min => format!("at_most({arguments})"),
            Function::Max => format!("at_least({arguments})"),
        }
    }
    fn quotient(&self, _dividend: &str, _divisor: &str) -> Option<String> {
        None
    }
    fn select(&self, condition: &str, then: &str, otherwise: &str) -> String {
        format!("(({condition}) ? ({then}) : ({otherwise}))")
    }
    fn logic(&self) -> [&'static str; 4] {
        ["&&", "||", "!", "!="]
    }
    fn signal(&self, signal: Signal, channel: usize) -> String {
        match signal {
            Signal::Own => "signal".into(),
            Signal::Command => "u".into(),
            Signal::Flow => "y".into(),
            Signal::Arrived => "arrived".into(),
            Signal::Present => "present".into(),
            Signal::Relaxation => "relaxation".into(),
            Signal::Before => "before".into(),
            Signal::Next => "next_y".into(),
            Signal::Released => "released".into(),
            Signal::Channel => format!("channels[{channel}]"),
            Signal::Time => "((real)(s->lived - 1u) * PERIOD)".into(),
            Signal::SinceEdge => "((real)s->since_edge * PERIOD)".into(),
        }
    }
    fn state(&self, name: &str) -> String {
        format!("s->{name}")
    }
    fn local(&self, name: &str, value: &str) -> String {
        format!("const real {name} = {value};")
    }
    fn assign(&self, state: &str, value: &str) -> String {
        format!("s->{state} = {value};")
    }
    fn push(&self, line: &str, value: &str) -> String {
        format!(
            "push(s->{line}, {}, &s->{line}_newest, {value});",
            length(line)
        )
    }
    fn read(&self, line: &str, samples: Tapped<'_>) -> String {
        let length = length(line);
        match samples {
            Tapped::Fixed { whole, fraction } => {
                let fraction = self.number(fraction);
                format!("between(s->{line}, {length}, s->{line}_newest, {whole}u, {fraction})")
            }
            Tapped::Varying(samples) => {
                format!("ago(s->{line}, {length}, s->{line}_newest, {samples})")
            }
        }
    }
    fn heading(&self, text: &str) -> String {
        format!("\n/* {text} */\n")
    }
    fn define(&self, name: &str, value: &str, remark: &str) -> String {
        if remark.is_empty() {
            return format!("#define {name} {value}");
        }
        format!("#define {name} {value} /* {remark} */")
    }
    /// A number, in parentheses if its sign could follow another sign.
    fn constant(&self, value: f64) -> String {
        let number = self.number(value);
        if number.starts_with('-') {
            return format!("({number})");
        }
        number
    }
    fn whole(&self, value: u32) -> String {
        format!("{value}u")
    }
    fn derived(&self, constant: &Constant) -> String {
        let value = self.constant(constant.value);
        self.define(&constant.name, &value, &comment(&constant.formula))
    }
    fn length(&self, line: &str, samples: usize) -> Option<String> {
        Some(self.define(&length(line), &format!("{samples}u"), ""))
    }
    fn block(&self, name: &str, statements: &[String]) -> String {
        let inner = lines(statements.iter().map(|line| format!("    {line}")));
        format!("{{ /* {name} */\n{inner}}}\n")
    }
}

fn length(line: &str) -> String {
    format!("{}_LENGTH", line.to_uppercase())
}

/// Functions by name, each after those that it calls.
fn helpers(precision: Precision) -> Vec<(&'static str, String)> {
    let core = include_str!("core.c")
        .split("//:")
        .filter_map(|part| part.split_once('\n'));
    let single = precision == Precision::Single;
    let pick = |name: &str, own: &str| match (name, single) {
        ("exponential", true) => include_str!("exp_f32.c").to_owned(),
        ("exponential", false) => include_str!("exp_f64.c").to_owned(),
        ("cube_root", true) => include_str!("cbrt_f32.c").to_owned(),
        ("cube_root", false) => include_str!("cbrt_f64.c").to_owned(),
        ("sine_of", true) => include_str!("trig_f32.c").to_owned(),
        ("sine_of", false) => include_str!("trig_f64.c").to_owned(),
        _ => own.replace("REAL_SQRT", if single { "sqrtf" } else { "sqrt" }),
    };
    core.map(|(name, own)| (name, pick(name, own))).collect()
}

/// The helpers that `body` calls.
fn needed(body: &str, precision: Precision) -> String {
    let mut taken: Vec<String> = Vec::new();
    for (name, text) in helpers(precision).into_iter().rev() {
        let call = format!("{name}(");
        let calls = |text: &str| {
            let mut found = text.match_indices(&call);
            found.any(|(at, _)| {
                let before = text[..at].chars().next_back();
                !before.is_some_and(|c| c.is_alphanumeric() || c == '_')
            })
        };
        if calls(body) || taken.iter().any(|text| calls(text)) {
            taken.push(text);
        }
    }
    taken.reverse();
    taken.join("\n")
}

pub(super) fn write<T: Real>(sheet: &Sheet<'_>, precision: Precision) -> String {
    let holes = holes::<T>(sheet, &C { precision });
    let law = match sheet.law() {
        None => "",
        Some(Law::Track(_)) => include_str!("law.c"),
        Some(Law::Maximise(_)) => include_str!("pulses.c"),
    };
    let body = format!("{}{law}", holes.fill(include_str!("model.c")));
    let head = holes.fill(include_str!("head.c"));
    format!("{head}{}{body}", needed(&body, precision))
}

/// The texts of `head.c` and `model.c`.
fn holes<T: Real>(sheet: &Sheet<'_>, c: &C) -> Holes {
    let model = sheet.model;
    let averaged = model.averaging.averaged_model;
    let signal = if averaged {
        "at_least(y, ZERO)"
    } else {
        "at_least((s->sum + s->sum_low) / (real)WINDOW, ZERO)"
    };
    let ports = Ports {
        jet: ["jet", "jet = {};"],
        delay: [signal, "const real delay = {}; /* samples */"],
        sensor: ["seen.measured", "seen.measured = {};"],
        flow: ["y", "sum = sum + ({});"],
    };
    let mut holes = common::holes::<T>(sheet, c, &ports);
    let (real, most) = match c.precision {
        Precision::Single => ("float", "(real)INFINITY"),
        Precision::Double => ("double", "1.7976931348623157e308"),
    };
    let (n1, n2, n3) = (
        sheet.state_back.len(),
        sheet.product_back.len(),
        sheet.rows.len(),
    );
    let rows = sheet.rows.iter();
    let transport = sheet.transport.as_ref();
    holes
        .set(
            "header",
            lines(sheet.header.iter().map(|line| format!(" * {line}"))),
        )
        .set("real", real)
        .set("real_max", most)
        .set("nought", c.number(0.0))
        .set("one", c.number(1.0))
        .set("n1", n1)
        .set("n2", n2)
        .set("n3", n3)
        .set("size1", n1.max(1))
        .set("size2", n2.max(1))
        .set("state_back", samples(&sheet.state_back))
        .set("product_back", samples(&sheet.product_back))
        .set("a", numbers(c, &model.a))
        .set("b", numbers(c, &model.b))
        .set(
            "c",
            rows.map(|row| format!("    {{ {} }}", numbers(c, row)))
                .collect::<Vec<_>>()
                .join(",\n"),
        )
        .set(
            "order",
            sheet
                .pace
                .2
                .map_or("UINT32_MAX".into(), |order| format!("{order}u")),
        )
        .set("near", NEAR)
        .flag("interpolated", transport.is_some_and(|t| !t.rounded))
        .flag(
            "shows_present",
            sheet.effects.iter().any(|e| e.piece.reads(Signal::Present)),
        );
    match (&model.delay, transport) {
        (Delay::Fixed { delays }, _) => {
            let delays: Vec<usize> = delays.iter().map(|h| usize::from(*h)).collect();
            holes.set("delays", samples(&delays));
        }
        (_, Some(transport)) => {
            holes.set("factors", numbers(c, &transport.factors));
        }
        _ => {}
    }
    let channels = &sheet.memory.channels;
    let names: Vec<String> = channels.iter().map(|c| c_string(&c.name)).collect();
    let usual: Vec<f64> = channels.iter().map(|c| c.reference).collect();
    holes
        .set("channel_count", channels.len())
        .set("channel_names", names.join(", "))
        .set("usual", numbers(c, &usual))
        .set(
            "usual_channels",
            if channels.is_empty() { "NULL" } else { "USUAL" },
        );
    let members = common::memories(
        sheet,
        |state, _| format!("real {state};"),
        |line, _| {
            format!(
                "real {line}[2u * {}];\nuint32_t {line}_newest;",
                length(line)
            )
        },
    );
    let starts = sheet.pieces().flat_map(Piece::states);
    holes.set("memories", members).set(
        "starts",
        lines(starts.map(|(state, start)| format!("s->{state} = {};", c.number(start)))),
    );
    let share = if sheet.graded() {
        "share_of(arrived)"
    } else if model.grading == Grading::Switched {
        "at_most(at_least((real)0.5 + (arrived - (real)0.5) * (real)50.0, ZERO), ONE)"
    } else {
        "arrived"
    };
    let range = model.command;
    let (jet, words) = if range.is_unit() {
        ("command".to_owned(), String::new())
    } else {
        let (off, full) = (range.off, range.full);
        let jet = format!("(real)(((double)command - {off:?}) / {:?})", full - off);
        let words = format!(" ({off:?} for no jet, {full:?} for a full jet)");
        (jet.replace("- -", "+ "), words)
    };
    holes
        .set("share", share)
        .set("jet", jet)
        .set("range", words);
    if let Some(Law::Maximise(law)) = sheet.law() {
        let mut pulses = law.pulses.clone();
        pulses.sort_unstable();
        let (first, length): (Vec<usize>, Vec<usize>) = pulses
            .iter()
            .map(|(first, length)| (*first as usize, *length as usize))
            .unzip();
        holes
            .set("law_pulses", pulses.len())
            .set("law_first", samples(&first))
            .set("law_length", samples(&length));
    }
    holes
}

fn numbers(c: &C, values: &[f64]) -> String {
    // C has no arrays of length 0.
    let values = if values.is_empty() { &[0.0] } else { values };
    let values: Vec<String> = values.iter().map(|v| c.number(*v)).collect();
    values.join(", ")
}

fn samples(values: &[usize]) -> String {
    let values = if values.is_empty() { &[0] } else { values };
    let values: Vec<String> = values.iter().map(|v| format!("{v}u")).collect();
    values.join(", ")
}
