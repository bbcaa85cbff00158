//! Rust constants for a board from an identified model.
//!
//! The text is the same bytes for the same model, formatted as rustfmt would,
//! and compiles in a `no_std` crate that depends on `model-core` only. Numbers
//! are the nearest `f32`, written as short as they can be read back.

use crate::model::{Added, Delay, Model};
use crate::simulate::Ring;
use model_core::effect::{Place, Spec};
use model_core::{State, effects, self_test};
use std::fmt::Write as _;
use thiserror::Error;

/// Expected values in the golden run.
const GOLDEN_VALUES: usize = 32;

/// Why no constants were generated.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CodegenError {
    /// A number of the model is not finite in single precision.
    #[error(
        "`{name}` is {value}, which single precision cannot hold. \
         Identify the model again; scale the measured output if it is large."
    )]
    NotFinite {
        /// What it is.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// An effect is not in the catalogue of `model-core`.
    #[error(
        "effect `{name}` has no Rust form in model-core. Remove it from the model, \
         or add it to the catalogue (`host-fit effects` lists it)."
    )]
    UnknownEffect {
        /// Its name.
        name: String,
    },
    /// The model forgets faster than it can be tested or not at all.
    #[error(
        "the model's response to the golden run is not finite after {samples} samples: it is \
         unstable. Identify it again, with fewer lags or `--objective free-run`."
    )]
    Unstable {
        /// Where it left all bounds.
        samples: u32,
    },
}

/// The generated file `identified.rs` for `model`.
///
/// # Errors
/// A number beyond `f32`, an unknown effect, or a model that is unstable.
pub fn generate(model: &Model) -> Result<String, CodegenError> {
    check(model)?;
    let mut out = String::new();
    header(&mut out, model);
    let graded = needs_graded_jets(model);
    imports(&mut out, model, graded);
    sizes(&mut out, model, graded);
    types(&mut out, model, graded)?;
    coefficients(&mut out, model);
    compile_time_checks(&mut out, model, graded);
    constructors(&mut out, model, graded)?;
    golden(&mut out, model)?;
    Ok(out)
}

fn check(model: &Model) -> Result<(), CodegenError> {
    let fits = |name: &'static str, values: &[f64]| {
        let bad = values.iter().find(|value| !(**value as f32).is_finite());
        bad.map_or(Ok(()), |value| {
            Err(CodegenError::NotFinite {
                name,
                value: *value,
            })
        })
    };
    fits("sample_period_s", &[model.sample_period_s])?;
    fits("constant", &[model.constant])?;
    fits("a", &model.a)?;
    fits("b", &model.b)?;
    fits("c", &model.c)?;
    match &model.delay {
        Delay::Fixed { .. } => {}
        Delay::StateDependent {
            delay_floor,
            delay_rise,
            delay_rate,
            factors,
        } => {
            fits("delay", &[*delay_floor, *delay_rise, *delay_rate])?;
            fits("factors", factors)?;
        }
        Delay::EdgeDependent {
            rise_delay,
            fall_delay,
        } => fits("delay", &[*rise_delay, *fall_delay])?,
    }
    for added in &model.effects {
        fits("effect parameter", &added.parameters)?;
        fits("effect reference", added.reference.as_slice())?;
        spec_of(added)?;
    }
    Ok(())
}

fn spec_of(added: &Added) -> Result<&'static Spec, CodegenError> {
    effects::spec(&added.name).ok_or_else(|| CodegenError::UnknownEffect {
        name: added.name.clone(),
    })
}

/// One bit a sample serves unless jets take strengths between on and off.
fn needs_graded_jets(model: &Model) -> bool {
    let shapes_jet =
        |added: &Added| effects::spec(&added.name).is_none_or(|spec| spec.place == Place::Jet);
    matches!(model.delay, Delay::EdgeDependent { .. }) || model.effects.iter().any(shapes_jet)
}

/// Outputs to keep. A power of two: the ring's index then wraps with a mask.
fn outputs(model: &Model) -> usize {
    let needed = (model.longest_lag() + 1).max(model.averaging.window as usize);
    needed.max(2).next_power_of_two()
}

