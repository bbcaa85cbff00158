//! C99: one file without a heap, static state, the host's bits in its precision.

use super::Precision;
use super::piece::{Function, Tapped, Tongue};
use super::plain::{c_string, comment};
use super::sheet::{Effect, Sheet};
use crate::model::{Delay, Law, Maximise, Track};
use crate::user_effect::program::Signal;
use model_core::Real;
use model_core::effect::Place;
use model_core::recursion::Grading;
use std::fmt::Write as _;

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
    let c = C { precision };
    let body = format!("{}{}", model(sheet, &c), law::<T>(sheet, &c));
    format!(
        "{}{}\n{}{body}",
        heading(sheet, precision),
        constants(sheet, &c),
        needed(&body, precision)
    )
}

fn heading(sheet: &Sheet<'_>, precision: Precision) -> String {
    let mut text =
        String::from("/* An identified model. Generated; edit the model file instead.\n *\n");
    for line in &sheet.header {
        let _ = writeln!(text, " * {line}");
    }
    let kind = if precision == Precision::Single {
        "float"
    } else {
        "double"
    };
    let _ = write!(
        text,
        " *\n * model_step takes the command of a sample, returns the sensor's reading at that sample, and advances the model.\n \
         * Bit-identical to the host with IEEE numbers and without fused multiply-add: -std=c99 -ffp-contract=off.\n */\n\
         #include <math.h>\n#include <stddef.h>\n#include <stdint.h>\n\n\
         typedef {kind} real;\n\n/* Declarations for your header. */\n"
    );
    if !sheet.memory.channels.is_empty() {
        let names: Vec<String> = sheet
            .memory
            .channels
            .iter()
            .map(|c| c_string(&c.name))
            .collect();
        let _ = writeln!(
            text,
            "#define MODEL_CHANNELS {}u\nextern const char *const model_channels[MODEL_CHANNELS];",
            names.len()
        );
    }
    text.push_str(
        "void model_reset(void);\nvoid model_hold(real command, real reading, const real *channels);\n\
         real model_step(real command, const real *channels);\n",
    );
    match sheet.law() {
        Some(Law::Track(_)) => text.push_str(
            "struct law_decision {\n    int on;          /* the valve until the next sample */\n    \
             real reference;  /* reference now, y */\n    real foreseen;   /* predicted flow at the arrival of the decision, y */\n    \
             uint32_t delay;  /* from now to that arrival, samples */\n    real estimate;   /* flow now, y */\n    \
             real residual;   /* reading minus the model's output, y */\n    real bias;       /* mean error of the predictions, y */\n    \
             uint32_t lost;   /* samples without a reading */\n};\nvoid law_reset(void);\n\
             /* A reading of NaN counts as missing. */\n\
             struct law_decision law_step(real reading, const real *channels);\n",
        ),
        Some(Law::Maximise(_)) => text.push_str("void law_reset(void);\nint law_step(void);\n"),
        None => {}
    }
    text.push('\n');
    text
}

fn numbers(c: &C, values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|v| c.number(*v)).collect();
    // C has no arrays of length 0.
    let none = c.number(0.0);
    if values.is_empty() {
        none
    } else {
        values.join(", ")
    }
}

fn samples(values: &[usize]) -> String {
    let values: Vec<String> = values.iter().map(|v| format!("{v}u")).collect();
    if values.is_empty() {
        "0u".into()
    } else {
        values.join(", ")
    }
}

