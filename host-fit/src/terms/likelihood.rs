//! Likelihood and evidence of models under the noise model.

use super::judge::Judge;
use crate::data::Record;
use crate::fit::sensitivities;
use crate::model::{Coordinate, Model};
use crate::noise::{Metric, NoiseModel, Series, Whitened};
use crate::parallel;
use crate::residual::{NoiseSource, noise_floor};
use numerics::linalg::{dot, inverse_where_known, symmetric_eigenvalues};

/// The range of a parameter in standard deviations of its prior.
const RANGE: f64 = 4.0;

/// Variances below this share of their mean are raised to it: a standard error of 0 comes from too few
/// repeats.
const LEAST_VARIANCE: f64 = 1e-4;

/// A record and the metric (inverse noise covariance) of its scored samples.
pub(super) struct Weighed {
    record: Record,
    metric: Metric,
}

impl Weighed {
    /// ln of the likelihood of a model, nats; `None` if its free run diverges.
    pub(super) fn log_likelihood(&self, model: &Model) -> Option<f64> {
        let run = model.free_run(&self.record).ok()?;
        Some(self.metric.log_likelihood(&residual(&self.record, &run)))
    }
}

/// Errors of a model over records and their noise variance; `None` if the free run diverges.
pub(super) fn errors(judge: &Judge, model: &Model, records: &[Record]) -> Option<Vec<Series>> {
    let measured: Vec<Vec<f64>> = records.iter().map(|r| r.y.clone()).collect();
    let (variances, _) = noise_floor(&records.iter().collect::<Vec<_>>(), &measured);
    let each = records.iter().zip(variances).map(|(record, variance)| {
        let run = model.free_run(record).ok()?;
        Some(Series {
            residual: residual(record, &run),
            variance: scored_variance(judge, record, &variance),
            run: scored(record, &run).to_vec(),
        })
    });
    each.collect()
}

/// Records in the metric of `noise`, with the `errors` of a model over them.
pub(super) fn weighed(records: &[Record], errors: &[Series], noise: &NoiseModel) -> Vec<Weighed> {
    let each = records.iter().zip(errors);
    each.map(|(record, error)| Weighed {
        record: record.clone(),
        metric: noise.metric(&error.variance, &error.run),
    })
    .collect()
}

/// The noise model estimated from a good model's residual, and the likelihoods of other models under it.
pub(crate) struct Likelihood<'a> {
    judge: &'a Judge,
    records: Vec<Weighed>,
}

impl<'a> Likelihood<'a> {
    /// The noise model from the residual of `good`; `None` if its free run diverges.
    pub(crate) fn of(judge: &'a Judge, good: &Model) -> Option<Self> {
        let records = judge.scored_records();
        let errors = errors(judge, good, &records)?;
        let noise = NoiseModel::of(&errors, judge.noise_source != NoiseSource::Scatter);
        Some(Self {
            judge,
            records: weighed(&records, &errors, &noise),
        })
    }

    /// ln of the evidence for a fitted model, nats; see [`evidence`].
    pub(crate) fn evidence(&self, model: &Model) -> Option<f64> {
        evidence(self.judge, model, &self.records)
    }
}