/// Jet strengths to keep: the delay, a sample to interpolate to, one for what
/// single precision may round up, and the window of an averaged input.
fn jets(model: &Model) -> usize {
    let window = if model.averaging.averaged_model {
        model.averaging.window as usize
    } else {
        0
    };
    model.longest_delay() + 3 + window
}

fn echo_samples(model: &Model, added: &Added) -> usize {
    let delay = added.parameters.get(1).copied().unwrap_or(0.0) / model.sample_period_s;
    delay.clamp(0.0, effects::LONGEST_ECHO as f64) as usize + 3
}

/// Shortest text that reads back as the nearest `f32`.
fn number(value: f64) -> String {
    format!("{:?}", value as f32)
}

fn numbers(values: &[f64]) -> Vec<String> {
    values.iter().map(|value| number(*value)).collect()
}

/// Samples, measured; `None` for what is not known.
fn header(out: &mut String, model: &Model) {
    let training = &model.training;
    let mut line = |text: String| {
        out.push_str("//!");
        if !text.is_empty() {
            out.push(' ');
            out.push_str(&text);
        }
        out.push('\n');
    };
    let tool = if training.tool_version.is_empty() {
        env!("CARGO_PKG_VERSION")
    } else {
        &training.tool_version
    };
    line("Constants of an identified model. Generated; edit the model file instead.".into());
    line(String::new());
    line(format!("- tool: host-fit {tool}"));
    if !training.data_hash.is_empty() {
        line(format!("- data: {}", training.data_hash));
    }
    let sizes = (model.a.len(), model.product_lags.len(), model.b.len());
    line(format!(
        "- structure: {} model, N1 = {}, N2 = {}, N3 = {}, window {} samples, {}",
        if model.averaging.averaged_model {
            "averaged"
        } else {
            "full"
        },
        sizes.0,
        sizes.1,
        sizes.2,
        model.averaging.window,
        match model.convention {
            model_core::recursion::LagConvention::Literal => "literal lags (lag 1 is y_{k-1})",
            model_core::recursion::LagConvention::OneStep => "one-step lags (lag 1 is y_k)",
        }
    ));
    let names = model.effect_names();
    if !names.is_empty() {
        line(format!("- effects: {}", names.join(", ")));
    }
    if !training.objective.is_empty() {
        line(format!(
            "- objective: {} = {:?}, seed {}",
            training.objective, training.objective_value, training.seed
        ));
        line(format!(
            "- free-run fit: {:.2} % identified{}",
            training.identify_fit_percent,
            training
                .validate_fit_percent
                .map_or(String::new(), |fit| format!(", {fit:.2} % held out"))
        ));
    }
    line(format!(
        "- units: y is the normalised friction gain, u is 0 or 1, delays and lags are samples of {:?} s",
        model.sample_period_s
    ));
}

fn imports(out: &mut String, model: &Model, graded: bool) {
    let mut lines = vec!["use model_core::checks;".to_owned()];
    if matches!(model.delay, Delay::Fixed { .. }) {
        lines.push("use model_core::delay::FixedDelay;".to_owned());
    }
    let mut named: Vec<&str> = Vec::new();
    let mut setting = false;
    match model.delay {
        Delay::Fixed { .. } => {}
        Delay::StateDependent { .. } => named.push("StateDependentDelay"),
        Delay::EdgeDependent { .. } => {
            named.push("EdgeDependentDelay");
            setting = true;
        }
    }
    for added in &model.effects {
        setting = true;
        if let Some(spec) = effects::spec(&added.name) {
            named.push(rust_name(spec));
        }
    }
    named.sort_unstable();
    named.dedup();
    if setting {
        lines.push("use model_core::effect::{Physics, Setting};".to_owned());
    }
    if !named.is_empty() {
        lines.push(use_line("model_core::effects", &named));
    }
    let state = if graded { "GradedState" } else { "OnOffState" };
    let mut from_model = vec!["Averaging", state, "Params", "Parts", "matrix", "vector"];
    from_model.sort_unstable_by_key(|name| (name.starts_with(char::is_lowercase), *name));
    lines.push(use_line("model_core::model", &from_model));
    lines.push("use model_core::recursion::LagConvention;".to_owned());
    lines.push("use model_core::self_test::Golden;".to_owned());
    out.push('\n');
    for line in lines {
        out.push_str(&line);
        out.push('\n');
    }
}