fn constants(sheet: &Sheet<'_>, c: &C) -> String {
    let model = sheet.model;
    let mut text = String::new();
    let (n1, n2, n3) = (
        sheet.state_back.len(),
        sheet.product_back.len(),
        sheet.rows.len(),
    );
    let w = &mut text;
    let _ = writeln!(
        w,
        "#define ZERO {}\n#define ONE {}",
        c.number(0.0),
        c.number(1.0)
    );
    let _ = writeln!(
        w,
        "#define PERIOD {} /* s */",
        c.number(model.sample_period_s)
    );
    let _ = writeln!(
        w,
        "#define OUTPUTS {}u /* stored flow states, samples */",
        sheet.memory.outputs
    );
    let _ = writeln!(
        w,
        "#define JETS {}u /* stored jet strengths, samples */",
        sheet.memory.jets
    );
    let _ = writeln!(
        w,
        "#define WINDOW {}u /* length of averages, samples */",
        model.averaging.window
    );
    let _ = writeln!(
        w,
        "#define HELD {}u /* samples that model_hold simulates */",
        sheet.held
    );
    let _ = writeln!(w, "#define SENSOR_ZERO {} /* y */", c.number(sheet.zero));
    let _ = writeln!(w, "#define N1 {n1}u\n#define N2 {n2}u\n#define N3 {n3}u");
    if sheet.graded() {
        let (off, on, order) = sheet.pace;
        let order = order.map_or("UINT32_MAX".into(), |order| format!("{order}u"));
        let _ = writeln!(
            w,
            "#define RATE_OFF {} /* relaxation rate of the separated flow, 1/sample */\n#define RATE_ON {} /* relaxation rate of the attached flow */\n\
             #define ORDER {order} /* lags below this count for the relaxation rates */",
            c.number(off),
            c.number(on)
        );
    } else if sheet.drives {
        let _ = writeln!(
            w,
            "#define RATE_OFF {}\n#define RATE_ON {}",
            c.number(sheet.pace.0),
            c.number(sheet.pace.1)
        );
    }
    let _ = writeln!(
        w,
        "\nstatic const real CONSTANT = {}; /* d */",
        c.number(model.constant)
    );
    let one = |n: usize| n.max(1);
    let _ = writeln!(
        w,
        "/* Lags in samples behind the newest flow, y_k, and coefficients. */\n\
         static const uint32_t STATE_BACK[{}] = {{ {} }};\nstatic const real A[{}] = {{ {} }};\n\
         static const uint32_t PRODUCT_BACK[{}] = {{ {} }};\nstatic const real B[{n3}] = {{ {} }};",
        one(n1),
        samples(&sheet.state_back),
        one(n1),
        numbers(c, &model.a),
        one(n2),
        samples(&sheet.product_back),
        numbers(c, &model.b)
    );
    let rows = sheet
        .rows
        .iter()
        .map(|row| format!("    {{ {} }}", numbers(c, row)));
    let rows: Vec<String> = rows.collect();
    let _ = writeln!(
        w,
        "static const real C[{n3}][{}] = {{\n{}\n}};",
        one(n2),
        rows.join(",\n")
    );
    match (&model.delay, &sheet.transport) {
        (Delay::Fixed { delays }, _) => {
            let delays: Vec<usize> = delays.iter().map(|h| usize::from(*h)).collect();
            let _ = writeln!(
                w,
                "static const uint32_t DELAYS[{n3}] = {{ {} }}; /* samples */",
                samples(&delays)
            );
        }
        (_, Some(transport)) => {
            let _ = writeln!(
                w,
                "static const real FACTORS[{n3}] = {{ {} }};",
                numbers(c, &transport.factors)
            );
        }
        _ => {}
    }
    for effect in sheet.cards() {
        let _ = writeln!(w, "\n/* {}: {}. */", effect.name, effect.summary);
        for (name, value, unit) in &effect.parameters {
            let _ = writeln!(w, "#define {name} {} /* {unit} */", signed(c, *value));
        }
        if effect.piece.reads_reference() {
            let owner = effect.piece.owner();
            let _ = writeln!(
                w,
                "#define {owner}_REFERENCE {}",
                signed(c, effect.reference)
            );
        }
    }
    text.push('\n');
    for piece in sheet.pieces() {
        for constant in piece.constants(c) {
            let _ = writeln!(
                text,
                "#define {} {} /* {} */",
                constant.name,
                signed(c, constant.value),
                comment(&constant.formula)
            );
        }
        for (line, samples) in piece.lines() {
            let _ = writeln!(text, "#define {} {samples}u", length(&line));
        }
    }
    text
}

/// A number, in parentheses if its sign could follow another sign.
fn signed(c: &C, value: f64) -> String {
    let number = c.number(value);
    if number.starts_with('-') {
        format!("({number})")
    } else {
        number
    }
}

