//! Selection of the reader by a file's first bytes.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::problem::ImportProblem;
use super::source::{Budget, Source, fault};
use super::{mat, npy, text};
use crate::error::{DataError, FilePlace};
use crate::memory;

impl Source {
    /// Reads the variables of a CSV of any dialect, a MATLAB file (v5 to v7) or NumPy's `.npy` and `.npz`. The
    /// format is determined by the first bytes, not by the name.
    ///
    /// # Errors
    /// [`DataError`] naming the file, and line, column or variable if there is one.
    pub fn open(path: &Path) -> Result<Self, DataError> {
        Self::open_beside(path, 0)
    }

    /// Opens a file while `taken` bytes of memory are already in use.
    pub(super) fn open_beside(path: &Path, taken: u64) -> Result<Self, DataError> {
        Self::read_beside(path, &read(path, taken)?, taken)
    }

    /// Reads the variables of a file whose content is in memory; `path` names it.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn read(path: &Path, bytes: &[u8]) -> Result<Self, DataError> {
        Self::read_beside(path, bytes, 0)
    }

    fn read_beside(path: &Path, bytes: &[u8], taken: u64) -> Result<Self, DataError> {
        let mut budget = Budget::with(taken);
        budget
            .take(bytes.len() as u64, || "its content".to_owned())
            .map_err(|e| in_file(e, path))?;
        let is_mat = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("mat"));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let read = if bytes.starts_with(b"\x93NUMPY") {
            npy::single(path, bytes, &mut budget)
        } else if bytes.starts_with(b"PK\x03\x04") {
            npy::archive(bytes, &mut budget)
        } else if bytes.starts_with(b"MATLAB 7.3") || (is_mat && bytes.starts_with(b"\x89HDF")) {
            Err(fault(ImportProblem::Matlab73(name.into_owned())))
        } else if bytes.starts_with(b"\x89HDF") {
            Err(fault(ImportProblem::Hdf5))
        } else if mat::is_one(bytes) {
            mat::variables(bytes, &mut budget)
        } else if is_mat {
            Err(fault(ImportProblem::NoMatlab))
        } else {
            text::variables(bytes, &mut budget)
        };
        let mut source = read.map_err(|e| in_file(e, path))?;
        source.path = path.to_path_buf();
        Ok(source)
    }
}

fn in_file(mut error: DataError, path: &Path) -> DataError {
    error.place.file = Some(path.to_path_buf());
    error
}

fn read(path: &Path, taken: u64) -> Result<Vec<u8>, DataError> {
    let unreadable = |e| DataError::unreadable(path, e);
    let file = File::open(path).map_err(unreadable)?;
    let size = file.metadata().map_err(unreadable)?.len();
    let mut budget = Budget::with(taken);
    budget
        .take(size, || "its content".to_owned())
        .map_err(|e| in_file(e, path))?;
    let mut bytes = Vec::with_capacity(usize::try_from(size).unwrap_or(0));
    // A pipe has no size, and a file may grow.
    let most = memory::limit();
    file.take(most + 1)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.is_empty() {
        return Err(FilePlace::file(path).error(crate::error::DataProblem::Empty));
    }
    Budget::with(taken)
        .take(bytes.len() as u64, || "its content".to_owned())
        .map_err(|e| in_file(e, path))?;
    Ok(bytes)
}
