//! Agreement of the exported models between languages: `cargo xtask agreement`.

use anyhow::{Result, bail};
use clap::Parser;
use scenarios::agreement::{Tool, cases, run};
use std::process::ExitCode;

/// Runs every bundled model, effect, delay law and control law in C, Python and Octave and compares with the
/// host.
#[derive(Debug, Parser)]
#[command(name = "agreement")]
struct Arguments {
    /// Fail if a language's tool is not installed.
    #[arg(long)]
    all: bool,
    /// Only cases whose names contain this.
    #[arg(long, default_value = "")]
    only: String,
}

fn main() -> Result<ExitCode> {
    let arguments = Arguments::parse();
    let mut cases = cases();
    cases.retain(|case| case.name.contains(&arguments.only));
    let folder = tempfile::tempdir()?;
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
            println!("{:<44} {:<8} {said:>12}{mark}", row.case, row.language);
        }
    }
    println!(
        "{} models, {failed} differences beyond what is promised",
        cases.len()
    );
    Ok(if failed == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
