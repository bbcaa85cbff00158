//! The model file `model.toml`.

use super::delay_table::{self, DelayTable};
use super::{Added, CommandRange, Law, Model, Start, Training, bounds};
use crate::output::{self, OutputError};
use crate::user_effect::{Definition, DefinitionError, Source};
use model_core::effect::{Place, Spec};
use model_core::model::Averaging;
use model_core::recursion::{Grading, LagConvention};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Version of the file format that this tool writes and reads.
pub const FORMAT_VERSION: u32 = 1;

/// Why a model file was refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The file could not be read.
    #[error("{}: cannot read the model file: {source}. Check the path and its permissions.", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file has another format version.
    #[error(
        "{place}: `format_version` is {found}, but this tool reads version {FORMAT_VERSION}. \
             Identify the model again with this tool, or use the version that wrote it."
    )]
    Version {
        /// The file.
        place: String,
        /// Version in the file.
        found: i64,
    },
    /// The file is not a valid model.
    #[error("{place}: {problem}")]
    Syntax {
        /// The file.
        place: String,
        /// The problem, with line and key.
        problem: String,
    },
    /// Two parts of the file contradict each other.
    #[error("{place}: key `{key}`: {problem}. Correct the key, or identify the model again.")]
    Inconsistent {
        /// The file.
        place: String,
        /// The key.
        key: String,
        /// The problem.
        problem: String,
    },
    /// A user effect in the file was refused.
    #[error(transparent)]
    Definition(#[from] DefinitionError),
    /// The file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format_version: u32,
    sample_period_s: f64,
    #[serde(with = "Convention")]
    lag_convention: LagConvention,
    #[serde(default)]
    start: Start,
    /// The commands of no jet and of a full jet; omitted if they are 0 and 1.
    #[serde(default, skip_serializing_if = "CommandRange::is_unit")]
    command: CommandRange,
    structure: StructureTable,
    coefficients: CoefficientTable,
    delay: DelayTable,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    effect: Vec<EffectTable>,
    /// The user's own effects in full, so that a model file is self-contained.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    definition: Vec<Source>,
    #[serde(default)]
    training: Training,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    law: Option<Law>,
}

/// Names in files.
#[derive(Serialize, Deserialize)]
#[serde(remote = "LagConvention", rename_all = "kebab-case")]
enum Convention {
    Literal,
    OneStep,
}

/// Names in files.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Grading", rename_all = "kebab-case")]
enum JetResponse {
    Proportional,
    Interpolated,
    Switched,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StructureTable {
    averaged: bool,
    window: u32,
    #[serde(default, with = "JetResponse")]
    jet_response: Grading,
    state_lags: Vec<u16>,
    product_lags: Vec<u16>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CoefficientTable {
    #[serde(default)]
    constant: f64,
    a: Vec<f64>,
    b: Vec<f64>,
    /// One row of N2 numbers for each input.
    c: Vec<Vec<f64>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EffectTable {
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    channel: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reference: Option<f64>,
    /// Parameter values by name, in the units of the catalogue.
    #[serde(default)]
    parameters: toml::map::Map<String, toml::Value>,
}

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    /// [`ModelError`] names the file and the key.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        let text = std::fs::read_to_string(path).map_err(|source| ModelError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        Self::from_toml(&text, &path.display().to_string())
    }

    /// Reads a model from the text of a model file; `place` names it in errors.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn from_toml(text: &str, place: &str) -> Result<Self, ModelError> {
        let syntax = |error: toml::de::Error| {
            let line = error.span().map_or(1, |span| {
                1 + text
                    .bytes()
                    .take(span.start)
                    .filter(|b| *b == b'\n')
                    .count()
            });
            ModelError::Syntax {
                place: format!("{place}, line {line}"),
                problem: format!(
                    "{}. Compare it with a model file that `host-fit identify` wrote.",
                    error.message()
                ),
            }
        };
        // The version is checked first, because other versions may have other keys.
        let table: toml::Table = toml::from_str(text).map_err(syntax)?;
        if let Some(found) = table
            .get("format_version")
            .and_then(toml::Value::as_integer)
            && found != i64::from(FORMAT_VERSION)
        {
            return Err(ModelError::Version {
                place: place.to_owned(),
                found,
            });
        }
        let mut file: File = toml::from_str(text).map_err(syntax)?;
        let definitions = std::mem::take(&mut file.definition)
            .into_iter()
            .map(|source| {
                let prefix = format!("definition.{}.", source.name);
                Definition::from_source(source, place, &prefix)
            })
            .collect::<Result<_, _>>()?;
        file.into_model(definitions)
            .map_err(|(key, problem)| ModelError::Inconsistent {
                place: place.to_owned(),
                key,
                problem,
            })
    }

