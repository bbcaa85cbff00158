//! Rust constants for a board from an identified model.
//!
//! The text is deterministic and compiles in a `no_std` crate that depends on `model-core` only. Numbers are the
//! nearest `f32` in their shortest form. The file exports the same names for every model, so firmware compiles with
//! any of them:
//!
//! | name | is |
//! |---|---|
//! | `Identified`, `model()` | the model |
//! | `IdentifiedState`, `state(&model)` | its state, at rest |
//! | `Outputs`, `OUTPUTS`, `Jets`, `JETS` | its memories and their lengths, samples |
//! | `CHANNELS`, `REFERENCES` | measured channels, and their usual values |
//! | `share(command)` | the fraction of a full jet, the model's input, for a command of the records |
//! | `SAMPLE_PERIOD_S`, `WINDOW`, `READINGS` | period, averaging window, readings to average |
//! | `Law`, `LAW`, `LOOK_AHEAD` | the designed law; `()` for none |
//! | `CHECKSUM`, `GOLDEN`, `LAW_GOLDEN` | reference values that a board checks at start |

pub mod board;
mod delay;
mod items;
mod law;
mod pieces;
pub mod portable;

use crate::data::visible;
use crate::model::{Added, Delay, Footprint, Law, Model};
use model_core::control::Unusable;
use model_core::effect::Spec;
use model_core::self_test;
use proc_macro2::{Literal, TokenStream};
use quote::quote;
use thiserror::Error;

/// Expected values in the reference run.
const GOLDEN_VALUES: usize = 32;

/// Why no constants were generated.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CodegenError {
    /// A number of the model is not finite in single precision.
    #[error(
        "`{name}` is {value}, which single precision cannot represent. \
         Identify the model again; scale the measured output if it is large."
    )]
    NotFinite {
        /// Name of the constant.
        name: &'static str,
        /// Value of the constant.
        value: f64,
    },
    /// An effect is neither in the catalogue nor defined by the model.
    #[error(
        "effect `{name}` cannot be written in Rust: it is neither in the catalogue (`host-fit effects` lists it) \
         nor defined by the model. Remove it from the model."
    )]
    UnknownEffect {
        /// Name of the effect.
        name: String,
    },
    /// An effect of the catalogue that can be generated in Rust only.
    #[error(
        "effect `{name}` can be written in Rust only. \
         Use `--lang rust`, or add its definition to host-fit/src/user_effect/forms.toml."
    )]
    NoForm {
        /// Name of the effect.
        name: String,
    },
    /// The model's response decays within too few samples for the self-test, or does not decay.
    #[error(
        "the model is unstable: its response to the reference command is not finite after {samples} samples. \
         Identify the model again, with fewer lags or `--objective free-run`."
    )]
    Unstable {
        /// Samples after which the response is not finite.
        samples: u32,
    },
    /// The designed law does not fit the model.
    #[error("the designed law does not fit the model: {0}; run `host-fit design` again")]
    Law(#[from] Unusable),
    /// The generated code is not valid Rust.
    #[error(
        "the generated Rust cannot be parsed: {problem}. This is a fault of the tool; \
         report it with the model file."
    )]
    Malformed {
        /// Message of the parser.
        problem: String,
    },
}

/// The generated file `identified.rs` for `model`.
///
/// # Errors
/// A number beyond `f32`, an unknown effect, or a model that is unstable.
pub fn generate(model: &Model) -> Result<String, CodegenError> {
    check(model)?;
    let memory = model.memory();
    let delays = delay::written(model);
    let mut sections = vec![
        header(model),
        items::imports(&delays),
        items::sizes(model, &memory),
        items::types(model, &delays)?,
        items::coefficients(model, &delays),
        items::compile_time_checks(model, &delays),
        items::constructors(model, &delays),
        golden(model, &memory)?,
        law::items(model)?,
    ];
    sections.extend(items::own_effects(model));
    let sections = sections.into_iter().map(text);
    let text = sections.collect::<Result<Vec<_>, _>>()?.join("\n");
    // Names and notes of the model file are written as comments, in which the compiler rejects invisible
    // characters.
    Ok(visible(&text).into_owned())
}

/// The language of the generated code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Language {
    /// Constants for `model-core`.
    Rust,
    /// C99 in numbers of a precision.
    C(portable::Precision),
    /// A module for NumPy.
    Python,
    /// A function file of this name, for MATLAB and Octave.
    Matlab(String),
}