/// ln of the evidence of `records` for a fitted model, nats, by Laplace's approximation: the likelihood times
/// the share of the prior volume that the data leave. `None` if the free run or a derivative of it diverges. Coordinates that act
/// in steps have no derivative and no penalty.
///
/// ln Z = ℓ(θ̂) + ½ gᵀH⁻¹g − ½ ‖θ̂ − μ‖²_Λ + ½ ln|Λ| − ½ ln|H| with H = JᵀΣ⁻¹J + Λ and g = JᵀΣ⁻¹r − Λ(θ̂ − μ), since θ̂
/// is the least-squares estimate. Priors are normal: the range of a parameter is four standard deviations, of its
/// logarithm for times and frequencies; priors of coefficients have size 1.
pub(super) fn evidence(judge: &Judge, model: &Model, records: &[Weighed]) -> Option<f64> {
    let free = judge.free(model);
    let all = model.coordinates();
    let values = model.values();
    let priors: Vec<Prior> = free
        .iter()
        .map(|i| Prior::of(all.get(*i)?, *values.get(*i)?))
        .collect::<Option<_>>()?;
    let normal = normal_equations(model, &free, records)?;
    let n = free.len();
    // In units of the prior's standard deviation, Λ = 1.
    let deviation: Vec<f64> = priors.iter().map(|prior| prior.deviation).collect();
    let information: Vec<f64> = (0..n * n)
        .map(|at| {
            let (i, j) = (at / n, at % n);
            let unit = if i == j { 1.0 } else { 0.0 };
            unit + normal.information[at] * deviation[i] * deviation[j]
        })
        .collect();
    let gradient: Vec<f64> = (0..n)
        .map(|i| normal.gradient[i] * deviation[i] - priors[i].off)
        .collect();
    let (inverse, _) = inverse_where_known(&information, n)?;
    let to_the_top: f64 = (0..n)
        .map(|i| gradient[i] * dot(&inverse[i * n..(i + 1) * n], &gradient))
        .sum();
    let eigenvalues = symmetric_eigenvalues(&information, n)?;
    let occam: f64 = eigenvalues.iter().map(|e| e.max(1.0).ln()).sum();
    let off: f64 = priors.iter().map(|prior| prior.off * prior.off).sum();
    let evidence = normal.log_likelihood + 0.5 * (to_the_top - off - occam);
    evidence.is_finite().then_some(evidence)
}

/// Normal equations of `model` over these records for the coordinates with the indices `free`.
pub(super) fn normal_equations(
    model: &Model,
    free: &[usize],
    records: &[Weighed],
) -> Option<NormalEquations> {
    let n = free.len();
    let each = parallel::all(records, |Weighed { record, metric }| {
        let (run, columns) = sensitivities(model, record, free)?;
        let whitened = columns.iter().map(|c| metric.whiten(scored(record, c)));
        let columns: Vec<Whitened> = whitened.collect();
        let mut information = vec![0.0; n * n];
        for (i, column) in columns.iter().enumerate() {
            for (j, product) in column.dots(&columns[..=i]).into_iter().enumerate() {
                information[i * n + j] = product;
                information[j * n + i] = product;
            }
        }
        let residual = residual(record, &run);
        let own = metric.whiten(&residual);
        Some(NormalEquations {
            log_likelihood: metric.log_likelihood(&residual),
            gradient: own.dots(&columns),
            information,
        })
    })?;
    let mut sum = NormalEquations {
        log_likelihood: 0.0,
        gradient: vec![0.0; n],
        information: vec![0.0; n * n],
    };
    for one in each {
        sum.log_likelihood += one.log_likelihood;
        let add = |all: &mut [f64], own: &[f64]| {
            all.iter_mut().zip(own).for_each(|(a, b)| *a += b);
        };
        add(&mut sum.gradient, &one.gradient);
        add(&mut sum.information, &one.information);
    }
    Some(sum)
}

/// ℓ, Jᵀ Σ⁻¹ r and Jᵀ Σ⁻¹ J.
pub(super) struct NormalEquations {
    pub(super) log_likelihood: f64,
    pub(super) gradient: Vec<f64>,
    pub(super) information: Vec<f64>,
}

/// The prior of one coordinate.
struct Prior {
    /// Standard deviation in the coordinate's own unit, at its present value.
    deviation: f64,
    /// Distance of the value from the prior mean, standard deviations.
    off: f64,
}

impl Prior {
    fn of(coordinate: &Coordinate, value: f64) -> Option<Self> {
        let Some(parameter) = coordinate.parameter() else {
            return Some(Self {
                deviation: 1.0,
                off: value,
            });
        };
        let (low, high) = (parameter.low, parameter.high);
        let prior = if parameter.is_logarithmic() && value > 0.0 && low > 0.0 {
            let deviation = (high / low).ln() / RANGE;
            Self {
                deviation: deviation * value,
                off: (value / (low * high).sqrt()).ln() / deviation,
            }
        } else {
            let deviation = (high - low) / RANGE;
            Self {
                deviation,
                off: (value - 0.5 * (low + high)) / deviation,
            }
        };
        (prior.deviation > 0.0 && prior.off.is_finite()).then_some(prior)
    }
}

/// The scored part of a series of the record.
fn scored<'s>(record: &Record, series: &'s [f64]) -> &'s [f64] {
    series.get(record.lead..).unwrap_or(&[])
}