    /// The text of the model's file: the same bytes for the same model.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let text = toml::to_string_pretty(&File::from_model(self));
        // Numbers, strings and tables can always be serialised.
        text.unwrap_or_default()
    }

    /// Writes the model file completely or not at all, and only if it can be read back.
    ///
    /// # Errors
    /// [`ModelError::Output`], and those of [`load`](Self::load) for a model that contradicts itself.
    pub fn save(&self, path: &Path) -> Result<(), ModelError> {
        let text = self.to_toml();
        Self::from_toml(&text, &path.display().to_string())?;
        output::write_atomic(path, |file| file.write_all(text.as_bytes()))?;
        Ok(())
    }
}

impl File {
    fn from_model(model: &Model) -> Self {
        let lags = model.product_lags.len();
        Self {
            format_version: FORMAT_VERSION,
            sample_period_s: model.sample_period_s,
            lag_convention: model.convention,
            start: model.start,
            command: model.command,
            structure: StructureTable {
                averaged: model.averaging.averaged_model,
                window: model.averaging.window,
                jet_response: model.grading,
                state_lags: model.state_lags.clone(),
                product_lags: model.product_lags.clone(),
            },
            coefficients: CoefficientTable {
                constant: model.constant,
                a: model.a.clone(),
                b: model.b.clone(),
                c: (0..model.b.len())
                    .map(|l| model.c.iter().copied().skip(l * lags).take(lags).collect())
                    .collect(),
            },
            delay: DelayTable::of(&model.delay),
            effect: model
                .effects
                .iter()
                .map(|added| EffectTable::of(added, model.spec(&added.name)))
                .collect(),
            definition: model
                .definitions
                .iter()
                .map(|definition| definition.source().clone())
                .collect(),
            training: model.training.clone(),
            law: model.law.clone(),
        }
    }

