//! Certificates: how far the records are from any model without an effect.

use super::judge::Judge;
use super::likelihood::{Weighed, errors, evidence, normal_equations, weighed};
use crate::data::Record;
use crate::fit::fit;
use crate::linalg::inverse_where_known;
use crate::model::Model;
use crate::noise::NoiseModel;
use crate::residual::NoiseSource;

/// Steps in the metric of the noise after least squares, and halvings of each.
const STEPS: usize = 8;
const HALVINGS: i32 = 8;

/// A model at its most likely parameters.
pub(crate) struct MostLikely {
    /// ln of the likelihood of all records, nats, but for a constant of the records.
    pub(crate) log_likelihood: f64,
    model: Model,
    records: Vec<Weighed>,
    samples: f64,
}

impl MostLikely {
    /// `model` with its parameters, and those of the noise, at the largest likelihood of all records: least squares, then steps of
    /// Gauss and Newton in the metric of the noise. `None` where it diverges.
    pub(crate) fn of(judge: &Judge, model: &Model) -> Option<Self> {
        let records = judge.scored_records();
        let mut best = Self::at(judge, model, &records)?;
        let all: Vec<&Record> = records.iter().collect();
        if let Ok(fitted) = fit(model, &all, &judge.options_for(model))
            && let Some(better) = Self::at(judge, &fitted.model, &records)
            && better.log_likelihood > best.log_likelihood
        {
            best = better;
        }
        for _ in 0..STEPS {
            let moved = best.stepped(judge);
            match moved.and_then(|moved| Self::at(judge, &moved, &records)) {
                Some(better) if better.log_likelihood > best.log_likelihood => best = better,
                _ => break,
            }
        }
        Some(best)
    }

    fn at(judge: &Judge, model: &Model, records: &[Record]) -> Option<Self> {
        let errors = errors(judge, model, records)?;
        let measured = judge.noise_source != NoiseSource::Scatter;
        let noise = NoiseModel::most_likely(&errors, measured);
        Some(Self {
            log_likelihood: noise.log_likelihood(&errors),
            model: model.clone(),
            records: weighed(records, &errors, &noise),
            samples: errors.iter().map(|e| e.residual.len() as f64).sum(),
        })
    }

    /// ln of the evidence, nats: parameters of the model at their priors, those of the noise at the price of BIC.
    pub(crate) fn evidence(&self, judge: &Judge) -> Option<f64> {
        let noise = 0.5 * NoiseModel::PARAMETERS as f64 * self.samples.max(1.0).ln();
        Some(evidence(judge, &self.model, &self.records)? - noise)
    }

    /// A step of Gauss and Newton, halved until the likelihood grows; `None` where it never does.
    fn stepped(&self, judge: &Judge) -> Option<Model> {
        let free = judge.free(&self.model);
        let normal = normal_equations(&self.model, &free, &self.records)?;
        let n = free.len();
        let (inverse, unknown) = inverse_where_known(&normal.information, n)?;
        let step = |i: usize| -> f64 {
            let known = (0..n).filter(|j| !unknown[i] && !unknown[*j]);
            known.map(|j| inverse[i * n + j] * normal.gradient[j]).sum()
        };
        let steps: Vec<f64> = (0..n).map(step).collect();
        let coordinates = self.model.coordinates();
        (0..HALVINGS).find_map(|halving| {
            let mut values = self.model.values();
            for (place, step) in free.iter().zip(&steps) {
                values[*place] += step * 0.5_f64.powi(halving);
                if let Some(parameter) = coordinates[*place].parameter() {
                    values[*place] = values[*place].clamp(parameter.low, parameter.high);
                }
            }
            let moved = self.model.with_values(&values);
            let each = self.records.iter().map(|one| one.log_likelihood(&moved));
            let likelihood = each.sum::<Option<f64>>()?;
            (likelihood > normal.log_likelihood).then_some(moved)
        })
    }
}