fn model(sheet: &Sheet<'_>, c: &C) -> String {
    let model = sheet.model;
    let mut text = String::new();
    let w = &mut text;
    if !sheet.memory.channels.is_empty() {
        let names: Vec<String> = sheet
            .memory
            .channels
            .iter()
            .map(|c| c_string(&c.name))
            .collect();
        let usual: Vec<f64> = sheet.memory.channels.iter().map(|c| c.reference).collect();
        let _ = writeln!(
            w,
            "\nconst char *const model_channels[MODEL_CHANNELS] = {{ {} }};\n\
             static const real USUAL[MODEL_CHANNELS] = {{ {} }}; /* used if no channels are given */",
            names.join(", "),
            numbers(c, &usual)
        );
    }
    w.push_str("\nstruct model {\n    real y[2u * OUTPUTS]; /* flow states, each stored twice */\n    uint32_t y_newest;\n    real jets[2u * JETS];\n    uint32_t jets_newest;\n");
    if sheet.follows && !model.averaging.averaged_model {
        w.push_str("    real sum, sum_low, fresh, fresh_low; /* sums over the window, each in two words */\n    uint32_t in_block;\n");
    }
    if sheet.clocked {
        w.push_str("    uint32_t lived, since_edge;\n    real last_command;\n");
    }
    for piece in sheet.pieces() {
        for (state, _) in piece.states() {
            let _ = writeln!(w, "    real {state};");
        }
        for (line, _) in piece.lines() {
            let _ = writeln!(
                w,
                "    real {line}[2u * {}];\n    uint32_t {line}_newest;",
                length(&line)
            );
        }
    }
    w.push_str("};\n\n/* All signals are 0 before the first sample. */\nstatic void at_rest(struct model *s)\n{\n    static const struct model zero;\n    *s = zero;\n");
    if sheet.clocked {
        w.push_str("    s->since_edge = 16777216u;\n");
    }
    for piece in sheet.pieces() {
        for (state, start) in piece.states() {
            let _ = writeln!(w, "    s->{state} = {};", c.number(start));
        }
    }
    w.push_str("}\n");
    recursion(sheet, w);
    if sheet.follows && !model.averaging.averaged_model {
        w.push_str(AVERAGE);
    }
    observe(sheet, c, w);
    let average = sheet.follows && !model.averaging.averaged_model;
    w.push_str("\n/* Stores `flow` as the newest flow state. */\nstatic void advance(struct model *s, real flow)\n{\n");
    if average {
        w.push_str("    slide(s, back(s->y, OUTPUTS, s->y_newest, 0u), back(s->y, OUTPUTS, s->y_newest, WINDOW - 1u));\n");
    }
    w.push_str("    push(s->y, OUTPUTS, &s->y_newest, flow);\n}\n");
    if matches!(sheet.law(), Some(Law::Track(_))) {
        w.push_str("\n/* Stores a flow state that the law predicts, with a less accurate average. */\nstatic void foresee(struct model *s, real flow, real next)\n{\n");
        if average {
            w.push_str("    s->sum_low = s->sum_low + (flow - back(s->y, OUTPUTS, s->y_newest, WINDOW - 1u));\n");
        } else {
            w.push_str("    (void)flow;\n");
        }
        w.push_str("    push(s->y, OUTPUTS, &s->y_newest, next);\n}\n");
    }
    let range = model.command;
    let share = if range.is_unit() {
        "command".to_owned()
    } else {
        let size = range.full - range.off;
        format!("(real)(((double)command - {:?}) / {size:?})", range.off).replace("- -", "+ ")
    };
    let usual = if sheet.memory.channels.is_empty() {
        "NULL"
    } else {
        "USUAL"
    };
    let _ = write!(
        w,
        "\nstatic struct model the_model;\nstatic int begun;\n\n\
         /* Restarts at the first sample; all signals before it are 0. */\n\
         void model_reset(void)\n{{\n    at_rest(&the_model);\n    begun = 1;\n}}\n\n\
         /* Restarts with a constant command and reading before the first sample. */\n\
         void model_hold(real command, real reading, const real *channels)\n{{\n    uint32_t i;\n    model_reset();\n    \
         for (i = 0u; i < HELD; i++) {{\n        advance(&the_model, reading - SENSOR_ZERO);\n        \
         (void)observe(&the_model, {share}, channels != NULL ? channels : {usual}, 0);\n    }}\n    \
         advance(&the_model, reading - SENSOR_ZERO);\n}}\n\n\
         /* Returns the reading at this sample and advances the model; the command{} holds until the next sample. */\n\
         real model_step(real command, const real *channels)\n{{\n    struct seen seen;\n    if (begun == 0) {{\n        \
         model_reset();\n    }}\n    seen = observe(&the_model, {share}, channels != NULL ? channels : {usual}, 0);\n    \
         advance(&the_model, seen.next);\n    return seen.measured;\n}}\n",
        if range.is_unit() {
            String::new()
        } else {
            format!(
                " ({:?} for no jet, {:?} for a full jet)",
                range.off, range.full
            )
        }
    );
    text
}

