//! Python: a class with `step` and `simulate`, for NumPy.

use super::c::{counts, reals};
use super::piece::{Function, Piece, Tapped, Tongue};
use super::plain::python_string;
use super::sheet::{Effect, Sheet};
use crate::model::{Delay, Law};
use crate::user_effect::program::Signal;
use model_core::effect::Place;
use model_core::recursion::Grading;
use std::fmt::Write as _;

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
}

pub(super) fn write(sheet: &Sheet<'_>) -> String {
    let constants = constants(sheet);
    let body = format!("{constants}\n{}{}", class(sheet), law(sheet));
    let core = include_str!("core.py")
        .split("#:")
        .filter_map(|part| part.split_once('\n'));
    let helpers = core.filter(|(name, _)| body.contains(&format!("{name}(")));
    let helpers: String = helpers.map(|(_, text)| text).collect();
    let mut head = String::from(
        "\"\"\"An identified model: `Model().simulate(u)` computes a free run, `step` one sample.\"\"\"\n\n",
    );
    for line in &sheet.header {
        let _ = writeln!(head, "# {line}");
    }
    format!("{head}\nimport copy\nimport math\n\nimport numpy as np\n\n\n{helpers}{body}")
}

fn constants(sheet: &Sheet<'_>) -> String {
    let (mut text, model) = (String::new(), sheet.model);
    let w = &mut text;
    let names: Vec<String> = sheet
        .memory
        .channels
        .iter()
        .map(|c| python_string(&c.name))
        .collect();
    let usual: Vec<String> = sheet
        .memory
        .channels
        .iter()
        .map(|c| format!("{:?}", c.reference))
        .collect();
    let tuple = |values: &[String]| match values {
        [] => "()".to_owned(),
        values => format!("({},)", values.join(", ")),
    };
    let _ = writeln!(w, "PERIOD = {:?}  # s", model.sample_period_s);
    let _ = writeln!(
        w,
        "COMMAND_OFF, COMMAND_FULL = {:?}, {:?}  # commands of no jet and of a full jet",
        model.command.off, model.command.full
    );
    let _ = writeln!(
        w,
        "CHANNELS = {}  # measured channels, in the order in which they are passed",
        tuple(&names)
    );
    let _ = writeln!(w, "USUAL = {}  # their usual values", tuple(&usual));
    let _ = writeln!(
        w,
        "OUTPUTS, JETS = {}, {}  # stored flow states and jet strengths, samples",
        sheet.memory.outputs, sheet.memory.jets
    );
    let _ = writeln!(
        w,
        "WINDOW = {}  # length of averages, samples",
        model.averaging.window
    );
    let _ = writeln!(
        w,
        "HELD = {}  # samples simulated before a run that does not begin at rest",
        sheet.held
    );
    let _ = writeln!(w, "SENSOR_ZERO = {:?}  # y", sheet.zero);
    if sheet.graded() || sheet.drives {
        let _ = writeln!(
            w,
            "RATE_OFF, RATE_ON = {:?}, {:?}  # relaxation rates of the separated and the attached flow, 1/sample",
            sheet.pace.0, sheet.pace.1
        );
    }
    for effect in sheet.cards() {
        let _ = writeln!(w, "\n# {}: {}.", effect.name, effect.summary);
        for (name, value, unit) in &effect.parameters {
            let _ = writeln!(w, "{name} = {value:?}  # {unit}");
        }
        if effect.piece.reads_reference() {
            let _ = writeln!(
                w,
                "{}_REFERENCE = {:?}",
                effect.piece.owner(),
                effect.reference
            );
        }
    }
    w.push('\n');
    for piece in sheet.pieces() {
        for constant in piece.constants(&Python) {
            let _ = writeln!(w, "{} = {}", constant.name, constant.formula);
        }
        for (line, samples) in piece.lines() {
            let _ = writeln!(w, "{}_LENGTH = {samples}  # samples", line.to_uppercase());
        }
    }
    match sheet.law() {
        Some(Law::Track(track)) => {
            w.push_str("\n# The law; times in samples.\n");
            for (name, value) in counts(track) {
                let _ = writeln!(w, "{name} = {value}");
            }
            for (name, value, unit) in reals::<f64>(track) {
                let _ = writeln!(w, "{name} = {value:?}  # {unit}");
            }
        }
        Some(Law::Maximise(law)) => {
            let pulses: Vec<String> = law
                .pulses
                .iter()
                .map(|(f, l)| format!("({f}, {l})"))
                .collect();
            let _ = writeln!(
                w,
                "\n# The law; times in samples, pulses as (first sample, length).\nLAW_PERIOD = {}\nLAW_PULSES = {}\nLAW_HOLD_ON, LAW_HOLD_OFF = {}, {}",
                law.period.max(1),
                tuple(&pulses),
                law.hold.on.max(1),
                law.hold.off.max(1)
            );
        }
        None => {}
    }
    text
}

