//! Bookkeeping of campaigns: selecting cases, running them in parallel, and storing one line of JSON each, so
//! that a campaign can be stopped, continued and run in parts.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::Context;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::program::Program;

/// The result of a case.
pub trait Entry: Clone + Send + Serialize + DeserializeOwned {
    /// The case's key.
    fn key(&self) -> &str;
}

/// The options of every campaign.
#[derive(Debug, clap::Args)]
pub struct Ledger {
    /// File of the rows; by default the campaign's name in `target`.
    #[arg(long)]
    rows: Option<PathBuf>,
    /// Seed of the campaign.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Only cases with this text in their key, such as `memory1/` or `/hot-film-lag/`.
    #[arg(long, default_value = "")]
    only: String,
    /// Every N-th case from the I-th on, as 1/4.
    #[arg(long, default_value = "1/1", value_parser = part)]
    part: (usize, usize),
    /// Only this many of these cases, from the start; the order is random.
    #[arg(long)]
    first: Option<usize>,
    /// Cases that run in parallel. With two or more the whole is faster, but wall-clock times differ from a
    /// user's.
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// Time limit of a run of the program, s.
    #[arg(long, default_value_t = 900)]
    limit: u64,
    /// Folder for every unsuccessful case: data set, answer, models, documents.
    #[arg(long)]
    keep: Option<PathBuf>,
    /// The program to test; by default the one in the same folder as this program.
    #[arg(long)]
    program: Option<PathBuf>,
    /// Only print the tables of existing results.
    #[arg(long)]
    table: bool,
    /// Only print the cases.
    #[arg(long)]
    list: bool,
}

fn part(text: &str) -> Result<(usize, usize), String> {
    let numbers = text.split_once('/').and_then(|(i, n)| {
        let (i, n) = (i.parse::<usize>().ok()?, n.parse::<usize>().ok()?);
        (i >= 1 && i <= n).then_some((i, n))
    });
    numbers.ok_or_else(|| "two numbers as in 1/4 are needed".to_owned())
}

impl Ledger {
    /// Runs the selected `cases` of the campaign `name` that have no result yet, and prints the table of all
    /// selected ones.
    ///
    /// # Errors
    /// Files that cannot be read or written.
    pub fn keep<C: Display + Sync, R: Entry>(
        &self,
        name: &str,
        cases: Vec<C>,
        run: impl Fn(&C, &Program) -> R + Sync,
        tell: impl Fn(&R) + Sync,
        table: impl Fn(&[R]) -> String,
    ) -> anyhow::Result<()> {
        let (from, every) = self.part;
        let wanted: Vec<C> = cases
            .into_iter()
            .filter(|case| case.to_string().contains(&self.only))
            .skip(from - 1)
            .step_by(every)
            .take(self.first.unwrap_or(usize::MAX))
            .collect();
        if self.list {
            for case in &wanted {
                println!("{case}");
            }
            return Ok(());
        }
        let path = (self.rows.clone())
            .unwrap_or_else(|| Path::new("target").join(format!("{name}.jsonl")));
        let mut rows: BTreeMap<String, R> = read(&path)?;
        if !self.table {
            let done = |case: &&C| rows.contains_key(&case.to_string());
            let left: Vec<&C> = wanted.iter().filter(|case| !done(case)).collect();
            eprintln!("{} cases, {} to run", wanted.len(), left.len());
            let cores = std::thread::available_parallelism()?.get();
            let program = Program {
                path: (self.program.clone()).unwrap_or_else(crate::program),
                limit: Duration::from_secs(self.limit),
                threads: cores.div_ceil(self.jobs.max(1)),
                keep: self.keep.clone(),
                part: None,
            };
            let play = |case: &C| {
                let row = run(case, &program);
                tell(&row);
                row
            };
            play_all(&left, self.jobs, &path, play)?;
            rows = read(&path)?;
        }
        let known: Vec<R> = (wanted.iter())
            .filter_map(|case| rows.get(&case.to_string()).cloned())
            .collect();
        print!("{}", table(&known));
        Ok(())
    }
}

/// Runs cases and appends their results.
fn play_all<C: Sync, R: Entry>(
    left: &[&C],
    jobs: usize,
    path: &Path,
    play: impl Fn(&C) -> R + Sync,
) -> anyhow::Result<()> {
    let cut_off = fs::read(path).is_ok_and(|text| text.last().is_some_and(|end| *end != b'\n'));
    let file = fs::OpenOptions::new().create(true).append(true).open(path);
    let mut file = file.with_context(|| path.display().to_string())?;
    if cut_off {
        writeln!(file)?;
    }
    let file = Mutex::new(file);
    let next = AtomicUsize::new(0);
    let work = || -> anyhow::Result<()> {
        while let Some(case) = left.get(next.fetch_add(1, Ordering::Relaxed)) {
            let line = serde_json::to_string(&play(case))?;
            if let Ok(mut file) = file.lock() {
                writeln!(file, "{line}")?;
            }
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs.max(1)).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            match worker.join() {
                Ok(done) => done?,
                Err(_) => anyhow::bail!("a worker broke down"),
            }
        }
        Ok(())
    })
}

/// The results of a file by key; the last one counts. A case with an unreadable line, for example the last line of a
/// killed campaign, is run again.
fn read<R: Entry>(path: &Path) -> anyhow::Result<BTreeMap<String, R>> {
    let mut rows = BTreeMap::new();
    if !path.is_file() {
        return Ok(rows);
    }
    for (number, line) in fs::read_to_string(path)?.lines().enumerate() {
        match serde_json::from_str::<R>(line) {
            Ok(row) => _ = rows.insert(row.key().to_owned(), row),
            Err(error) => eprintln!("{}, line {}: {error}", path.display(), number + 1),
        }
    }
    Ok(rows)
}
