//! The items of the generated file.

use super::layout::{array, documented, number, numbers};
use super::{CodegenError, law, spec_of};
use crate::model::{Added, Delay, Footprint, Model, TransportLaw};
use crate::user_effect::rust_source;
use model_core::effect::{RustType, Setting, Spec};
use model_core::effects;
use std::fmt::Write as _;

pub(super) fn imports(out: &mut String, model: &Model, graded: bool) {
    let mut lines = vec!["use model_core::checks;".to_owned()];
    if let Some(designed) = &model.law {
        lines.extend(law::imports(designed));
    }
    let mut named: Vec<&str> = Vec::new();
    // A user's own effects bring their `new` with them.
    let (mut physics, mut setting) = (false, false);
    match &model.delay {
        Delay::Fixed { .. } => lines.push("use model_core::delay::FixedDelay;".to_owned()),
        Delay::Law(law) => {
            lines.push("use model_core::delay::ScaledDelay;".to_owned());
            named.push(rust_name(law.spec));
            (physics, setting) = (!is_frozen(model), !is_frozen(model));
        }
    }
    for added in &model.effects {
        setting = true;
        if let Some(spec) = effects::spec(&added.name) {
            physics = true;
            named.push(rust_name(spec));
        }
    }
    named.sort_unstable();
    named.dedup();
    if physics {
        lines.push("use model_core::effect::{Physics, Setting};".to_owned());
    } else if setting {
        lines.push("use model_core::effect::Setting;".to_owned());
    }
    lines.extend(
        named
            .iter()
            .map(|name| format!("use model_core::effects::{name};")),
    );
    if is_frozen(model) {
        lines.push("use model_core::frozen::{self, Frozen};".to_owned());
    }
    let state = if graded { "GradedState" } else { "OnOffState" };
    lines.push(format!(
        "use model_core::model::{{Averaging, {state}, Params, Parts, matrix, vector}};"
    ));
    lines.push("use model_core::recursion::{Grading, LagConvention};".to_owned());
    lines.push("use model_core::self_test::Golden;".to_owned());
    out.push('\n');
    for line in lines {
        out.push_str(&line);
        out.push('\n');
    }
}

/// Whether the constants are part of the code: those of some delay laws are
/// computed where they are used, for the sample period.
fn is_frozen(model: &Model) -> bool {
    match &model.delay {
        Delay::Fixed { .. } => true,
        Delay::Law(law) => fields(law).is_some(),
    }
}

/// The law's public fields, if they are its parameters.
fn fields(law: &TransportLaw) -> Option<&'static [&'static str]> {
    law.spec.law.and_then(|card| card.fields)
}

pub(super) fn sizes(out: &mut String, model: &Model, memory: &Footprint) {
    let _ = write!(
        out,
        "
/// Sample period, s.
pub const SAMPLE_PERIOD_S: f32 = {};
/// Outputs kept: more than the longest lag, and no less than the averaging window.
pub const OUTPUTS: usize = {};
",
        number(model.sample_period_s),
        memory.outputs
    );
    if memory.graded {
        let _ = write!(
            out,
            "/// Jet strengths kept: more than the longest input delay.
pub const JETS: usize = {};
",
            memory.jets
        );
    } else {
        let _ = write!(
            out,
            "/// Commands kept, in words of 32: more than the longest input delay.
pub const WORDS: usize = {};
",
            memory.words()
        );
    }
    let references: Vec<f32> = memory.references();
    let names = memory.channels.iter();
    let names: Vec<String> = names.map(|channel| format!("{:?}", channel.name)).collect();
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
        &references
            .iter()
            .map(|x| format!("{x:?}"))
            .collect::<Vec<_>>(),
    );
}

pub(super) fn effect_type(model: &Model, added: &Added) -> Result<String, CodegenError> {
    let spec = spec_of(model, added)?;
    if model.definition(spec.name).is_some() {
        return Ok(spec.rust.to_owned());
    }
    let name = rust_name(spec);
    Ok(match spec.rust_type {
        RustType::Plain => name.to_owned(),
        RustType::Numbers => format!("{name}<f32>"),
        RustType::Buffer(time) => format!("{name}<f32, {}>", buffer(model, added, time)),
    })
}

