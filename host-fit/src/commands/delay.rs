//! `host-fit delay`: edge delays, the exponential law (2), its statistics.

use std::path::PathBuf;

use host_fit::data::DataSet;
use host_fit::delay::{DelayOptions, draw_delays};
use host_fit::output::Staging;
use host_fit::steps;

use super::Console;

/// Measure the delay of the response to every edge of the command, and fit the law h = p0 + p1·exp(−p2·ỹ).
///
/// A delay is the time from an edge to the kink where y starts to head elsewhere, located by least squares between
/// the neighbouring responses. The law is fitted to the identify records.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// W of the averaged output ỹ, in samples.
    #[arg(long, value_name = "SAMPLES", default_value_t = 250, value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    window: u32,
    /// Longest delay that is looked for, in samples.
    #[arg(long, value_name = "SAMPLES", default_value_t = 250, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    max_delay: u32,
    /// Samples of y used on either side of the start of a response.
    #[arg(long, value_name = "SAMPLES", default_value_t = 30, value_parser = clap::value_parser!(u32).range(8..=10_000))]
    reach: u32,
    /// Seed of the permutation tests.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for edges.csv (every edge) and delays.svg (the picture).
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let set = DataSet::load(&args.dataset)?;
    let options = DelayOptions {
        window: args.window,
        max_delay: args.max_delay as usize,
        reach: args.reach as usize,
        seed: args.seed,
    };
    let report = steps::measure_delays(&set, &options)?;
    if let Some(out) = &args.out {
        let mut staging = Staging::new(out)?;
        staging.write("edges.csv", |file| report.write_csv(file))?;
        let title = set.title.as_deref().unwrap_or_default();
        let picture = draw_delays(&report.study, title, set.sample_period_s);
        staging.write("delays.svg", |file| file.write_all(picture.as_bytes()))?;
        staging.commit()?;
    }
    console.show(&report, &[], &[])
}
