//! Selection of the reader by a file's first bytes.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use flate2::read::MultiGzDecoder;

use super::problem::ImportProblem;
use super::source::{Budget, Source, damaged, fault};
use super::{mat, npy, text};
use crate::error::{DataError, FilePlace};
use crate::memory;

impl Source {
    /// Reads the variables of a CSV of any dialect, a MATLAB file (v5 to v7) or NumPy's `.npy` and `.npz`, packed by gzip
    /// or not. The format is determined by the first bytes, not by the name.
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
        let bytes = unpacked(bytes, &mut budget).map_err(|e| in_file(e, path))?;
        let bytes = &*bytes;
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

/// The content of a file that is packed by gzip.
fn unpacked<'a>(bytes: &'a [u8], budget: &mut Budget) -> Result<Cow<'a, [u8]>, DataError> {
    if !bytes.starts_with(b"\x1f\x8b") {
        return Ok(Cow::Borrowed(bytes));
    }
    let mut inner = Vec::new();
    // Reading takes at least as much again.
    MultiGzDecoder::new(bytes)
        .take(memory::limit() / 2 + 1)
        .read_to_end(&mut inner)
        .map_err(|_| damaged("it cannot be unpacked"))?;
    // A longer content was cut.
    let size = inner.len() as u64;
    budget.take(2 * size, || "its unpacked content".to_owned())?;
    budget.give(size);
    Ok(Cow::Owned(inner))
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

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use std::io::Write;

    #[test]
    fn a_packed_table_is_read() {
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(b"t,u,y\n0,0,1\n1,1,2\n").expect("packed");
        let packed = packed.finish().expect("packed");
        let read = |bytes: &[u8]| Source::read(Path::new("log.csv.gz"), bytes);
        let source = read(&packed).expect("a table");
        assert_eq!(source.variables[2].values, [1.0, 2.0]);
        let cut = read(&packed[..packed.len() / 2]).expect_err("cut short");
        assert!(cut.to_string().contains("damaged or cut short"), "{cut}");
    }
}