fn use_line(module: &str, names: &[&str]) -> String {
    match names {
        [one] => format!("use {module}::{one};"),
        _ => {
            let line = format!("use {module}::{{{}}};", names.join(", "));
            if line.len() <= 100 {
                return line;
            }
            let mut text = format!("use {module}::{{\n");
            let mut row = String::from("   ");
            for name in names {
                if row.len() + name.len() + 2 > 100 {
                    text.push_str(&row);
                    text.push('\n');
                    row = String::from("   ");
                }
                let _ = write!(row, " {name},");
            }
            text.push_str(&row);
            text.push_str("\n};");
            text
        }
    }
}

fn rust_name(spec: &Spec) -> &'static str {
    spec.rust.rsplit("::").next().unwrap_or(spec.rust)
}

fn sizes(out: &mut String, model: &Model, graded: bool) {
    let _ = write!(
        out,
        "
/// Sample period, s.
pub const SAMPLE_PERIOD_S: f32 = {};
/// Outputs kept: more than the longest lag and the averaging window; a power of two.
pub const OUTPUTS: usize = {};
",
        number(model.sample_period_s),
        outputs(model)
    );
    if graded {
        let _ = write!(
            out,
            "/// Jet strengths kept: more than the longest input delay; a power of two.
pub const JETS: usize = {};
",
            jets(model).next_power_of_two()
        );
    } else {
        let _ = write!(
            out,
            "/// Commands kept, in words of 32: more than the longest input delay.
pub const WORDS: usize = {};
",
            jets(model).div_ceil(32)
        );
    }
    let channels = model.channels();
    let references: Vec<f64> = channels
        .iter()
        .map(|channel| {
            let of_channel = |added: &&Added| added.channel.as_ref() == Some(channel);
            let added = model.effects.iter().find(of_channel);
            added.and_then(|added| added.reference).unwrap_or(1.0)
        })
        .collect();
    let names: Vec<String> = channels.iter().map(|name| format!("{name:?}")).collect();
    let _ = writeln!(
        out,
        "/// Measured channels that the effects need, in the order in which they are passed."
    );
    array(out, "CHANNELS", &format!("[&str; {}]", names.len()), &names);
    let _ = writeln!(out, "/// Usual values of the channels, in their units.");
    array(
        out,
        "REFERENCES",
        &format!("[f32; {}]", names.len()),
        &numbers(&references),
    );
}

fn effect_type(model: &Model, added: &Added) -> Result<String, CodegenError> {
    let spec = spec_of(added)?;
    let name = rust_name(spec);
    Ok(match spec.name {
        "echo-path" => format!("{name}<f32, {}>", echo_samples(model, added)),
        "rectifying-sensor" => name.to_owned(),
        _ => format!("{name}<f32>"),
    })
}

fn types(out: &mut String, model: &Model, graded: bool) -> Result<(), CodegenError> {
    let inputs = model.b.len();
    let delay = match model.delay {
        Delay::Fixed { .. } => format!("FixedDelay<[u16; {inputs}]>"),
        Delay::StateDependent { .. } => format!("StateDependentDelay<f32, [f32; {inputs}]>"),
        Delay::EdgeDependent { .. } => "EdgeDependentDelay<f32>".to_owned(),
    };
    let mut chain = "()".to_owned();
    for added in model.effects.iter().rev() {
        chain = format!("({}, {chain})", effect_type(model, added)?);
    }
    let state = if graded {
        "GradedState<f32, OUTPUTS, JETS, Identified>"
    } else {
        "OnOffState<f32, OUTPUTS, WORDS, Identified>"
    };
    let _ = write!(
        out,
        "
/// The delay law.
pub type Delay = {delay};
/// The effects, in the order of the physics.
{effects}
/// The model: N1, N2, N3 as identified.
pub type Identified = Params<f32, {}, {}, {inputs}, Delay, Effects>;
/// What the model remembers.
pub type IdentifiedState = {state};
",
        model.a.len(),
        model.product_lags.len(),
        effects = alias("Effects", &chain),
    );
    Ok(())
}

/// `pub type NAME = TYPE;`, broken after the `=` as rustfmt does.
fn alias(name: &str, definition: &str) -> String {
    let line = format!("pub type {name} = {definition};");
    if line.len() <= 100 {
        line
    } else {
        format!("pub type {name} =\n    {definition};")
    }
}

