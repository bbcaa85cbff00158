//! Raw recordings to a data set.

use std::path::Path;

use serde::Serialize;

use super::StepError;
use crate::data::{AverageSummary, Averaging, DataSet, average_files};

/// Result of averaging. Serialises to the keys of `average --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Average {
    /// The phase-averaged records.
    #[serde(skip)]
    pub set: DataSet,
    /// Hash of the data set.
    pub hash: String,
    /// Summary of each recording.
    pub recordings: Vec<AverageSummary>,
}

/// Phase-averages raw recordings in constant memory; those named in `validate` (file name without its ending)
/// become validation records. `progress` receives the index of the file being read and the bytes read of it.
///
/// ```no_run
/// use host_fit::data::Averaging;
/// use host_fit::steps::average;
///
/// let raw = ["step.csv".as_ref(), "square.csv".as_ref()];
/// let held_out = ["square".to_owned()];
/// let averaged = average(&raw, &held_out, &Averaging::over(2.0), &mut |_, _| {})?;
/// println!("{} records", averaged.set.records.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`] naming file and line, or the name that no recording has.
pub fn average(
    recordings: &[&Path],
    validate: &[String],
    averaging: &Averaging,
    progress: &mut dyn FnMut(usize, u64),
) -> Result<Average, StepError> {
    check_names(recordings, [], validate)?;
    let (set, recordings) = average_files(recordings, validate, averaging, progress)?;
    Ok(Average {
        hash: set.hash.clone(),
        set,
        recordings,
    })
}

/// Rejects names of validation records that none of the files and of the `records` made of them has.
pub(super) fn check_names<'a>(
    files: &[&Path],
    records: impl IntoIterator<Item = &'a str>,
    validate: &[String],
) -> Result<(), StepError> {
    let stems: Vec<_> = files.iter().filter_map(|p| p.file_stem()).collect();
    let records: Vec<&str> = records.into_iter().collect();
    let unknown = |name: &&String| {
        !stems.iter().any(|stem| *stem == name.as_str()) && !records.contains(&name.as_str())
    };
    match validate.iter().find(unknown) {
        Some(name) => Err(StepError::NoSuchRecording(name.clone())),
        None => Ok(()),
    }
}
