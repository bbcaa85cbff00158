//! What would have been seen, had it been there: the amplitude of each effect
//! that the held-out records show with 80 % power.
//!
//! X = (1.96 + 0.84)·s/‖z_p‖ with z_p the change of the free run per amplitude
//! after projecting out what the base model's own parameters can imitate, and s
//! the error's size with its correlation in time (theory 4.2).

use crate::data::{Record, Use};
use crate::dual::Dual;
use crate::fit::channel_reference;
use crate::linalg::{dot, take_away};
use crate::model::{Delay, Model, Rounding};
use crate::picture::significant;
use crate::rules;
use crate::simulate::{Signals, SimulateError, Simulator};
use model_core::Output;
use model_core::effect::{Parameter, Spec};
use model_core::effects::SPECS;
use rayon::prelude::*;
use serde::Serialize;
use std::ops::ControlFlow;

rules! {
    /// Which amplitude of an effect would have been seen.
    pub struct Rules in "power";

    /// What is seen stands this far above its own uncertainty.
    deviations: f64 = 1.96 + 0.84, "standard deviations", "convention: two-sided 5 % and 80 % power; held by `twice_the_amplitude_is_seen_and_a_third_is_not`";
    /// Longest correlation of the error that is looked at.
    memory_s: f64 = 0.15, "s", "judgement: seven correlation times of the simulated hot film";
    /// An effect that is not linear in its amplitude is probed this often, ever nearer to the amplitude that comes out.
    probes: usize = 3, "", "judgement";
}

/// Derivatives carried by one run.
const CHUNK: usize = 8;

/// The smallest amplitude that would have been seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Detectable {
    /// The effect.
    pub effect: String,
    /// The parameter that is its amplitude.
    pub parameter: String,
    /// The amplitude's unit.
    pub unit: String,
    /// The amplitude that is seen with 80 % power; none if no amplitude in the
    /// parameter's range is.
    pub amplitude: Option<f64>,
    /// The same in words.
    pub words: String,
}

/// For each effect of the catalogue that has an amplitude, is not in the model
/// and whose channel is there: the amplitude that would have been seen on the
/// held-out records (on all records if none is held out). The effect's other
/// parameters are at the middle of the catalogue's starting values.
///
/// # Errors
/// A missing channel of the model's own, or a free run that diverges.
pub fn detectable(model: &Model, records: &[Record]) -> Result<Vec<Detectable>, SimulateError> {
    let held_out: Vec<&Record> = records.iter().filter(|r| r.role == Use::Validate).collect();
    let judged: Vec<&Record> = if held_out.is_empty() {
        records.iter().collect()
    } else {
        held_out
    };
    let runs: Result<Vec<Vec<f64>>, SimulateError> =
        judged.iter().map(|r| model.free_run(r)).collect();
    let bench = Detector::new(model, &judged, runs?)?;
    let present = model.effect_names();
    let found: Vec<Option<Detectable>> = SPECS
        .par_iter()
        .filter(|spec| !present.iter().any(|name| name == spec.name))
        .filter(|spec| channel_reference(spec, &judged).is_ok())
        .map(|spec| bench.smallest(spec))
        .collect();
    Ok(found.into_iter().flatten().collect())
}

struct Detector<'a> {
    model: &'a Model,
    records: &'a [&'a Record],
    runs: Vec<Vec<f64>>,
    /// Orthonormal directions that the model's own parameters imitate.
    imitated: Vec<Vec<f64>>,
    /// Autocovariance of the error by lag.
    covariance: Vec<f64>,
    /// First samples of the records, in the joined series.
    starts: Vec<usize>,
}