fn coefficients(out: &mut String, model: &Model) {
    let lags = |lags: &[u16]| lags.iter().map(u16::to_string).collect::<Vec<_>>();
    let (n1, n2, n3) = (model.a.len(), model.product_lags.len(), model.b.len());
    out.push('\n');
    documented(
        out,
        "τ_i, samples.",
        "STATE_LAGS",
        &format!("[u16; {n1}]"),
        &lags(&model.state_lags),
    );
    documented(
        out,
        "a_i.",
        "A",
        &format!("[f32; {n1}]"),
        &numbers(&model.a),
    );
    documented(
        out,
        "τ̄_j, samples.",
        "PRODUCT_LAGS",
        &format!("[u16; {n2}]"),
        &lags(&model.product_lags),
    );
    documented(
        out,
        "b_l.",
        "B",
        &format!("[f32; {n3}]"),
        &numbers(&model.b),
    );
    for l in 0..n3 {
        let column: Vec<f64> = model.c.iter().copied().skip(l * n2).take(n2).collect();
        documented(
            out,
            &format!("c_j{}.", l + 1),
            &format!("C{}", l + 1),
            &format!("[f32; {n2}]"),
            &numbers(&column),
        );
    }
    match &model.delay {
        Delay::Fixed { delays } => {
            documented(
                out,
                "h_l, samples.",
                "DELAYS",
                &format!("[u16; {n3}]"),
                &lags(delays),
            );
        }
        Delay::StateDependent {
            delay_floor,
            delay_rise,
            delay_rate,
            factors,
        } => {
            let _ = write!(
                out,
                "/// p0, samples.
pub const DELAY_FLOOR: f32 = {};
/// p1, samples.
pub const DELAY_RISE: f32 = {};
/// p2, 1/y.
pub const DELAY_RATE: f32 = {};
/// f_l.
",
                number(*delay_floor),
                number(*delay_rise),
                number(*delay_rate),
            );
            array(
                out,
                "DELAY_FACTORS",
                &format!("[f32; {n3}]"),
                &numbers(factors),
            );
        }
        Delay::EdgeDependent {
            rise_delay,
            fall_delay,
        } => documented(
            out,
            "Delays of rising and falling edges, s.",
            "EDGE_DELAYS",
            "[f32; 2]",
            &numbers(&[*rise_delay, *fall_delay]),
        ),
    }
    for (i, added) in model.effects.iter().enumerate() {
        let Some(spec) = effects::spec(&added.name) else {
            continue;
        };
        let units: Vec<String> = spec
            .parameters
            .iter()
            .map(|parameter| format!("{} ({})", parameter.name, parameter.unit))
            .collect();
        let doc = match units.as_slice() {
            [] => format!("{}: no parameters.", spec.name),
            units => format!("{}: {}.", spec.name, units.join(", ")),
        };
        documented(
            out,
            &doc,
            &format!("EFFECT{}", i + 1),
            &format!("[f32; {}]", added.parameters.len()),
            &numbers(&added.parameters),
        );
    }
}

fn documented(out: &mut String, doc: &str, name: &str, kind: &str, values: &[String]) {
    let _ = writeln!(out, "/// {doc}");
    array(out, name, kind, values);
}

/// `pub const NAME: TYPE = [values];` as rustfmt lays it out: on one line, in
/// rows where all elements are short, otherwise one element a line.
fn array(out: &mut String, name: &str, kind: &str, values: &[String]) {
    const LONGEST_ON_A_LINE: usize = 60;
    const SHORT: usize = 10;
    let joined = values.join(", ");
    let line = format!("pub const {name}: {kind} = [{joined}];");
    if joined.len() + 2 <= LONGEST_ON_A_LINE && line.len() <= 100 {
        out.push_str(&line);
        out.push('\n');
        return;
    }
    let _ = writeln!(out, "pub const {name}: {kind} = [");
    if values.iter().all(|value| value.len() <= SHORT) {
        let mut row = String::from("   ");
        for value in values {
            if row.len() + value.len() + 2 > 100 {
                let _ = writeln!(out, "{row}");
                row = String::from("   ");
            }
            let _ = write!(row, " {value},");
        }
        let _ = writeln!(out, "{row}");
    } else {
        for value in values {
            let _ = writeln!(out, "    {value},");
        }
    }
    out.push_str("];\n");
}

