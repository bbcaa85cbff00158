//! MATLAB: one function file that GNU Octave runs too.

use super::c::{counts, reals};
use super::piece::{Function, Piece, Tapped, Tongue};
use super::plain::matlab_string;
use super::sheet::{Effect, Sheet};
use crate::model::{Delay, Law};
use crate::user_effect::program::Signal;
use model_core::effect::Place;
use model_core::recursion::Grading;
use std::fmt::Write as _;

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
}

pub(super) fn write(sheet: &Sheet<'_>, name: &str) -> String {
    let mut text = format!(
        "% An identified model.\n%   y = {name}(u) is a free run for the commands u, starting at rest.\n\
         %   [y, s] = {name}(u, s, channels) continues from the state s ([] for rest); channels has one column per channel.\n\
         %   s = {name}('hold', u, y) is the state after a long time with constant command u and reading y.\n"
    );
    if sheet.law().is_some() {
        let _ = writeln!(
            text,
            "%   [on, law] = {name}('law', reading, law) returns the valve's position until the next sample; law is [] at the first call."
        );
    }
    text.push_str("%\n");
    for line in &sheet.header {
        // With a space, because `%{` would begin a block comment.
        let _ = writeln!(text, "% {line}");
    }
    main(sheet, name, &mut text);
    at_rest(sheet, &mut text);
    observe(sheet, &mut text);
    advance(sheet, &mut text);
    law(sheet, &mut text);
    let helpers = [
        (
            "pick(",
            "\nfunction x = pick(condition, yes, no)\n  if condition\n    x = yes;\n  else\n    x = no;\n  end\nend\n",
        ),
        (
            "ago(",
            "\n% The value `samples` samples ago, with linear interpolation.\nfunction x = ago(line, samples)\n  samples = max(samples, 0);\n  whole = floor(samples);\n  x = line(1 + whole) + (samples - whole) * (line(2 + whole) - line(1 + whole));\nend\n",
        ),
    ];
    for (call, helper) in helpers {
        if text.contains(&format!(" {call}")) || text.contains(&format!("({call}")) {
            text.push_str(helper);
        }
    }
    text
}

fn row(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|v| format!("{v:?}")).collect();
    format!("[{}]", values.join(", "))
}

fn main(sheet: &Sheet<'_>, name: &str, w: &mut String) {
    let command = sheet.model.command;
    let share = if command.is_unit() {
        String::new()
    } else {
        format!(
            "(u - ({:?})) / ({:?})",
            command.off,
            command.full - command.off
        )
    };
    let share = |u: &str| {
        if share.is_empty() {
            u.to_owned()
        } else {
            share.replacen('u', u, 1)
        }
    };
    let usual: Vec<f64> = sheet.memory.channels.iter().map(|c| c.reference).collect();
    let usual = if usual.is_empty() {
        "zeros(1, 0)".to_owned()
    } else {
        row(&usual)
    };
    let names: Vec<String> = sheet
        .memory
        .channels
        .iter()
        .map(|c| matlab_string(&c.name))
        .collect();
    let _ = write!(
        w,
        "function [y, s] = {name}(u, s, channels, more)\n  usual = {}; % usual values of the channels, in this order: {}\n  if nargin < 2, s = []; end\n  \
         if nargin < 3, channels = []; end\n  if ischar(u) && strcmp(u, 'hold')\n    if nargin < 4, more = usual; end\n    \
         y = hold(s, channels, more);\n    s = y;\n    return\n  end\n",
        usual,
        names.join(", ")
    );
    if sheet.law().is_some() {
        w.push_str("  if ischar(u) && strcmp(u, 'law')\n    if isempty(channels), channels = law_at_rest(); end\n    if nargin < 4, more = usual; end\n    [y, s] = law_step(channels, s, more);\n    return\n  end\n");
    }
    let _ = write!(
        w,
        "  if isempty(s), s = at_rest(); end\n  if isempty(channels), channels = repmat(usual, numel(u), 1); end\n  y = zeros(size(u));\n  \
         for k = 1:numel(u)\n    [y(k), ~, following, ~, s] = observe(s, {}, channels(k, :), true);\n    s = advance(s, following);\n  end\nend\n\n\
         function s = hold(u, y, channels)\n  s = at_rest();\n  for k = 1:{}\n    s = advance(s, y - ({:?}));\n    \
         [~, ~, ~, ~, s] = observe(s, {}, channels, true);\n  end\n  s = advance(s, y - ({:?}));\nend\n",
        share("u(k)"),
        sheet.held,
        sheet.zero,
        share("u"),
        sheet.zero
    );
}