/// A sum over the past, starting with `start`.
fn sum(start: &str, coefficients: &[f64], back: &[usize]) -> String {
    let mut text = start.to_owned();
    for (i, (coefficient, lag)) in coefficients.iter().zip(back).enumerate() {
        text.push_str(if i % 4 == 3 {
            "\n            + "
        } else {
            " + "
        });
        let _ = write!(text, "{coefficient:?} * y[-{}]", lag + 1);
    }
    text
}

fn piece(w: &mut String, piece: &Piece, indent: &str, signal: &str, target: &str) {
    let (lines, value) = piece.statements(&Python);
    if piece.reads(Signal::Own) {
        let _ = writeln!(w, "{indent}signal = {signal}");
    }
    for line in lines {
        let _ = writeln!(w, "{indent}{line}");
    }
    let _ = writeln!(w, "{indent}{target}{value}");
}

fn effect(w: &mut String, effect: &Effect, indent: &str, signal: &str, target: &str) {
    let _ = writeln!(w, "{indent}# {}", effect.name);
    piece(w, &effect.piece, indent, signal, target);
}

fn class(sheet: &Sheet<'_>) -> String {
    let model = sheet.model;
    let average = sheet.follows && !model.averaging.averaged_model;
    let mut text = String::from(
        "\nclass Model:\n    \"\"\"The model with its state.\"\"\"\n\n    def __init__(self):\n        self.reset()\n\n    \
         def reset(self, y=None, u=None, channels=USUAL):\n        \
         \"\"\"Restarts at the first sample. Before it all signals are 0, or the reading `y` and the command `u` are constant.\"\"\"\n        \
         self.y = [0.0] * OUTPUTS\n        self.jets = [0.0] * JETS\n",
    );
    let w = &mut text;
    if average {
        w.push_str("        self.sum = self.fresh = 0.0\n        self.in_block = 0\n");
    }
    let averaged = model.averaging.averaged_model;
    if averaged {
        w.push_str("        self.sums = [0.0] * (JETS + 1)  # sums of the jets so far\n");
    }
    if sheet.clocked {
        w.push_str("        self.lived, self.since_edge, self.last_command = 0, 1 << 24, 0.0\n");
    }
    for piece in sheet.pieces() {
        for (state, start) in piece.states() {
            let _ = writeln!(w, "        self.{state} = {start:?}");
        }
        for (line, _) in piece.lines() {
            let _ = writeln!(
                w,
                "        self.{line} = [0.0] * {}_LENGTH",
                line.to_uppercase()
            );
        }
    }
    let share = if model.command.is_unit() {
        "float(command)"
    } else {
        "(command - COMMAND_OFF) / (COMMAND_FULL - COMMAND_OFF)"
    };
    let _ = write!(
        w,
        "        if y is not None:\n            command = COMMAND_OFF if u is None else u\n            for _ in range(HELD):\n                \
         self.advance(y - SENSOR_ZERO)\n                self.observe({share}, channels, True)\n            self.advance(y - SENSOR_ZERO)\n\n    \
         def copy(self):\n        return copy.deepcopy(self)\n\n    \
         def observe(self, u, channels, sensed):\n        \
         \"\"\"Computes one sample without advancing the flow: (reading, flow, next flow, shortest delay).\"\"\"\n        \
         y, jets = self.y, self.jets\n        now = y[-1]\n"
    );
    if sheet.clocked {
        w.push_str("        self.lived += 1\n        self.since_edge = 0 if u != self.last_command else min(self.since_edge + 1, 1 << 24)\n        self.last_command = u\n");
    }
    w.push_str("        jet = u\n");
    let indent = "        ";
    if let Some(command) = sheet.transport.as_ref().and_then(|t| t.command.as_ref()) {
        w.push_str("        # delayed edges\n");
        piece(w, command, indent, "jet", "jet = ");
    }
    for own in sheet.at(Place::Jet) {
        effect(w, own, indent, "jet", "jet = ");
    }
    w.push_str("        jets.append(jet)\n");
    if averaged {
        w.push_str("        sums = self.sums\n        sums.append(sums[-1] + jet)\n");
    }
    arriving(sheet, w);
    w.push_str("        reading = now\n");
    if sheet.at(Place::Sensor).next().is_some() {
        w.push_str("        if sensed:\n");
        for own in sheet.at(Place::Sensor) {
            effect(w, own, "            ", "reading", "reading = ");
        }
    }
    flow(sheet, w);
    w.push_str("        return reading, now, following, nearest\n\n    def advance(self, flow):\n        \"\"\"Stores `flow` as the newest flow state.\"\"\"\n        y = self.y\n");
    if average {
        w.push_str("        # The sum of every block is computed anew, so it does not drift.\n        self.fresh += y[-1]\n        self.in_block += 1\n        \
                    if self.in_block >= WINDOW - 1:\n            self.sum, self.fresh, self.in_block = self.fresh, 0.0, 0\n        \
                    else:\n            self.sum += y[-1] - y[-WINDOW]\n");
    }
    // Sums stay small, and thereby exact.
    let shorter = if averaged {
        "            self.sums = [s - self.sums[-JETS - 1] for s in self.sums[-JETS - 1:]]\n"
    } else {
        ""
    };
    let _ = write!(
        w,
        "        y.append(flow)\n        if len(y) > 65536 + OUTPUTS:\n            del y[:-OUTPUTS]\n            del self.jets[:-JETS]\n{shorter}\n    \
         def step(self, command, channels=USUAL):\n        \
         \"\"\"Returns the reading at this sample and advances the model; the command holds until the next sample.\"\"\"\n        \
         reading, _, following, _ = self.observe({share}, channels, True)\n        self.advance(following)\n        return reading\n\n    \
         def simulate(self, u, channels=None, y_before=None, u_before=None):\n        \
         \"\"\"A free run for the commands `u`; returns one reading per command.\n\n        \
         `channels` has a column for each of CHANNELS, in its unit. Before the first sample all signals are 0, or the\n        \
         reading `y_before` and the command `u_before` (by default the first one) are constant.\n        \"\"\"\n        \
         u = np.asarray(u, dtype=float).ravel()\n        \
         rows = [USUAL] * len(u) if channels is None else np.asarray(channels, dtype=float).reshape(len(u), -1).tolist()\n        \
         first = u[0] if u_before is None and len(u) else u_before\n        \
         self.reset(y_before, first, rows[0] if rows else USUAL)\n        \
         observe, advance, readings = self.observe, self.advance, []\n        for command, row in zip(u.tolist(), rows):\n            \
         reading, _, following, _ = observe({share}, row, True)\n            advance(following)\n            \
         readings.append(reading)\n        return np.array(readings)\n"
    );
    text
}