fn compile_time_checks(out: &mut String, model: &Model, graded: bool) {
    let kept = if graded { "JETS" } else { "32 * WORDS" };
    let averaged = if model.averaging.averaged_model {
        " + WINDOW as usize"
    } else {
        ""
    };
    let _ = write!(
        out,
        "
/// W, samples.
pub const WINDOW: u32 = {};
/// What lags mean.
pub const CONVENTION: LagConvention = LagConvention::{:?};
/// d, what drives the flow without jets.
pub const CONSTANT: f32 = {};

const _: () = {{
    assert!(CONSTANT.is_finite(), \"the constant is not finite\");
    assert!(checks::finite(&A), \"a coefficient a is not finite\");
    assert!(checks::finite(&B), \"a coefficient b is not finite\");
",
        model.averaging.window,
        model.convention,
        number(model.constant),
    );
    for l in 1..=model.b.len() {
        let _ = writeln!(
            out,
            "    assert!(checks::finite(&C{l}), \"a coefficient c is not finite\");"
        );
    }
    let _ = write!(
        out,
        "    assert!(
        OUTPUTS >= checks::outputs_for(&STATE_LAGS, CONVENTION),
        \"a state lag reaches beyond the outputs kept\"
    );
    assert!(
        OUTPUTS >= checks::outputs_for(&PRODUCT_LAGS, CONVENTION),
        \"a product lag reaches beyond the outputs kept\"
    );
    assert!(
        OUTPUTS >= WINDOW as usize,
        \"the averaging window reaches beyond the outputs kept\"
    );
"
    );
    let mut fits = |delay: String| {
        let condition = format!("{kept} >= {delay} + 1{averaged}");
        let _ = write!(
            out,
            "    assert!(
        {condition},
        \"an input delay reaches beyond the commands kept\"
    );
"
        );
    };
    match &model.delay {
        Delay::Fixed { delays } => {
            for l in 0..delays.len() {
                fits(format!("DELAYS[{l}] as usize"));
            }
        }
        Delay::StateDependent { factors, .. } => {
            // The law is monotonic in ỹ ≥ 0: longest at one of its ends.
            for l in 0..factors.len() {
                fits(format!(
                    "(DELAY_FACTORS[{l}] * (DELAY_FLOOR + DELAY_RISE) + 0.5) as usize"
                ));
                fits(format!("(DELAY_FACTORS[{l}] * DELAY_FLOOR + 0.5) as usize"));
            }
        }
        Delay::EdgeDependent { .. } => {
            for l in 0..2 {
                fits(format!("(EDGE_DELAYS[{l}] / SAMPLE_PERIOD_S) as usize + 1"));
            }
        }
    }
    out.push_str("};\n");
}

fn constructors(out: &mut String, model: &Model, graded: bool) -> Result<(), CodegenError> {
    let channels = model.channels();
    let setting = |added: Option<&Added>| {
        let index = added
            .and_then(|added| added.channel.as_ref())
            .and_then(|name| channels.iter().position(|channel| channel == name));
        let reference = index.map_or("1.0".to_owned(), |i| format!("REFERENCES[{i}]"));
        (index.unwrap_or(0), reference)
    };
    let built = |name: &str, parameters: &str, added: Option<&Added>, indent: &str| {
        let (channel, reference) = setting(added);
        format!(
            "{name}::new(
{indent}    &{parameters},
{indent}    &Setting {{
{indent}        period: SAMPLE_PERIOD_S,
{indent}        channel: {channel},
{indent}        reference: {reference},
{indent}    }},
{indent})"
        )
    };
    let constant = model.effects.is_empty() && !matches!(model.delay, Delay::EdgeDependent { .. });
    let delay = match &model.delay {
        Delay::Fixed { .. } => "FixedDelay { delays: DELAYS }".to_owned(),
        Delay::StateDependent { .. } => "StateDependentDelay {
        floor: DELAY_FLOOR,
        rise: DELAY_RISE,
        rate: DELAY_RATE,
        factors: DELAY_FACTORS,
    }"
        .to_owned(),
        Delay::EdgeDependent { .. } => built("EdgeDependentDelay", "EDGE_DELAYS", None, "    "),
    };
    let mut effects = "()".to_owned();
    if !model.effects.is_empty() {
        effects = String::from("effects()");
    }
    let columns: Vec<String> = (1..=model.b.len()).map(|l| format!("C{l}")).collect();
    let params = format!(
        "Params {{
    convention: CONVENTION,
    averaging: Averaging {{
        window: WINDOW,
        averaged_model: {},
    }},
    constant: CONSTANT,
    state_lags: STATE_LAGS,
    a: vector(A),
    product_lags: PRODUCT_LAGS,
    b: vector(B),
    c: matrix([{}]),
    delay: {delay},
    effects: {effects},
}}",
        model.averaging.averaged_model,
        columns.join(", "),
    );
    if constant {
        let _ = write!(
            out,
            "
/// The model.
pub const MODEL: Identified = {params};

/// The model.
#[must_use]
pub const fn model() -> Identified {{
    MODEL
}}
"
        );
    } else {
        let _ = write!(
            out,
            "
/// The model, its effects prepared for the sample period.
#[must_use]
pub fn model() -> Identified {{
    {}
}}
",
            params.replace('\n', "\n    ")
        );
    }
    if !model.effects.is_empty() {
        out.push_str("\nfn effects() -> Effects {\n");
        for (i, added) in model.effects.iter().enumerate() {
            let name = rust_name(spec_of(added)?);
            let value = built(name, &format!("EFFECT{}", i + 1), Some(added), "    ");
            let _ = writeln!(out, "    let effect{} = {value};", i + 1);
        }
        let mut chain = "()".to_owned();
        for i in (1..=model.effects.len()).rev() {
            chain = format!("(effect{i}, {chain})");
        }
        let _ = write!(out, "    {chain}\n}}\n");
    }
    let method = if graded {
        "graded_state"
    } else {
        "on_off_state"
    };
    let _ = write!(
        out,
        "
/// The state at rest.
#[must_use]
pub fn state(model: &Identified) -> IdentifiedState {{
    model.{method}()
}}
"
    );
    Ok(())
}

