//! Records in the formats of other loggers drawn from a seed: random rigs, clocks and formats.
//!
//! Each set is a folder with the logger's files and an `expected.toml`, and is run and checked like the project's
//! sets. The plants are linear; some sets have a second input, the others hide nothing.

mod kind;
mod logger;
mod plant;

use anyhow::{Context, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use kind::{Drawn, KINDS};
use logger::Logger;

/// Writes `count` sets of the campaign with this seed below `folder`, kinds in turn, and returns the folder of the
/// seed. Sets of an earlier run are replaced.
///
/// # Errors
/// Files that cannot be written, with their path.
pub fn draw(folder: &Path, seed: u64, count: usize) -> Result<PathBuf> {
    let folder = folder.join(format!("seed-{seed}"));
    if folder.exists() {
        fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    for index in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(index as u64);
        let kind = &KINDS[index % KINDS.len()];
        let drawn = (kind.draw)(&mut rng);
        let set = folder.join(format!("{index:03}-{}", kind.name));
        write(&set, kind.what, &drawn, &Logger::draw(&mut rng, &drawn))
            .with_context(|| set.display().to_string())?;
    }
    Ok(folder)
}

fn write(set: &Path, what: &str, drawn: &Drawn, logger: &Logger) -> Result<()> {
    fs::create_dir_all(set)?;
    let mut files = Vec::new();
    for (number, record) in drawn.records.iter().enumerate() {
        let name = format!("run-{number}.csv");
        fs::write(set.join(&name), logger.csv(record, drawn.period_s))?;
        files.push(name);
    }
    let mut import = logger.options();
    import.extend(drawn.import.clone());
    let commands = match drawn.dead_time {
        Some(_) => vec!["identify", "delay", "diagnose"],
        None => vec!["identify", "diagnose"],
    };
    let mut text = format!("# {}\n", drawn.truth);
    writeln!(text, "kind = {what:?}\n\n[[case]]\nname = \"run\"")?;
    writeln!(
        text,
        "files = {files:?}\nimport = {import:?}\ncommands = {commands:?}"
    )?;
    match drawn.input {
        Some(name) => writeln!(
            text,
            "verdicts = [\"effect-missing\"]\nnames = [\"input-{name}\"]"
        )?,
        None if drawn.disturbed => {
            writeln!(
                text,
                "verdicts = [\"nothing-missing\", \"unexplained\", \"partly-explained\"]"
            )?;
        }
        None => writeln!(text, "verdicts = [\"nothing-missing\"]")?,
    }
    if let Some(dead_time) = drawn.dead_time {
        writeln!(text, "dead_time_samples = {dead_time}")?;
    }
    Ok(fs::write(set.join("expected.toml"), text)?)
}

/// A number from `low` to `high` with evenly distributed logarithm.
fn logarithmic(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    rng.random_range(low.ln()..high.ln()).exp()
}

fn chance(rng: &mut ChaCha8Rng, probability: f64) -> bool {
    rng.random::<f64>() < probability
}

/// Standard normal (Box and Muller).
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strangers::folder;
    use host_fit::data::DataSet;

    fn drawn(count: usize) -> (tempfile::TempDir, PathBuf) {
        let scratch = tempfile::tempdir().unwrap();
        let folder = draw(scratch.path(), 3, count).unwrap();
        (scratch, folder)
    }

    #[test]
    fn a_set_of_every_kind_is_written_with_an_answer_that_can_be_read() {
        let (_scratch, folder) = drawn(KINDS.len());
        let cases = folder::cases(&folder).unwrap();
        assert_eq!(cases.len(), KINDS.len());
        for (case, kind) in cases.iter().zip(KINDS) {
            assert_eq!(case.kind, kind.what);
            assert!(case.files.iter().all(|file| file.is_file()), "{}", case.set);
            assert!(!case.right.verdicts.is_empty(), "{}", case.set);
        }
        let with_input = cases.iter().filter(|case| !case.right.names.is_empty());
        assert_eq!(with_input.count(), 1);
    }

    #[test]
    fn a_seed_draws_the_same_sets_however_many_are_drawn() {
        let ((_a, few), (_b, many)) = (drawn(2), drawn(5));
        for entry in fs::read_dir(&few).unwrap() {
            let set = entry.unwrap().path();
            for file in fs::read_dir(&set).unwrap() {
                let file = file.unwrap().path();
                let same = many.join(file.strip_prefix(&few).unwrap());
                assert_eq!(fs::read(&file).unwrap(), fs::read(same).unwrap());
            }
        }
    }

    /// A plain file is a data set without `import`.
    #[test]
    fn plain_loggers_write_what_can_be_loaded() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let drawn = (KINDS[0].draw)(&mut rng);
        let scratch = tempfile::tempdir().unwrap();
        let file = scratch.path().join("run.csv");
        fs::write(&file, Logger::PLAIN.csv(&drawn.records[0], drawn.period_s)).unwrap();
        let read = DataSet::load(&file).unwrap();
        assert!((read.sample_period_s / drawn.period_s - 1.0).abs() < 1e-6);
        assert_eq!(read.records[0].len(), drawn.records[0].y.len());
    }
}
