//! Runs the hidden-effects campaign and prints its tables as Markdown.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::Context;
use clap::Parser;
use scenarios::campaign::{Case, Given, Group, Program, Row, Sizes, cases, run, table};

/// The diagnosis on rigs that hide something.
///
/// One line a rig is kept in a file: a campaign that was stopped goes on where it was, and pieces of it can
/// run one after the other. Rows belong to the program that made them; take a new file for a new program.
#[derive(Debug, Parser)]
#[command(name = "hidden-effects")]
struct Arguments {
    /// File of the rows.
    #[arg(long, default_value = "target/hidden-effects.jsonl")]
    rows: PathBuf,
    /// Seed of the campaign.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rigs for each effect and each family.
    #[arg(long, default_value_t = 1)]
    draws: u64,
    /// Rigs for each effect in another law than the catalogue's.
    #[arg(long, default_value_t = 1)]
    altered: u64,
    /// Rigs that hide nothing, over all families, noises and nuisances.
    #[arg(long, default_value_t = 24)]
    nulls: u64,
    /// Rigs that hide two effects.
    #[arg(long, default_value_t = 8)]
    pairs: u64,
    /// Rigs for each fault that the catalogue does not have.
    #[arg(long, default_value_t = 1)]
    outside: u64,
    /// Rigs that are written down in five units each.
    #[arg(long, default_value_t = 2)]
    units: u64,
    /// Model that is handed in: default (what `identify` makes), lean, truth, guess, bad-delays.
    #[arg(long, default_value = "default", value_parser = given)]
    given: Given,
    /// Only this group: single, altered, nothing, pair, outside, units.
    #[arg(long, value_parser = group)]
    group: Option<Group>,
    /// Only cases with this in their key, as `memory1/` or `/hot-film-lag/`.
    #[arg(long, default_value = "")]
    only: String,
    /// Every N-th case from the I-th on, as 1/4.
    #[arg(long, default_value = "1/1", value_parser = part)]
    part: (usize, usize),
    /// Only the first so many of these cases; they are mixed.
    #[arg(long)]
    first: Option<usize>,
    /// Cases that run at the same time. From two on, each diagnosis has its share of the cores, and the whole
    /// is done sooner; times on the clock are those of a user only with one.
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// After how many seconds a run of the program is stopped.
    #[arg(long, default_value_t = 900)]
    limit: u64,
    /// Keeps a folder for every case that is not as it should be: data set, answer, models, documents.
    #[arg(long)]
    keep: Option<PathBuf>,
    /// The program that is asked; the one beside this one if not given.
    #[arg(long)]
    program: Option<PathBuf>,
    /// Only print the tables of the rows that there are.
    #[arg(long)]
    table: bool,
    /// Only print the cases.
    #[arg(long)]
    list: bool,
}

fn given(word: &str) -> Result<Given, String> {
    let found = Given::ALL.into_iter().find(|given| given.word() == word);
    found.ok_or_else(|| "one of default, lean, truth, guess, bad-delays is needed".to_owned())
}

fn group(word: &str) -> Result<Group, String> {
    let found = Group::ALL.into_iter().find(|group| group.word() == word);
    found
        .ok_or_else(|| "one of single, altered, nothing, pair, outside, units is needed".to_owned())
}

fn part(text: &str) -> Result<(usize, usize), String> {
    let numbers = text.split_once('/').and_then(|(i, n)| {
        let (i, n) = (i.parse::<usize>().ok()?, n.parse::<usize>().ok()?);
        (i >= 1 && i <= n).then_some((i, n))
    });
    numbers.ok_or_else(|| "two numbers as in 1/4 are needed".to_owned())
}

fn main() -> ExitCode {
    match campaign(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("hidden-effects: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn campaign(arguments: &Arguments) -> anyhow::Result<()> {
    let sizes = Sizes {
        draws: arguments.draws,
        altered: arguments.altered,
        nulls: arguments.nulls,
        pairs: arguments.pairs,
        outside: arguments.outside,
        units: arguments.units,
    };
    let (from, every) = arguments.part;
    let wanted: Vec<Case> = cases(&sizes, arguments.given, arguments.seed)
        .into_iter()
        .filter(|case| arguments.group.is_none_or(|group| case.group == group))
        .filter(|case| case.to_string().contains(&arguments.only))
        .skip(from - 1)
        .step_by(every)
        .take(arguments.first.unwrap_or(usize::MAX))
        .collect();
    if arguments.list {
        for case in &wanted {
            println!("{case}");
        }
        return Ok(());
    }
    let mut rows = read(&arguments.rows)?;
    if !arguments.table {
        let done = |case: &&Case| rows.contains_key(&case.to_string());
        let left: Vec<&Case> = wanted.iter().filter(|case| !done(case)).collect();
        eprintln!("{} cases, {} to run", wanted.len(), left.len());
        let cores = std::thread::available_parallelism()?.get();
        let program = Program {
            path: (arguments.program.clone()).unwrap_or_else(scenarios::program),
            limit: Duration::from_secs(arguments.limit),
            threads: cores.div_ceil(arguments.jobs.max(1)),
            keep: arguments.keep.clone(),
        };
        play(&left, &program, arguments)?;
        rows = read(&arguments.rows)?;
    }
    let known: Vec<Row> = (wanted.iter())
        .filter_map(|case| rows.get(&case.to_string()).cloned())
        .collect();
    print!("{}", table(&known));
    Ok(())
}

/// Runs cases and appends their rows.
fn play(left: &[&Case], program: &Program, arguments: &Arguments) -> anyhow::Result<()> {
    let path = &arguments.rows;
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
            let row = run(case, program);
            let line = serde_json::to_string(&row)?;
            if let Ok(mut file) = file.lock() {
                writeln!(file, "{line}")?;
            }
            tell(&row);
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..arguments.jobs.max(1))
            .map(|_| scope.spawn(work))
            .collect();
        for worker in workers {
            match worker.join() {
                Ok(done) => done?,
                Err(_) => anyhow::bail!("a worker broke down"),
            }
        }
        Ok(())
    })
}

/// A line for whoever watches.
fn tell(row: &Row) {
    let mark = match (row.is_found(), row.is_right()) {
        (true, true) => "ok   ",
        (true, false) => "extra",
        (false, _) => "MISS ",
    };
    let over = |over: Option<f64>| over.map_or("-".to_owned(), |over| format!("{over:.2}"));
    let parameters: Vec<String> = (row.parameters.iter())
        .map(|p| format!("{} {:.4} -> {:.4}", p.name, p.truth, p.found))
        .collect();
    eprintln!(
        "{mark} {}: {} | {} -> {} x floor, {:.0} + {:.0} s | {}",
        row.key,
        row.said(),
        over(row.given_over_floor),
        over(row.over_floor),
        row.identify.wall_s,
        row.diagnose.wall_s,
        parameters.join(", ")
    );
}

/// The rows of a file by their keys; the last of each counts. A line that cannot be read, as the last one of a
/// campaign that was killed, is run again.
fn read(path: &Path) -> anyhow::Result<BTreeMap<String, Row>> {
    let mut rows = BTreeMap::new();
    if !path.is_file() {
        return Ok(rows);
    }
    for (number, line) in fs::read_to_string(path)?.lines().enumerate() {
        match serde_json::from_str::<Row>(line) {
            Ok(row) => _ = rows.insert(row.key.clone(), row),
            Err(error) => eprintln!("{}, line {}: {error}", path.display(), number + 1),
        }
    }
    Ok(rows)
}