/// Checksum and golden run, by the code that the host simulates with.
fn golden(out: &mut String, model: &Model) -> Result<(), CodegenError> {
    let prepared = model.prepare::<f32>();
    let references: Vec<f32> = model
        .channels()
        .iter()
        .map(|channel| {
            let of_channel = |added: &&Added| added.channel.as_ref() == Some(channel);
            let added = model.effects.iter().find(of_channel);
            added.and_then(|added| added.reference).unwrap_or(1.0) as f32
        })
        .collect();
    // Long enough for what is sent to arrive, twice over.
    let memory = model.longest_lag().max(model.longest_delay());
    let every = (2 * memory).div_ceil(GOLDEN_VALUES).clamp(32, 4096) as u32;
    let state = State::at_rest(
        &prepared,
        Ring::reaching(outputs(model)),
        Ring::reaching(jets(model)),
    );
    let mut values = Vec::with_capacity(GOLDEN_VALUES);
    let mut unstable = None;
    self_test::run(
        &prepared,
        state,
        &references,
        every,
        GOLDEN_VALUES,
        |i, bits| {
            if !f32::from_bits(bits).is_finite() {
                unstable.get_or_insert((i as u32 + 1) * every);
            }
            values.push(format!("0x{:04x}_{:04x}", bits >> 16, bits & 0xffff));
        },
    );
    if let Some(samples) = unstable {
        return Err(CodegenError::Unstable { samples });
    }
    let checksum = self_test::checksum(&prepared);
    let _ = write!(
        out,
        "
/// CRC-32 of structure and coefficients, for the start-up self-test.
pub const CHECKSUM: u32 = 0x{:04x}_{:04x};
/// What the model says to the golden run, bit for bit, as the host computed it.
pub const GOLDEN: Golden<{GOLDEN_VALUES}> = Golden {{
    every: {every},
    expected: [
",
        checksum >> 16,
        checksum & 0xffff
    );
    for value in values {
        let _ = writeln!(out, "        {value},");
    }
    out.push_str("    ],\n};\n");
    Ok(())
}