const AVERAGE: &str = "
static void add_to(real *high, real *low, real term)
{
    const real sum = *high + term;
    const real part = sum - *high;
    *low = *low + ((*high - (sum - part)) + (term - part));
    *high = sum;
}

/* Advances the window of the average by a sample. The sum of every block is computed anew, so it does not drift. */
static void slide(struct model *s, real entering, real leaving)
{
    add_to(&s->fresh, &s->fresh_low, entering);
    s->in_block += 1u;
    if (s->in_block >= WINDOW - 1u) {
        s->sum = s->fresh;
        s->sum_low = s->fresh_low;
        s->fresh = ZERO;
        s->fresh_low = ZERO;
        s->in_block = 0u;
    } else {
        add_to(&s->sum, &s->sum_low, entering);
        add_to(&s->sum, &s->sum_low, -leaving);
    }
}
";

/// The function that computes y_{k+1} from the arriving jets.
fn recursion(sheet: &Sheet<'_>, w: &mut String) {
    if sheet.graded() {
        if sheet.model.grading == Grading::Switched {
            w.push_str("\n/* The weight of the attached flow's rate. */\nstatic real share_of(real jet)\n{\n    const real half = ONE / (ONE + ONE);\n    return at_most(at_least(half + (jet - half) * (real)50.0, ZERO), ONE);\n}\n");
        } else {
            w.push_str("\n/* The weight of the attached flow's rate. */\nstatic real share_of(real jet) { return jet; }\n");
        }
        w.push_str(
            "
/* The flow at the next sample. Lags of at least `horizon` are summed first. */
static real next_flow(const struct model *s, const real *jets, uint32_t horizon)
{
    const real jet = jets[0];
    const real share = share_of(jet);
    real known = ZERO, known_gain = ZERO, free, past, gain = ZERO, past_gain, separated, attached;
    uint32_t i;
    for (i = 0u; i < N1; i++) {
        if (STATE_BACK[i] >= horizon) {
            known = known + A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
        }
    }
    for (i = 0u; i < N2; i++) {
        if (PRODUCT_BACK[i] >= horizon) {
            known_gain = known_gain + C[0][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
        }
    }
    free = CONSTANT;
    past = known;
    for (i = 0u; i < N1; i++) {
        if (STATE_BACK[i] < horizon) {
            const real term = A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
            if (STATE_BACK[i] < ORDER) {
                free = free + term;
            } else {
                past = past + term;
            }
        }
    }
    past_gain = known_gain;
    for (i = 0u; i < N2; i++) {
        if (PRODUCT_BACK[i] < horizon) {
            const real term = C[0][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
            if (PRODUCT_BACK[i] < ORDER) {
                gain = gain + term;
            } else {
                past_gain = past_gain + term;
            }
        }
    }
    if (jet == ZERO) {
        return free + past;
    }
    if (ORDER == UINT32_MAX) {
        free = free + past;
        gain = gain + past_gain;
        past = ZERO;
        past_gain = ZERO;
    }
    separated = past == ZERO ? ZERO : (ONE - jet) * past / RATE_OFF;
    attached = jet * (B[0] + past + past_gain) / RATE_ON;
    return free + gain * share + (RATE_OFF + (RATE_ON - RATE_OFF) * share) * (separated + attached);
}
",
        );
        return;
    }
    let far = matches!(sheet.law(), Some(Law::Track(_)));
    w.push_str(
        "
/* The flow at the next sample",
    );
    w.push_str(if far {
        ". Lags of at least `horizon` are summed first"
    } else {
        ""
    });
    w.push_str(
        ". */
static real next_flow(const struct model *s, const real *jets, uint32_t horizon)
{
    real next = CONSTANT;
    uint32_t i, l;
",
    );
    if far {
        w.push_str("    real known = ZERO, known_gain = ZERO;
    if (horizon < UINT32_MAX) {
        for (i = 0u; i < N1; i++) {
            if (STATE_BACK[i] >= horizon) {
                known = known + A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
            }
        }
        for (i = 0u; i < N2; i++) {
            if (PRODUCT_BACK[i] >= horizon) {
                known_gain = known_gain + C[0][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
            }
        }
    }
    next = next + known;
    for (i = 0u; i < N1; i++) {
        if (STATE_BACK[i] < horizon) {
            next = next + A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
        }
    }
    for (l = 0u; l < N3; l++) {
        if (jets[l] != ZERO) {
            const uint32_t nearer = l == 0u ? horizon : UINT32_MAX;
            real gain = l == 0u ? B[l] + known_gain : B[l];
            for (i = 0u; i < N2; i++) {
                if (PRODUCT_BACK[i] < nearer) {
                    gain = gain + C[l][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
                }
            }
            next = next + gain * jets[l];
        }
    }
    return next;
}
");
    } else {
        w.push_str(
            "    (void)horizon;
    for (i = 0u; i < N1; i++) {
        next = next + A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
    }
    for (l = 0u; l < N3; l++) {
        if (jets[l] != ZERO) {
            real gain = B[l];
            for (i = 0u; i < N2; i++) {
                gain = gain + C[l][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
            }
            next = next + gain * jets[l];
        }
    }
    return next;
}
",
        );
    }
}

/// A block that computes an effect from `signal` and sets `target`.
fn block(effect: &Effect, c: &C, w: &mut String, signal: &str, target: &str, indent: &str) {
    let (lines, value) = effect.piece.statements(c);
    let _ = writeln!(w, "{indent}{{ /* {} */", effect.name);
    if effect.piece.reads(Signal::Own) {
        let _ = writeln!(w, "{indent}    const real signal = {signal};");
    }
    for line in lines {
        let _ = writeln!(w, "{indent}    {line}");
    }
    let value = if target.ends_with("+ ") {
        format!("({value})")
    } else {
        value
    };
    let _ = writeln!(w, "{indent}    {target}{value};\n{indent}}}");
}

fn observe(sheet: &Sheet<'_>, c: &C, w: &mut String) {
    let model = sheet.model;
    w.push_str("
struct seen {
    real measured;     /* the sensor's reading */
    real flow;         /* the flow now */
    real next;         /* the flow at the next sample */
    uint32_t nearest;  /* the shortest input delay, samples */
};

/* Computes one sample without advancing the flow. If the law `looks` ahead, the sensor is not evaluated. */
static struct seen observe(struct model *s, real u, const real *channels, int looks)
{
    struct seen seen;
    const real y = back(s->y, OUTPUTS, s->y_newest, 0u);
    real jet = u, arriving[N3], arrived, present = ZERO;
    const uint32_t horizon = looks != 0 ? ");
    let _ = writeln!(w, "{NEAR}u : UINT32_MAX;");
    let interpolated = sheet.transport.as_ref().is_some_and(|t| !t.rounded);
    w.push_str("    uint32_t l;\n    (void)channels;\n");
    if sheet.clocked {
        w.push_str("    s->lived = s->lived < UINT32_MAX ? s->lived + 1u : s->lived;\n    s->since_edge = u != s->last_command ? 0u : (s->since_edge < 16777216u ? s->since_edge + 1u : s->since_edge);\n    s->last_command = u;\n");
    }
    w.push_str("    seen.nearest = UINT32_MAX;\n");
    if let Some(command) = sheet.transport.as_ref().and_then(|t| t.command.as_ref()) {
        let (lines, value) = command.statements(c);
        w.push_str("    { /* delayed edges */\n        const real signal = jet;\n");
        for line in lines {
            let _ = writeln!(w, "        {line}");
        }
        let _ = writeln!(w, "        jet = {value};\n    }}");
    }
    for effect in sheet.at(Place::Jet) {
        block(effect, c, w, "jet", "jet = ", "    ");
    }
    w.push_str("    push(s->jets, JETS, &s->jets_newest, jet);\n");
    if let Some(transport) = &sheet.transport {
        w.push_str("    {\n");
        if sheet.follows {
            w.push_str(if model.averaging.averaged_model {
                "        const real signal = at_least(y, ZERO);\n"
            } else {
                "        /* The mean of the preceding flow states, eq. (1). */\n        const real signal = at_least((s->sum + s->sum_low) / (real)WINDOW, ZERO);\n"
            });
        }
        let (lines, value) = transport.effect.piece.statements(c);
        for line in lines {
            let _ = writeln!(w, "        {line}");
        }
        let _ = writeln!(w, "        const real delay = {value}; /* samples */");
    } else {
        w.push_str("    {\n");
    }
    w.push_str("        for (l = 0u; l < N3; l++) {\n");
    match &sheet.transport {
        None => w.push_str("            uint32_t whole = DELAYS[l];\n"),
        Some(t) if t.rounded => {
            w.push_str("            uint32_t whole = rounded(FACTORS[l] * delay);\n");
        }
        Some(_) => w.push_str("            const real exact = at_least(FACTORS[l] * delay, ZERO);\n            uint32_t whole = below(exact);\n            const real fraction = exact - (real)whole;\n            real older;\n"),
    }
    w.push_str("            if (whole > JETS - 2u) {\n                whole = JETS - 2u;\n            }\n            if (whole < seen.nearest) {\n                seen.nearest = whole;\n            }\n");
    let read = |lag: &str| {
        if model.averaging.averaged_model {
            format!("mean_jet(s, {lag})")
        } else {
            format!("back(s->jets, JETS, s->jets_newest, {lag})")
        }
    };
    let _ = writeln!(w, "            arriving[l] = {};", read("whole"));
    let shown = sheet.effects.iter().any(|e| e.piece.reads(Signal::Present));
    if interpolated {
        let _ = writeln!(
            w,
            "            older = fraction != ZERO ? {} : arriving[l];\n            if (l == 0u) {{\n                present = older;\n            }}\n            \
             if (fraction != ZERO) {{\n                arriving[l] = arriving[l] + fraction * (older - arriving[l]);\n            }}",
            read("whole + 1u")
        );
    } else if shown {
        w.push_str(
            "            if (l == 0u) {\n                present = arriving[0];\n            }\n",
        );
    }
    w.push_str("        }\n    }\n    arrived = arriving[0];\n    (void)arrived;\n    (void)present;\n    seen.flow = y;\n    seen.measured = y;\n    if (looks == 0) {\n");
    for effect in sheet.at(Place::Sensor) {
        block(
            effect,
            c,
            w,
            "seen.measured",
            "seen.measured = ",
            "        ",
        );
    }
    w.push_str("    }\n    seen.next = next_flow(s, arriving, horizon);\n");
    if sheet.drives {
        let share = if sheet.graded() {
            "share_of(arrived)"
        } else if model.grading == Grading::Switched {
            "at_most(at_least((real)0.5 + (arrived - (real)0.5) * (real)50.0, ZERO), ONE)"
        } else {
            "arrived"
        };
        let part = if model.grading == Grading::Proportional {
            "arrived != ZERO && arrived != ONE ? (ONE - arrived) * (next_flow(s, NO_JETS, horizon) - y) : separated * (seen.next - y)"
        } else {
            "separated * (seen.next - y)"
        };
        let _ = write!(
            w,
            "    {{ /* effects of the flow: each uses the motion with the preceding effects */\n        \
             static const real NO_JETS[N3] = {{ ZERO }};\n        const real before = back(s->y, OUTPUTS, s->y_newest, 1u);\n        \
             const real part = {share};\n        const real relaxation = RATE_OFF + (RATE_ON - RATE_OFF) * part;\n        \
             const real separated = (part == ZERO || part == ONE || relaxation == ZERO) ? ONE - part : (ONE - part) * RATE_OFF / relaxation;\n        \
             const real motion = {part};\n        real sum = ZERO;\n        (void)NO_JETS;\n        (void)before;\n        (void)motion;\n"
        );
        for effect in sheet.at(Place::Flow) {
            w.push_str("        {\n            const real next_y = seen.next + sum;\n            const real released = motion + separated * sum;\n            (void)next_y;\n            (void)released;\n");
            block(effect, c, w, "y", "sum = sum + ", "            ");
            w.push_str("        }\n");
        }
        w.push_str("        seen.next = seen.next + sum;\n    }\n");
    }
    w.push_str("    return seen;\n}\n");
    if model.averaging.averaged_model {
        // Before its use.
        let at = w.find("\nstruct seen {").unwrap_or(0);
        w.insert_str(
            at,
            "
/* The mean of a window of jets, the newest of them `lag` samples back, eq. (13). */
static real mean_jet(const struct model *s, uint32_t lag)
{
    real sum = ZERO;
    uint32_t i;
    for (i = 0u; i < WINDOW; i++) {
        sum = sum + back(s->jets, JETS, s->jets_newest, lag + i);
    }
    return sum / (real)WINDOW;
}
",
        );
    }
}

fn law<T: Real>(sheet: &Sheet<'_>, c: &C) -> String {
    match sheet.law() {
        None => String::new(),
        Some(Law::Track(track)) => format!("{}{}", tracking::<T>(track, c), include_str!("law.c")),
        Some(Law::Maximise(law)) => format!("{}{}", train(law), include_str!("pulses.c")),
    }
}

/// The constants of a tracking law that are whole numbers, by name.
pub(super) fn counts(track: &Track) -> Vec<(&'static str, u32)> {
    let [cost, saved] = track.switches.unwrap_or_default();
    let [per_mille, air] = track.air.unwrap_or([0, 0]);
    let has_air = track.air.is_some();
    let drain = if has_air {
        1000_u32.saturating_sub(per_mille)
    } else {
        0
    };
    let capacity = if has_air {
        drain.max(1).saturating_mul(air.max(1))
    } else {
        0
    };
    let (on, off) = (track.hold.on.max(1), track.hold.off.max(1));
    vec![
        ("LAW_HOLD_ON", on),
        ("LAW_HOLD_OFF", off),
        ("LAW_SAMPLES_PER_SWITCH", cost),
        ("LAW_SWITCHES_CAPACITY", cost.saturating_mul(saved.max(2))),
        ("LAW_AIR_PER_MILLE", per_mille),
        ("LAW_AIR_DRAIN", drain),
        ("LAW_AIR_CAPACITY", capacity),
        ("LAW_AIR_FIRST", drain.saturating_mul(on)),
        ("LAW_LEAD", track.lead.into()),
        ("LAW_OPENING", track.opening.into()),
        ("LAW_CLOSING", track.closing.into()),
        ("LAW_LOOK_AHEAD", track.look_ahead.into()),
    ]
}

/// Constants of the law that are real numbers, with their units.
pub(super) fn reals<T: Real>(track: &Track) -> Vec<(&'static str, f64, &'static str)> {
    let law = track.tracking::<T>();
    vec![
        ("LAW_REFERENCE", law.reference.value(), "y"),
        ("LAW_SLOPE", law.slope.value(), "y per sample; 0 for steps"),
        (
            "LAW_OBSERVER",
            law.observer.value(),
            "share of a residual that corrects the estimate",
        ),
        ("LAW_BIAS_RATE", law.bias_rate.value(), "1/sample"),
        ("LAW_INTEGRAL_RATE", law.integral_rate.value(), "1/sample"),
        ("LAW_PLAY", law.play.value(), "y"),
        (
            "LAW_SETTLED",
            law.settled.value(),
            "long-term share of the integral's rate",
        ),
        ("LAW_CORRECTION_LIMIT", law.correction_limit.value(), "y"),
        ("LAW_RESIDUAL_LIMIT", law.residual_limit.value(), "y"),
    ]
}

fn tracking<T: Real>(track: &Track, c: &C) -> String {
    let mut text = String::from("\n/* Times in samples. */\n");
    for (name, value) in counts(track) {
        let _ = writeln!(text, "#define {name} {value}u");
    }
    for (name, value, unit) in reals::<T>(track) {
        let _ = writeln!(text, "#define {name} {} /* {unit} */", signed(c, value));
    }
    let most = match c.precision {
        Precision::Single => "(real)INFINITY",
        Precision::Double => "1.7976931348623157e308",
    };
    let _ = writeln!(text, "#define REAL_MAX {most}");
    text
}

fn train(law: &Maximise) -> String {
    let mut pulses = law.pulses.clone();
    pulses.sort_unstable();
    let first: Vec<String> = pulses
        .iter()
        .map(|(first, _)| format!("{first}u"))
        .collect();
    let lengths: Vec<String> = pulses
        .iter()
        .map(|(_, length)| format!("{length}u"))
        .collect();
    format!(
        "\n/* Times in samples. */\n#define LAW_PERIOD {}u\n#define LAW_PULSES {}u\n#define LAW_HOLD_ON {}u\n\
         #define LAW_HOLD_OFF {}u\nstatic const uint32_t LAW_FIRST[LAW_PULSES] = {{ {} }};\n\
         static const uint32_t LAW_LENGTH[LAW_PULSES] = {{ {} }};\n",
        law.period.max(1),
        pulses.len(),
        law.hold.on.max(1),
        law.hold.off.max(1),
        first.join(", "),
        lengths.join(", ")
    )
}