fn at_rest(sheet: &Sheet<'_>, w: &mut String) {
    let _ = write!(
        w,
        "\n% All signals are 0 before the first sample; element 1 of each memory is the newest.\nfunction s = at_rest()\n  \
         s.y = zeros({}, 1);\n  s.jets = zeros({}, 1);\n",
        sheet.memory.outputs, sheet.memory.jets
    );
    if sheet.follows && !sheet.model.averaging.averaged_model {
        w.push_str("  s.sum = 0; s.fresh = 0; s.in_block = 0;\n");
    }
    if sheet.clocked {
        w.push_str("  s.lived = 0; s.since_edge = 2 ^ 24; s.last_command = 0;\n");
    }
    for piece in sheet.pieces() {
        for (state, start) in piece.states() {
            let _ = writeln!(w, "  s.{state} = {start:?};");
        }
        for (line, samples) in piece.lines() {
            let _ = writeln!(w, "  s.{line} = zeros({samples}, 1);");
        }
    }
    w.push_str("end\n");
}

fn piece(w: &mut String, piece: &Piece, indent: &str, signal: &str, target: &str) {
    let (lines, value) = piece.statements(&Matlab);
    if piece.reads(Signal::Own) {
        let _ = writeln!(w, "{indent}signal = {signal};");
    }
    for line in lines {
        let _ = writeln!(w, "{indent}{line}");
    }
    let end = if target.ends_with('(') { ")" } else { "" };
    let _ = writeln!(w, "{indent}{target}{value}{end};");
}

fn effect(w: &mut String, effect: &Effect, indent: &str, signal: &str, target: &str) {
    let _ = writeln!(w, "{indent}% {}", effect.name);
    piece(w, &effect.piece, indent, signal, target);
}

fn observe(sheet: &Sheet<'_>, w: &mut String) {
    let model = sheet.model;
    let _ = write!(
        w,
        "\n% Computes one sample without advancing the flow.\n\
         function [reading, now, following, nearest, s] = observe(s, u, channels, sensed)\n  PERIOD = {:?}; % s\n",
        model.sample_period_s
    );
    for effect in sheet.cards() {
        let _ = writeln!(w, "  % {}: {}.", effect.name, effect.summary);
        for (name, value, unit) in &effect.parameters {
            let _ = writeln!(w, "  {name} = {value:?}; % {unit}");
        }
        if effect.piece.reads_reference() {
            let _ = writeln!(
                w,
                "  {}_REFERENCE = {:?};",
                effect.piece.owner(),
                effect.reference
            );
        }
    }
    for piece in sheet.pieces() {
        for constant in piece.constants(&Matlab) {
            let _ = writeln!(w, "  {} = {};", constant.name, constant.formula);
        }
    }
    w.push_str("  now = s.y(1);\n");
    if sheet.clocked {
        w.push_str("  s.lived = s.lived + 1;\n  if u ~= s.last_command\n    s.since_edge = 0;\n  else\n    s.since_edge = min(s.since_edge + 1, 2 ^ 24);\n  end\n  s.last_command = u;\n");
    }
    w.push_str("  jet = u;\n");
    if let Some(command) = sheet.transport.as_ref().and_then(|t| t.command.as_ref()) {
        w.push_str("  % delayed edges\n");
        piece(w, command, "  ", "jet", "jet = ");
    }
    for own in sheet.at(Place::Jet) {
        effect(w, own, "  ", "jet", "jet = ");
    }
    w.push_str("  s.jets = [jet; s.jets(1:end-1)];\n");
    arriving(sheet, w);
    w.push_str("  reading = now;\n");
    if sheet.at(Place::Sensor).next().is_some() {
        w.push_str("  if sensed\n");
        for own in sheet.at(Place::Sensor) {
            effect(w, own, "    ", "reading", "reading = ");
        }
        w.push_str("  end\n");
    }
    flow(sheet, w);
    w.push_str("end\n");
}

