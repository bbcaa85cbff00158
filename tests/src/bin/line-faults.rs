//! Faults on the line, under QEMU: garbage, half frames, a host that stops, two hosts, a board that is reset. (The
//! firmware's tests cover a host that does not read, because QEMU stops if its line is not read.) The valve ends
//! closed, and no sample is lost undetected. `cargo xtask faults` runs it with the board's program.

use anyhow::{Context, Result, bail, ensure};
use rig_line::alarm::Test;
use rig_line::emulator::{self, Emulator};
use rig_line::log::Columns;
use rig_line::record::record;
use rig_line::watch::{Plan, Turn, watch};
use rig_line::{Command, Event, Host, LineError, word};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Samples of the flow's dead time, and of its lag. They are close to the bundled models; otherwise the residual
/// would close the valve.
const DEAD_TIME: usize = 50;
const LAG: f64 = 150.0;

/// A first-order flow with dead time, read with noise.
#[derive(Default)]
struct Flow {
    friction: f64,
    /// Valve positions of the latest [`DEAD_TIME`] samples.
    valve: std::collections::VecDeque<bool>,
    k: u64,
}

impl emulator::Rig for Flow {
    fn sample(&mut self, open: bool) -> [u16; 2] {
        self.k += 1;
        self.valve.push_back(open);
        let blows = self.valve.len() > DEAD_TIME && self.valve.pop_front() == Some(true);
        self.friction += (f64::from(u8::from(blows)) - self.friction) / LAG;
        let noise = (self.k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) % 41;
        [
            800 + (2000.0 * self.friction) as u16 + noise as u16,
            (self.k % 4096) as u16,
        ]
    }
}

/// A board with its host.
struct Bench {
    emulator: Emulator,
    host: Host,
}

