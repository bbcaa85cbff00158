//! The effects that can be missing, as data.

use super::symptom::described;
use model_core::effect::{Place, Spec};
use model_core::effects::{LAWS, NUISANCES, SPECS};
use serde::Serialize;

/// An effect of the catalogue. Serialises to the keys of `effects --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectEntry {
    /// Name of the effect.
    pub name: &'static str,
    /// Place of the effect: `jet`, `delay`, `flow` or `sensor`.
    pub place: &'static str,
    /// The effect in one line.
    pub summary: &'static str,
    /// Equation of the effect.
    pub equation: &'static str,
    /// The measured channel that the effect needs, if any.
    pub channel: Option<&'static str>,
    /// Literature source.
    pub source: &'static str,
    /// The behaviour of the records that the effect describes.
    pub shows: Option<String>,
    /// The bench check that confirms the effect.
    pub check: Option<&'static str>,
    /// Candidates with a similar residual, and the measurement that distinguishes them.
    pub confused_with: Option<&'static str>,
    /// Whether the effect is a base term, which is never reported as missing.
    pub base: bool,
    /// Parameters of the effect.
    pub parameters: Vec<ParameterEntry>,
}

/// A parameter of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterEntry {
    /// Name of the parameter.
    pub name: &'static str,
    /// Unit of the parameter.
    pub unit: &'static str,
    /// Lower end of the searched range.
    pub low: f64,
    /// Upper end of the searched range.
    pub high: f64,
}

impl From<&'static Spec> for EffectEntry {
    fn from(spec: &'static Spec) -> Self {
        let parameters = spec.parameters.iter().map(|p| ParameterEntry {
            name: p.name,
            unit: p.unit.symbol(),
            low: p.low,
            high: p.high,
        });
        let [shows, check, confused_with] = described(spec.name);
        Self {
            shows: shows.map(|text| text.replace("{frequency}", "")),
            check,
            confused_with,
            base: spec.base,
            name: spec.name,
            place: match spec.place {
                Place::Jet => "jet",
                Place::Delay => "delay",
                Place::Flow => "flow",
                Place::Sensor => "sensor",
            },
            summary: spec.summary,
            equation: spec.equation,
            channel: spec.channel,
            source: spec.source,
            parameters: parameters.collect(),
        }
    }
}

/// Every effect of the catalogue.
#[must_use]
pub fn catalogue() -> Vec<EffectEntry> {
    SPECS.iter().map(EffectEntry::from).collect()
}

/// The base terms that `identify` may add, and the delay laws of base models.
#[must_use]
pub fn base_terms() -> Vec<EffectEntry> {
    let laws = LAWS.iter().filter(|law| law.base);
    NUISANCES
        .into_iter()
        .chain(laws)
        .map(EffectEntry::from)
        .collect()
}