fn arriving(sheet: &Sheet<'_>, w: &mut String) {
    let model = sheet.model;
    let read = |lag: &str| {
        if model.averaging.averaged_model {
            let window = model.averaging.window;
            format!("sum(s.jets(1 + {lag}:{window} + {lag})) / {window}")
        } else {
            format!("s.jets(1 + {lag})")
        }
    };
    let Some(transport) = &sheet.transport else {
        if let Delay::Fixed { delays } = &model.delay {
            for (l, h) in delays.iter().enumerate() {
                let _ = writeln!(w, "  jet{l} = {};", read(&h.to_string()));
            }
            let nearest = delays.iter().min().copied().unwrap_or(0);
            let _ = writeln!(
                w,
                "  arrived = jet0;\n  present = jet0;\n  nearest = {nearest};"
            );
        }
        return;
    };
    let signal = if model.averaging.averaged_model {
        "max(now, 0)".to_owned()
    } else {
        format!("max(s.sum / {}, 0)", model.averaging.window)
    };
    piece(w, &transport.effect.piece, "  ", &signal, "delay = ");
    let most = sheet.memory.jets - 2;
    w.push_str("  nearest = inf;\n");
    for (l, factor) in transport.factors.iter().enumerate() {
        let _ = writeln!(w, "  exact = max({factor:?} * delay, 0);");
        if transport.rounded {
            let _ = writeln!(
                w,
                "  whole = min(round(exact), {most});\n  jet{l} = {};",
                read("whole")
            );
            if l == 0 {
                w.push_str("  present = jet0;\n");
            }
        } else {
            let _ = writeln!(
                w,
                "  whole = min(floor(exact), {most});\n  fraction = exact - floor(exact);\n  newer = {};\n  older = {};",
                read("whole"),
                read("(whole + 1)")
            );
            if l == 0 {
                w.push_str("  present = newer;\n  if fraction ~= 0, present = older; end\n");
            }
            let _ = writeln!(w, "  jet{l} = newer + fraction * (older - newer);");
        }
        w.push_str("  nearest = min(nearest, whole);\n");
    }
    w.push_str("  arrived = jet0;\n");
}

fn share(grading: Grading) -> &'static str {
    match grading {
        Grading::Proportional | Grading::Interpolated => "arrived",
        Grading::Switched => "min(max(0.5 + (arrived - 0.5) * 50, 0), 1)",
    }
}

/// Coefficients times the past.
fn product(coefficients: &[f64], back: &[usize]) -> String {
    let places: Vec<String> = back.iter().map(|lag| (lag + 1).to_string()).collect();
    if places.is_empty() {
        return "0".into();
    }
    format!("{} * s.y([{}])", row(coefficients), places.join(", "))
}

