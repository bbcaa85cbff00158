//! Tests invariances of the program's answer on random rigs.

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use scenarios::invariances::{Broken, Change, Options, run};

/// Changes of records that must not change the answer: scale and level of y, of u, of the clock, additional rest at
/// the start, records cut, reordered, renamed. Exit code 1 if one of them changes it.
#[derive(Debug, Parser)]
#[command(name = "invariances")]
struct Arguments {
    /// Number of rigs; every change is applied once to each.
    #[arg(long, default_value_t = 200)]
    cases: u64,
    /// The first rig.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Use the records of `tests/data/strangers` instead of simulated rigs.
    #[arg(long)]
    strangers: bool,
    /// Run `diagnose` on every N-th rig; 0 for none.
    #[arg(long, value_name = "COUNT", default_value_t = 10)]
    diagnose_every: u64,
    /// Only this change: output, command, inverted, clock, rest, cut, order, names; repeatable.
    #[arg(long, value_name = "CHANGE", value_parser = change)]
    only: Vec<Change>,
    /// Time limit of a command.
    #[arg(long, value_name = "SECONDS", default_value_t = 300)]
    limit: u64,
    /// Rigs that run in parallel.
    #[arg(long, value_name = "COUNT", default_value_t = 1)]
    jobs: usize,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

fn change(word: &str) -> Result<Change, String> {
    Change::of(word).ok_or_else(|| "not a change; --help lists them".to_owned())
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let options = Options {
        cases: arguments.cases,
        seed: arguments.seed,
        strangers: arguments.strangers,
        diagnose_every: arguments.diagnose_every,
        only: arguments.only,
        limit: Duration::from_secs(arguments.limit),
        jobs: arguments.jobs,
    };
    let tell = |broken: &Broken| {
        let differs = broken.differs.join("; ");
        eprintln!("seed {} {}: {differs}", broken.seed, broken.change.words());
    };
    match run(&options, tell) {
        Err(error) => {
            eprintln!("invariances: {error}");
            ExitCode::FAILURE
        }
        Ok(outcome) => {
            match (arguments.json, serde_json::to_string_pretty(&outcome)) {
                (true, Ok(text)) => println!("{text}"),
                _ => print!("{}", outcome.table()),
            }
            ExitCode::from(u8::from(!outcome.broken.is_empty()))
        }
    }
}
