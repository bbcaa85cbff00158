//! Agreement of the exported models between languages: `cargo xtask agreement`.

use anyhow::{Result, bail};
use clap::Parser;
use scenarios::agreement::{Gradings, Pace, Tool, cases, pace, run};
use std::process::ExitCode;

/// Runs every bundled model, effect, delay law and control law in C, Python and Octave and compares with the
/// host.
#[derive(Debug, Parser)]
#[command(name = "agreement")]
struct Arguments {
    /// Fail if a language's tool is not installed.
    #[arg(long)]
    all: bool,
    /// Instead of the comparison, times a million samples of the bundled models in each language.
    #[arg(long)]
    pace: bool,
    /// Tries each effect with graded commands of one kind, not of every kind.
    #[arg(long)]
    in_turn: bool,
    /// Only cases whose names contain this.
    #[arg(long, default_value = "")]
    only: String,
}

fn main() -> Result<ExitCode> {
    let arguments = Arguments::parse();
    let mut cases = cases(if arguments.in_turn {
        Gradings::InTurn
    } else {
        Gradings::All
    });
    cases.retain(|case| case.name.contains(&arguments.only));
    let folder = tempfile::tempdir()?;
    if arguments.pace {
        cases.retain(|case| case.is_bundled);
        println!(
            "{:<28} {:>8} {:>8} {:>8} {:>9}",
            "seconds for 10^6 samples", "Rust", "C", "C / Rust", "Python"
        );
        for case in &cases {
            let Pace { rust, c, python } = pace(case, folder.path())?;
            let python = python.map_or("-".to_owned(), |s| format!("{s:.2}"));
            println!(
                "{:<28} {rust:>8.3} {c:>8.3} {:>8.2} {python:>9}",
                case.name,
                c / rust
            );
        }
        return Ok(ExitCode::SUCCESS);
    }
    let mut failed = 0;
    println!("{:<44} {:<8} {:>12}", "model", "language", "difference");
    for tool in Tool::ALL {
        if !tool.is_installed() {
            if arguments.all {
                bail!("{tool:?} is not installed; run `cargo xtask setup`");
            }
            println!("{tool:?}: not installed");
            continue;
        }
        for row in run(tool, &cases, folder.path())? {
            failed += usize::from(!row.agrees);
            let mark = if row.agrees { "" } else { "  DIFFERS" };
            let said = if row.difference == 0.0 {
                "bit for bit".to_owned()
            } else {
                format!("{:.1e}", row.difference)
            };
            let instructions = row
                .instructions
                .map(|n| format!("{n:>8.0} instructions a sample"));
            let instructions = instructions.unwrap_or_default();
            println!(
                "{:<44} {:<8} {said:>12}{instructions}{mark}",
                row.case, row.language
            );
        }
    }
    println!(
        "{} models, {failed} differences beyond the tolerance",
        cases.len()
    );
    Ok(if failed == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
