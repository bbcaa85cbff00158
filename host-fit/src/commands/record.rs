//! `host-fit record`: plays commands on the board and records the samples, or calibrates the rig.

use std::path::PathBuf;

use anyhow::{Context, bail};
use rig_line::calibrate::{self, ChannelSaid};
use rig_line::log::{Columns, Written, to_files};
use rig_line::record::Progress;
use rig_line::{Command, RigFile};
use serde::Serialize;

use super::average::{not_negative, positive};
use super::words::Words;
use super::{Console, interrupt};
use crate::rig_port::PortArgs;

/// Play commands with the board and record every sample: raw recordings for `average`.
///
/// The valve is closed at the end, on any fault, and when the link breaks. Repeats with a lost sample are
/// played again, so that every written repeat is complete and starts from rest. With `--calibrate` the rig is
/// measured instead; rig.toml is for `--rig` and for the next build of the firmware.
///
/// Example: host-fit record --port /dev/ttyACM0 --rig rig.toml --command command.csv -o raw
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Command to play: a CSV file with the columns t and u (0 or 1); repeatable, one after the other.
    #[arg(
        long,
        value_name = "experiment.csv",
        required_unless_present = "calibrate"
    )]
    command: Vec<PathBuf>,
    /// Number of repeats of each command.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    repeats: u32,
    /// Rest before each repeat with the valve closed, s: the flow must have settled.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.5, value_parser = not_negative)]
    rest: f64,
    /// Folder for the recordings; with `--calibrate` the rig file.
    #[arg(short, long, value_name = "DIR|rig.toml")]
    output: PathBuf,
    /// Rig file with the scale of the readings. Without it the board's own constants are used.
    #[arg(long, value_name = "rig.toml", conflicts_with = "calibrate")]
    rig: Option<PathBuf>,
    /// Calibrate the rig: zero, steady blowing, noise, converter limits, the valve's shortest times.
    #[arg(long)]
    calibrate: bool,
    /// With `--calibrate`: name, unit, zero in counts and units per count of the measured channel.
    #[arg(long, value_name = "NAME,UNIT,ZERO,PER_COUNT", requires = "calibrate", value_parser = said)]
    channel: Option<ChannelSaid>,
    /// With `--calibrate`: settling time of the flow, s [default: 4, or 1000 samples where that is longer].
    #[arg(long, value_name = "SECONDS", value_parser = positive, requires = "calibrate")]
    steady: Option<f64>,
    /// With `--calibrate`: number of pulses per length that is tried; with fewer pulses the detection of a response to
    /// short pulses is less reliable.
    #[arg(long, value_name = "COUNT", default_value_t = 24, value_parser = clap::value_parser!(u32).range(3..=10_000), requires = "calibrate")]
    pulses: u32,
    /// Acknowledge a latched fault, or disarm the law, first.
    #[arg(long)]
    disarm: bool,
}

fn said(text: &str) -> Result<ChannelSaid, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let number = |text: &str| {
        text.parse::<f64>()
            .map_err(|_| format!("`{text}` is not a number"))
    };
    match parts[..] {
        [name, unit, zero, per_count] => Ok(ChannelSaid {
            name: name.to_owned(),
            unit: unit.to_owned(),
            zero_counts: number(zero)?,
            per_count: number(per_count)?,
        }),
        _ => Err("four parts are needed: name, unit, counts at 0, units per count, as in u_inf,m/s,0,0.005".into()),
    }
}

/// The recordings of a run.
#[derive(Serialize)]
struct Recorded {
    recordings: Vec<Written>,
}

impl Words for Recorded {
    fn words(&self) -> String {
        let each = self.recordings.iter().map(|r| {
            let mut text = format!(
                "{}: {} complete repeats of {} s, {}",
                r.file.display(),
                r.repeats,
                r.period_s,
                if r.parts == 1 { "without interruption".into() } else { format!("in {} parts", r.parts) },
            );
            if r.lost_samples > 0 {
                text.push_str(&format!(
                    "; {} samples were lost ({} of them because the board's memory was full); their repeats \
                         were played again",
                    r.lost_samples, r.left_out_samples
                ));
            }
            text
        });
        let mut lines: Vec<String> = each.collect();
        if let [first, rest @ ..] = &self.recordings[..] {
            let same = rest.iter().all(|r| r.period_s == first.period_s);
            let folder = first.file.parent().unwrap_or(&first.file);
            lines.push(if same {
                format!(
                    "next: host-fit average {}/*.csv --period {} --out DIR",
                    folder.display(),
                    first.period_s
                )
            } else {
                "next: run `host-fit average` on each recording, with the --period of that recording".into()
            });
        }
        lines.join("\n")
    }
}

