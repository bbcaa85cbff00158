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
    /// Its unit.
    pub unit: String,
    /// Lower end of the 95 % confidence interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Estimates of an effect's parameters with 95 % intervals, of a fit in inner `units`.
pub(crate) fn estimates(
    fit: &Fit,
    spec: &Spec,
    units: &Units,
) -> BTreeMap<String, ParameterEstimate> {
    estimates_among(fit, &[], spec, units)
}

/// The same with the choice of the structure included: the scatter of the parameters over `alike`, models
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

/// Whether an effect's parameters are identifiable: the interval of its amplitude excludes 0, and each
/// positive parameter is known to within a factor.
pub(super) fn is_identified(fit: &Fit, spec: &Spec) -> bool {
    let values = fit.model.values();
    let amplitude = spec.amplitude.filter(|amplitude| amplitude.linear);
    own(&fit.model, spec).into_iter().all(|(index, card)| {
        let half = DEVIATES * fit.standard_error(index).unwrap_or(f64::INFINITY);
        if amplitude.is_some_and(|amplitude| amplitude.parameter == card.name) {
            values[index].abs() > half
        } else if card.is_logarithmic() && card.low < card.high {
            2.0 * half / values[index] <= RULES.identified.ln()
        } else {
            true
        }
    })
}

/// Whether the amplitude of an effect differs significantly from 0; `true` if its card has no linear amplitude.
pub(super) fn is_there(fit: &Fit, spec: &Spec) -> bool {
    let values = fit.model.values();
    let amplitude = spec.amplitude.filter(|amplitude| amplitude.linear);
    own(&fit.model, spec).into_iter().all(|(index, card)| {
        let half = DEVIATES * fit.standard_error(index).unwrap_or(0.0);
        amplitude.is_none_or(|amplitude| amplitude.parameter != card.name)
            || values[index].abs() > half
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

    /// Whether a vortex of gain 0.3 and decay time 30 ms counts as identified with these standard errors.
    fn known_to(gain: f64, decay: f64) -> bool {
        let vortex = spec("starting-vortex").expect("in the catalogue");
        let mut model = Model::default();
        model.add(vortex, &[0.3, 0.03], None);
        let at = |name: &str| {
            let coordinates = model.coordinates();
            coordinates
                .iter()
                .position(|c| c.name == name)
                .expect("a parameter")
        };
        let free = vec![at("starting-vortex.gain"), at("starting-vortex.decay_time")];
        let fit = Fit {
            model,
            sum_of_squares: 1.0,
            samples: 100,
            free,
            covariance: vec![gain * gain, 0.0, 0.0, decay * decay],
            iterations: 1,
            stop: FitStop::Converged,
        };
        is_identified(&fit, vortex)
    }

    #[test]
    fn an_amplitude_that_may_be_none_and_a_time_that_may_be_any_are_not_known() {
        assert!(known_to(0.1, 0.01));
        assert!(!known_to(0.2, 0.01));
        assert!(!known_to(0.1, 0.05));
    }
}
