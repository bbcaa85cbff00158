//! `host-fit average`: raw recordings to a phase-averaged data set.

use std::path::{Path, PathBuf};

use host_fit::data::{Align, Averaging};
use host_fit::steps;

use super::Console;

/// Phase-average long raw recordings, in constant memory, into a data set with y_sd, y_min and y_max.
///
/// Each RAW.csv (columns t,u,y and any channels; u is 0 or 1) becomes one record named by the file. A period is
/// dropped and counted if it has missing or unreadable samples, or if its command differs from that of most
/// periods.
///
/// Example: host-fit average raw.csv --period 10 --out set
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Raw recordings; each repeats one command sequence.
    #[arg(required = true, value_name = "RAW.csv")]
    recordings: Vec<PathBuf>,
    /// Length of one repeat of the command sequence, s.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    period: f64,
    /// Folder for the data set (dataset.toml and one CSV per recording).
    #[arg(long, value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    out: PathBuf,
    /// Time after the first row at which the first period starts, s; best while the flow is at rest.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = not_negative)]
    start: f64,
    /// Align repeats on the command's rising edges, or on whole periods of the recording's clock.
    #[arg(long, value_enum, default_value_t = Alignment::Edges)]
    align: Alignment,
    /// Largest difference of an edge between repeats, samples.
    #[arg(long, value_name = "SAMPLES", default_value_t = 1)]
    edge_jitter: usize,
    /// Name of a recording (file name without .csv) that becomes a validation record; repeatable.
    #[arg(long, value_name = "NAME")]
    validate: Vec<String>,
    /// Title of the data set.
    #[arg(long)]
    title: Option<String>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Alignment {
    Edges,
    Grid,
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("a finite number above 0 is needed".into()),
    }
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x >= 0.0 => Ok(x),
        _ => Err("a finite number, 0 or above, is needed".into()),
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let paths: Vec<&Path> = args.recordings.iter().map(PathBuf::as_path).collect();
    let averaging = Averaging {
        period_s: args.period,
        start_s: args.start,
        align: match args.align {
            Alignment::Edges => Align::Edges,
            Alignment::Grid => Align::Grid,
        },
        edge_jitter: args.edge_jitter,
    };
    let sizes: Vec<u64> = paths
        .iter()
        .map(|p| std::fs::metadata(p).map_or(0, |m| m.len()))
        .collect();
    let bar = console.progress(
        sizes.iter().sum(),
        "averaging {wide_bar} {bytes}/{total_bytes} {bytes_per_sec} {eta}",
    );
    let mut progress = |file: usize, bytes| {
        bar.set_position(sizes.iter().take(file).sum::<u64>() + bytes);
    };
    let mut average = steps::average(&paths, &args.validate, &averaging, &mut progress)?;
    bar.finish_and_clear();
    average.set.title.clone_from(&args.title);
    average.set.save(&args.out)?;
    console.show(&average, &[("dataset", &args.out)], &[&args.out])
}