/// `model`, its effects and its law in `language`.
///
/// # Errors
/// The errors of [`generate`]; or an effect that can be generated in Rust only.
pub fn write(model: &Model, language: &Language) -> Result<String, CodegenError> {
    match language {
        Language::Rust => generate(model),
        Language::C(precision) => portable::c(model, *precision),
        Language::Python => portable::python(model),
        Language::Matlab(name) => portable::matlab(model, name),
    }
}

/// Items as text, one section of the file.
fn text(items: TokenStream) -> Result<String, CodegenError> {
    let file = syn::parse2(items).map_err(|error| CodegenError::Malformed {
        problem: error.to_string(),
    })?;
    Ok(prettyplease::unparse(&file))
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

fn header(model: &Model) -> TokenStream {
    let lines = header_lines(model).into_iter().map(|text| {
        // A line break would end a comment.
        let text = text.replace(char::is_control, " ");
        let space = if text.is_empty() { "" } else { " " };
        format!("{space}{text}")
    });
    quote!(#(#![doc = #lines])*)
}

/// The origin of a model, in lines.
fn header_lines(model: &Model) -> Vec<String> {
    let training = &model.training;
    let mut lines = Vec::new();
    let mut line = |text: String| lines.push(text);
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
                .map_or(String::new(), |fit| format!(", {fit:.2} % validation"))
        ));
    }
    if !model.command.is_unit() {
        let range = model.command;
        line(format!(
            "- command: {:?} is no jet, {:?} a full one; in Rust the model's input is `share(command)`",
            range.off, range.full
        ));
    }
    let lost = model.law.as_ref().map_or(&[][..], Law::lost);
    if !lost.is_empty() {
        line(format!(
            "- the law LOSES ATTACHMENT in these trials: {}",
            lost.join(", ")
        ));
    }
    line(format!(
        "- units: y is the normalised friction gain, u is 0 or 1, delays and lags are samples of {:?} s",
        model.sample_period_s
    ));
    lines
}

/// Checksum and reference run, computed by the code of the host's simulation.
fn golden(model: &Model, memory: &Footprint) -> Result<TokenStream, CodegenError> {
    let prepared = model.prepare::<f32>();
    // The run is twice as long as the longest lag or delay.
    let longest = model.longest_lag().max(model.longest_delay());
    let every = (2 * longest).div_ceil(GOLDEN_VALUES).clamp(32, 4096) as u32;
    let mut values = Vec::with_capacity(GOLDEN_VALUES);
    let mut unstable = None;
    self_test::run(
        &prepared,
        memory.at_rest(&prepared),
        &memory.references(),
        every,
        GOLDEN_VALUES,
        |i, bits| {
            if !f32::from_bits(bits).is_finite() {
                unstable.get_or_insert((i as u32 + 1) * every);
            }
            values.push(pieces::word(bits));
        },
    );
    if let Some(samples) = unstable {
        return Err(CodegenError::Unstable { samples });
    }
    let checksum = pieces::word(self_test::checksum(&prepared));
    let (count, every) = (pieces::count(GOLDEN_VALUES), Literal::u32_unsuffixed(every));
    Ok(quote! {
        /// CRC-32 of structure and coefficients, for the start-up self-test.
        pub const CHECKSUM: u32 = #checksum;
        /// Outputs of the model in the reference run, bit for bit as computed on the host.
        pub const GOLDEN: Golden<#count> = Golden {
            every: #every,
            expected: [#(#values),*],
        };
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::CommandRange;
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
            include_str!("../../../firmware/identified/generated/full.rs"),
            "regenerate with `cargo xtask identified`"
        );
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
    fn commands_of_any_range_become_shares() {
        let text = |off, full| {
            let mut model = with_effects("");
            model.command = CommandRange { off, full };
            generate(&model).expect("constants")
        };
        for (range, share) in [
            ((0.0, 1.0), "f32 {\n    command\n}"),
            ((2.0, 7.0), "((f64::from(command) - 2f64) / 5f64) as f32\n}"),
            (
                (1.0, 0.0),
                "((f64::from(command) - 1f64) / (-1f64)) as f32\n}",
            ),
            (
                (-0.5, 0.25),
                "((f64::from(command) - (-0.5f64)) / 0.75f64) as f32\n}",
            ),
        ] {
            let text = text(range.0, range.1);
            assert!(text.contains(share), "{range:?}: {text}");
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
