//! Conversion of other files to a data set: CSV of any dialect, MATLAB's `.mat`, NumPy's `.npy` and `.npz`.
//!
//! A [`Source`] contains a file's variables, whatever the format; a [`Mapping`] assigns them. The resulting data
//! set is checked like any other, and its `dataset.toml` contains the mapping.

mod cell;
mod column;
mod delimited;
mod gaps;
mod labelled;
mod long;
mod mapping;
mod marker;
mod mat;
mod mean;
mod names;
mod npy;
mod open;
pub(crate) mod problem;
mod source;
mod split;
mod stamp;
mod text;
mod timing;

pub use mapping::{Mapping, near_two_levels};
pub use problem::ImportProblem;
pub use source::{Source, Variable};
use split::Part;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::{DataError, DataProblem, FilePlace};
use crate::output::OutputError;
use crate::record::{Origin, Record, Use};
use crate::set::MANIFEST;
use crate::set::{DataSet, unite_periods};

/// Origin of a record, as stored in `dataset.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct From {
    /// The file's name, without its folder.
    pub file: String,
    /// The mapping of the file's variables.
    #[serde(flatten)]
    pub mapping: Mapping,
    /// Units by column, as the file states them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, String>,
}

/// Options of an import.
#[derive(Debug, Clone, Default)]
pub struct Import {
    /// Mapping of the variables, for every file.
    pub mapping: Mapping,
    /// Title of the data set.
    pub title: Option<String>,
    /// Names of validation records: files without their ending, or records of a file that is split.
    pub validate: Vec<String>,
    /// Splits each record at this time, s: the whole becomes a validation record whose lead is the earlier samples.
    pub hold_out_from_s: Option<f64>,
    /// Command before the first sample of every record; `None`: the first value of u.
    pub u_before: Option<f64>,
    /// The input has levels between 0 and 1.
    pub graded: bool,
}

/// Summary of one file.
#[derive(Debug, Clone, Serialize)]
pub struct ImportedFile {
    /// Name of the file's record.
    pub name: String,
    /// Description of the file's format.
    pub dialect: String,
    /// Samples.
    pub samples: usize,
    /// Sampling period of the file, s.
    pub sample_period_s: f64,
    /// The variables used, with their scaling.
    pub mapping: Mapping,
    /// Remarks: variables left out, a command that looks like a voltage.
    pub remarks: Vec<String>,
}

/// A data set made from other files.
#[derive(Debug, Clone)]
pub struct Imported {
    /// The data set.
    pub set: DataSet,
    /// Summary of each file.
    pub files: Vec<ImportedFile>,
    /// Remarks on the data set as a whole.
    pub remarks: Vec<String>,
    from: Vec<From>,
    sources: Vec<PathBuf>,
}

impl Imported {
    /// Writes the data set as a folder, with the mapping in its `dataset.toml`.
    ///
    /// # Errors
    /// [`OutputError`] if the folder cannot be written; no partial output remains.
    pub fn save(&self, folder: &Path) -> Result<(), OutputError> {
        self.set.save_from(folder, &self.from)
    }

    /// Refuses to replace a data set or a file in `folder`. With `force` only the imported files themselves
    /// are protected.
    ///
    /// # Errors
    /// [`DataError`] naming the file or data set.
    pub fn refuse_to_replace(&self, folder: &Path, force: bool) -> Result<(), DataError> {
        let manifest = folder.join(MANIFEST);
        let files = self.set.file_names();
        let mut targets = files.iter().map(|name| folder.join(name));
        let is_source = |target: &PathBuf| {
            let real = target.canonicalize();
            real.is_ok_and(|real| {
                self.sources
                    .iter()
                    .any(|s| s.canonicalize().is_ok_and(|s| s == real))
            })
        };
        if let Some(target) = targets.clone().find(is_source) {
            return Err(FilePlace::file(&target).error(ImportProblem::ReplacesSource.into()));
        }
        if force {
            return Ok(());
        }
        if manifest.exists() {
            return Err(FilePlace::file(folder).error(ImportProblem::ReplacesSet.into()));
        }
        match targets.find(|target| target.exists()) {
            Some(target) => Err(FilePlace::file(&target).error(ImportProblem::ReplacesFile.into())),
            None => Ok(()),
        }
    }
}

/// Endings of tables and arrays.
const TABLES: [&str; 5] = ["csv", "tsv", "mat", "npy", "npz"];
/// Endings of text files, which are imported from a folder only if it has none of `TABLES`.
const TEXTS: [&str; 3] = ["txt", "dat", "log"];