impl<'a> Detector<'a> {
    fn new(
        model: &'a Model,
        records: &'a [&'a Record],
        runs: Vec<Vec<f64>>,
    ) -> Result<Self, SimulateError> {
        let skip = model.warm_up();
        let mut starts = vec![0];
        let mut errors = Vec::new();
        for (record, run) in records.iter().zip(&runs) {
            let e: Vec<f64> = record
                .y
                .iter()
                .zip(run)
                .skip(skip)
                .map(|(y, s)| y - s)
                .collect();
            starts.push(starts.last().copied().unwrap_or(0) + e.len());
            errors.push(e);
        }
        let period = records.first().map_or(1.0, |r| r.sample_period_s);
        let lags = (RULES.memory_s / period).round().clamp(1.0, 1000.0) as usize;
        let n = starts.last().copied().unwrap_or(0).max(1) as f64;
        let covariance = (0..lags)
            .map(|lag| {
                let sum: f64 = errors
                    .iter()
                    .map(|e| dot(&e[lag.min(e.len())..], &e[..e.len().saturating_sub(lag)]))
                    .sum();
                // Bartlett's weights keep the variance above 0.
                sum / n * (1.0 - lag as f64 / lags as f64)
            })
            .collect();
        let mut bench = Self {
            model,
            records,
            runs,
            imitated: Vec::new(),
            covariance,
            starts,
        };
        bench.imitated = orthonormal(bench.jacobian()?);
        Ok(bench)
    }

    /// Judged samples of all records, joined.
    fn joined(&self, series: &[Vec<f64>]) -> Vec<f64> {
        let skip = self.model.warm_up();
        series
            .iter()
            .flat_map(|s| s.iter().skip(skip))
            .copied()
            .collect()
    }

    /// Derivatives of the free run by the model's parameters and fixed delays.
    fn jacobian(&self) -> Result<Vec<Vec<f64>>, SimulateError> {
        let values = self.model.values();
        // d is left out where the model has none.
        let first = usize::from(self.model.constant == 0.0);
        let mut columns = Vec::new();
        let indices: Vec<usize> = (first..values.len()).collect();
        for chunk in indices.chunks(CHUNK) {
            let mut duals: Vec<Dual<CHUNK>> = values.iter().map(|v| Dual::constant(*v)).collect();
            for (slot, index) in chunk.iter().enumerate() {
                duals[*index] = Dual::parameter(values[*index], slot);
            }
            let simulator = Simulator::with_values(self.model, &duals, Rounding::None);
            let mut slopes = vec![Vec::new(); chunk.len()];
            for record in self.records {
                let signals = Signals::of(self.model, record)?;
                let mut own = vec![vec![0.0; record.len()]; chunk.len()];
                simulator.run(&signals, |k, output: &Output<Dual<CHUNK>>| {
                    for (slot, column) in own.iter_mut().enumerate() {
                        column[k] = output.measured.partials[slot];
                    }
                    ControlFlow::Continue(())
                });
                for (column, own) in slopes.iter_mut().zip(own) {
                    column.push(own);
                }
            }
            columns.extend(slopes.iter().map(|series| self.joined(series)));
        }
        if let Delay::Fixed { delays } = &self.model.delay {
            for l in 0..delays.len() {
                let shifted = |by: i32| {
                    let mut delays = delays.clone();
                    delays[l] = (i32::from(delays[l]) + by).clamp(0, i32::from(u16::MAX)) as u16;
                    let model = Model {
                        delay: Delay::Fixed { delays },
                        ..self.model.clone()
                    };
                    self.records
                        .iter()
                        .map(|r| model.free_run(r))
                        .collect::<Result<Vec<_>, _>>()
                };
                let (later, sooner) = (self.joined(&shifted(1)?), self.joined(&shifted(-1)?));
                columns.push(later.iter().zip(&sooner).map(|(a, b)| a - b).collect());
            }
        }
        Ok(columns)
    }

    fn smallest(&self, spec: &'static Spec) -> Option<Detectable> {
        let card = spec.amplitude?;
        let index = spec.parameter(card.parameter)?;
        let parameter = &spec.parameters[index];
        let middle = |p: &Parameter| p.starts.get(p.starts.len() / 2).copied();
        let mut parameters: Vec<f64> = spec.parameters.iter().map(middle).collect::<Option<_>>()?;
        let set = |parameters: &mut Vec<f64>, value: f64| {
            if card.together {
                parameters.fill(value);
            } else {
                parameters[index] = value;
            }
        };
        let first = parameters[index];
        set(&mut parameters, first);
        let mut found = None;
        for _ in 0..RULES.probes {
            let seen = self.seen(spec, &parameters, parameters[index].abs());
            found = seen;
            let Some(x) = seen else { break };
            let next = x.clamp(parameter.low.max(1e-9 * parameter.high), parameter.high);
            set(&mut parameters, next);
        }
        let amplitude = found.filter(|x| *x <= parameter.high);
        parameters[index] = amplitude.unwrap_or(0.0);
        let (value, unit) = match card.said {
            Some(said) => said(&parameters),
            None => parameter.unit.spoken(parameters[index]),
        };
        let words = match amplitude {
            Some(_) => format!(
                "{} above {} {unit} would have been seen",
                card.words,
                significant(value, 2)
            ),
            None => format!("{} of any size could have stayed unseen", card.words),
        };
        Some(Detectable {
            effect: spec.name.to_owned(),
            parameter: parameter.name.to_owned(),
            unit: parameter.unit.to_string(),
            amplitude,
            words,
        })
    }

    /// The amplitude seen with 80 % power, from the change that `parameters` make.
    fn seen(&self, spec: &'static Spec, parameters: &[f64], size: f64) -> Option<f64> {
        let mut model = self.model.clone();
        let reference = channel_reference(spec, self.records).ok()?;
        model.add(spec, parameters, reference);
        let with: Option<Vec<Vec<f64>>> = self
            .records
            .iter()
            .map(|r| model.free_run(r).ok())
            .collect();
        let (with, without) = (self.joined(&with?), self.joined(&self.runs));
        let mut z: Vec<f64> = with
            .iter()
            .zip(&without)
            .map(|(a, b)| (a - b) / size)
            .collect();
        for direction in &self.imitated {
            take_away(direction, &mut z);
        }
        let norm = dot(&z, &z).sqrt();
        // Σ_l γ(l)·Σ_k z_k z_{k+l}/‖z‖²: the variance of the error seen through z.
        let mut variance = 0.0;
        for (lag, covariance) in self.covariance.iter().enumerate() {
            let both = if lag == 0 { 1.0 } else { 2.0 };
            let products: f64 = self
                .starts
                .windows(2)
                .map(|ends| {
                    let z = &z[ends[0]..ends[1]];
                    dot(&z[lag.min(z.len())..], &z[..z.len().saturating_sub(lag)])
                })
                .sum();
            variance += both * covariance * products / (norm * norm);
        }
        let x = RULES.deviations * variance.max(0.0).sqrt() / norm;
        x.is_finite().then_some(x)
    }
}