pub(super) fn types(out: &mut String, model: &Model, graded: bool) -> Result<(), CodegenError> {
    let inputs = model.b.len();
    let delay = match &model.delay {
        Delay::Fixed { .. } => format!("FixedDelay<[u16; {inputs}]>"),
        Delay::Law(law) => format!(
            "ScaledDelay<{}<f32>, [f32; {inputs}], {}>",
            rust_name(law.spec),
            !law.interpolated
        ),
    };
    out.push('\n');
    for (i, added) in model.effects.iter().enumerate() {
        let _ = writeln!(
            out,
            "/// {}.\npub type Effect{} = {};",
            added.name,
            i + 1,
            effect_type(model, added)?
        );
    }
    let chain = nested(model.effects.len(), "Effect");
    let sizes = format!("{}, {}", model.a.len(), model.product_lags.len());
    let identified = if is_frozen(model) {
        format!(
            "/// Structure, coefficients and delay law: N1, N2, N3 as identified.
pub type Base = Params<f32, {sizes}, {inputs}, Delay, ()>;
/// The model: its constants are part of the code.
pub type Identified = Frozen<Constants, Effects>;
"
        )
    } else {
        format!(
            "/// The model: N1, N2, N3 as identified.
pub type Identified = Params<f32, {sizes}, {inputs}, Delay, Effects>;
"
        )
    };
    let state = if graded {
        "GradedState<f32, OUTPUTS, JETS, Identified>"
    } else {
        "OnOffState<f32, OUTPUTS, WORDS, Identified>"
    };
    let _ = write!(
        out,
        "/// The delay law.
pub type Delay = {delay};
/// The effects, in the order of the physics.
pub type Effects = {chain};
{identified}/// What the model remembers.
pub type IdentifiedState = {state};
"
    );
    Ok(())
}

pub(super) fn coefficients(out: &mut String, model: &Model) {
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
        Delay::Law(law) => {
            documented(
                out,
                &format!("{}: {}.", law.spec.name, with_units(law.spec)),
                "DELAY_PARAMETERS",
                &format!("[f32; {}]", law.parameters.len()),
                &numbers(&law.parameters),
            );
            documented(
                out,
                "Shortest and longest delay of the law, samples.",
                "DELAY_RANGE",
                "[f32; 2]",
                &numbers(&law.range(model.sample_period_s)),
            );
            documented(
                out,
                "f_l, the delays of the inputs in units of the law's.",
                "DELAY_FACTORS",
                &format!("[f32; {n3}]"),
                &numbers(&law.factors),
            );
        }
    }
    for (i, added) in model.effects.iter().enumerate() {
        let Some(spec) = model.spec(&added.name) else {
            continue;
        };
        documented(
            out,
            &format!("{}: {}.", spec.name, with_units(spec)),
            &format!("EFFECT{}", i + 1),
            &format!("[f32; {}]", added.parameters.len()),
            &numbers(&added.parameters),
        );
    }
}

