//! Runs the program under test and measures its time.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use host_fit::data::{DataSet, Record};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Duration of a run of the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spent {
    /// Wall-clock time (s).
    pub wall_s: f64,
    /// Processor time of all threads (s); none if the system does not provide it.
    pub cpu_s: Option<f64>,
}

/// The program under test.
#[derive(Clone, Debug)]
pub struct Program {
    /// The binary `host-fit`.
    pub path: PathBuf,
    /// Time limit.
    pub limit: Duration,
    /// Threads that a diagnosis may use; as many as there are cores if 0.
    pub threads: usize,
    /// Folder for unsuccessful cases (data set, answer, models, documents); none to discard them.
    pub keep: Option<PathBuf>,
    /// The part of a rig's records that is used; all if `None`. Tests are faster on a part, if it suffices for the
    /// tested decision.
    pub part: Option<Part>,
}

/// A part of a rig's records.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Positions of the records that are used.
    pub records: &'static [usize],
    /// Number of samples of each record, from its start.
    pub samples: usize,
}

impl Part {
    /// For estimation two square waves and a random on/off command, for validation one of each: a third of the
    /// samples of eight records of 10 s, and a third of the time.
    pub const THIRD: Self = Self {
        records: &[1, 2, 4, 5, 7],
        samples: 5000,
    };

    /// The part of `set`, which must contain the named records.
    #[must_use]
    pub fn of(self, set: &DataSet) -> Vec<Record> {
        let records = self.records.iter();
        records.map(|at| self.start(&set.records[*at])).collect()
    }

    fn start(self, record: &Record) -> Record {
        let mut record = record.clone();
        let cut = |x: &mut Vec<f64>| x.truncate(self.samples);
        cut(&mut record.u);
        cut(&mut record.y);
        [&mut record.y_sd, &mut record.y_min, &mut record.y_max]
            .into_iter()
            .flatten()
            .for_each(cut);
        record.channels.values_mut().for_each(cut);
        record
    }
}

/// Polling interval of a running program.
const POLL: Duration = Duration::from_millis(5);

impl Program {
    /// The binary with default threads and a time limit.
    #[must_use]
    pub fn new(path: PathBuf, limit: Duration) -> Self {
        Self {
            path,
            limit,
            threads: 0,
            keep: None,
            part: None,
        }
    }

    /// Runs `fill` in a folder for the case `key`. With `keep` the folder is removed only if `is_right` accepts the
    /// result; otherwise it is temporary.
    pub(super) fn in_folder<R>(
        &self,
        key: &str,
        row: &mut R,
        fill: impl FnOnce(&mut R, &Path) -> Result<(), String>,
        is_right: impl FnOnce(&R) -> bool,
    ) -> Option<String> {
        let Some(keep) = &self.keep else {
            let scratch = tempfile::tempdir().map_err(|e| e.to_string());
            return scratch.and_then(|folder| fill(row, folder.path())).err();
        };
        let folder = keep.join(key.replace('/', "_"));
        let failure = fill(row, &folder).err();
        if failure.is_none() && is_right(row) {
            // Failures to remove a folder are harmless.
            let _ = fs::remove_dir_all(&folder);
        }
        failure
    }

    /// Runs a command with `--json`; returns its document and duration.
    pub(super) fn json(
        &self,
        arguments: &[&str],
        scratch: &Path,
    ) -> Result<(Value, Spent), String> {
        let failed = |what: &dyn std::fmt::Display| format!("{}: {what}", arguments[0]);
        let [out, err] = ["json", "err"].map(|end| scratch.join(format!("{}.{end}", arguments[0])));
        let file = |path: &Path| fs::File::create(path).map_err(|e| failed(&e));
        let start = Instant::now();
        let mut child = Command::new(&self.path)
            .args(arguments)
            .arg("--json")
            .env("RAYON_NUM_THREADS", self.threads.to_string())
            .stdin(Stdio::null())
            .stdout(file(&out)?)
            .stderr(file(&err)?)
            .spawn()
            .map_err(|e| failed(&e))?;
        let mut spent = Spent::default();
        let status = loop {
            spent.cpu_s = cpu_seconds(child.id()).or(spent.cpu_s);
            if let Some(status) = child.try_wait().map_err(|e| failed(&e))? {
                break status;
            }
            if start.elapsed() > self.limit {
                // An error means that it has ended already.
                let _ = child.kill();
                let _ = child.wait();
                return Err(failed(&format!("stopped after {} s", self.limit.as_secs())));
            }
            std::thread::sleep(POLL);
        };
        spent.wall_s = start.elapsed().as_secs_f64();
        if !status.success() {
            let said = fs::read_to_string(&err).unwrap_or_default();
            return Err(failed(&said.trim()));
        }
        let text = fs::read_to_string(&out).map_err(|e| failed(&e))?;
        let document = serde_json::from_str(&text).map_err(|e| failed(&e))?;
        Ok((document, spent))
    }
}

/// Clock ticks per second in Linux's process accounting; equal on every machine.
const TICKS_PER_SECOND: f64 = 100.0;

/// Processor time of a process so far, all threads; none without `/proc`.
fn cpu_seconds(process: u32) -> Option<f64> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The second field, the name, may contain blanks; the times are the 14th and 15th.
    let (_, fields) = text.rsplit_once(')')?;
    let mut times = fields.split_whitespace().skip(11);
    let mut ticks = || times.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / TICKS_PER_SECOND)
}
