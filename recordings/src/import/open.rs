//! Which reader a file's first bytes call for.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::problem::ImportProblem;
use super::source::{LARGEST, Source, fault};
use super::{delimited, mat, npy};
use crate::error::{DataError, FilePlace};

impl Source {
    /// Reads the variables of a CSV of any dialect, a MATLAB file (v5 to v7) or NumPy's `.npy` and `.npz`. What a file is, its
    /// first bytes say, not its name.
    ///
    /// # Errors
    /// [`DataError`] naming the file, and line, column or variable where there is one.
    pub fn open(path: &Path) -> Result<Self, DataError> {
        let bytes = read(path)?;
        let is_mat = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("mat"));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let read = if bytes.starts_with(b"\x93NUMPY") {
            npy::single(path, &bytes)
        } else if bytes.starts_with(b"PK\x03\x04") {
            npy::archive(&bytes)
        } else if bytes.starts_with(b"MATLAB 7.3") || (is_mat && bytes.starts_with(b"\x89HDF")) {
            Err(fault(ImportProblem::Matlab73(name.into_owned())))
        } else if bytes.starts_with(b"\x89HDF") {
            Err(fault(ImportProblem::Hdf5))
        } else if mat::is_one(&bytes) {
            mat::variables(&bytes)
        } else if is_mat {
            Err(fault(ImportProblem::NoMatlab))
        } else {
            delimited::variables(&bytes)
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

fn read(path: &Path) -> Result<Vec<u8>, DataError> {
    let unreadable = |e| DataError::unreadable(path, e);
    let file = File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    let most = LARGEST;
    file.take(most + 1)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.is_empty() {
        return Err(FilePlace::file(path).error(crate::error::DataProblem::Empty));
    }
    if bytes.len() as u64 > most {
        return Err(in_file(fault(ImportProblem::TooLarge(most >> 20)), path));
    }
    Ok(bytes)
}
