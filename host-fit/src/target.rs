//! What a model's free run is compared with.
//!
//! A full model imitates y; an averaged model imitates y_avg, eq. (12). The
//! command stays as recorded: an averaged model forms u_avg, eq. (13), itself.

use crate::averages::moving_average;
use crate::data::Record;
use crate::model::{Model, Start};

impl Model {
    /// The records as this model sees them: as they are for a full model, with
    /// y_avg in place of y for an averaged one.
    ///
    /// The averages of `y_sd` and of the envelope are left out: how much an
    /// average scatters depends on how the scatter is correlated in time,
    /// which a standard error per sample does not say.
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