    /// The model, or the wrong key with its problem.
    fn into_model(self, definitions: Vec<&'static Definition>) -> Result<Model, (String, String)> {
        fn wrong<T>(key: &str, problem: String) -> Result<T, (String, String)> {
            Err((key.to_owned(), problem))
        }
        let finite = |key: &str, values: &[f64]| match values.iter().find(|v| !v.is_finite()) {
            Some(value) => wrong(key, format!("{value} is not a finite number")),
            None => Ok(()),
        };
        let (structure, coefficients) = (&self.structure, &self.coefficients);
        bounds::period(self.sample_period_s)?;
        bounds::window(structure.window)?;
        if !self.command.is_valid() {
            return wrong(
                "command",
                "`off` and `full` must be finite and differ".into(),
            );
        }
        let pairs = [
            (
                "coefficients.a",
                coefficients.a.len(),
                "structure.state_lags",
                structure.state_lags.len(),
            ),
            (
                "coefficients.c",
                coefficients.c.len(),
                "coefficients.b",
                coefficients.b.len(),
            ),
        ];
        for (key, found, other, expected) in pairs {
            if found != expected {
                return wrong(
                    key,
                    format!("has {found} entries, but `{other}` has {expected}"),
                );
            }
        }
        if coefficients.b.is_empty() {
            return wrong("coefficients.b", "a model has at least one input".into());
        }
        if let Some(row) = coefficients
            .c
            .iter()
            .find(|r| r.len() != structure.product_lags.len())
        {
            return wrong(
                "coefficients.c",
                format!(
                    "a row has {} numbers, but `structure.product_lags` has {}",
                    row.len(),
                    structure.product_lags.len()
                ),
            );
        }
        finite("coefficients.constant", &[coefficients.constant])?;
        finite("coefficients.a", &coefficients.a)?;
        finite("coefficients.b", &coefficients.b)?;
        let c: Vec<f64> = coefficients.c.iter().flatten().copied().collect();
        finite("coefficients.c", &c)?;
        for (key, lags) in [
            ("structure.state_lags", &structure.state_lags),
            ("structure.product_lags", &structure.product_lags),
        ] {
            if self.lag_convention == LagConvention::OneStep && lags.contains(&0) {
                return wrong(
                    key,
                    "a lag of 0 refers to the future; one-step lags begin at 1".into(),
                );
            }
        }
        if let Some(law) = &self.law {
            bounds::law(law)?;
            law.fault().map_or(Ok(()), Err)?;
        }
        for (key, range) in [
            ("y_range", &self.training.y_range),
            ("duty_range", &self.training.duty_range),
            ("on_time_range_s", &self.training.on_time_range_s),
        ] {
            finite(&format!("training.{key}"), range)?;
        }
        let delay = self.delay.into_delay(self.coefficients.b.len())?;
        bounds::delay(&delay, self.sample_period_s)?;
        let mut model = Model {
            sample_period_s: self.sample_period_s,
            convention: self.lag_convention,
            averaging: Averaging {
                window: self.structure.window,
                averaged_model: self.structure.averaged,
            },
            start: self.start,
            command: self.command,
            grading: self.structure.jet_response,
            constant: self.coefficients.constant,
            state_lags: self.structure.state_lags,
            a: self.coefficients.a,
            product_lags: self.structure.product_lags,
            delay,
            b: self.coefficients.b,
            c,
            effects: Vec::new(),
            calibrated_at: None,
            definitions: Vec::new(),
            training: self.training,
            law: self.law,
        };
        for definition in definitions {
            let name = definition.spec().name;
            if model.definition(name).is_some() {
                return wrong(&format!("definition.{name}"), "it is there twice".into());
            }
            model.definitions.push(definition);
        }
        for table in self.effect {
            let added = table.into_added(&model)?;
            if model.has_effect(&added.name) {
                let key = format!("effect.{}", added.name);
                return wrong(&key, "the effect is listed twice; list it once".into());
            }
            model.effects.push(added);
        }
        model.order_effects();
        Ok(model)
    }
}

impl EffectTable {
    fn of(added: &Added, spec: Option<&Spec>) -> Self {
        let names = spec.map_or(&[][..], |spec| spec.parameters);
        let pairs = names.iter().zip(&added.parameters);
        Self {
            name: added.name.clone(),
            channel: added.channel.clone(),
            reference: added.reference,
            parameters: pairs
                .map(|(parameter, value)| (parameter.name.to_owned(), (*value).into()))
                .collect(),
        }
    }

