//! The data set of the project, and the uploaded files from which it is imported.

use std::path::{Path, PathBuf};

use host_fit::data::import::Source;
use host_fit::data::{DataSet, Record};
use host_fit::excitation::Excitation;
use host_fit::output::write_atomic;
use serde_json::{Value, json};
use workbench::{Refusal, beneath};

use crate::commands::words::role_name;

/// A data set with its excitation check.
pub(super) struct Data {
    /// The path as given by the user, for commands.
    pub(super) path: PathBuf,
    pub(super) set: DataSet,
    remarks: Vec<String>,
}

impl Data {
    pub(super) fn load(path: &Path) -> anyhow::Result<Self> {
        let set = DataSet::load(path)?;
        let shortest = set.records.iter().map(Record::len).min();
        let longest_lag = 500.min(shortest.unwrap_or(4) / 4);
        Ok(Self {
            path: path.to_owned(),
            remarks: Excitation::of(&set, longest_lag).remarks,
            set,
        })
    }

    pub(super) fn state(&self) -> Value {
        let record =
            |r: &Record| json!({"name": r.name, "use": role_name(r.role), "samples": r.len()});
        json!({
            "title": self.set.title.as_deref().unwrap_or("data set"),
            "path": self.path.display().to_string(),
            "hash": self.set.hash,
            "period": self.set.sample_period_s,
            "records": self.set.records.iter().map(record).collect::<Vec<_>>(),
            "remarks": self.remarks,
        })
    }
}

/// The files that were uploaded into a project.
pub(super) struct Uploads(PathBuf);

/// Name of the folder of uploads in the project.
const UPLOADS: &str = "uploads";

impl Uploads {
    pub(super) fn of(project: &Path) -> Self {
        Self(project.join(UPLOADS))
    }

    /// The project.
    fn project(&self) -> &Path {
        self.0.parent().unwrap_or(&self.0)
    }

    /// Names of the files, sorted.
    pub(super) fn names(&self) -> Vec<String> {
        super::names_in(&self.0, "")
    }

    /// Path of an uploaded file.
    pub(super) fn path(&self, name: &str) -> Result<PathBuf, Refusal> {
        match self.names().iter().any(|known| known == name) {
            true => Ok(self.0.join(name)),
            false => Err(Refusal(format!(
                "no file `{name}` was uploaded; drop it on the page first"
            ))),
        }
    }

    /// Stores an upload and returns its contents. An unreadable file is not stored and leaves an existing one
    /// unchanged.
    pub(super) fn keep(&self, name: &str, bytes: &[u8]) -> Result<Value, Refusal> {
        let plain = |c: char| c.is_alphanumeric() || "-_. +()".contains(c);
        if name.is_empty() || name.len() > 120 || name.starts_with('.') || !name.chars().all(plain)
        {
            let why = "a file's name may have letters, digits, spaces and -_.+(); rename it";
            return Err(Refusal(why.to_owned()));
        }
        let path = beneath(self.project(), &Path::new(UPLOADS).join(name))?;
        let source = Source::read(&path, bytes)?;
        std::fs::create_dir_all(&self.0)?;
        write_atomic(&path, |out| out.write_all(bytes))?;
        Ok(told(name, &source))
    }

    /// The variables of a file.
    pub(super) fn inspect(&self, name: &str) -> Result<Value, Refusal> {
        Ok(told(name, &Source::open(&self.path(name)?)?))
    }
}

/// Description of a file's contents.
fn told(name: &str, source: &Source) -> Value {
    let variables = source.variables.iter();
    let told =
        variables.map(|v| json!({"name": v.name, "unit": v.unit, "samples": v.values.len()}));
    json!({
        "name": name,
        "dialect": source.dialect,
        "variables": told.collect::<Vec<_>>(),
        "skipped": source.skipped,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_upload_is_kept_where_it_belongs_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let uploads = Uploads::of(folder.path());
        let csv = b"t,u,y\n0.0,0,0.1\n0.001,1,0.2\n";
        for name in [
            "../x.csv",
            "/etc/x.csv",
            "a/b.csv",
            "a\\b.csv",
            "..",
            ".x.csv",
            "",
            "x\0.csv",
        ] {
            assert!(uploads.keep(name, csv).is_err(), "{name:?}");
            assert!(uploads.path(name).is_err(), "{name:?}");
        }
        let told = uploads.keep("Messung 1.csv", csv).unwrap();
        assert_eq!(told["variables"][1]["name"], "u");
        for name in ["notes.csv", "Messung 1.csv"] {
            assert!(uploads.keep(name, b"no table").is_err());
        }
        assert_eq!(
            std::fs::read(uploads.path("Messung 1.csv").unwrap()).unwrap(),
            csv
        );
        assert_eq!(uploads.names(), ["Messung 1.csv"]);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_among_the_uploads_lead_nowhere() {
        use std::os::unix::fs::symlink;
        let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let uploads = Uploads::of(folder.path());
        let csv = b"t,u,y\n0.0,0,0.1\n0.001,1,0.2\n";
        uploads.keep("run.csv", csv).unwrap();
        let victim = other.path().join("victim.csv");
        std::fs::write(&victim, csv).unwrap();
        symlink(&victim, folder.path().join("uploads/link.csv")).unwrap();
        assert!(uploads.keep("link.csv", csv).is_err() && uploads.inspect("link.csv").is_err());
        assert_eq!(uploads.names(), ["run.csv"]);
        std::fs::remove_dir_all(folder.path().join("uploads")).unwrap();
        symlink(other.path(), folder.path().join("uploads")).unwrap();
        assert!(uploads.keep("new.csv", csv).is_err() && uploads.names().is_empty());
        assert_eq!(std::fs::read_dir(other.path()).unwrap().count(), 1);
    }
}
