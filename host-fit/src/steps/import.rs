//! Conversion of files of other programs to a data set.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::StepError;
use crate::data::import::{self, Import, Imported, ImportedFile};

/// Result of an import. Serialises to the keys of `import --json`.
#[derive(Clone, Debug, Serialize)]
pub struct ImportedSet {
    /// The data set with its mapping, to be saved.
    #[serde(skip)]
    pub imported: Imported,
    /// Hash of the data set.
    pub hash: String,
    /// Sampling period of the records, s.
    pub sample_period_s: f64,
    /// The result of each file.
    pub files: Vec<ImportedFile>,
    /// Remarks on the data set as a whole: periods that were unified, no validation record.
    pub remarks: Vec<String>,
}

/// Makes a data set of CSV files of any dialect, MATLAB's `.mat`, NumPy's `.npy` and `.npz`, or of a folder of
/// them.
///
/// ```
/// use host_fit::data::import::{Import, Mapping};
/// use host_fit::steps::import;
///
/// let mapping = Mapping { u_threshold: Some(2.5), ..Mapping::default() };
/// let request = Import { mapping, ..Import::default() };
/// let found = import(&["../recordings/tests/import/v7.mat".as_ref()], &request)?;
/// assert!(found.imported.set.is_on_off());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`] naming file, line and column or variable, or the name that no file has.
pub fn import(files: &[&Path], request: &Import) -> Result<ImportedSet, StepError> {
    let files = import::files_of(files)?;
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    // Records of a file that is split have names when the file is read.
    let is_split = request.mapping.split_by.is_some();
    if !is_split {
        super::average::check_names(&files, [], &request.validate)?;
    }
    let imported = import::import(&files, request)?;
    if is_split {
        let records = imported.files.iter().map(|file| file.name.as_str());
        super::average::check_names(&files, records, &request.validate)?;
    }
    Ok(ImportedSet {
        hash: imported.set.hash.clone(),
        sample_period_s: imported.set.sample_period_s,
        files: imported.files.clone(),
        remarks: imported.remarks.clone(),
        imported,
    })
}