fn arriving(sheet: &Sheet<'_>, w: &mut String) {
    let model = sheet.model;
    let inputs = model.b.len();
    let read = |lag: &str, plus: usize| {
        let from = plus + 1;
        if model.averaging.averaged_model {
            format!("(sums[-{from} - {lag}] - sums[-{from} - {lag} - WINDOW]) / WINDOW")
        } else {
            format!("jets[-{from} - {lag}]")
        }
    };
    let Some(transport) = &sheet.transport else {
        if let Delay::Fixed { delays } = &model.delay {
            for (l, h) in delays.iter().enumerate() {
                let value = if model.averaging.averaged_model {
                    read(&h.to_string(), 0)
                } else {
                    format!("jets[-{}]", h + 1)
                };
                let _ = writeln!(w, "        jet{l} = {value}");
            }
            let nearest = delays.iter().min().copied().unwrap_or(0);
            let _ = writeln!(
                w,
                "        arrived = present = jet0\n        nearest = {nearest}"
            );
        }
        return;
    };
    let signal = if model.averaging.averaged_model {
        "max(now, 0.0)"
    } else {
        "max(self.sum / WINDOW, 0.0)  # the mean of the preceding flow states, eq. (1)"
    };
    piece(w, &transport.effect.piece, "        ", signal, "delay = ");
    w.push_str("        nearest = JETS\n");
    for (l, factor) in transport.factors.iter().take(inputs).enumerate() {
        let _ = writeln!(
            w,
            "        exact = max({factor:?} * delay, 0.0)\n        whole = min(int(exact), JETS - 2)"
        );
        if transport.rounded {
            let _ = writeln!(
                w,
                "        if exact - whole >= 0.5:\n            whole = min(whole + 1, JETS - 2)\n        jet{l} = {}",
                read("whole", 0)
            );
            if l == 0 {
                w.push_str("        present = jet0\n");
            }
        } else {
            let _ = writeln!(
                w,
                "        fraction = exact - int(exact)\n        newer, older = {}, {}",
                read("whole", 0),
                read("whole", 1)
            );
            if l == 0 {
                w.push_str("        present = older if fraction else newer\n");
            }
            let _ = writeln!(w, "        jet{l} = newer + fraction * (older - newer)");
        }
        w.push_str("        nearest = min(nearest, whole)\n");
    }
    w.push_str("        arrived = jet0\n");
}

