//! What every search starts from: records in their own units, and a judge over them.

use super::judge::Judge;
use super::rest::tared;
use super::units::{Units, begins_in_mid_run};
use crate::data::Record;
use crate::fit::{FitOptions, restart_after};
use crate::model::Model;

/// Records in inner units with the judge over them, and the model that is asked about.
pub struct Bench {
    /// What inner units are.
    pub units: Units,
    /// The judge.
    pub judge: Judge,
    /// The model as given, in inner units.
    pub given: Model,
    /// Whether a record begins in mid-run.
    pub mid_run: bool,
    /// After how many samples free runs start anew, for rigs that drift.
    pub restarted: Option<usize>,
}

impl Bench {
    /// The bench for `given` on `records`, each from its own zero where that moves; `None` if there is nothing to learn
    /// from.
    #[must_use]
    pub fn of(given: &Model, records: &[Record]) -> Option<Self> {
        let records = tared(records);
        let units = Units::of(given, &records);
        let inner: Vec<Record> = records.iter().map(|r| units.record_in(r)).collect();
        let mid_run = inner.iter().any(begins_in_mid_run);
        let options = FitOptions {
            constant: mid_run || given.constant != 0.0,
            ..FitOptions::default()
        };
        let given = units.model_in(given);
        let restarted = restart_after(&given, &inner);
        let mut judge = Judge::new(&inner, restarted, options)?;
        judge.full_is_one = units.u == 1.0;
        Some(Self {
            judge,
            units,
            given,
            mid_run,
            restarted,
        })
    }
}
