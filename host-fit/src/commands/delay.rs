//! `host-fit delay`: edge delays, the exponential law (2), its statistics.

use std::path::PathBuf;

use host_fit::data::DataSet;
use host_fit::delay::{DelayOptions, draw_delays};
use host_fit::output::Staging;
use host_fit::steps;

use super::Console;
use super::time_span::TimeSpan;

/// Measure the delay of the response to every edge of the command, and fit the law h = p0 + p1·exp(−p2·ỹ).
///
/// One plant of first or second order with dead time is fitted to all records. If it fits, the delay of an
/// edge is its shift on that trajectory; otherwise the start of each response is located separately. The law
/// is fitted to the identify records. It is rejected if it is not a valid delay on all records or not better
/// than a constant.
///
/// Example: host-fit delay DATASET --out delays
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// W of the averaged output ỹ: samples (250) or a time (0.25s). Models average over 250 samples [default: 250].
    #[arg(long, value_name = "TIME")]
    window: Option<TimeSpan>,
    /// Longest delay to search: samples (250) or a time (0.25s) [default: what the records can show].
    #[arg(long, value_name = "TIME")]
    max_delay: Option<TimeSpan>,
    /// Length of y on either side of the start of a response, if each edge is measured separately: samples
    /// (30) or a time (0.03s) [default: three response times, or half the time between edges if that is
    /// less].
    #[arg(long, value_name = "TIME")]
    reach: Option<TimeSpan>,
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
    let within = |time: Option<TimeSpan>, option: &str, least: u32, most: u32| {
        time.map(|time| time.samples_within(set.sample_period_s, option, least..=most))
            .transpose()
    };
    let usual = DelayOptions::default();
    let max_delay = within(args.max_delay, "--max-delay", 1, 100_000)?;
    let reach = within(args.reach, "--reach", 4, 10_000)?;
    let options = DelayOptions {
        window: within(args.window, "--window", 2, 1_000_000)?.unwrap_or(usual.window),
        max_delay: max_delay.map(|samples| samples as usize),
        reach: reach.map(|samples| samples as usize),
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