/// Orthonormal directions that span the columns (Gram–Schmidt, twice, which is
/// enough: Kahan, in Parlett 1980); columns that depend on earlier ones are left out.
fn orthonormal(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for mut column in columns {
        let size = dot(&column, &column).sqrt();
        for _ in 0..2 {
            for direction in &basis {
                take_away(direction, &mut column);
            }
        }
        let left = dot(&column, &column).sqrt();
        if left > 1e-8 * size && left.is_finite() {
            column.iter_mut().for_each(|c| *c /= left);
            basis.push(column);
        }
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};
    use model_core::effects::spec;

    /// Score test of `effect` on records whose y is the model's own, with the
    /// effect at `times` its detectable amplitude, plus the records' noise.
    fn z_score(model: &Model, records: &[Record], effect: &str, times: f64) -> f64 {
        let found = detectable(model, records).expect("stable");
        let found = found.iter().find(|d| d.effect == effect).expect("judged");
        let x = found.amplitude.expect("visible");
        let spec = spec(effect).expect("in the catalogue");
        let index = spec
            .parameters
            .iter()
            .position(|p| p.name == found.parameter)
            .expect("known");
        let mut parameters: Vec<f64> = spec
            .parameters
            .iter()
            .map(|p| p.starts[p.starts.len() / 2])
            .collect();
        parameters[index] = times * x;
        let mut true_model = model.clone();
        true_model.add(spec, &parameters, None);
        let judged: Vec<&Record> = records.iter().filter(|r| r.role == Use::Validate).collect();
        let runs: Vec<Vec<f64>> = judged
            .iter()
            .map(|r| model.free_run(r).expect("stable"))
            .collect();
        let with: Vec<Vec<f64>> = judged
            .iter()
            .map(|r| true_model.free_run(r).expect("stable"))
            .collect();
        let bench = Detector::new(model, &judged, runs.clone()).expect("stable");
        let joined = bench.joined(&with);
        let before = bench.joined(&runs);
        let y = bench.joined(&judged.iter().map(|r| r.y.clone()).collect::<Vec<_>>());
        let mut z: Vec<f64> = joined.iter().zip(&before).map(|(a, b)| a - b).collect();
        // y without the effect is the model's run and noise.
        let e: Vec<f64> = y
            .iter()
            .zip(&before)
            .zip(&z)
            .map(|((y, b), z)| y - b + z)
            .collect();
        for direction in &bench.imitated {
            take_away(direction, &mut z);
        }
        let norm = dot(&z, &z).sqrt();
        dot(&e, &z) / norm / (x * norm / (times * x) / RULES.deviations)
    }

    #[test]
    fn twice_the_amplitude_is_seen_and_a_third_is_not() {
        let records = records(&[], &[], 2);
        let model = base(&records);
        for effect in [
            "electrical-pickup",
            "plenum-droop",
            "echo-path",
            "hot-film-lag",
        ] {
            let (twice, third) = (
                z_score(&model, &records, effect, 2.0),
                z_score(&model, &records, effect, 0.3),
            );
            println!("{effect}: {twice:.1} and {third:.1} standard deviations");
            // 5.6 ± 1 and 0.84 ± 1 are expected.
            assert!(twice > 3.0, "{effect}: {twice}");
            assert!(third < 3.0, "{effect}: {third}");
        }
        for found in detectable(&model, &records).expect("stable") {
            println!("{}", found.words);
        }
    }
}
