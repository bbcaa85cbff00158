//! The records of a data set on which every step runs and validates models.

use super::StepError;
use crate::data::DataSet;
use crate::preparation::{Preparation, scored_samples};

/// The records of `set`, prepared from the data alone: the same beginnings and the same scored samples for every
/// model of a command.
///
/// # Errors
/// [`StepError::TooFewScored`] if less than half of the samples outside stated leads would be scored.
pub(super) fn prepared(set: &DataSet) -> Result<Preparation, StepError> {
    let prepared = Preparation::of(&set.records);
    let (scored, _) = scored_samples(&prepared.records);
    let (samples, _) = scored_samples(&set.records);
    if 2 * scored < samples {
        return Err(StepError::TooFewScored { scored, samples });
    }
    Ok(prepared)
}
