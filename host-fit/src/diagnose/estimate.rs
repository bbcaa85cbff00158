//! Fitted parameters as they are reported.

use super::RULES;
use crate::fit::Fit;
use crate::model::Model;
use crate::terms::Units;
use model_core::effect::{Parameter, Spec};
use serde::Serialize;
use std::collections::BTreeMap;

/// Half width of a 95 % interval in standard errors.
const DEVIATES: f64 = 1.96;

/// A fitted physical parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterEstimate {
    /// The estimate.
    pub value: f64,
    /// Unit of the estimate.
    pub unit: String,
    /// Lower end of the 95 % confidence interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the records determine the parameter: the interval is finite and does not cover the whole range of the
    /// parameter.
    #[serde(skip)]
    pub determined: bool,
}

/// Estimates of an effect's parameters with 95 % intervals, of a fit in inner `units`.
pub(super) fn estimates(
    fit: &Fit,
    spec: &Spec,
    units: &Units,
) -> BTreeMap<String, ParameterEstimate> {
    estimates_among(fit, &[], spec, units)
}

/// [`estimates`] with the uncertainty of the choice of structure: the scatter of the parameters over `alike`, models
/// with the same effects and an equivalent validation error, is added to the variance.
pub(crate) fn estimates_among(
    fit: &Fit,
    alike: &[&Model],
    spec: &Spec,
    units: &Units,
) -> BTreeMap<String, ParameterEstimate> {
    let values = fit.model.values();
    let coordinates = fit.model.coordinates();
    let own = own(&fit.model, spec).into_iter();
    own.map(|(index, parameter)| {
        let value = values[index];
        let own = fit.standard_error(index).unwrap_or(f64::INFINITY);
        let of = |model: &&Model| {
            let others = model.coordinates();
            let at = others
                .iter()
                .position(|other| other.name == coordinates[index].name)?;
            Some((model.values()[at] - value).powi(2))
        };
        let apart: Vec<f64> = alike.iter().filter_map(of).collect();
        let between = apart.iter().sum::<f64>() / (apart.len() + 1) as f64;
        let half = DEVIATES * (own * own + between).sqrt();
        let (low, high) = if parameter.is_logarithmic() {
            let factor = (half / value).exp();
            (value / factor, value * factor)
        } else {
            (value - half, value + half)
        };
        let out = |value: f64| units.value_out(parameter.unit, value);
        let covers = low <= parameter.low && high >= parameter.high;
        let estimate = ParameterEstimate {
            value: out(value),
            unit: parameter.unit.symbol().to_owned(),
            low: out(low.max(parameter.low.min(value))),
            high: out(high.min(parameter.high.max(value))),
            determined: half.is_finite() && !covers,
        };
        (parameter.name.to_owned(), estimate)
    })
    .collect()
}

/// Whether these intervals identify an effect. The interval of the amplitude must exclude 0. The interval of a
/// parameter that must be below another parameter must exclude the value of that parameter. The interval of at least
/// one positive parameter must be narrower than a factor. Two parameters may be correlated, for example those of King's
/// law; then only a combination of them is identifiable.
pub(super) fn is_identified(estimates: &BTreeMap<String, ParameterEstimate>, spec: &Spec) -> bool {
    let amplitude = spec.amplitude.filter(|amplitude| amplitude.linear);
    let amplitude = amplitude.and_then(|amplitude| estimates.get(amplitude.parameter));
    let cards = spec.parameters.iter().filter(|card| card.is_logarithmic());
    let mut spans = cards
        .filter_map(|card| estimates.get(card.name))
        .filter(|one| one.low < one.high)
        .map(|one| one.high / one.low);
    let least = spans.next().map(|first| spans.fold(first, f64::min));
    let separate = spec.parameters.iter().all(|card| {
        let other = card.below.and_then(|other| estimates.get(other));
        let pair = estimates.get(card.name).zip(other);
        pair.is_none_or(|(own, other)| own.high < other.value)
    });
    separate
        && amplitude.is_none_or(|one| one.low > 0.0 || one.high < 0.0)
        && least.is_none_or(|least| least < RULES.identified)
}

/// An effect's parameters with their indices among the coordinates of a model.
fn own(model: &Model, spec: &Spec) -> Vec<(usize, &'static Parameter)> {
    let coordinates = model.coordinates();
    let place = |parameter: &'static Parameter| {
        let name = format!("{}.{}", spec.name, parameter.name);
        let index = coordinates.iter().position(|own| own.name == name)?;
        Some((index, parameter))
    };
    spec.parameters.iter().filter_map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::effects::spec;

    /// Whether an effect with these parameters and intervals counts as identified.
    fn known_to(name: &str, intervals: &[(&str, f64, f64, f64)]) -> bool {
        let estimate = |&(name, low, value, high): &(&str, f64, f64, f64)| {
            let unit = String::new();
            let estimate = ParameterEstimate {
                value,
                unit,
                low,
                high,
                determined: true,
            };
            (name.to_owned(), estimate)
        };
        let effect = spec(name).expect("in the catalogue");
        is_identified(&intervals.iter().map(estimate).collect(), effect)
    }

    #[test]
    fn an_amplitude_that_may_be_none_and_a_time_that_may_be_any_are_not_known() {
        let known = |low, high, longest| {
            let gain = ("gain", low, 0.3, high);
            known_to(
                "starting-vortex",
                &[gain, ("decay_time", 0.02, 0.03, longest)],
            )
        };
        assert!(known(0.1, 0.5, 0.05));
        assert!(!known(-0.1, 0.7, 0.05));
        assert!(!known(0.1, 0.5, 3.0));
    }

    /// A relay that never switches back in the records has no hysteresis there.
    #[test]
    fn a_lower_threshold_that_may_be_the_upper_one_is_not_known() {
        let known = |highest| {
            let intervals = [
                ("gain", 0.2, 0.3, 0.4),
                ("lower_threshold", 0.1, 0.15, highest),
                ("upper_threshold", 0.35, 0.4, 0.45),
            ];
            known_to("attachment-hysteresis", &intervals)
        };
        assert!(known(0.2));
        assert!(!known(0.5));
    }

    /// The ratio and the offset of King's law are correlated, therefore it is enough if one of them
    /// is known.
    #[test]
    fn one_known_parameter_of_two_identifies_an_effect() {
        let known = |ratio: f64, offset: f64| {
            let interval =
                |name, value: f64, factor: f64| (name, value / factor, value, value * factor);
            let both = [
                interval("king_ratio", 1.5, ratio),
                interval("king_offset", 0.2, offset),
            ];
            known_to("hot-film-nonlinearity", &both)
        };
        assert!(known(20.0, 1.2));
        assert!(known(1.5, 20.0));
        assert!(!known(20.0, 20.0));
    }
}
