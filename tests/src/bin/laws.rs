//! Counts wrong rejections of laws, accepted laws that lose attachment, and margins that do not hold.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::PathBuf;

use anyhow::Context;
use clap::Parser;
use scenarios::laws::{Row, play, table};

/// Laws on simulated rigs whose plants share no code with the model: one table.
///
/// Results are kept in a file, one line per rig; a stopped campaign continues there.
#[derive(Debug, Parser)]
#[command(name = "laws")]
struct Arguments {
    /// Number of rigs.
    #[arg(long, default_value_t = 200)]
    rigs: u64,
    /// Seed of the first rig.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Identify with two lags each and without a diagnosis. This takes a tenth of the time, but fewer
    /// models reach the noise level.
    #[arg(long)]
    quick: bool,
    /// File of the results.
    #[arg(long, value_name = "FILE.jsonl")]
    rows: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let mut rows: Vec<Row> = Vec::new();
    if let Some(text) = arguments
        .rows
        .as_ref()
        .and_then(|path| std::fs::read_to_string(path).ok())
    {
        for line in text.lines() {
            rows.push(
                serde_json::from_str(line)
                    .context("a row of another version of the program; use a new file")?,
            );
        }
    }
    for seed in arguments.seed..arguments.seed + arguments.rigs {
        if rows.iter().any(|row| row.seed == seed) {
            continue;
        }
        let row = match play(seed, arguments.quick) {
            Ok(row) => row,
            Err(error) => {
                eprintln!("rig {seed}: {error:#}");
                continue;
            }
        };
        eprintln!("rig {seed}: {}", serde_json::to_string(&row)?);
        if let Some(path) = &arguments.rows {
            let mut file = OpenOptions::new().create(true).append(true).open(path)?;
            writeln!(file, "{}", serde_json::to_string(&row)?)?;
        }
        rows.push(row);
    }
    println!("{}", table(&rows));
    Ok(())
}
