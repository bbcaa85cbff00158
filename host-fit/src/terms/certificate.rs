//! Certificates: comparison with the most likely models that lack an effect.

use super::judge::Judge;
use super::likelihood::{Weighed, errors, evidence, normal_equations, weighed};
use crate::data::Record;
use crate::fit::fit;
use crate::model::Model;
use crate::noise::NoiseModel;
use crate::residual::NoiseSource;
use numerics::linalg::inverse_where_known;

/// Number of Gauss–Newton steps in the metric of the noise after least squares, and of halvings of each step.
const STEPS: usize = 8;
const HALVINGS: i32 = 8;

/// ln of the e-value of a model with this `evidence` (ln, nats) against the evidence `without` the tested effect,
/// the best of this many `tried` models (theory 4.5).
pub(crate) fn log_e(evidence: f64, without: f64, tried: usize) -> f64 {
    evidence - without - (tried.max(1) as f64).ln()
}

/// Upper bound of the p-value: the inverse of the e-value, by Markov's inequality.
pub(crate) fn p_of(log_e: f64) -> f64 {
    (-log_e).exp().clamp(f64::MIN_POSITIVE, 1.0)
}

/// A model at its maximum-likelihood parameters.
pub(crate) struct MostLikely {
    /// ln of the likelihood of all records up to a constant of the records, nats.
    pub(crate) log_likelihood: f64,
    model: Model,
    noise: NoiseModel,
    records: Vec<Weighed>,
    samples: f64,
}

impl MostLikely {
    /// Maximum likelihood of `model` and noise parameters over all records: least squares, then Gauss–Newton
    /// steps in the metric of the noise. `None` if the free run diverges.
    pub(crate) fn of(judge: &Judge, model: &Model) -> Option<Self> {
        let records = judge.scored_records();
        let mut best = Self::at(judge, model, &records, None)?;
        let all: Vec<&Record> = records.iter().collect();
        if let Ok(fitted) = fit(model, &all, &judge.options_for(model))
            && let Some(better) = Self::at(judge, &fitted.model, &records, Some(&best.noise))
            && better.log_likelihood > best.log_likelihood
        {
            best = better;
        }
        for _ in 0..STEPS {
            let at = |moved: Model| Self::at(judge, &moved, &records, Some(&best.noise));
            match best.stepped(judge).and_then(at) {
                Some(better) if better.log_likelihood > best.log_likelihood => best = better,
                _ => break,
            }
        }
        Some(best)
    }

    /// `model` with unchanged parameters and the most likely noise; its colour is searched near that of a `similar`
    /// model.
    fn at(
        judge: &Judge,
        model: &Model,
        records: &[Record],
        similar: Option<&NoiseModel>,
    ) -> Option<Self> {
        let errors = errors(judge, model, records)?;
        let measured = judge.noise_source != NoiseSource::Scatter;
        let noise = NoiseModel::most_likely(&errors, measured, similar);
        Some(Self {
            log_likelihood: noise.log_likelihood(&errors),
            model: model.clone(),
            records: weighed(records, &errors, &noise),
            samples: errors.iter().map(|e| e.residual.len() as f64).sum(),
            noise,
        })
    }

    /// ln of the evidence, nats: model parameters by their priors, noise parameters by the BIC penalty.
    pub(crate) fn evidence(&self, judge: &Judge) -> Option<f64> {
        let noise = 0.5 * NoiseModel::PARAMETERS as f64 * self.samples.max(1.0).ln();
        Some(evidence(judge, &self.model, &self.records)? - noise)
    }

    /// A Gauss–Newton step, halved until the likelihood increases; `None` if no step length increases it.
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