    fn into_added(self, model: &Model) -> Result<Added, (String, String)> {
        let key = format!("effect.{}", self.name);
        let Some(spec) = model.spec(&self.name) else {
            let problem = "no such effect in the catalogue (`host-fit effects` lists them), nor under `[[definition]]`";
            return Err((key, problem.to_owned()));
        };
        if spec.place == Place::Delay {
            let problem = format!(
                "it is a law of the delay: write `law = \"{}\"` and its parameters under [delay]",
                delay_table::name_of(spec)
            );
            return Err((key, problem));
        }
        if spec.channel.is_some() && (self.channel.is_none() || self.reference.is_none()) {
            let problem = "this effect needs `channel` and `reference`".to_owned();
            return Err((key, problem));
        }
        if spec.calibrated && self.reference.is_some_and(|r| !(r.is_finite() && r > 0.0)) {
            let problem =
                "`reference`, the y at which the sensor was calibrated, must be a number above 0"
                    .to_owned();
            return Err((key, problem));
        }
        if self.reference.is_some_and(|r| !r.is_finite()) {
            return Err((key, "`reference` is not a finite number".to_owned()));
        }
        let known = |name: &String| spec.parameters.iter().any(|p| p.name == name);
        if let Some(name) = self.parameters.keys().find(|name| !known(name)) {
            return Err((key, format!("it has no parameter `{name}`")));
        }
        let number = |value: &toml::Value| {
            let integer = || value.as_integer().map(|whole| whole as f64);
            value.as_float().or_else(integer).filter(|v| v.is_finite())
        };
        let parameters = spec.parameters.iter().map(|parameter| {
            let value = match self.parameters.get(parameter.name) {
                Some(value) => number(value),
                None => parameter.left_out,
            };
            let value = value.ok_or_else(|| {
                let problem = format!(
                    "parameter `{}` ({}) is missing or not a finite number",
                    parameter.name, parameter.unit
                );
                (key.clone(), problem)
            })?;
            bounds::parameter(&format!("{key}.{}", parameter.name), parameter, value)?;
            Ok::<f64, bounds::Fault>(value)
        });
        Ok(Added {
            parameters: parameters.collect::<Result<_, _>>()?,
            name: self.name,
            channel: self.channel,
            reference: self.reference,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Delay, Maximise, Track};
    use super::*;
    use model_core::control::HoldTimes;

    fn example() -> Model {
        let mut model = Model {
            state_lags: vec![1, 44],
            a: vec![0.9, 0.01],
            b: vec![0.1, 1.0 / 3.0],
            c: vec![-0.02, 0.01],
            delay: Delay::Fixed {
                delays: vec![49, 417],
            },
            ..Model::default()
        };
        for name in ["hot-film-lag", "valve-lag"] {
            let spec = model.spec(name).expect("in the catalogue");
            let values: Vec<f64> = spec.parameters.iter().map(|p| p.starts[0]).collect();
            model.add(spec, &values, None);
        }
        model
    }

    /// Files of version 0.2.0 have a pickup without delay.
    #[test]
    fn a_parameter_that_may_be_left_out_has_its_value() {
        let mut model = example();
        let spec = model.spec("electrical-pickup").expect("in the catalogue");
        model.add(spec, &[0.07, 0.0], None);
        let text = model.to_toml();
        let shorter = text.replace("delay = 0.0\n", "");
        assert_ne!(shorter, text);
        assert_eq!(Model::from_toml(&shorter, "m").expect("readable"), model);
        let wrong = text.replace("delay = 0.0\n", "delay = \"none\"\n");
        assert!(Model::from_toml(&wrong, "m").is_err());
    }

    #[test]
    fn a_model_survives_its_file_bit_for_bit() {
        let model = example();
        let text = model.to_toml();
        assert_eq!(Model::from_toml(&text, "m").expect("own file"), model);
        assert_eq!(model.effect_names(), ["valve-lag", "hot-film-lag"]);
        let moved = model.with_values(&model.values());
        assert_eq!(moved, model);
        assert_eq!(model.values().len(), model.coordinates().len());
    }

    #[test]
    fn what_a_sensor_was_calibrated_at_is_above_nothing() {
        let mut model = Model::default();
        let film = model.spec("hot-film-nonlinearity").expect("known");
        model.add(film, &[3.0, 0.1], Some(5.0));
        let text = model.to_toml();
        assert!(Model::from_toml(&text, "m").is_ok());
        for wrong in ["0.0", "-5.0", "nan"] {
            let text = text.replace("reference = 5.0", &format!("reference = {wrong}"));
            let error = Model::from_toml(&text, "m").expect_err("no calibration");
            assert!(error.to_string().contains("`reference`"), "{error}");
        }
    }

    /// A seed has 64 bits, TOML's integers 63.
    #[test]
    fn every_seed_survives_its_file() {
        for seed in [0, 7, 1 << 53, (1 << 63) - 1, 1 << 63, u64::MAX] {
            let mut model = example();
            model.training.seed = seed;
            let read = Model::from_toml(&model.to_toml(), "m").expect("own file");
            assert_eq!(read, model, "{seed}");
        }
    }

    #[test]
    fn effects_stand_in_the_order_of_the_physics() {
        let order = [
            "valve-lag",
            "starting-vortex",
            "slow-wake",
            "level-rate",
            "dry-friction",
            "reading-curve",
            "hot-film-lag",
            "zero-offset",
        ];
        let mut model = Model::default();
        for name in [6, 3, 7, 5, 1, 4, 0, 2].map(|i: usize| order[i]) {
            let spec = model.spec(name).expect("known");
            let values: Vec<f64> = spec.parameters.iter().map(|p| p.starts[0]).collect();
            model.add(spec, &values, None);
        }
        assert_eq!(model.effect_names(), order);
        // The effects are in arbitrary order, as in a file edited by hand.
        model.effects.reverse();
        let read = Model::from_toml(&model.to_toml(), "m").expect("whole");
        assert_eq!(read.effect_names(), order);
    }

    #[test]
    fn a_law_survives_and_its_faults_are_named() {
        let law = Track {
            reference: 0.8,
            reachable: [0.0, 1.05],
            slope: 0.0,
            hold: HoldTimes { on: 10, off: 12 },
            anticipation: Some([9, 11]),
            switches: Some([20, 10]),
            air: None,
            lead: 47,
            opening: 3,
            closing: 0,
            look_ahead: 80,
            observer: 0.03,
            bias_rate: 0.002,
            integral_rate: 0.001,
            settled: 0.5,
            play: 0.01,
            correction_limit: 0.3,
            residual_limit: 0.25,
            lost: Vec::new(),
        };
        let mut model = example();
        model.law = Some(Law::Track(law.clone()));
        let read = Model::from_toml(&model.to_toml(), "m").expect("own file");
        assert_eq!(read, model);
        model.law = Some(Law::Track(Track {
            reference: 1.2,
            ..law
        }));
        let error = Model::from_toml(&model.to_toml(), "m").expect_err("unreachable");
        assert!(error.to_string().contains("law.reference"), "{error}");
        model.law = Some(Law::Maximise(Maximise {
            period: 250,
            pulses: vec![(0, 100)],
            hold: HoldTimes { on: 10, off: 10 },
            air_price: 0.0,
            lost: vec!["twice the noise".into()],
        }));
        let read = Model::from_toml(&model.to_toml(), "m").expect("own file");
        assert_eq!(read, model);
    }

    #[test]
    fn faults_are_named_by_key() {
        let text = example().to_toml();
        let cases = [
            (
                "format_version = 1",
                "format_version = 9",
                "`format_version` is 9",
            ),
            ("window = 250", "window = 1", "structure.window"),
            ("window = 250", "windoe = 250", "windoe"),
            ("valve-lag", "valve-lug", "effect.valve-lug"),
            ("opening_time", "opening_tim", "opening_tim"),
            ("valve-lag", "edge-dependent-delay", "under [delay]"),
            (
                "sample_period_s = 0.001",
                "sample_period_s = -1.0",
                "sample_period_s",
            ),
            (
                "lag_convention = \"one-step\"",
                "lag_convention = \"two-step\"",
                "line 3",
            ),
            ("    49,\n", "", "delay.delays"),
        ];
        for (from, to, expected) in cases {
            let broken = text.replacen(from, to, 1);
            assert_ne!(broken, text, "{from} is not in the file:\n{text}");
            let error = Model::from_toml(&broken, "m.toml")
                .expect_err(to)
                .to_string();
            assert!(error.contains(expected), "{error} does not name {expected}");
            assert!(error.starts_with("m.toml"), "{error}");
        }
    }
}
