//! `host-fit watch`: monitors the closed loop, logs it and checks the model.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use anyhow::bail;
use rig_line::RigFile;
use rig_line::alarm::{DAY_S, Test, Verdict};
use rig_line::log::Columns;
use rig_line::watch::{Now, Plan, Watched, watch};
use rig_line::word;

use super::average::positive;
use super::words::Words;
use super::{Console, interrupt};
use crate::rig_port::PortArgs;

/// Monitor the law in operation: live values, a log for `compare` and `diagnose`, and a check that the model
/// still fits.
///
/// The residual (reading minus the model's free run) is averaged over blocks, and each block is compared with
/// the first ones; the probability of any false alarm in 8 hours is --false-alarms. The log starts at rest
/// and ends at the first lost sample, because a free run needs the whole history.
///
/// Example: host-fit watch --port /dev/ttyACM0 --rig rig.toml --seconds 60 -o service
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Let the law switch the valve after a second of rest, and close it at the end; without this option the
    /// loop is only observed.
    #[arg(long)]
    arm: bool,
    /// Duration, s; until Ctrl-C if not given.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    seconds: Option<f64>,
    /// Folder for the log, a data set.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Longest log, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = positive)]
    log: f64,
    /// Length of a block, s; several correlation times of the noise.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = block)]
    block: f64,
    /// Number of blocks of the baseline.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(3..=10_000))]
    learn: u32,
    /// Probability of a false alarm in 8 hours.
    #[arg(long, value_name = "CHANCE", default_value_t = 0.01, value_parser = positive)]
    false_alarms: f64,
    /// Rig file with the scale of the readings. Without it the board's own constants are used.
    #[arg(long, value_name = "rig.toml")]
    rig: Option<PathBuf>,
    /// Acknowledge a latched fault, or disarm the law, first.
    #[arg(long)]
    disarm: bool,
}

/// A block length of at most a day, for which the false-alarm rate is valid.
fn block(text: &str) -> Result<f64, String> {
    match positive(text)? {
        seconds if (1e-6..=DAY_S).contains(&seconds) => Ok(seconds),
        _ => Err(format!("a time from 1e-6 to {DAY_S} s is needed")),
    }
}

impl Words for Watched {
    fn words(&self) -> String {
        let mut lines = vec![format!(
            "{:.1} s, {} samples, {} lost",
            self.seconds, self.samples, self.lost_samples
        )];
        let shown = |name: &str, value: Option<f64>| value.map(|v| format!("{name} {v:.4}"));
        let figures = [
            shown("mean y", self.mean),
            shown("rms error", self.rms_error),
            shown("rms residual", self.rms_residual),
            shown("air", self.air),
            self.switches_per_s.map(|s| format!("switches/s {s:.1}")),
        ];
        let figures: Vec<String> = figures.into_iter().flatten().collect();
        if !figures.is_empty() {
            lines.push(figures.join(", "));
        }
        lines.extend(self.verdict.map(|verdict| judged(&verdict)));
        if self.log.is_some() {
            lines.push(format!("log: {} samples", self.logged));
        }
        lines.join("\n")
    }
}

fn judged(verdict: &Verdict) -> String {
    match verdict {
        Verdict::Learning { blocks_left } => {
            format!("the model is not checked yet: the baseline needs {blocks_left} more blocks")
        }
        Verdict::True { largest, threshold } => format!(
            "the model still fits: the largest deviation of a block is {largest:.1} standard deviations \
            (alarm at {threshold:.1})"
        ),
        Verdict::Stopped {
            at_s,
            residual,
            usual,
            distance,
            threshold,
        } => format!(
            "MODEL NO LONGER FITS at {at_s:.1} s: the residual went from {usual:.4} to {residual:.4}, {:.1} \
             standard deviations (alarm at {threshold:.1}); check the log with `compare` and `diagnose`",
            distance.abs()
        ),
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let columns = match &args.rig {
        Some(path) => Columns::of(&RigFile::load(path)?),
        None => Columns::default(),
    };
    let plan = Plan {
        arm: args.arm,
        rest_s: 1.0,
        duration_s: args.seconds.unwrap_or(f64::INFINITY),
        log_s: args.log,
        test: Test {
            block_s: args.block,
            learn: args.learn,
            false_alarms_per_day: args.false_alarms.min(1.0),
        },
    };
    let mut connected = args.port.connect()?;
    if args.disarm {
        connected.host.disarm()?;
    }
    let bar = console.progress(0, "{msg}");
    let interrupt = interrupt::watch();
    let watched = watch(
        &mut connected.host,
        &plan,
        &columns,
        args.output.as_deref(),
        &mut |now: &Now| {
            let shown = |name: &str, value: Option<f64>| {
                value.map_or_else(String::new, |v| format!("  {name} {v:6.3}"))
            };
            let state = match now.verdict {
                Verdict::Learning { .. } => "learning",
                Verdict::True { .. } => "true",
                Verdict::Stopped { .. } => "NO LONGER FITS",
            };
            bar.set_message(format!(
                "{:8.1} s  {}  y {:6.3}{}{}  valve {}  lost {}  model: {state}",
                now.t,
                word(now.phase),
                now.y,
                shown("y*", now.reference),
                shown("model", now.model),
                u8::from(now.open),
                now.lost
            ));
            !interrupt.load(Ordering::Relaxed)
        },
    )?;
    bar.finish_and_clear();
    let written = watched.log.clone();
    let written: Vec<_> = written.iter().map(PathBuf::as_path).collect();
    console.show(&watched, &[], &written)?;
    console.say(&format!(
        "probability of a false alarm in {} h: {}",
        DAY_S / 3600.0,
        plan.test.false_alarms_per_day
    ))?;
    match &watched.ended {
        Some(why) => bail!("{why}"),
        None => Ok(()),
    }
}
