//! Records from other loggers with the program's answers: a table of all sets with the baselines. Every answer is
//! checked against `expected.toml` or, for measured sets, against the best baseline.
//!
//! The program is run like by a user: `import` if the set requires it, `identify` with its defaults, `compare`,
//! `delay`, `diagnose`, and `discover` and `extend` on request. The sets are in `tests/data/strangers`; any other
//! folder of sets can be given.

pub(crate) mod answer;
mod case;
mod check;
pub mod drawn;
mod folder;
mod rehearsal;
mod table;

pub use case::{Case, Right, Step};
pub use table::{by_kind, json, table};

use host_fit::baseline::BaselineFits;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Options of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folders of sets; `tests/data/strangers` if empty.
    pub folders: Vec<PathBuf>,
    /// Only sets or cases whose name contains one of these; all if empty.
    pub only: Vec<String>,
    /// Run `extend` and `discover` for every case too, and check their files.
    pub all_commands: bool,
    /// Commands to skip.
    pub without: Vec<Step>,
    /// Time limit of a command.
    pub limit: Duration,
    /// Cases that run in parallel.
    pub jobs: usize,
}

/// The result of a case.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    /// Name of the set.
    pub set: String,
    /// Name of the case.
    pub case: String,
    /// Kind of the records.
    pub kind: String,
    /// Samples of all records; 0 if the case is only about `import`.
    pub samples: usize,
    /// Samples of all records that were scored.
    pub scored: usize,
    /// Records of the FIT: `validate`, or `identify` without validation records.
    pub judged: String,
    /// The baselines on the scored samples of those records.
    pub baselines: BaselineFits,
    /// FIT of the file written by `identify`, according to `compare`, in percent.
    pub fit_percent: Option<f64>,
    /// State lags, product lags and delay of the model in words.
    pub structure: String,
    /// Mean of the delays that `delay` measured, samples.
    pub edge_delay_samples: Option<f64>,
    /// Verdict of `diagnose`.
    pub verdict: Option<String>,
    /// Names in the diagnosis.
    pub names: Vec<String>,
    /// Time of all commands together, s.
    pub seconds: f64,
    /// Problems, one sentence each; empty if none.
    pub wrong: Vec<String>,
    /// Reason why the case was not run; `None` if it was run.
    pub skipped: Option<String>,
}

impl Row {
    /// Whether there are no problems.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.wrong.is_empty() && self.skipped.is_none()
    }
}

/// The cases of the project.
///
/// # Errors
/// An `expected.toml` that cannot be read, with its path.
pub fn bundled_cases() -> anyhow::Result<Vec<Case>> {
    folder::cases(&folder::bundled())
}

/// Runs every case and passes each result to `tell` as it arrives; results are in the order of the cases.
///
/// # Errors
/// A folder or an `expected.toml` that cannot be read, with its path.
pub fn run(options: &Options, tell: impl Fn(&Row) + Sync) -> anyhow::Result<Vec<Row>> {
    let mut cases = Vec::new();
    if options.folders.is_empty() {
        cases = bundled_cases()?;
    }
    for path in &options.folders {
        cases.extend(folder::cases(path)?);
    }
    let wanted = |case: &Case| {
        let named = |part: &String| case.set.contains(part) || case.name.contains(part);
        options.only.is_empty() || options.only.iter().any(named)
    };
    cases.retain(wanted);
    let next = AtomicUsize::new(0);
    let rows: Mutex<Vec<(usize, Row)>> = Mutex::default();
    std::thread::scope(|scope| {
        for _ in 0..options.jobs.max(1) {
            scope.spawn(|| {
                while let Some((index, case)) = {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    cases.get(index).map(|case| (index, case))
                } {
                    let row = rehearsal::rehearse(case, options);
                    tell(&row);
                    if let Ok(mut rows) = rows.lock() {
                        rows.push((index, row));
                    }
                }
            });
        }
    });
    let mut rows = rows.into_inner().unwrap_or_default();
    rows.sort_by_key(|(index, _)| *index);
    let mut rows: Vec<Row> = rows.into_iter().map(|(_, row)| row).collect();
    check::same_answers(&cases, &mut rows);
    Ok(rows)
}
