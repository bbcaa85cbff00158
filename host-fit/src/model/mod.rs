//! An identified model with sizes known at run time.

mod bounds;
mod chain;
mod command;
mod delay;
mod delay_table;
mod envelope;
mod file;
mod law;
mod memory;
mod parameters;
mod poles;
mod prepared;
mod rules;
mod seed;

pub use chain::{Chain, ChainState, HostEffect, HostState};
pub use command::CommandRange;
pub use delay::{Delay, TransportLaw};
pub use file::{FORMAT_VERSION, ModelError};
pub use law::{Law, Maximise, Track};
pub use memory::{Channel, Footprint};
pub use parameters::{Coordinate, Kind};
pub use prepared::{AnyDelay, Prepared, Rounding};
pub use rules::{RULES, Rules};

use crate::user_effect::Definition;
use model_core::average::WINDOW;
use model_core::effect::{Place, Spec, Unit};
use model_core::effects::{ConstantDelay, NUISANCES, SPECS};
use model_core::model::Averaging;
use model_core::recursion::{Grading, LagConvention};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A bilinear model, eqs. (3), (4), (14) or (15), with its effects and training record.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Sample period T, s.
    pub sample_period_s: f64,
    /// Meaning of the lags.
    pub convention: LagConvention,
    /// Averages.
    pub averaging: Averaging,
    /// Initial state of a free run.
    pub start: Start,
    /// The commands of no jet and of a full jet.
    pub command: CommandRange,
    /// The response to jets of part strength.
    pub grading: Grading,
    /// d, the constant drive of the flow without jets; 0 in the paper.
    pub constant: f64,
    /// τ_i, samples.
    pub state_lags: Vec<u16>,
    /// a_i.
    pub a: Vec<f64>,
    /// τ̄_j, samples.
    pub product_lags: Vec<u16>,
    /// b_l.
    pub b: Vec<f64>,
    /// c_jl, column-major (N2 coefficients of input 1 first).
    pub c: Vec<f64>,
    /// Input delays.
    pub delay: Delay,
    /// Effects in physical order, without delay laws.
    pub effects: Vec<Added>,
    /// Reading at which the sensor counts as calibrated for added effects, y; `None` for 1. Not part of a model
    /// file.
    pub calibrated_at: Option<f64>,
    /// The user's own effects that are available to the model, used or not.
    pub definitions: Vec<&'static Definition>,
    /// Records and options of the identification.
    pub training: Training,
    /// The control law designed for the model; `None` without a law.
    pub law: Option<Law>,
}

/// A model has a different effect of the same name.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "the model has an effect `{name}` with another definition. Give the new one another name, or start from a \
     model without it."
)]
pub struct DefineError {
    /// The name.
    pub name: String,
}

/// Initial state of a free run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// At rest: all signals were 0 before the record, as in the paper.
    #[default]
    Rest,
    /// Constant at the first values of the record, or at the known values before it. The first samples of a
    /// record that starts in mid-run follow the measurement (see [`preparation`](crate::preparation)).
    Measured,
}

/// An effect that was added to a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Added {
    /// Name of the effect in the catalogue, or of the user's effect.
    pub name: String,
    /// Parameter values in the order and units of the catalogue.
    pub parameters: Vec<f64>,
    /// The measured channel that the effect uses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
    /// The reference of the effect's channel, in its unit, or the calibration reading of the sensor, y; see
    /// [`reference`](Self::reference).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
}

impl Added {
    /// Default of a missing reference. It is not 0, because effects divide by it.
    pub(crate) const NO_REFERENCE: f64 = 1.0;

    /// The reference of the effect's channel, in its unit, or the [calibration](Spec::calibrated) reading of
    /// the sensor, y; 1 by default.
    #[must_use]
    pub fn reference(&self) -> f64 {
        self.reference.unwrap_or(Self::NO_REFERENCE)
    }
}

/// The training range of a model: predictions outside are extrapolations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Training {
    /// Lowest and highest measured y.
    pub y_range: [f64; 2],
    /// Lowest and highest duty over the records, fractions.
    pub duty_range: [f64; 2],
    /// Shortest and longest on-time, s; zeros if the input is not on/off.
    pub on_time_range_s: [f64; 2],
    /// Shortest and longest off-time between two on-times, s; zeros if there is none.
    pub off_time_range_s: [f64; 2],
    /// Hash of the data set.
    pub data_hash: String,
    /// Version of the tool.
    pub tool_version: String,
    /// The seed; one above 2⁶³ − 1, the largest TOML integer, is text in a file.
    #[serde(with = "seed")]
    pub seed: u64,
    /// Objective of the delay search.
    pub objective: String,
    /// Value of the objective.
    pub objective_value: f64,
    /// FIT of the free run over the identify records, %.
    pub identify_fit_percent: f64,
    /// Effects of the model that are surrogates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stand_ins: Vec<String>,
    /// FIT of the free run over the validate records, %; NaN is written as absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validate_fit_percent: Option<f64>,
}

