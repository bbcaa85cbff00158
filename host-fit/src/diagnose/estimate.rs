//! Fitted parameters as they are reported.

use crate::fit::Fit;
use crate::model::Model;
use crate::terms::Units;
use model_core::effect::Spec;
use serde::Serialize;
use std::collections::BTreeMap;

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

/// The same with the choice of lags and of jet response in the intervals: by how much the
/// parameters differ in `alike`, models that do as well with the same effects, adds to the variance.
pub(crate) fn estimates_among(
    fit: &Fit,
    alike: &[&Model],
    spec: &Spec,
    units: &Units,
) -> BTreeMap<String, ParameterEstimate> {
    let values = fit.model.values();
    let coordinates = fit.model.coordinates();
    let own = coordinates
        .iter()
        .enumerate()
        .filter_map(|(index, coordinate)| {
            let parameter = coordinate.parameter()?;
            let of_spec = coordinate.name == format!("{}.{}", spec.name, parameter.name);
            of_spec.then_some((index, parameter))
        });
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
        let half = 1.96 * (own * own + between).sqrt();
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
