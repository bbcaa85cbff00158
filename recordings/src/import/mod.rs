//! Files that people have, made into a data set: CSV of any dialect, MATLAB's `.mat`, NumPy's `.npy` and `.npz`.
//!
//! A [`Source`] is a file's variables, whatever the format; a [`Mapping`] says which of them is what. The data set that comes
//! of it is checked as any other, and its `dataset.toml` keeps the mapping.

mod delimited;
mod mapping;
mod mat;
mod npy;
mod open;
pub(crate) mod problem;
mod source;

pub use mapping::Mapping;
pub use problem::ImportProblem;
pub use source::{Source, Variable};

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{DataError, DataProblem, FilePlace};
use crate::output::OutputError;
use crate::record::{Origin, Record, Use};
use crate::set::DataSet;

/// Where a record came from, as `dataset.toml` keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct From {
    /// The file's name, without its folder.
    pub file: String,
    /// What was done with its variables.
    #[serde(flatten)]
    pub mapping: Mapping,
    /// Units by column, as the file states them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, String>,
}

/// What to make of files.
#[derive(Debug, Clone, Default)]
pub struct Import {
    /// Which variable is what, in every file.
    pub mapping: Mapping,
    /// Title of the data set.
    pub title: Option<String>,
    /// Names of records (files without their ending) to hold out.
    pub validate: Vec<String>,
    /// From this time of each record on, s, its samples become a held-out record of their own.
    pub hold_out_from_s: Option<f64>,
    /// The input has levels between 0 and 1.
    pub graded: bool,
}

/// What became of one file.
#[derive(Debug, Clone, Serialize)]
pub struct ImportedFile {
    /// Name of its record.
    pub name: String,
    /// How the file was understood.
    pub dialect: String,
    /// Samples.
    pub samples: usize,
    /// The variables that were taken, and what was done with them.
    pub mapping: Mapping,
    /// What should be known: variables left out, a command that looks like a voltage.
    pub remarks: Vec<String>,
}

/// A data set made of other files.
#[derive(Debug, Clone)]
pub struct Imported {
    /// The data set.
    pub set: DataSet,
    /// What became of each file.
    pub files: Vec<ImportedFile>,
    from: Vec<From>,
}

impl Imported {
    /// Writes the data set as a folder, with the mapping in its `dataset.toml`.
    ///
    /// # Errors
    /// [`OutputError`] when the folder cannot be written; nothing is left behind then.
    pub fn save(&self, folder: &Path) -> Result<(), OutputError> {
        self.set.save_from(folder, &self.from)
    }
}

/// Makes a data set of files, one record of each.
///
/// # Errors
/// [`DataError`] naming file, line and column or variable of the first fault.
pub fn import(files: &[&Path], request: &Import) -> Result<Imported, DataError> {
    let mut records: Vec<Record> = Vec::new();
    let mut origins: Vec<Origin> = Vec::new();
    let mut from: Vec<From> = Vec::new();
    let mut told = Vec::new();
    for path in files {
        let source = Source::open(path)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let name = unused(&stem, &records);
        let role = match request.validate.iter().any(|v| *v == stem) {
            true => Use::Validate,
            false => Use::Identify,
        };
        let mapped = request.mapping.record(&source, &name, role)?;
        told.push(ImportedFile {
            name,
            dialect: source.dialect.clone(),
            samples: mapped.record.len(),
            mapping: mapped.mapping.clone(),
            remarks: mapped.remarks,
        });
        let came_from = From {
            file: path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            mapping: mapped.mapping,
            units: mapped.units,
        };
        let parts = match request.hold_out_from_s {
            Some(time) if role == Use::Identify => {
                parts(mapped.record, mapped.origin, time, &records, path)?
            }
            _ => vec![(mapped.record, mapped.origin)],
        };
        for (record, origin) in parts {
            records.push(record);
            origins.push(origin);
            from.push(came_from.clone());
        }
    }
    let whole = FilePlace::default();
    let set = DataSet::assemble(request.title.clone(), records, origins, &whole)?;
    if !request.graded {
        set.refuse_strays().map_err(|e| match *e.problem {
            DataProblem::StrayInput(u) => e.place.error(ImportProblem::StrayInput(u).into()),
            other => e.place.error(other),
        })?;
    }
    Ok(Imported {
        set,
        files: told,
        from,
    })
}

/// A record in two: what is learnt from, and what is held out.
fn parts(
    record: Record,
    origin: Origin,
    time: f64,
    before: &[Record],
    path: &Path,
) -> Result<Vec<(Record, Origin)>, DataError> {
    let at = ((time - record.t0) / record.sample_period_s).round();
    if !(at >= 2.0 && at + 2.0 <= record.len() as f64) {
        let problem = ImportProblem::SplitOutside(time);
        return Err(FilePlace::file(path).error(problem.into()));
    }
    let at = at as usize;
    let (first, mut second) = (record.part(0, at), record.part(at, record.len()));
    second.role = Use::Validate;
    second.name = unused(&format!("{}-held-out", record.name), before);
    let cut = |lines: &[u64]| Origin {
        file: origin.file.clone(),
        lines: lines.to_vec(),
    };
    let split = at.min(origin.lines.len());
    let (head, tail) = origin.lines.split_at(split);
    Ok(vec![(first, cut(head)), (second, cut(tail))])
}

fn unused(name: &str, records: &[Record]) -> String {
    let name = if name.is_empty() { "record" } else { name };
    let numbered = |i: usize| match i {
        1 => name.to_owned(),
        _ => format!("{name}-{i}"),
    };
    (1..)
        .map(numbered)
        .find(|n| records.iter().all(|r| r.name != *n))
        .unwrap_or_default()
}