fn share(grading: Grading) -> &'static str {
    match grading {
        Grading::Proportional | Grading::Interpolated => "arrived",
        Grading::Switched => "min(max(0.5 + (arrived - 0.5) * 50.0, 0.0), 1.0)",
    }
}

fn flow(sheet: &Sheet<'_>, w: &mut String) {
    let model = sheet.model;
    let constant = format!("{:?}", model.constant);
    if sheet.graded() {
        let order = sheet.pace.2.unwrap_or(usize::MAX);
        let split = |coefficients: &[f64], back: &[usize], short: bool| {
            let pairs = coefficients
                .iter()
                .zip(back)
                .filter(|(_, lag)| (**lag < order) == short);
            let (c, b): (Vec<f64>, Vec<usize>) = pairs.map(|(c, b)| (*c, *b)).unzip();
            sum("0.0", &c, &b)
        };
        let _ = write!(
            w,
            "        # Rate and final level of the flow lie between those of separated and attached flow.\n        \
             free = {constant} + (\n            {})\n        past = (\n            {})\n        following = free + past\n        \
             if arrived != 0.0:\n            share = {}\n            gain = (\n            {})\n            past_gain = (\n            {})\n            \
             separated = (1.0 - arrived) * past / RATE_OFF if past != 0.0 else 0.0\n            \
             attached = arrived * ({:?} + past + past_gain) / RATE_ON\n            \
             following = free + gain * share + (RATE_OFF + (RATE_ON - RATE_OFF) * share) * (separated + attached)\n",
            split(&model.a, &sheet.state_back, true),
            split(&model.a, &sheet.state_back, false),
            share(model.grading),
            split(&sheet.rows[0], &sheet.product_back, true),
            split(&sheet.rows[0], &sheet.product_back, false),
            model.b[0]
        );
    } else {
        let _ = writeln!(
            w,
            "        following = free = (\n            {})",
            sum(&constant, &model.a, &sheet.state_back)
        );
        for (l, row) in sheet.rows.iter().enumerate() {
            let drive = format!("{:?}", model.b[l]);
            let _ = writeln!(
                w,
                "        if jet{l} != 0.0:\n            following += jet{l} * (\n            {})",
                sum(&drive, row, &sheet.product_back)
            );
        }
    }
    if !sheet.drives {
        return;
    }
    let part = if model.grading == Grading::Proportional {
        "(1.0 - arrived) * (free - now) if arrived not in (0.0, 1.0) else separated * (following - now)"
    } else {
        "separated * (following - now)"
    };
    let _ = write!(
        w,
        "        # Effects of the flow: each uses the motion with the preceding effects.\n        share = {}\n        \
         relaxation = RATE_OFF + (RATE_ON - RATE_OFF) * share\n        \
         separated = 1.0 - share if share in (0.0, 1.0) or relaxation == 0.0 else (1.0 - share) * RATE_OFF / relaxation\n        \
         motion = {part}\n        added = 0.0\n",
        share(model.grading)
    );
    for own in sheet.at(Place::Flow) {
        w.push_str(
            "        next_y = following + added\n        released = motion + separated * added\n",
        );
        effect(w, own, "        ", "now", "added += ");
    }
    w.push_str("        following += added\n");
}

fn law(sheet: &Sheet<'_>) -> &'static str {
    match sheet.law() {
        None => "",
        Some(Law::Track(_)) => include_str!("law.py"),
        Some(Law::Maximise(_)) => include_str!("pulses.py"),
    }
}