pub(super) fn compile_time_checks(out: &mut String, model: &Model, graded: bool) {
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
/// The response to jets of part strength.
pub const GRADING: Grading = Grading::{:?};
/// d, what drives the flow without jets.
pub const CONSTANT: f32 = {};

const _: () = {{
    assert!(CONSTANT.is_finite(), \"the constant is not finite\");
    assert!(checks::finite(&A), \"a coefficient a is not finite\");
    assert!(checks::finite(&B), \"a coefficient b is not finite\");
",
        model.averaging.window,
        model.convention,
        model.grading,
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
        let condition = format!("{kept} > {delay}{averaged}");
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
        Delay::Law(law) => {
            for l in 0..law.factors.len() {
                fits(format!(
                    "(DELAY_FACTORS[{l}] * DELAY_RANGE[1] + 0.5) as usize"
                ));
            }
        }
    }
    out.push_str("};\n");
}

pub(super) fn constructors(out: &mut String, model: &Model, graded: bool) {
    let frozen = is_frozen(model);
    let delay = match &model.delay {
        Delay::Fixed { .. } => "FixedDelay { delays: DELAYS }".to_owned(),
        Delay::Law(law) => {
            let name = rust_name(law.spec);
            let prepared = match fields(law) {
                None => format!("{name}::new(&DELAY_PARAMETERS, &SETTING)"),
                Some(fields) => {
                    let each = fields.iter().enumerate();
                    let lines: String = each
                        .map(|(i, field)| format!("            {field}: DELAY_PARAMETERS[{i}],\n"))
                        .collect();
                    format!("{name} {{\n{lines}        }}")
                }
            };
            format!(
                "ScaledDelay {{
        law: {prepared},
        factors: DELAY_FACTORS,
    }}"
            )
        }
    };
    let effects = if model.effects.is_empty() {
        "()"
    } else {
        "effects()"
    };
    let base_effects = if frozen { "()" } else { effects };
    let columns: Vec<String> = (1..=model.b.len()).map(|l| format!("C{l}")).collect();
    let params = format!(
        "Params {{
    convention: CONVENTION,
    grading: GRADING,
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
    effects: {base_effects},
}}",
        model.averaging.averaged_model,
        columns.join(", "),
    );
    if frozen {
        let _ = write!(
            out,
            "
/// Structure, coefficients and delay law.
pub const BASE: Base = {params};

/// Where the model finds its constants.
#[derive(Clone, Copy, Debug)]
pub struct Constants;

impl frozen::Constants<f32> for Constants {{
    type Base = Base;
    const BASE: &'static Base = &BASE;
}}
"
        );
    }
    let body = if frozen {
        format!("Frozen::new({effects})")
    } else {
        params.replace('\n', "\n    ")
    };
    let (prepared, constant) = if model.effects.is_empty() && frozen {
        ("", "const ")
    } else {
        (", its effects prepared for the sample period", "")
    };
    let _ = write!(
        out,
        "
/// The model{prepared}.
#[must_use]
pub {constant}fn model() -> Identified {{
    {body}
}}
"
    );
    if !model.effects.is_empty() || !frozen {
        out.push_str(
            "
const SETTING: Setting<f32> = Setting {
    period: SAMPLE_PERIOD_S,
    channel: 0,
    reference: 1.0,
};
",
        );
    }
    if !model.effects.is_empty() {
        out.push_str("\nfn effects() -> Effects {\n");
        let channels = model.channels();
        for (i, added) in model.effects.iter().enumerate() {
            let n = i + 1;
            let channel = channels
                .iter()
                .position(|name| added.channel.as_ref() == Some(name));
            let _ = match channel {
                None => writeln!(
                    out,
                    "    let effect{n} = Effect{n}::new(&EFFECT{n}, &SETTING);"
                ),
                Some(channel) => writeln!(
                    out,
                    "    let effect{n} = Effect{n}::new(
        &EFFECT{n},
        &Setting {{
            channel: {channel},
            reference: REFERENCES[{channel}],
            ..SETTING
        }},
    );"
                ),
            };
        }
        let _ = writeln!(out, "    {}\n}}", nested(model.effects.len(), "effect"));
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
}

/// The user's own effects, written out: `model-core` does not have them.
pub(super) fn own_effects(out: &mut String, model: &Model) {
    for added in &model.effects {
        if let Some(definition) = model.definition(&added.name) {
            let setting = Setting {
                period: model.sample_period_s as f32,
                channel: 0,
                reference: added.reference() as f32,
            };
            out.push('\n');
            out.push_str(&rust_source(definition, &added.parameters, &setting));
        }
    }
}

/// The parameters with their units.
fn with_units(spec: &Spec) -> String {
    let each = spec.parameters.iter();
    let units: Vec<String> = each.map(|p| format!("{} ({})", p.name, p.unit)).collect();
    if units.is_empty() {
        return "no parameters".to_owned();
    }
    units.join(", ")
}

pub(super) fn rust_name(spec: &Spec) -> &'static str {
    spec.rust.rsplit("::").next().unwrap_or(spec.rust)
}

/// Samples of memory of an effect that reaches back as long as the parameter
/// with index `time` is.
pub(super) fn buffer(model: &Model, added: &Added, time: usize) -> usize {
    let time = added.parameters.get(time).copied().unwrap_or(0.0) / model.sample_period_s;
    time.clamp(0.0, effects::LONGEST_BUFFER as f64) as usize + 3
}

/// `(name1, (name2, ()))`.
fn nested(effects: usize, name: &str) -> String {
    (1..=effects)
        .rev()
        .fold("()".to_owned(), |chain, i| format!("({name}{i}, {chain})"))
}
