//! Mutated input for every reader of foreign files, in this process and with a stable compiler.
//!
//! Branches are not counted. The response of a target to an input (its message without the numbers in it) is used
//! instead: an input with a new response is kept and mutated further. Inputs that once caused a failure are in
//! `tests/data/fuzz/TARGET` and are tried by a test.

mod mutate;
mod targets;

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub use targets::{TARGETS, Target};

/// Time limit for an input; exceeding it is a failure.
const LONGEST: Duration = Duration::from_secs(20);
/// Number of inputs kept for mutation.
const KEPT: usize = 5000;
/// The longest input, bytes: small inputs are enough for line and table readers.
const LARGEST: usize = 1 << 14;

/// Result for a target.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Number of inputs tried.
    pub executions: u64,
    /// Number of distinct responses.
    pub said: usize,
    /// The first input that caused a failure, and the failure.
    pub broken: Option<(Vec<u8>, String)>,
}

/// Folder of a target's stored inputs.
#[must_use]
pub fn corpus(target: &Target) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("data/fuzz")
        .join(target.name)
}

/// The stored inputs of a target, by name.
#[must_use]
pub fn kept(target: &Target) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(corpus(target))
        .into_iter()
        .flatten()
        .flatten();
    let mut inputs: Vec<(String, Vec<u8>)> = entries
        .filter_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            Some((name, std::fs::read(entry.path()).ok()?))
        })
        .collect();
    inputs.sort();
    inputs
}

/// Tries one input: the response, or the failure.
///
/// # Errors
/// The panic's message.
pub fn try_one(target: &Target, input: &[u8]) -> Result<String, String> {
    let done = catch_unwind(AssertUnwindSafe(|| (target.run)(input)));
    done.map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
        text.unwrap_or_else(|| "a panic".to_owned())
    })
}

/// The first words of a response without numbers, quotes and brackets, which depend on the input.
fn shape(said: &str) -> String {
    let mut own = String::new();
    let mut until = None;
    for c in said.chars() {
        match (until, c) {
            (Some(end), c) if c == end => until = None,
            (Some(_), _) => {}
            (None, '`' | '"') => until = Some(c),
            (None, '(') => until = Some(')'),
            (None, c) => own.push(c),
        }
    }
    let words = own.split(|c: char| !c.is_ascii_alphabetic());
    let words: Vec<&str> = words.filter(|word| word.len() > 1).take(10).collect();
    words.join(" ")
}

/// Tries mutated inputs for some time, or until a failure.
#[must_use]
pub fn fuzz(target: &Target, time: Duration, seed: u64) -> Outcome {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut pool: Vec<Vec<u8>> = kept(target).into_iter().map(|(_, input)| input).collect();
    pool.extend((target.seeds)());
    let mut outcome = Outcome::default();
    let mut known = HashSet::new();
    let now: Arc<Mutex<(Instant, Vec<u8>)>> = Arc::new(Mutex::new((Instant::now(), Vec::new())));
    watch(target.name, Arc::downgrade(&now));
    let until = Instant::now() + time;
    let mut first = 0;
    while Instant::now() < until {
        let input = match pool.get(first) {
            Some(seed) => seed.clone(),
            None => {
                let of = pool[random.random_range(0..pool.len())].clone();
                let other = &pool[random.random_range(0..pool.len())];
                let mut input = mutate::mutated(of, other, target.words, &mut random);
                input.truncate(LARGEST);
                input
            }
        };
        first += 1;
        *now.lock().unwrap_or_else(PoisonError::into_inner) = (Instant::now(), input.clone());
        outcome.executions += 1;
        match try_one(target, &input) {
            Ok(said) => {
                if known.insert(shape(&said)) && pool.len() < KEPT && first > pool.len() {
                    pool.push(input);
                    first = pool.len();
                }
            }
            Err(how) => {
                outcome.broken = Some((input, how));
                break;
            }
        }
    }
    outcome.said = known.len();
    outcome
}

/// Ends the process if an input takes too long, since a thread cannot be stopped. The input is left in the
/// folder of temporary files.
fn watch(name: &'static str, now: std::sync::Weak<Mutex<(Instant, Vec<u8>)>>) {
    std::thread::spawn(move || {
        while let Some(now) = now.upgrade() {
            let (since, input) = now.lock().unwrap_or_else(PoisonError::into_inner).clone();
            drop(now);
            if since.elapsed() > LONGEST {
                let path = std::env::temp_dir().join(format!("fuzz-{name}-no-end"));
                let _ = std::fs::write(&path, input);
                eprintln!(
                    "{name}: no end within {LONGEST:?}; the input is {}",
                    path.display()
                );
                std::process::exit(1);
            }
            std::thread::sleep(Duration::from_millis(500));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests all seeds and all stored inputs, such as those of earlier failures.
    #[test]
    fn every_input_that_was_kept_is_withstood() {
        for target in TARGETS {
            let seeds = (target.seeds)()
                .into_iter()
                .map(|seed| ("a seed".to_owned(), seed));
            for (name, input) in seeds.chain(kept(target)) {
                if let Err(how) = try_one(target, &input) {
                    panic!("{} breaks {}: {how}", name, target.name);
                }
            }
        }
    }

    /// A deliberate failure is found, with its input.
    #[test]
    fn a_fault_is_found() {
        fn odd(input: &[u8]) -> String {
            assert!(!input.windows(2).any(|pair| pair == b"77"), "two sevens");
            format!("{} bytes", input.len())
        }
        let target = Target {
            name: "odd",
            seeds: || vec![b"a = 7, b = 8".to_vec()],
            words: &["7"],
            run: odd,
        };
        let outcome = fuzz(&target, Duration::from_secs(60), 1);
        let (input, how) = outcome.broken.expect("found");
        assert!(how.contains("two sevens") && String::from_utf8_lossy(&input).contains("77"));
    }

    #[test]
    fn what_is_said_is_told_apart_without_its_numbers() {
        assert_eq!(
            shape("line 12, column `x y`: 3.25"),
            shape("line 7, column `z`: 41.9")
        );
        assert_ne!(shape("line 1: empty"), shape("line 1: full"));
    }
}
