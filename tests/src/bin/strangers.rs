//! Runs the program on records from other loggers and prints the table.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use scenarios::strangers::{Options, Row, Step, by_kind, drawn, json, run, table};

/// Every set compared with the three baselines: scored samples, FIT, verdict, delay, seconds, and whether the
/// result is right.
///
/// The project's sets, or those of the named folders. A set is a folder with `expected.toml`, or with
/// `*_train*.csv` and `*_test*.csv`. Exit code 1 if a result is wrong.
#[derive(Debug, Parser)]
#[command(name = "strangers")]
struct Arguments {
    /// A folder of sets; repeatable.
    #[arg(long, value_name = "DIR")]
    folder: Vec<PathBuf>,
    /// Draw this many sets from the seed, 21 kinds in turn, and run them.
    #[arg(long, value_name = "COUNT", conflicts_with = "folder")]
    drawn: Option<usize>,
    /// Seed of the drawn sets.
    #[arg(long, default_value_t = 1, requires = "drawn")]
    seed: u64,
    /// Folder for the drawn sets, which are kept there.
    #[arg(
        long,
        value_name = "DIR",
        default_value = "target/strangers",
        requires = "drawn"
    )]
    draw_into: PathBuf,
    /// Only sets or cases whose name contains this; repeatable.
    #[arg(long, value_name = "WORD")]
    only: Vec<String>,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
    /// Also run `extend` and `discover`, and check the files that they write with `compare`.
    #[arg(long)]
    all: bool,
    /// Leave out this command; repeatable.
    #[arg(long, value_name = "COMMAND", value_parser = step)]
    without: Vec<Step>,
    /// Time limit of a command.
    #[arg(long, value_name = "SECONDS", default_value_t = 300)]
    limit: u64,
    /// Cases that run in parallel.
    #[arg(long, value_name = "COUNT", default_value_t = 1)]
    jobs: usize,
}

fn step(word: &str) -> Result<Step, String> {
    Step::named(word).ok_or_else(|| "one of delay, diagnose, discover, extend is needed".to_owned())
}

fn main() -> ExitCode {
    let mut arguments = Arguments::parse();
    if let Some(count) = arguments.drawn {
        match drawn::draw(&arguments.draw_into, arguments.seed, count) {
            Ok(folder) => arguments.folder.push(folder),
            Err(error) => {
                eprintln!("strangers: {error:#}");
                return ExitCode::FAILURE;
            }
        }
    }
    let options = Options {
        folders: arguments.folder,
        only: arguments.only,
        all_commands: arguments.all,
        without: arguments.without,
        limit: Duration::from_secs(arguments.limit),
        jobs: arguments.jobs,
    };
    let tell = |row: &Row| {
        let mark = match (row.is_right(), &row.skipped) {
            (_, Some(_)) => "skip ",
            (true, _) => "ok   ",
            (false, _) => "WRONG",
        };
        eprintln!("{mark} {} {} ({:.1} s)", row.set, row.case, row.seconds);
    };
    match run(&options, tell) {
        Err(error) => {
            eprintln!("strangers: {error:#}");
            ExitCode::FAILURE
        }
        Ok(rows) => {
            if arguments.json {
                println!("{:#}", json(&rows));
            } else if arguments.drawn.is_some() {
                print!("{}", by_kind(&rows));
            } else {
                print!("{}", table(&rows));
            }
            let all_right = rows.iter().all(|row| row.wrong.is_empty());
            ExitCode::from(u8::from(!all_right))
        }
    }
}
