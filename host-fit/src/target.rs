//! The signal with which a model's free run is compared.
//!
//! A full model reproduces y; an averaged model reproduces y_avg, eq. (12). The command stays as recorded, because
//! an averaged model forms u_avg, eq. (13), itself.

use crate::averages::moving_average;
use crate::data::Record;
use crate::model::{Model, Start};

impl Model {
    /// The records for this model: unchanged for a full model, with y_avg instead of y for an averaged one.
    ///
    /// The averages of `y_sd` and of the envelope are left out: the scatter of an average depends on the
    /// autocorrelation of the noise, which a standard error per sample does not contain.
    #[must_use]
    pub fn targets(&self, records: &[Record]) -> Vec<Record> {
        if !self.averaging.averaged_model {
            return records.to_vec();
        }
        let held = self.start == Start::Measured;
        let average = |record: &Record| Record {
            y: moving_average(&record.y, self.averaging.window, held),
            y_sd: None,
            y_min: None,
            y_max: None,
            ..record.clone()
        };
        records.iter().map(average).collect()
    }
}