/// Measurement minus simulation on the scored samples.
fn residual(record: &Record, run: &[f64]) -> Vec<f64> {
    let pairs = scored(record, &record.y).iter().zip(scored(record, run));
    pairs.map(|(y, sim)| y - sim).collect()
}

/// Noise variances of the scored samples without the scatter of the level; all above 0.
fn scored_variance(judge: &Judge, record: &Record, variance: &[f64]) -> Vec<f64> {
    let mut own = scored(record, variance).to_vec();
    if let Some(scatter) = &judge.options.level_scatter {
        scatter.take_from(&mut own, scored(record, &record.y));
    }
    let mean = own.iter().sum::<f64>() / own.len().max(1) as f64;
    let least = (LEAST_VARIANCE * mean).max(f64::MIN_POSITIVE);
    own.iter_mut().for_each(|v| *v = v.max(least));
    own
}

#[cfg(test)]
mod tests {
    use super::super::certificate::{MostLikely, log_e};
    use super::*;
    use crate::data::Use;
    use crate::fit::FitOptions;
    use crate::model::Delay;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn model(a: &[f64], c: f64) -> Model {
        Model {
            state_lags: (1..=a.len() as u16).collect(),
            a: a.to_vec(),
            b: vec![0.03],
            product_lags: vec![1],
            c: vec![c],
            delay: Delay::Fixed { delays: vec![20] },
            ..Model::default()
        }
    }

    /// Records of a bilinear flow with noise of correlation time eight samples.
    fn records(seed: u64) -> Vec<Record> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let record = |half: usize| {
            let n = 3000;
            let u: Vec<f64> = (0..n)
                .map(|k| f64::from(u8::from(k / half % 2 == 1)))
                .collect();
            let mut record = Record::new("r", Use::Identify, 0.001, u, vec![1.0; n]);
            let run = model(&[0.97], -0.01).free_run(&record).expect("stable");
            let mut noise = 0.0;
            record.y = run
                .iter()
                .map(|y| {
                    noise = 0.88 * noise + rng.random_range(-0.01..0.01);
                    y + noise
                })
                .collect();
            record.y_sd = Some(vec![0.0122; n]);
            record
        };
        [70, 110, 170].map(record).into()
    }

    /// The true structure has far more evidence than one without its product, and more than one with a
    /// superfluous lag, which fits equally well.
    #[test]
    fn evidence_is_for_the_true_structure() {
        let judge = Judge::new(&records(2), None, FitOptions::default()).expect("records");
        let fitted = |start: Model| judge.refitted(&start).expect("stable").model().clone();
        let truth = fitted(model(&[0.97], -0.01));
        let linear = fitted(Model {
            product_lags: Vec::new(),
            c: Vec::new(),
            ..model(&[0.97], 0.0)
        });
        let needless = fitted(model(&[0.97, 0.001], -0.01));
        let likelihood = Likelihood::of(&judge, &truth).expect("stable");
        let [truth, linear, needless] =
            [truth, linear, needless].map(|m| likelihood.evidence(&m).expect("stable"));
        assert!(truth > linear + 100.0, "{truth} {linear}");
        assert!(
            truth > needless && truth < needless + 30.0,
            "{truth} {needless}"
        );
    }

    /// A lag that is not in the plant is never certified; the product that is there always is. Terms common to both
    /// models do not reduce the evidence.
    #[test]
    fn certificates_are_of_what_is_there() {
        for seed in 0..4 {
            let judge = Judge::new(&records(seed), None, FitOptions::default()).expect("records");
            let likely = |model: Model| MostLikely::of(&judge, &model).expect("stable");
            let truth = likely(model(&[0.97], -0.01));
            let linear = likely(Model {
                product_lags: Vec::new(),
                c: Vec::new(),
                ..model(&[0.97], 0.0)
            });
            let needless = likely(model(&[0.97, 0.001], -0.01));
            let log_e = |with: &MostLikely, without: &MostLikely| {
                let of = |model: &MostLikely| model.evidence(&judge).expect("stable");
                log_e(of(with), of(without), 1)
            };
            assert!(log_e(&truth, &linear) > 100.0, "{seed}");
            assert!(log_e(&needless, &truth) < 0.0, "{seed}");
            assert_eq!(log_e(&truth, &truth), 0.0);
        }
    }
}