/// The files to import: the named ones, and for a folder the possible tables in it, by name.
///
/// # Errors
/// [`DataError`] if a folder cannot be read, is a data set already, or contains no such file.
pub fn files_of(paths: &[&Path]) -> Result<Vec<PathBuf>, DataError> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.to_path_buf());
            continue;
        }
        if path.join(MANIFEST).exists() {
            return Err(FilePlace::file(path).error(ImportProblem::IsDataSet.into()));
        }
        let unreadable = |e| DataError::unreadable(path, e);
        let mut inside = Vec::new();
        for entry in fs::read_dir(path).map_err(unreadable)? {
            let file = entry.map_err(unreadable)?.path();
            let name = file
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .to_lowercase();
            if file.is_file() && !name.starts_with('.') && !name.starts_with("readme") {
                inside.push(file);
            }
        }
        inside.sort();
        let ending_in = |endings: &[&str]| -> Vec<PathBuf> {
            let fits = |file: &&PathBuf| {
                let ending = file.extension().unwrap_or_default();
                endings.iter().any(|e| ending.eq_ignore_ascii_case(e))
            };
            inside.iter().filter(fits).cloned().collect()
        };
        let mut found = ending_in(&TABLES);
        if found.is_empty() {
            found = ending_in(&TEXTS);
        }
        if found.is_empty() {
            return Err(FilePlace::file(path).error(ImportProblem::NothingInFolder.into()));
        }
        files.append(&mut found);
    }
    Ok(files)
}

/// Makes a data set of files, one record per file, or several from a file that is split.
///
/// # Errors
/// [`DataError`] naming file, line and column or variable of the first fault.
pub fn import(files: &[&Path], request: &Import) -> Result<Imported, DataError> {
    let mut records: Vec<Record> = Vec::new();
    let mut origins: Vec<Origin> = Vec::new();
    let mut from: Vec<From> = Vec::new();
    let mut told = Vec::new();
    for path in files {
        let kept = records.iter().map(Record::bytes).sum();
        let source = Source::open_beside(path, kept)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let runs = request.mapping.parts(&source)?;
        let rows = runs.last().map_or(0, |last| last.rows.end);
        // A file that is not split is one record of its name.
        let several = runs.len() > 1;
        let runs: Vec<Option<Part>> = match several {
            true => runs.into_iter().map(Some).collect(),
            false => vec![None],
        };
        for (number, run) in (1..).zip(&runs) {
            let own = match run {
                None => stem.clone().into_owned(),
                Some(part) => format!("{stem}-{}", part.run.unwrap_or(number)),
            };
            let part = run.as_ref().map(|part| source.part(&part.rows, rows));
            let source = part.as_ref().unwrap_or(&source);
            let name = unused(&own, &records);
            let role = match request.validate.iter().any(|v| *v == stem || *v == name) {
                true => Use::Validate,
                false => Use::Identify,
            };
            let mut mapped = request.mapping.record(source, &name, role)?;
            mapped.record.u_before = request.u_before;
            told.push(ImportedFile {
                name,
                dialect: source.dialect.clone(),
                samples: mapped.record.len(),
                sample_period_s: mapped.record.sample_period_s,
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
    }
    let mut remarks = Vec::new();
    if let Some(one) = unite_periods(&mut records) {
        remarks.push(format!(
            "The records' sampling periods differ by less than a sample over their length ({} to {} s): all \
                 get the mean, {} s.",
            one.shortest, one.longest, one.mean
        ));
    }
    remarks.extend(nothing_held_out(&records));
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
        remarks,
        from,
        sources: files.iter().map(|path| path.to_path_buf()).collect(),
    })
}

/// The remark if no record is for validation.
fn nothing_held_out(records: &[Record]) -> Option<String> {
    if records.iter().any(|r| r.role == Use::Validate) {
        return None;
    }
    let shortest = records.iter().min_by_key(|r| r.len())?;
    let from = shortest.time(shortest.len() * 7 / 10);
    let from: f64 = format!("{from:.1e}").parse().unwrap_or(from);
    let tail = format!("the end of each record with --hold-out-from {from}");
    let how = match records {
        [_] => tail,
        [.., last] => format!("a file with --validate {}, or {tail}", last.name),
        [] => return None,
    };
    Some(format!(
        "There is no validation record: models would be validated on the data they are fitted to. Use {how}."
    ))
}

/// Splits a record at `time`: the samples before it become an estimation record, and the whole becomes a validation
/// record with those samples as its lead.
fn parts(
    record: Record,
    origin: Origin,
    time: f64,
    before: &[Record],
    path: &Path,
) -> Result<Vec<(Record, Origin)>, DataError> {
    let at = ((time - record.t0) / record.sample_period_s).round();
    if !(at >= 2.0 && at + 2.0 <= record.len() as f64) {
        let problem = ImportProblem::SplitOutside {
            time,
            from: record.t0,
            to: record.time(record.len().saturating_sub(1)),
        };
        return Err(FilePlace::file(path).error(problem.into()));
    }
    let at = at as usize;
    let first = record.part(0, at);
    let head = Origin {
        file: origin.file.clone(),
        lines: origin.lines.iter().take(at).copied().collect(),
    };
    let mut second = record;
    second.role = Use::Validate;
    second.lead = at;
    second.name = unused(&format!("{}-held-out", second.name), before);
    Ok(vec![(first, head), (second, origin)])
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
