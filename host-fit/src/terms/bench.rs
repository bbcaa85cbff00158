//! What every search starts from: records in their own units, and a judge over them.

use super::judge::Judge;
use super::units::Units;
use crate::data::Record;
use crate::fit::{FitOptions, restart_after};
use crate::model::Model;
use crate::preparation::{MovingZero, Preparation};

/// Records in inner units with the judge over them, and the model that is asked about.
pub struct Bench {
    /// What inner units are.
    pub units: Units,
    /// The judge.
    pub judge: Judge,
    /// The model as given, in inner units.
    pub given: Model,
    /// Whether a record begins otherwise than at rest without command.
    pub mid_run: bool,
    /// The zero that differs between records, where it does.
    pub moving_zero: Option<MovingZero>,
    /// After how many samples free runs start anew, for rigs that drift.
    pub restarted: Option<usize>,
}

impl Bench {
    /// The bench for `given` on `records`, each from its own zero where that moves; `None` if there is nothing to learn
    /// from.
    #[must_use]
    pub fn of(given: &Model, records: &[Record]) -> Option<Self> {
        let prepared = Preparation::of(records);
        let units = Units::of(given, &prepared);
        let inner: Vec<Record> = prepared
            .records
            .iter()
            .map(|r| units.record_in(r))
            .collect();
        let mid_run = !prepared.at_rest;
        let options = FitOptions {
            constant: mid_run || given.constant != 0.0,
            ..FitOptions::default()
        };
        let given = units.model_in(given);
        let restarted = restart_after(&given, &inner);
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
