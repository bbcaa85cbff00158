//! Invariances: changes of the records that do not change the answer of the program, on simulated rigs drawn at
//! random and on records from other loggers.
//!
//! | change | the answer |
//! |---|---|
//! | y → a·y + b, \|b\| up to 100 × the range | the same, errors times \|a\| |
//! | u → α·u + β, also inverted | the same |
//! | t → c·t, 0.1 ms to 60 s a sample | the same in samples |
//! | rest added before the record | the same within the scatter, or a near tie |
//! | records cut anywhere, or joined | the same within the scatter, or a near tie |
//! | records reordered, or renamed | the same to the last digit |
//!
//! The answer consists of verdict and names of `diagnose`, structure and delay of the model, FIT, error and poles,
//! and the delays that `delay` measures.
//!
//! A near tie: two models of different structure each describe the other's records equally well, within 2 % of the
//! error. Records with other samples may then prefer either. Near ties are counted separately from failures.

mod change;
mod records;
mod said;

pub use change::Change;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use said::{Said, broken, is_near_tie};
use serde::Serialize;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Options of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Number of rigs; every change is applied once to each.
    pub cases: u64,
    /// The first rig.
    pub seed: u64,
    /// Records from other loggers instead of simulated rigs.
    pub strangers: bool,
    /// `diagnose` is run on every N-th rig; 0 for none.
    pub diagnose_every: u64,
    /// The changes that are tried; all if empty.
    pub only: Vec<Change>,
    /// Time limit of a command.
    pub limit: Duration,
    /// Number of rigs that run in parallel.
    pub jobs: usize,
}

impl Options {
    fn tries(&self, change: Change) -> bool {
        self.only.is_empty() || self.only.contains(&change)
    }
}

/// A change that made a difference.
#[derive(Clone, Debug, Serialize)]
pub struct Broken {
    /// The change of the records.
    pub change: Change,
    /// Seed of the rig; `--seed` with this number repeats the rig.
    pub seed: u64,
    /// The rig and the change with their numbers.
    pub rig: String,
    /// Differences between the answers, one sentence each.
    pub differs: Vec<String>,
}

/// Result of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Outcome {
    /// The changes, and on how many rigs each was tried.
    pub tried: Vec<(Change, u64)>,
    /// Changes that made a difference, in the order of seeds.
    pub broken: Vec<Broken>,
    /// Changes after which another structure describes all records equally well.
    pub near_ties: Vec<Broken>,
}

impl Outcome {
    /// A line for each change with the numbers of failures and near ties, and each of these below it.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = String::from("| change | broken | near ties |\n|---|---|---|\n");
        for (change, cases) in &self.tried {
            let count = |list: &[Broken]| list.iter().filter(|b| b.change == *change).count();
            let (broken, ties) = (count(&self.broken), count(&self.near_ties));
            text += &format!("| {} | {broken} of {cases} | {ties} |\n", change.words());
        }
        for (words, list) in [("broken", &self.broken), ("near tie", &self.near_ties)] {
            for found in list {
                let Broken {
                    change,
                    seed,
                    rig,
                    differs,
                } = found;
                let (change, differs) = (change.words(), differs.join("; "));
                text += &format!("- {words}: {change}, seed {seed}, {rig}: {differs}\n");
            }
        }
        text
    }
}

/// Tries every change on every rig; `tell` receives each change that made a difference, as soon as it is found.
///
/// # Errors
/// No temporary folder.
pub fn run(options: &Options, tell: impl Fn(&Broken) + Sync) -> std::io::Result<Outcome> {
    let strangers = match options.strangers {
        true => records::strangers(),
        false => Vec::new(),
    };
    let next = AtomicU64::new(0);
    let outcome: Mutex<Outcome> = Mutex::default();
    let folders: Vec<_> = (0..options.jobs.max(1))
        .map(|_| tempfile::tempdir())
        .collect::<std::io::Result<_>>()?;
    std::thread::scope(|scope| {
        for folder in &folders {
            let (next, outcome, tell, strangers) = (&next, &outcome, &tell, &*strangers);
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= options.cases {
                        break;
                    }
                    let seed = options.seed + index;
                    let every = options.diagnose_every;
                    let diagnose = every > 0 && index.is_multiple_of(every);
                    let found = rig(seed, strangers, diagnose, options, folder.path());
                    let (ties, broken): (Vec<_>, Vec<_>) = found.into_iter().partition(|f| f.1);
                    let [ties, broken] = [ties, broken].map(|list| list.into_iter().map(|f| f.0));
                    if let Ok(mut outcome) = outcome.lock() {
                        outcome.broken.extend(broken.inspect(tell));
                        outcome.near_ties.extend(ties);
                    }
                }
            });
        }
    });
    let mut outcome = outcome.into_inner().unwrap_or_default();
    outcome.broken.sort_by_key(|broken| broken.seed);
    outcome.near_ties.sort_by_key(|tie| tie.seed);
    let tried = Change::ALL.into_iter().filter(|c| options.tries(*c));
    outcome.tried = tried.map(|change| (change, options.cases)).collect();
    Ok(outcome)
}

/// The changes of one rig that made a difference, and for each whether the difference is a near
/// tie.
fn rig(
    seed: u64,
    strangers: &[records::Base],
    diagnose: bool,
    options: &Options,
    scratch: &Path,
) -> Vec<(Broken, bool)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let base = match strangers.len() as u64 {
        0 => records::draw(&mut random),
        count => strangers[(seed % count) as usize].clone(),
    };
    let folders = ["before", "after"].map(|name| scratch.join(name));
    let ask = |records: &[records::Part], folder: &Path| {
        // If this fails, every command fails and reports it.
        let _ = std::fs::create_dir_all(folder);
        Said::of(records, diagnose, folder, options.limit)
    };
    let before = ask(&base.parts, &folders[0]);
    let mut found = Vec::new();
    for change in Change::ALL {
        // The random numbers are drawn for every change, so that a change is the same with and
        // without the others.
        let (changed, factor, words) = change.applied(&base, &mut random);
        if !options.tries(change) {
            continue;
        }
        let after = ask(&changed, &folders[1]);
        let differs = broken(change, factor, &before, &after);
        let tie = change.changes_samples()
            && differs.of_answer.is_empty()
            && !before.is_built_as(&after)
            && is_near_tie(&folders[0], &folders[1], options.limit);
        let differs = differs.all();
        if !differs.is_empty() {
            let broken = Broken {
                change,
                seed,
                rig: format!("{}, {words}", base.words),
                differs,
            };
            found.push((broken, tie));
        }
    }
    found
}
