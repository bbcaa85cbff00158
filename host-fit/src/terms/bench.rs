//! Preparation of every search: records in inner units and a judge over them.

use super::RULES;
use super::judge::Judge;
use super::units::Units;
use crate::data::Record;
use crate::fit::{FitOptions, restart_after};
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
            // Where records start at rest, a level is the sensor's offset, which is a term of the search.
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
/// lacks an input may have a pole at 1 although the plant has none.
pub(crate) fn restarted(
    model: &Model,
    records: &[Record],
    reference: Option<&FirstOrder>,
) -> Option<usize> {
    let shortest = records.iter().map(Record::len).min()? as f64;
    let forgets = reference.is_some_and(|reference| {
        reference.explained > RULES.self_regulates
            && reference.time_constant * PREPARATION.times_of_rest < shortest
    });
    restart_after(model, records).filter(|_| !forgets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Start;
    use crate::residual::plants::{base, records};

    /// A constant that a linear fit left in the given model is no reason to fit one in every candidate.
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
}