fn flow(sheet: &Sheet<'_>, w: &mut String) {
    let model = sheet.model;
    if sheet.graded() || sheet.drives {
        let _ = writeln!(
            w,
            "  RATE_OFF = {:?}; RATE_ON = {:?}; % relaxation rates of the separated and the attached flow, 1/sample\n  share = {};",
            sheet.pace.0,
            sheet.pace.1,
            share(model.grading)
        );
    }
    if sheet.graded() {
        let order = sheet.pace.2.unwrap_or(usize::MAX);
        let split = |coefficients: &[f64], back: &[usize], short: bool| {
            let pairs = coefficients
                .iter()
                .zip(back)
                .filter(|(_, lag)| (**lag < order) == short);
            let (c, b): (Vec<f64>, Vec<usize>) = pairs.map(|(c, b)| (*c, *b)).unzip();
            product(&c, &b)
        };
        let _ = write!(
            w,
            "  % Rate and final level of the flow lie between those of separated and attached flow.\n  \
             free = {:?} + {};\n  past = {};\n  following = free + past;\n  if arrived ~= 0\n    gain = {};\n    past_gain = {};\n    \
             separated = 0;\n    if past ~= 0, separated = (1 - arrived) * past / RATE_OFF; end\n    \
             attached = arrived * ({:?} + past + past_gain) / RATE_ON;\n    \
             following = free + gain * share + (RATE_OFF + (RATE_ON - RATE_OFF) * share) * (separated + attached);\n  end\n",
            model.constant,
            split(&model.a, &sheet.state_back, true),
            split(&model.a, &sheet.state_back, false),
            split(&sheet.rows[0], &sheet.product_back, true),
            split(&sheet.rows[0], &sheet.product_back, false),
            model.b[0]
        );
    } else {
        let _ = writeln!(
            w,
            "  free = {:?} + {};\n  following = free;",
            model.constant,
            product(&model.a, &sheet.state_back)
        );
        for (l, coefficients) in sheet.rows.iter().enumerate() {
            let _ = writeln!(
                w,
                "  if jet{l} ~= 0\n    following = following + jet{l} * ({:?} + {});\n  end",
                model.b[l],
                product(coefficients, &sheet.product_back)
            );
        }
    }
    if !sheet.drives {
        return;
    }
    w.push_str("  % Effects of the flow: each uses the motion with the preceding effects.\n  relaxation = RATE_OFF + (RATE_ON - RATE_OFF) * share;\n  separated = 1 - share;\n  if share ~= 0 && share ~= 1 && relaxation ~= 0\n    separated = (1 - share) * RATE_OFF / relaxation;\n  end\n  motion = separated * (following - now);\n");
    if model.grading == Grading::Proportional {
        w.push_str("  if arrived ~= 0 && arrived ~= 1\n    motion = (1 - arrived) * (free - now);\n  end\n");
    }
    w.push_str("  added = 0;\n");
    for own in sheet.at(Place::Flow) {
        w.push_str("  next_y = following + added;\n  released = motion + separated * added;\n");
        effect(w, own, "  ", "now", "added = added + (");
    }
    w.push_str("  following = following + added;\n");
}

fn advance(sheet: &Sheet<'_>, w: &mut String) {
    w.push_str("\n% Stores `flow` as the newest flow state.\nfunction s = advance(s, flow)\n");
    if sheet.follows && !sheet.model.averaging.averaged_model {
        let window = sheet.model.averaging.window;
        let _ = write!(
            w,
            "  % The sum of every block is computed anew, so it does not drift.\n  s.fresh = s.fresh + s.y(1);\n  s.in_block = s.in_block + 1;\n  \
             if s.in_block >= {}\n    s.sum = s.fresh; s.fresh = 0; s.in_block = 0;\n  else\n    s.sum = s.sum + (s.y(1) - s.y({window}));\n  end\n",
            window - 1
        );
    }
    w.push_str("  s.y = [flow; s.y(1:end-1)];\nend\n");
}

fn law(sheet: &Sheet<'_>, w: &mut String) {
    match sheet.law() {
        None => {}
        Some(Law::Track(track)) => {
            w.push_str("\n% The law; times in samples.\nfunction c = constants()\n");
            for (name, value) in counts(track) {
                let _ = writeln!(w, "  c.{name} = {value};");
            }
            for (name, value, unit) in reals::<f64>(track) {
                let _ = writeln!(w, "  c.{name} = {value:?}; % {unit}");
            }
            let _ = write!(w, "end\n{}", include_str!("law.m"));
        }
        Some(Law::Maximise(law)) => {
            let list = |of: fn(&(u32, u32)) -> u32| {
                let each: Vec<String> = law.pulses.iter().map(|p| of(p).to_string()).collect();
                format!("[{}]", each.join(", "))
            };
            let _ = write!(
                w,
                "\n% The law; times in samples.\nfunction c = constants()\n  c.LAW_PERIOD = {};\n  c.LAW_FIRST = {};\n  c.LAW_LENGTH = {};\n  \
                 c.LAW_HOLD_ON = {};\n  c.LAW_HOLD_OFF = {};\nend\n{}",
                law.period.max(1),
                list(|p| p.0),
                list(|p| p.1),
                law.hold.on.max(1),
                law.hold.off.max(1),
                include_str!("pulses.m")
            );
        }
    }
}
