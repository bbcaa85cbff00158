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
        let estimate = ParameterEstimate {
            value: out(value),
            unit: parameter.unit.symbol().to_owned(),
            low: out(low.max(parameter.low.min(value))),
            high: out(high.min(parameter.high.max(value))),
        };
        (parameter.name.to_owned(), estimate)
    })
    .collect()
}

/// Whether the records identify an effect: the interval of its amplitude excludes 0, and the interval of at least
/// one positive parameter is narrower than a factor. Two parameters may be correlated, for example those of King's
/// law; then only a combination of them is identifiable.
pub(super) fn is_identified(fit: &Fit, spec: &Spec) -> bool {
    let values = fit.model.values();
    let mut spans = own(&fit.model, spec)
        .into_iter()
        .filter_map(|(index, card)| {
            let half = DEVIATES * fit.standard_error(index).unwrap_or(f64::INFINITY);
            (card.is_logarithmic() && card.low < card.high).then(|| 2.0 * half / values[index])
        });
    let least = spans.next().map(|first| spans.fold(first, f64::min));
    excludes_zero(fit, spec) && least.is_none_or(|least| least <= RULES.identified.ln())
}

/// Whether the interval of an effect's linear amplitude, if it has one, excludes 0.
fn excludes_zero(fit: &Fit, spec: &Spec) -> bool {
    let Some(amplitude) = spec.amplitude.filter(|amplitude| amplitude.linear) else {
        return true;
    };
    let mut own = own(&fit.model, spec).into_iter();
    let place = own.find(|(_, card)| amplitude.parameter == card.name);
    place.is_none_or(|(index, _)| {
        let half = DEVIATES * fit.standard_error(index).unwrap_or(f64::INFINITY);
        fit.model.values()[index].abs() > half
    })
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
    use crate::fit::FitStop;
    use model_core::effects::spec;

    /// Whether an effect with these values counts as identified with these standard errors.
    fn known_to(name: &str, values: &[f64], errors: &[f64]) -> bool {
        let effect = spec(name).expect("in the catalogue");
        let mut model = Model::default();
        model.add(effect, values, Some(1.0));
        let places: Vec<(usize, &Parameter)> = own(&model, effect);
        let count = errors.len();
        let mut covariance = vec![0.0; count * count];
        for (at, error) in errors.iter().enumerate() {
            covariance[at * count + at] = error * error;
        }
        let fit = Fit {
            free: places.iter().map(|(index, _)| *index).collect(),
            model,
            sum_of_squares: 1.0,
            samples: 100,
            covariance,
            iterations: 1,
            stop: FitStop::Converged,
        };
        is_identified(&fit, effect)
    }

    #[test]
    fn an_amplitude_that_may_be_none_and_a_time_that_may_be_any_are_not_known() {
        let known = |gain, decay| known_to("starting-vortex", &[0.3, 0.03], &[gain, decay]);
        assert!(known(0.1, 0.01));
        assert!(!known(0.2, 0.01));
        assert!(!known(0.1, 0.05));
    }

    /// Ratio and offset of King's law are correlated: one of them is enough.
    #[test]
    fn one_known_parameter_of_two_identifies_an_effect() {
        let known =
            |ratio, offset| known_to("hot-film-nonlinearity", &[1.5, 0.2], &[ratio, offset]);
        assert!(known(2.4, 0.04));
        assert!(known(0.3, 0.4));
        assert!(!known(2.4, 0.4));
    }
}
