//! Rust constants for a board from an identified model.
//!
//! The text is the same bytes for the same model, formatted as rustfmt would,
//! and compiles in a `no_std` crate that depends on `model-core` only. Numbers
//! are the nearest `f32`, written as short as they can be read back.

mod items;
mod law;
mod layout;

use crate::model::{Added, Delay, Model};
use model_core::control::tracking::Unusable;
use model_core::effect::Spec;
use model_core::self_test;
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
    /// An effect is neither in the catalogue nor defined by the model.
    #[error(
        "effect `{name}` has no Rust form: it is neither in the catalogue (`host-fit effects` lists it) \
         nor defined by the model. Remove it from the model."
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
    /// The designed law does not fit the model.
    #[error("the designed law does not fit the model: {0}; run `host-fit design` again")]
    Law(#[from] Unusable),
}

/// The generated file `identified.rs` for `model`.
///
/// # Errors
/// A number beyond `f32`, an unknown effect, or a model that is unstable.
pub fn generate(model: &Model) -> Result<String, CodegenError> {
    check(model)?;
    let mut out = String::new();
    header(&mut out, model);
    let memory = model.memory();
    let graded = memory.graded;
    items::imports(&mut out, model, graded);
    items::sizes(&mut out, model, &memory);
    items::types(&mut out, model, graded)?;
    items::coefficients(&mut out, model);
    items::compile_time_checks(&mut out, model, graded);
    items::constructors(&mut out, model, graded);
    items::own_effects(&mut out, model);
    golden(&mut out, model)?;
    if let Some(designed) = &model.law {
        law::items(&mut out, model, designed)?;
    }
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
    if let Delay::Law(law) = &model.delay {
        fits("delay", &law.parameters)?;
        fits("factors", &law.factors)?;
    }
    for added in &model.effects {
        fits("effect parameter", &added.parameters)?;
        fits("effect reference", added.reference.as_slice())?;
        spec_of(model, added)?;
    }
    Ok(())
}

fn spec_of(model: &Model, added: &Added) -> Result<&'static Spec, CodegenError> {
    model
        .spec(&added.name)
        .ok_or_else(|| CodegenError::UnknownEffect {
            name: added.name.clone(),
        })
}

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

/// Checksum and golden run, by the code that the host simulates with.
fn golden(out: &mut String, model: &Model) -> Result<(), CodegenError> {
    let prepared = model.prepare::<f32>();
    let size = model.memory();
    // Long enough for what is sent to arrive, twice over.
    let memory = model.longest_lag().max(model.longest_delay());
    let every = (2 * memory).div_ceil(GOLDEN_VALUES).clamp(32, 4096) as u32;
    let state = size.at_rest(&prepared);
    let mut values = Vec::with_capacity(GOLDEN_VALUES);
    let mut unstable = None;
    self_test::run(
        &prepared,
        state,
        &size.references(),
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

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::effect::Place;

    fn with_effects(extra: &str) -> Model {
        let text = include_str!("../../../firmware/identified/models/full.toml");
        Model::from_toml(&format!("{text}{extra}"), "full.toml").expect("a model file")
    }

    #[test]
    fn the_same_model_gives_the_same_bytes() {
        let model = with_effects("");
        let text = generate(&model).expect("constants");
        assert_eq!(generate(&model.clone()).expect("constants"), text);
        assert_eq!(
            text,
            include_str!("../../../firmware/identified/src/full.rs"),
            "regenerate with `cargo xtask identified`"
        );
    }

    /// Numbers read back as the nearest f32, and small ones are not lost.
    #[test]
    fn numbers_survive_their_text() {
        for value in [0.1, -0.0049, 1e-7, 3.2e-38, 1.0 / 3.0, -0.0, 16_777_217.0] {
            let text = layout::number(value);
            let read: f32 = text.parse().expect("a number");
            assert_eq!(read.to_bits(), (value as f32).to_bits(), "{text}");
            assert!(text.contains(['.', 'e']), "{text} is no float literal");
        }
    }

    #[test]
    fn every_effect_of_the_catalogue_has_its_constants() {
        for spec in model_core::effects::SPECS {
            if spec.place == Place::Delay {
                continue;
            }
            let mut model = with_effects("");
            let values: Vec<f64> = spec
                .parameters
                .iter()
                .map(|parameter| parameter.starts.first().copied().unwrap_or(parameter.low))
                .collect();
            model.add(spec, &values, Some(1.0));
            let text = generate(&model).expect(spec.name);
            assert!(text.contains(&format!("/// {}.\n", spec.name)), "{text}");
        }
    }

    #[test]
    fn what_single_precision_cannot_hold_is_refused() {
        let mut model = with_effects("");
        model.b = vec![1e39];
        let error = generate(&model).expect_err("beyond f32");
        assert_eq!(
            error,
            CodegenError::NotFinite {
                name: "b",
                value: 1e39
            }
        );
    }

    #[test]
    fn an_unstable_model_is_refused() {
        let mut model = with_effects("");
        model.a = vec![1.9, 0.0, 0.0, 0.0, 0.0];
        let error = generate(&model).expect_err("unstable");
        assert!(matches!(error, CodegenError::Unstable { .. }), "{error}");
    }
}