impl Default for Model {
    /// A template: one lag each, no delay, zero coefficients, 1 kHz.
    fn default() -> Self {
        Self {
            sample_period_s: 0.001,
            convention: LagConvention::OneStep,
            averaging: Averaging {
                window: WINDOW,
                averaged_model: false,
            },
            start: Start::Rest,
            command: CommandRange::UNIT,
            grading: Grading::Proportional,
            constant: 0.0,
            state_lags: vec![1],
            a: vec![0.0],
            product_lags: vec![1],
            b: vec![0.0],
            c: vec![0.0],
            delay: Delay::Fixed { delays: vec![0] },
            effects: Vec::new(),
            calibrated_at: None,
            definitions: Vec::new(),
            training: Training::default(),
            law: None,
        }
    }
}

impl Model {
    /// Names of the effects, delay law included, in physical order.
    #[must_use]
    pub fn effect_names(&self) -> Vec<String> {
        let jet = |added: &&Added| self.place_of(added) == Some(Place::Jet);
        let mut names: Vec<String> = self
            .effects
            .iter()
            .filter(jet)
            .map(|added| added.name.clone())
            .collect();
        names.extend(self.delay.effect_name().map(str::to_owned));
        names.extend(
            self.effects
                .iter()
                .filter(|added| !jet(added))
                .map(|added| added.name.clone()),
        );
        names
    }

    /// Whether an effect called `name` was added, disturbance terms included; the delay law does not count.
    #[must_use]
    pub fn has_effect(&self, name: &str) -> bool {
        self.effects.iter().any(|added| added.name == name)
    }

    fn place_of(&self, added: &Added) -> Option<Place> {
        self.spec(&added.name).map(|spec| spec.place)
    }

