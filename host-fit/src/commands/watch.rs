//! `host-fit watch`: monitors the closed loop, logs it and checks the model.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};

use anyhow::bail;
use rig_line::alarm::{Test, Verdict, YEAR_S};
use rig_line::log::Columns;
use rig_line::watch::{Now, Plan, Turn, Watched, watch};
use rig_line::{Change, RigFile, word};

use super::average::positive;
use super::words::Words;
use super::{Console, interrupt};
use crate::rig_port::PortArgs;

/// Monitor the law in operation: live values, a log for `compare` and `diagnose`, and a check that the model
/// still fits.
///
/// The residual (reading minus the model's free run) is averaged over blocks, and each block is compared with
/// all before it. The probability of a false alarm in a year is at most --false-alarms, however long it runs. The
/// log starts at rest and ends at the first lost sample, because a free run needs the whole history.
///
/// With --control the running law is changed while it is watched, by lines on standard input: `target 0.6`,
/// `air 0.4`, `pause`, `resume`, `stop`.
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
    /// Number of blocks of the baseline, before the first test.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(3..=10_000))]
    learn: u32,
    /// Largest probability of a false alarm in a year of operation.
    #[arg(long, value_name = "CHANCE", default_value_t = 0.01, value_parser = positive)]
    false_alarms: f64,
    /// Change the running law by lines on standard input: `target Y` (y* as shown), `air SHARE` (of the time, 1 for no
    /// limit), `pause` (valve shut), `resume`, `stop`.
    #[arg(long)]
    control: bool,
    /// Rig file with the scale of the readings. Without it the board's own constants are used.
    #[arg(long, value_name = "rig.toml")]
    rig: Option<PathBuf>,
    /// Acknowledge a latched fault, or disarm the law, first.
    #[arg(long)]
    disarm: bool,
}

/// A block length of at most a year, for which the false-alarm rate is stated.
fn block(text: &str) -> Result<f64, String> {
    match positive(text)? {
        seconds if (1e-6..=YEAR_S).contains(&seconds) => Ok(seconds),
        _ => Err(format!("a time from 1e-6 to {YEAR_S} s is needed")),
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
            self.least_margin.map(|m| {
                format!(
                    "residual at most {:.0} % of the board's limit",
                    100.0 * (1.0 - m)
                )
            }),
        ];
        let figures: Vec<String> = figures.into_iter().flatten().collect();
        if !figures.is_empty() {
            lines.push(figures.join(", "));
        }
        lines.extend(self.changes.iter().map(|one| {
            let answer = one.refused.as_deref().unwrap_or("done");
            format!("{:.1} s, {}: {answer}", one.t, one.change)
        }));
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
            "the model still fits: the evidence of a change was at most 10^{largest:.1} (alarm at 10^{threshold:.1})"
        ),
        Verdict::Stopped {
            at_s,
            residual,
            usual,
            distance,
            threshold,
        } => format!(
            "MODEL NO LONGER FITS at {at_s:.1} s: the mean residual changed from {usual:.4} to {residual:.4} in the \
             last block, by {:.1} standard deviations; the evidence of a change exceeds 10^{threshold:.1}. Check the \
             log with `compare` and `diagnose`",
            distance.abs()
        ),
    }
}

/// A line of the operator.
#[derive(Debug, PartialEq)]
enum Order {
    Change(Change),
    Stop,
}

/// The order in a line, or an error with the permitted orders.
fn order(line: &str) -> Result<Order, String> {
    let mut words = line.split_whitespace();
    let (word, value, rest) = (words.next(), words.next(), words.next());
    let number = || value.and_then(|text| text.parse().ok());
    let change = match (word, value) {
        (Some("target"), Some(_)) => number().map(Change::Target),
        (Some("air"), Some(_)) => number().map(Change::Air),
        (Some("pause"), None) => Some(Change::Pause),
        (Some("resume"), None) => Some(Change::Resume),
        (Some("stop"), None) => return Ok(Order::Stop),
        _ => None,
    };
    match (change, rest) {
        (Some(change), None) => Ok(Order::Change(change)),
        _ => Err(format!(
            "`{}` is not a valid line; write `target Y`, `air SHARE`, `pause`, `resume` or `stop`",
            line.trim()
        )),
    }
}

/// The lines of standard input, as they come.
fn typed() -> Receiver<String> {
    let (sender, receiver) = channel();
    // This thread ends with the program, because a read of a terminal cannot be interrupted.
    std::thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    receiver
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
            false_alarms_per_year: args.false_alarms.min(1.0),
        },
    };
    let mut connected = args.port.connect()?;
    if args.disarm {
        connected.host.disarm()?;
    }
    let bar = console.progress(0, "{msg}");
    let interrupt = interrupt::watch();
    let lines = args.control.then(typed);
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
                "{:8.1} s  {}  y {:6.3}{}{}{}{}  valve {}  lost {}  model: {state}",
                now.t,
                word(now.phase),
                now.y,
                shown("y*", now.reference),
                shown("model", now.model),
                shown("residual", now.residual),
                now.margin
                    .map_or_else(String::new, |m| format!("  margin {:3.0} %", 100.0 * m)),
                u8::from(now.open),
                now.lost
            ));
            if interrupt.load(Ordering::Relaxed) {
                return Turn::End;
            }
            let line = lines.as_ref().and_then(|lines| lines.try_recv().ok());
            match line
                .filter(|line| !line.trim().is_empty())
                .map(|line| order(&line))
            {
                None => Turn::GoOn,
                Some(Ok(Order::Change(change))) => Turn::Change(change),
                Some(Ok(Order::Stop)) => Turn::End,
                Some(Err(wrong)) => {
                    bar.println(wrong);
                    Turn::GoOn
                }
            }
        },
    )?;
    bar.finish_and_clear();
    let written = watched.log.clone();
    let written: Vec<_> = written.iter().map(PathBuf::as_path).collect();
    console.show(&watched, &[], &written)?;
    console.say(&format!(
        "probability of a false alarm in a year: at most {}",
        plan.test.false_alarms_per_year
    ))?;
    match &watched.ended {
        Some(why) => bail!("{why}"),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_a_whole_line() {
        let change = |line: &str| match order(line) {
            Ok(Order::Change(change)) => Some(change),
            _ => None,
        };
        assert_eq!(change("target 0.6"), Some(Change::Target(0.6)));
        assert_eq!(change("  air 0.4 "), Some(Change::Air(0.4)));
        assert_eq!(change("pause"), Some(Change::Pause));
        assert_eq!(change("resume"), Some(Change::Resume));
        assert_eq!(order("stop"), Ok(Order::Stop));
        for wrong in [
            "target",
            "target x",
            "target 0.6 0.7",
            "pause 3",
            "arm",
            "0.6",
        ] {
            assert!(order(wrong).is_err(), "{wrong}");
        }
    }
}
