//! Invariances: what does not change the answer of the program, on rigs that are drawn at random and on
//! records of strangers.
//!
//! | change | the answer |
//! |---|---|
//! | y → a·y + b, \|b\| up to 100 × the range | the same, errors times \|a\| |
//! | u → α·u + β, also inverted | the same |
//! | t → c·t, 0.1 ms to 60 s a sample | the same in samples |
//! | rest added in front | the same within the scatter |
//! | records cut anywhere, or joined | the same within the scatter |
//! | records reordered, or renamed | the same to the last digit |
//!
//! The answer is verdict and names of `diagnose`, structure and delay of the model, FIT, error and poles, and the delays
//! that `delay` measures.

mod change;
mod records;
mod said;

pub use change::Change;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use said::{Said, broken};
use serde::Serialize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// What is to be run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Rigs; each is changed in every way once.
    pub cases: u64,
    /// The first rig.
    pub seed: u64,
    /// Records of strangers in place of drawn rigs.
    pub strangers: bool,
    /// `diagnose` is asked of every so-many-th rig; 0 for none.
    pub diagnose_every: u64,
    /// The changes that are tried; all if empty.
    pub only: Vec<Change>,
    /// After how long a command is stopped.
    pub limit: Duration,
    /// Rigs that are asked of side by side.
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
    /// What was changed.
    pub change: Change,
    /// Seed of the rig: `--seed` of it alone shows it again.
    pub seed: u64,
    /// The rig and the change with their numbers.
    pub rig: String,
    /// What differs, one sentence each.
    pub differs: Vec<String>,
}

/// What came of it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Outcome {
    /// The changes, and on how many rigs each was tried.
    pub tried: Vec<(Change, u64)>,
    /// Those that made a difference, in the order of seeds.
    pub broken: Vec<Broken>,
}

impl Outcome {
    /// A line for each change: how often it held, and each that broke below it.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = String::from("| change | broken |\n|---|---|\n");
        for (change, cases) in &self.tried {
            let count = self.broken.iter().filter(|b| b.change == *change).count();
            text += &format!("| {} | {count} of {cases} |\n", change.words());
        }
        for broken in &self.broken {
            let Broken {
                change,
                seed,
                rig,
                differs,
            } = broken;
            let differs = differs.join("; ");
            text += &format!("- {}, seed {seed}, {rig}: {differs}\n", change.words());
        }
        text
    }
}

/// Tries every change on every rig; `tell` hears of each that made a difference as it comes.
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
                    let broken = rig(seed, strangers, diagnose, options, folder.path());
                    broken.iter().for_each(tell);
                    if let Ok(mut outcome) = outcome.lock() {
                        outcome.broken.extend(broken);
                    }
                }
            });
        }
    });
    let mut outcome = outcome.into_inner().unwrap_or_default();
    outcome.broken.sort_by_key(|broken| broken.seed);
    let tried = Change::ALL.into_iter().filter(|c| options.tries(*c));
    outcome.tried = tried.map(|change| (change, options.cases)).collect();
    Ok(outcome)
}

/// The changes of one rig that made a difference.
fn rig(
    seed: u64,
    strangers: &[records::Base],
    diagnose: bool,
    options: &Options,
    scratch: &std::path::Path,
) -> Vec<Broken> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let base = match strangers.len() as u64 {
        0 => records::draw(&mut random),
        count => strangers[(seed % count) as usize].clone(),
    };
    let ask = |records: &[records::Part]| Said::of(records, diagnose, scratch, options.limit);
    let before = ask(&base.parts);
    let mut found = Vec::new();
    for change in Change::ALL {
        // Drawn for every change, so that each is the same with and without the others.
        let (changed, factor, words) = change.applied(&base, &mut random);
        if !options.tries(change) {
            continue;
        }
        let differs = broken(change, factor, &before, &ask(&changed));
        if !differs.is_empty() {
            found.push(Broken {
                change,
                seed,
                rig: format!("{}, {words}", base.words),
                differs,
            });
        }
    }
    found
}