type Fault = (&'static str, fn(Bench) -> Result<String>);

/// Option: run only the faults that depend on the period of the loop.
const TIMED: &str = "--timed";
const FAULTS: [Fault; 6] = [
    ("a host that stops during a command", dead),
    ("no fault: the law is watched", watched),
    ("garbage and half frames", garbage),
    ("two hosts", two),
    ("a board that is reset during a recording", reset),
    ("a disarm typed between frames", typed),
];
/// Number of faults at the start of [`FAULTS`] that depend on the period of the loop.
const OF_THE_PERIOD: usize = 2;

fn main() -> Result<()> {
    let elf: PathBuf = std::env::args_os()
        .nth(1)
        .context("name the program of the board qemu-rig")?
        .into();
    let faults = match std::env::args().nth(2).as_deref() {
        None => FAULTS.len(),
        Some(TIMED) => OF_THE_PERIOD,
        Some(other) => bail!("`{other}`: the only option is {TIMED}"),
    };
    for (name, fault) in &FAULTS[..faults] {
        let mut emulator = Emulator::start(&elf, Box::new(Flow::default()))?;
        let port = emulator.port().context("a serial line")?;
        let host = Host::new(port, 1, Some(emulator.pace.clone()));
        let said = fault(Bench { emulator, host }).with_context(|| (*name).to_owned())?;
        println!("{name}: {said}");
    }
    Ok(())
}

/// Open for most of two seconds.
const LONG: [u32; 3] = [10, 2000, 100];

fn begin(bench: &mut Bench, runs: &[u32]) -> Result<()> {
    bench.host.hello()?;
    bench.host.load(runs)?;
    bench.host.play(runs, 1)?;
    Ok(())
}

/// Counts of a stream: samples, missing samples by number, and missing samples that the board counted.
fn count(
    bench: &mut Bench,
    while_at_it: &mut dyn FnMut(&mut Host, u32) -> Result<()>,
) -> Result<[u32; 3]> {
    let (mut came, mut missing, mut next) = (0, 0, 0);
    loop {
        match bench.host.next(Duration::from_secs(5))? {
            Event::Samples(streamed) => {
                let first = streamed.samples.first().map_or(streamed.next, |s| s.0);
                missing += first - next;
                next = streamed.next;
                came += streamed.samples.len() as u32;
                if streamed.last {
                    return Ok([came, missing, streamed.left_out]);
                }
                while_at_it(&mut bench.host, next)?;
            }
            Event::Silence => bail!("silence after {next} samples"),
        }
    }
}

/// The board's sample period, s.
fn period_s(bench: &mut Bench) -> Result<f64> {
    Ok(f64::from(bench.host.hello()?.period_us) * 1e-6)
}

fn shut(bench: &mut Bench) -> Result<()> {
    let until = Instant::now() + Duration::from_secs(120);
    let mut seen = None;
    // The valve must be closed, and still closed 50 samples later.
    while Instant::now() < until {
        let samples = bench.emulator.samples();
        match (bench.emulator.is_open(), seen) {
            (true, _) => seen = None,
            (false, None) => seen = Some(samples),
            (false, Some(since)) if samples > since + 50 => return Ok(()),
            _ => {}
        }
        bench.host.alive()?;
        std::thread::sleep(Duration::from_millis(5));
    }
    bail!("the valve is still open");
}

fn garbage(mut bench: Bench) -> Result<String> {
    begin(&mut bench, &LONG)?;
    let mut seed = 9_u32;
    let mut sent = 0;
    let [came, missing, left_out] = count(&mut bench, &mut |host, next| {
        if next < 1500 {
            let noise: Vec<u8> = (0..40)
                .map(|_| {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (seed >> 24) as u8
                })
                .collect();
            sent += noise.len();
            host.port().send(&noise)?;
            // Half of a request is sent without the other half.
            host.port().send(&[0, 40, 0x26, 1])?;
        }
        Ok(())
    })?;
    ensure!(
        (came, missing, left_out) == (2110, 0, 0),
        "{came} {missing} {left_out}"
    );
    let damaged = bench.host.hello()?.damaged;
    ensure!(damaged > 20, "{damaged} damaged frames were detected");
    shut(&mut bench)?;
    Ok(format!(
        "{sent} bytes of it, {damaged} damaged frames detected, all {came} samples received"
    ))
}

fn dead(mut bench: Bench) -> Result<String> {
    begin(&mut bench, &[10, 1_000_000, 10])?;
    let start = bench.emulator.samples();
    let _ = bench.host.next(Duration::from_millis(500))?;
    let port = bench.host.into_port();
    let mut bench = Bench {
        host: Host::new(port, 2, None),
        ..bench
    };
    shut(&mut bench)?;
    let after = bench.emulator.samples() - start;
    ensure!(after < 3000, "{after} samples");
    let phase = word(bench.host.hello()?.phase);
    ensure!(phase == "link", "{phase}");
    Ok(format!(
        "the valve is closed {after} samples after its beginning, fault={phase}"
    ))
}

fn two(mut bench: Bench) -> Result<String> {
    begin(&mut bench, &[10, 1_000_000, 10])?;
    let pace = bench.emulator.pace.clone();
    let mut second = Host::new(bench.host.into_port(), 2, Some(pace));
    let refused = match second.arm() {
        Err(LineError::Refused { reason, .. }) => reason,
        other => bail!("{other:?}"),
    };
    // The first host is gone: its command has ended, and the fault waits to be acknowledged.
    ensure!(
        refused.contains("link") || refused.contains("another host"),
        "{refused}"
    );
    second.disarm()?;
    let mut bench = Bench {
        host: second,
        ..bench
    };
    shut(&mut bench)?;
    Ok(format!("the second is refused: {refused}"))
}

fn reset(mut bench: Bench) -> Result<String> {
    let levels = (0..1000).map(|k| (100..500).contains(&k));
    let command = Command::new("pulse", period_s(&mut bench)?, levels);
    let mut kept = 0;
    let emulator = &bench.emulator;
    let recording = record(
        &mut bench.host,
        &mut || Err(LineError::Gone("it was pulled".into())),
        &command,
        6,
        &mut |repeat, samples| {
            kept += 1;
            let follow = samples
                .windows(2)
                .all(|w| (w[0].channel + 1) % 4096 == w[1].channel);
            if !follow {
                return Err(std::io::Error::other("a repeat of pieces"));
            }
            if repeat == 2 {
                emulator.press_reset();
            }
            Ok(())
        },
        &mut |_| {},
    )?;
    ensure!(
        (kept, recording.whole, recording.parts.len()) == (6, 6, 2),
        "{recording:?}"
    );
    shut(&mut bench)?;
    Ok(format!(
        "{}; six complete repeats in two parts",
        recording.parts[0].ended
    ))
}

fn typed(mut bench: Bench) -> Result<String> {
    begin(&mut bench, &LONG)?;
    let mut typed = false;
    let [came, missing, _] = count(&mut bench, &mut |host, next| {
        if next > 500 && !typed {
            typed = true;
            host.port().send(b"\ndisarm\n")?;
        }
        Ok(())
    })?;
    ensure!(missing == 0 && came < 2000, "{came} {missing}");
    shut(&mut bench)?;
    Ok(format!(
        "closed after {came} samples, as the stream reports"
    ))
}

/// Four thousand samples of the law on a plant that differs from its model.
fn watched(mut bench: Bench) -> Result<String> {
    let period_s = period_s(&mut bench)?;
    let plan = Plan {
        arm: true,
        rest_s: 100.0 * period_s,
        duration_s: 4000.0 * period_s,
        log_s: f64::INFINITY,
        test: Test::default(),
    };
    let mut reference = None;
    let watched = watch(
        &mut bench.host,
        &plan,
        &Columns::default(),
        None,
        &mut |now| {
            reference = now.reference.or(reference);
            Turn::GoOn
        },
    )?;
    shut(&mut bench)?;
    ensure!(
        watched.ended.is_none() && watched.lost_samples == 0,
        "{watched:?}"
    );
    let (reference, mean) = (
        reference.context("no reference")?,
        watched.mean.context("no mean")?,
    );
    ensure!((mean - reference).abs() < 0.1, "{mean} for {reference}");
    let lasted = watched.seconds / period_s;
    ensure!((4000.0..4100.0).contains(&lasted), "{watched:?}");
    Ok(format!(
        "{:.1} s at a sample every {} ms, none lost, mean {mean:.3} for {reference:.3}, {:.2} switches/s",
        watched.seconds,
        1e3 * period_s,
        watched.switches_per_s.unwrap_or(f64::NAN)
    ))
}