    /// Every effect that can be added: the catalogue, then the user's own.
    pub fn candidates(&self) -> impl Iterator<Item = &'static Spec> {
        let own = self.definitions.iter().map(|definition| definition.spec());
        SPECS.iter().chain(own)
    }

    /// All candidates and disturbance terms.
    fn known(&self) -> impl Iterator<Item = &'static Spec> {
        self.candidates().chain(NUISANCES)
    }

    /// The effect called `name`: of the catalogue, the user's own, or a disturbance term.
    #[must_use]
    pub fn spec(&self, name: &str) -> Option<&'static Spec> {
        self.known().find(|spec| spec.name == name)
    }

    /// The definition of the user's own effect called `name`.
    #[must_use]
    pub fn definition(&self, name: &str) -> Option<&'static Definition> {
        let mut own = self.definitions.iter().copied();
        own.find(|definition| definition.spec().name == name)
    }

    /// Whether the effect called `name` is the tool's own for a measured channel.
    pub(crate) fn is_of_a_channel(&self, name: &str) -> bool {
        let own = self.definition(name);
        own.is_some_and(Definition::is_of_a_channel)
    }

    /// Makes a user effect available to the model. It replaces an effect with the same name, unless the model uses that
    /// effect.
    ///
    /// # Errors
    /// [`DefineError`] if the model uses another effect of that name.
    pub fn define(&mut self, definition: &'static Definition) -> Result<(), DefineError> {
        let name = definition.spec().name;
        match self.definition(name) {
            Some(known) if known == definition => return Ok(()),
            Some(_) if self.has_effect(name) => {
                return Err(DefineError {
                    name: name.to_owned(),
                });
            }
            _ => {}
        }
        self.definitions.retain(|known| known.spec().name != name);
        self.definitions.push(definition);
        Ok(())
    }

    /// The model with `inputs` as further effects that can be added.
    #[must_use]
    pub(crate) fn with_inputs(&self, inputs: Vec<&'static Definition>) -> Self {
        let mut model = self.clone();
        for input in inputs {
            if model.definition(input.spec().name).is_none() {
                model.definitions.push(input);
            }
        }
        model
    }

    /// The measured inputs among the model's candidates.
    pub(crate) fn measured_inputs(&self) -> impl Iterator<Item = &'static Spec> {
        let inputs = self
            .definitions
            .iter()
            .filter(|own| own.is_measured_input());
        inputs.map(|own| own.spec())
    }

    /// Removes definitions that neither an effect of the model nor `given` uses.
    pub(crate) fn forget_unused(&mut self, given: &Self) {
        let used = |definition: &&'static Definition| {
            let name = definition.spec().name;
            given.definition(name).is_some() || self.effects.iter().any(|own| own.name == name)
        };
        self.definitions = self.definitions.iter().copied().filter(used).collect();
    }

    /// Whether data with this sample period, s, match the model's.
    #[must_use]
    pub fn is_sampled_at(&self, period_s: f64) -> bool {
        (period_s / self.sample_period_s - 1.0).abs() <= RULES.same_period
    }

    /// N3.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.b.len()
    }

    /// The longest lag behind y_k that the recursion reads, samples.
    #[must_use]
    pub fn longest_lag(&self) -> usize {
        self.state_lags
            .iter()
            .chain(&self.product_lags)
            .map(|lag| self.convention.behind_newest(*lag))
            .max()
            .unwrap_or(0)
    }

    /// The longest input delay, samples: at ỹ = 0 if it depends on the state.
    #[must_use]
    pub fn longest_delay(&self) -> usize {
        let longest = self.delay.longest(self.sample_period_s);
        // Longer delays in files are rejected, but during a search a delay may exceed the limit.
        longest.clamp(0.0, bounds::LONGEST.into()).round() as usize
    }

    /// Makes delays unrounded, so that a fit can vary them. A delay that changes by a whole sample would change y
    /// after an edge by several times the noise.
    pub(crate) fn delay_between_samples(&mut self) {
        match &mut self.delay {
            Delay::Law(law) => law.interpolated = true,
            Delay::Fixed { delays } => {
                let first = f64::from(delays.first().copied().unwrap_or(0));
                let factors = self.delay.factors();
                self.delay = Delay::of::<ConstantDelay<f64>>(&[first], factors, true);
            }
        }
    }

    /// Lengthens (or shortens) all delays by this many samples, if the law has a constant part.
    pub(crate) fn delay_later(&mut self, samples: f64) {
        match &mut self.delay {
            Delay::Fixed { delays } => {
                let later = |h: &u16| (f64::from(*h) + samples).round().clamp(0.0, 65_535.0) as u16;
                *delays = delays.iter().map(later).collect();
            }
            Delay::Law(law) => {
                let by = |unit: Unit| match unit {
                    Unit::Samples => Some(samples),
                    Unit::Second => Some(samples * self.sample_period_s),
                    _ => None,
                };
                if let Some((level, card)) =
                    law.parameters.iter_mut().zip(law.spec.parameters).next()
                    && let Some(by) = by(card.unit)
                {
                    *level = (*level + by).clamp(card.low, card.high);
                }
            }
        }
    }

    /// Rounds delays to samples, as in eqs. (3) and (4).
    pub(crate) fn delay_on_samples(&mut self) {
        let Delay::Law(law) = &mut self.delay else {
            return;
        };
        law.interpolated = false;
        if law.spec.base {
            let [constant, _] = law.range(self.sample_period_s);
            let rounded = |f: &f64| (f * constant).round().clamp(0.0, f64::from(u16::MAX)) as u16;
            self.delay = Delay::Fixed {
                delays: law.factors.iter().map(rounded).collect(),
            };
        }
    }

    /// Channels that the effects need, in the order in which they are passed.
    #[must_use]
    pub fn channels(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for name in self
            .effects
            .iter()
            .filter_map(|added| added.channel.as_ref())
        {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
        names
    }

    /// Adds an effect of the catalogue or a [defined](Self::define) user effect, with the values `parameters`, at its
    /// physical position. A delay law replaces the present one.
    pub fn add(&mut self, spec: &'static Spec, parameters: &[f64], reference: Option<f64>) {
        if spec.place == Place::Delay {
            self.delay = Delay::Law(TransportLaw {
                spec,
                parameters: parameters.to_vec(),
                // The ratios of the inputs' delays are kept.
                factors: self.delay.factors(),
                interpolated: true,
            });
            return;
        }
        self.effects.push(Added {
            name: spec.name.to_owned(),
            parameters: parameters.to_vec(),
            channel: spec.channel.map(str::to_owned),
            reference: reference.or(self.calibrated_at.filter(|_| spec.calibrated)),
        });
        self.order_effects();
    }

    /// Sorts the effects into physical order: by place; within a place, by turn; in the flow, driving
    /// effects before resisting ones; then in the order of the catalogue, of the user's own effects, and of the
    /// base terms.
    pub(crate) fn order_effects(&mut self) {
        let order: Vec<_> = self.known().collect();
        let rank = |added: &Added| {
            let index = order.iter().position(|spec| spec.name == added.name)?;
            let spec = order[index];
            Some((spec.place, spec.turn, spec.resists, index))
        };
        self.effects.sort_by_key(rank);
    }
}