/// A calibrated rig.
#[derive(Serialize)]
struct Measured(RigFile);

impl Words for Measured {
    fn words(&self) -> String {
        let rig = &self.0;
        let [on, off] = rig.hold_samples();
        let noise = rig
            .sensor
            .noise_counts
            .unwrap_or_default()
            .map(|n| n * rig.sensor.per_count.abs());
        format!(
            "sensor: {} counts is y = 0, {:.1} is y = 1; noise {:.4} shut, {:.4} open (y)\n\
             valve: shortest effective pulse {on} samples open, {off} samples shut\n\
             alarm limit of the residual: {} (y)",
            rig.sensor.zero_counts,
            rig.sensor.zero_counts + 1.0 / rig.sensor.per_count,
            noise[0],
            noise[1],
            rig.residual_envelope
        )
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let commands = args.command.iter().map(|path| Command::load(path));
    let commands = commands.collect::<Result<Vec<_>, _>>()?;
    let twice = commands
        .iter()
        .enumerate()
        .find(|(i, c)| commands[..*i].iter().any(|o| o.name == c.name));
    if let Some((_, command)) = twice {
        bail!(
            "two commands are named `{}`, and their recordings would have the same name; rename a file",
            command.name
        );
    }
    let columns = match &args.rig {
        Some(path) => Columns::of(&RigFile::load(path)?),
        None => Columns::default(),
    };
    let mut connected = args.port.connect()?;
    if args.disarm {
        connected.host.disarm()?;
    }
    if args.calibrate {
        return calibrate(args, connected, console);
    }
    let mut recordings = Vec::new();
    for command in commands {
        let rest = (args.rest / command.sample_period_s).round() as u32;
        let command = command.with_rest(rest);
        let total = u64::from(args.repeats) * command.samples();
        let bar = console.progress(total, "{wide_bar} {msg} {eta}");
        let sensor = columns.sensor;
        let mut watch = |now: &Progress| {
            let done = u64::from(now.whole) * command.samples() + u64::from(now.sample);
            bar.set_position(done);
            let reading = sensor.map_or_else(
                || format!("{} counts", now.newest.counts),
                |scale| format!("y {:6.3}", rig_line::log::value(scale, now.newest.counts)),
            );
            bar.set_message(format!(
                "{} {}/{}  {reading}  valve {}  lost {}",
                command.name,
                now.whole,
                args.repeats,
                u8::from(now.newest.open),
                now.lost
            ));
        };
        let (host, mut again) = connected.ends();
        let written = to_files(
            host,
            &mut again,
            &command,
            args.repeats,
            &columns,
            &args.output,
            &mut watch,
        )?;
        bar.finish_and_clear();
        let cut = written.cut_short.clone();
        recordings.push(written);
        if let Some(why) = cut {
            let recorded = Recorded { recordings };
            console.show(&recorded, &[], &[])?;
            bail!("the recording was cut short: {why}");
        }
    }
    let files: Vec<PathBuf> = recordings.iter().map(|r| r.header.clone()).collect();
    let written: Vec<&std::path::Path> = files.iter().map(PathBuf::as_path).collect();
    console.show(&Recorded { recordings }, &[], &written)
}

fn calibrate(
    args: &Args,
    mut connected: crate::rig_port::Connected,
    console: Console,
) -> anyhow::Result<()> {
    let plan = calibrate::Plan {
        steady_s: args.steady,
        pulses: args.pulses,
        ..calibrate::Plan::default()
    };
    let bar = console.progress(0, "{spinner} {msg} ({elapsed})");
    let interrupt = interrupt::watch();
    let rig = calibrate::calibrate(
        &mut connected.host,
        &plan,
        args.channel.clone(),
        &mut |what, now| {
            bar.set_message(format!("{what}: {} counts", now.newest.counts));
            if interrupt.load(std::sync::atomic::Ordering::Relaxed) {
                // The board closes the valve by itself if its host is silent.
                std::process::exit(130);
            }
        },
    )
    .context("no rig file was written")?;
    bar.finish_and_clear();
    rig.save(&args.output)?;
    console.show(&Measured(rig), &[("output", &args.output)], &[&args.output])
}
