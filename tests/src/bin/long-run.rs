//! Called by `cargo xtask long-run`: the board's loop for a day, and models in single against double precision.

use anyhow::{Result, ensure};
use clap::Parser;
use host_fit::model::Model;
use scenarios::long_run::{compare, day};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options.
#[derive(Parser)]
struct Options {
    /// Samples of the loop; 86400000 are 24 hours at 1 kHz.
    #[arg(long, default_value_t = 86_400_000)]
    ticks: u64,
    /// Steps of each model.
    #[arg(long, default_value_t = 100_000_000)]
    steps: u64,
    /// Seed of faults, commands and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of the models.
    #[arg(long, default_value = "firmware/identified/models")]
    models: PathBuf,
}

/// The typical difference of the last tenth is at most this multiple of that of the first tenth.
const GROWTH: f64 = 2.0;

fn main() -> Result<()> {
    let options = Options::parse();
    let started = Instant::now();
    let day = day(options.ticks, options.seed)?;
    println!(
        "the loop: {} samples, {} changes of the valve, {} bytes from the line, {} restarts by the watchdog; {:.0} s",
        day.ticks,
        day.switches,
        day.bytes,
        day.restarts,
        started.elapsed().as_secs_f64()
    );
    println!("samples in each mode: {:?}", day.modes);
    println!("faults: {:?}", day.faults);
    println!(
        "armed again against new: {} comparisons, predictions within {:e} y",
        day.fresh.0, day.fresh.1
    );
    println!(
        "equal, bit for bit, to a board whose clock and sample number wrap: {} samples, {} wraps",
        day.twin, day.wraps
    );
    if options.steps > 0 {
        models(&options)?;
    }
    println!("no rule was broken");
    Ok(())
}

fn models(options: &Options) -> Result<()> {
    println!(
        "\n| model | steps | largest output, y | largest difference, y | rms of the first tenth | rms of the last tenth |"
    );
    println!("|---|---|---|---|---|---|");
    let mut grown = Vec::new();
    for name in ["full", "effects", "own", "averaged", "slow", "volts"] {
        let path = options.models.join(name).with_extension("toml");
        let model = Model::load(Path::new(&path))?;
        let found = compare(&model, options.steps, options.seed)?;
        let most = found.parts.iter().fold(0.0, |m: f64, d| m.max(*d));
        let [first, .., last] = found.rms;
        println!(
            "| {name} | {} | {:.3} | {most:.1e} | {first:.1e} | {last:.1e} |",
            options.steps, found.largest
        );
        let [typical, .., typical_last] = found.typical;
        if typical_last > GROWTH * typical || most > found.largest {
            grown.push(name);
        }
    }
    ensure!(
        grown.is_empty(),
        "the difference of single and double precision grows: {grown:?}"
    );
    Ok(())
}
