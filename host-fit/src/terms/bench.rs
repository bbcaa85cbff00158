//! Preparation of every search: records in inner units and a judge over them.

use super::RULES;
use super::judge::Judge;
use super::units::Units;
use crate::data::{Record, Use};
use crate::fit::{FitOptions, pieces_of, restart_after};
use crate::model::Model;
use crate::preparation::{FirstOrder, MovingZero, Preparation, RULES as PREPARATION};

/// Records in inner units, the judge over them, and the given model.
pub struct Bench {
    /// The inner units.
    pub units: Units,
    /// The judge.
    pub judge: Judge,
    /// The model as given, in inner units.
    pub given: Model,
    /// Whether a record does not start at rest without command.
    pub mid_run: bool,
    /// The record-to-record offset of the sensor, if there is one.
    pub moving_zero: Option<MovingZero>,
    /// Free runs are restarted after this many samples, for plants that drift.
    pub restarted: Option<usize>,
}

impl Bench {
    /// The bench for `given` on `records`, a record-to-record offset subtracted. `None` without estimation
    /// records.
    #[must_use]
    pub fn of(given: &Model, records: &[Record]) -> Option<Self> {
        let prepared = Preparation::of(records);
        let units = Units::of(given, &prepared);
        let inner = units.records_in(&prepared.records);
        let mid_run = !prepared.at_rest;
        let options = FitOptions {
            // A constant is fitted only in mid-run. For records that start at rest, the constant is the sensor's
            // offset, which is a term of the search.
            constant: mid_run,
            ..FitOptions::default()
        };
        let given = units.model_in(given);
        let restarted = restarted(&given, &inner, prepared.reference.as_ref());
        let mut judge = Judge::new(&inner, restarted, options)?;
        judge.full_is_one = prepared.full_is_known;
        Some(Self {
            judge,
            units,
            given,
            mid_run,
            moving_zero: prepared.moving_zero,
            restarted,
        })
    }
}

/// Samples after which free runs of `model` over `records` (both in the same units) are restarted, for plants that
/// drift. `None` if the first-order `reference` forgets its initial state well within the records: a model that
/// lacks an input may have a pole at 1 although the plant has none. `None`, too, if runs over whole estimation records
/// do not drift: their error is then no larger than that of restarted runs, which begin with the noise of a sample.
fn restarted(model: &Model, records: &[Record], reference: Option<&FirstOrder>) -> Option<usize> {
    let shortest = records.iter().map(Record::len).min()? as f64;
    let forgets = reference.is_some_and(|reference| {
        reference.explained > RULES.self_regulates
            && reference.time_constant * PREPARATION.times_of_rest < shortest
    });
    let drifts = |samples: &usize| {
        let learning = || records.iter().filter(|record| record.role == Use::Identify);
        let cut = pieces_of(learning(), *samples);
        // An integrator keeps the noise of its first sample as a constant error. The mean error of a whole
        // run is therefore not a drift.
        mean_square(model, learning(), true) > mean_square(model, cut.iter(), false)
    };
    restart_after(model, records).filter(|samples| !forgets && drifts(samples))
}

/// Mean square error of the free runs over the scored samples, around the mean of each run if `centred`; infinite if a
/// run diverges or nothing is scored.
fn mean_square<'r>(model: &Model, records: impl Iterator<Item = &'r Record>, centred: bool) -> f64 {
    let (mut sum, mut samples) = (0.0, 0.0);
    for record in records {
        let Ok(run) = model.free_run(record) else {
            return f64::INFINITY;
        };
        let scored = record.y.iter().zip(run).skip(record.lead);
        let errors: Vec<f64> = scored.map(|(y, run)| y - run).collect();
        let count = errors.len() as f64;
        let mean = if centred && count > 0.0 {
            errors.iter().sum::<f64>() / count
        } else {
            0.0
        };
        sum += errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>();
        samples += count;
    }
    if samples > 0.0 {
        sum / samples
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Start;
    use crate::residual::plants::{base, records};

    /// If a linear fit left a constant in the given model, the candidates still have no constant.
    #[test]
    fn a_constant_of_the_given_model_is_not_fitted_where_records_start_at_rest() {
        let records = records(&[], &[], 3);
        let given = Model {
            constant: 1e-6,
            ..base(&records)
        };
        let bench = Bench::of(&given, &records).expect("records to learn from");
        assert!(!bench.mid_run && !bench.judge.options.constant);
    }

    /// If the records return to rest repeatedly, the plant does not drift, whatever the poles of the model are.
    #[test]
    fn a_rig_that_regulates_itself_is_not_restarted() {
        let records = records(&[], &[], 3);
        let integrating = Model {
            start: Start::Measured,
            a: vec![1.0],
            c: vec![0.0],
            ..base(&records)
        };
        let reference = FirstOrder::fitted(&records).expect("y follows u");
        assert!(restarted(&integrating, &records, None).is_some());
        assert_eq!(restarted(&integrating, &records, Some(&reference)), None);
    }

    /// The level of a tank with white noise can be simulated over the whole record; with a random walk it cannot.
    #[test]
    fn a_tank_is_restarted_only_if_it_drifts() {
        let model = Model {
            start: Start::Measured,
            a: vec![1.0],
            b: vec![0.1],
            c: vec![0.0],
            constant: -0.05,
            ..Model::default()
        };
        let u: Vec<f64> = (0..4000)
            .map(|k| f64::from((k / 70 + k / 310) % 2))
            .collect();
        let with = |walk: f64, noise: f64| {
            // A fixed sequence with a standard deviation of about 1.
            let drawn = |k: usize| ((k * 7919 + k * k * 104_729) % 1009) as f64 / 291.0 - 1.73;
            let mut level = 3.0;
            let y = u.iter().enumerate().map(|(k, u)| {
                let now = level + noise * drawn(k);
                level += 0.1 * u - 0.05 + walk * drawn(k + 4001);
                now
            });
            vec![Record::new(
                "tank",
                Use::Identify,
                1.0,
                u.clone(),
                y.collect(),
            )]
        };
        assert_eq!(restarted(&model, &with(0.0, 0.1), None), None);
        assert!(restarted(&model, &with(0.1, 0.1), None).is_some());
    }
}
