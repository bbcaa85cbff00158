//! Recordings in memory and on disk, in the layout every tool of this project reads.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a data set was not written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The file system refused.
    #[error("cannot write {path}: {source}; choose another --out or free space there")]
    Io {
        /// Which file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Columns of one record differ in length.
    #[error("record `{record}`: column `{column}` has {found} values instead of {expected}")]
    UnequalColumns {
        /// Name of the record.
        record: String,
        /// Name of the column.
        column: String,
        /// Values found.
        found: usize,
        /// Values expected (the length of `t`).
        expected: usize,
    },
}

/// What a record is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// Fitted.
    Identify,
    /// Held out.
    Validate,
}

impl Use {
    fn word(self) -> &'static str {
        match self {
            Self::Identify => "identify",
            Self::Validate => "validate",
        }
    }
}

/// One run of the rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Name, also of its file.
    pub name: String,
    /// Fitted or held out.
    pub role: Use,
    /// Time of each sample (s).
    pub t: Vec<f64>,
    /// Command of each sample.
    pub u: Vec<f64>,
    /// Reading, averaged over repeats where there are any (y).
    pub y: Vec<f64>,
    /// Standard error of `y`; empty without repeats.
    pub y_sd: Vec<f64>,
    /// Smallest repeat; empty without repeats.
    pub y_min: Vec<f64>,
    /// Largest repeat; empty without repeats.
    pub y_max: Vec<f64>,
    /// Further measured channels by column name (`u_inf` in m/s, …).
    pub channels: BTreeMap<String, Vec<f64>>,
}

impl Record {
    fn columns(&self) -> Vec<(&str, &[f64])> {
        let scatter = [
            ("y_sd", &self.y_sd),
            ("y_min", &self.y_min),
            ("y_max", &self.y_max),
        ];
        let mut columns: Vec<(&str, &[f64])> = vec![("t", &self.t), ("u", &self.u), ("y", &self.y)];
        columns.extend(
            scatter
                .iter()
                .filter(|(_, c)| !c.is_empty())
                .map(|(n, c)| (*n, c.as_slice())),
        );
        columns.extend(
            self.channels
                .iter()
                .map(|(n, c)| (n.as_str(), c.as_slice())),
        );
        columns
    }

    /// The record as CSV text: a header, then one line per sample, numbers in full precision.
    ///
    /// # Errors
    /// [`WriteError::UnequalColumns`] when a column is shorter or longer than `t`.
    pub fn to_csv(&self) -> Result<String, WriteError> {
        let columns = self.columns();
        for (name, column) in &columns {
            if column.len() != self.t.len() {
                return Err(WriteError::UnequalColumns {
                    record: self.name.clone(),
                    column: (*name).to_owned(),
                    found: column.len(),
                    expected: self.t.len(),
                });
            }
        }
        let names: Vec<&str> = columns.iter().map(|c| c.0).collect();
        let mut text = names.join(",");
        text.push('\n');
        for k in 0..self.t.len() {
            for (i, (name, column)) in columns.iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                let value = column.get(k).copied().unwrap_or(f64::NAN);
                // Writing to a String cannot fail.
                let _ = match *name {
                    "t" => write!(text, "{value:.6}"),
                    _ => write!(text, "{value}"),
                };
            }
            text.push('\n');
        }
        Ok(text)
    }
}

/// Records of one rig, sampled alike.
#[derive(Debug, Clone, PartialEq)]
pub struct DataSet {
    /// What a reader sees first.
    pub title: String,
    /// Sample period (s).
    pub sample_period_s: f64,
    /// The runs, in the order they are listed.
    pub records: Vec<Record>,
}

impl DataSet {
    /// Writes `dataset.toml` and one CSV per record into the folder `out`, making it if needed.
    ///
    /// Every file appears complete or not at all; `dataset.toml` comes last.
    ///
    /// # Errors
    /// [`WriteError`] naming the file, or the record and column.
    pub fn write(&self, out: &Path) -> Result<(), WriteError> {
        fs::create_dir_all(out).map_err(|source| WriteError::Io {
            path: out.to_owned(),
            source,
        })?;
        let mut toml = format!(
            "title = {:?}\nsample_period_s = {}\n",
            self.title, self.sample_period_s
        );
        for record in &self.records {
            let file = format!("{}.csv", record.name);
            write_whole(&out.join(&file), &record.to_csv()?)?;
            let _ = write!(
                toml,
                "\n[[record]]\nname = {:?}\nfile = {file:?}\nuse = \"{}\"\n",
                record.name,
                record.role.word()
            );
        }
        write_whole(&out.join("dataset.toml"), &toml)
    }
}

/// Writes a text file under a temporary name and renames it.
///
/// # Errors
/// [`WriteError::Io`] naming the file.
pub fn write_whole(path: &Path, text: &str) -> Result<(), WriteError> {
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(".part");
    let temporary = PathBuf::from(temporary);
    fs::write(&temporary, text)
        .and_then(|()| fs::rename(&temporary, path))
        .map_err(|source| {
            // The half-written file is of no use; that it may not exist does not matter.
            let _ = fs::remove_file(&temporary);
            WriteError::Io {
                path: path.to_owned(),
                source,
            }
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record() -> Record {
        Record {
            name: "a".to_owned(),
            role: Use::Validate,
            t: vec![0.0, 0.001],
            u: vec![1.0, 0.0],
            y: vec![0.125, 0.1],
            y_sd: vec![],
            y_min: vec![],
            y_max: vec![],
            channels: BTreeMap::from([("u_inf".to_owned(), vec![10.0, 10.5])]),
        }
    }

    #[test]
    fn csv_has_the_columns_there_are_in_full_precision() {
        assert_eq!(
            record().to_csv().unwrap(),
            "t,u,y,u_inf\n0.000000,1,0.125,10\n0.001000,0,0.1,10.5\n"
        );
        let mut short = record();
        short.u.pop();
        let message = short.to_csv().unwrap_err().to_string();
        assert!(
            message.contains("`u` has 1 values instead of 2"),
            "{message}"
        );
    }

    #[test]
    fn a_written_set_is_listed_and_leaves_no_temporary_file() {
        let out = std::env::temp_dir().join(format!("firmware-sim-{}", std::process::id()));
        let set = DataSet {
            title: "A \"quoted\" title".to_owned(),
            sample_period_s: 0.001,
            records: vec![record()],
        };
        set.write(&out).unwrap();
        let mut files: Vec<String> = fs::read_dir(&out)
            .unwrap()
            .map(|f| f.unwrap().file_name().into_string().unwrap())
            .collect();
        files.sort();
        let toml = fs::read_to_string(out.join("dataset.toml")).unwrap();
        fs::remove_dir_all(&out).unwrap();
        assert_eq!(files, ["a.csv", "dataset.toml"]);
        assert!(toml.contains("title = \"A \\\"quoted\\\" title\""));
        assert!(toml.contains("use = \"validate\""));
    }
}
