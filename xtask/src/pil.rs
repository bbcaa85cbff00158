//! The processor in the loop: the firmware under QEMU (or on a board) in
//! lockstep with a continuous-time plant on the host, over the serial line.
//!
//! The host runs the same controller in f32 and compares every prediction and
//! every decision bit for bit. Decisions travel to the plant in batches: air
//! that leaves the valve takes longer than a batch to arrive, so nothing that
//! is sensed in a batch depends on what is decided in it.

use crate::Task;
use crate::firmware::{Size, build, size};
use crate::shell::command;
use ::firmware::cases::{CASES, Rigs, SETTINGS};
use ::firmware::link::frame::{Frame, Receiver};
use ::firmware::link::lockstep::{BATCH, DAMAGED, REPORT, Report, START, STEPS};
use anyhow::{Context, Result, bail};
use firmware_sim::plant::{BasePlant, DelayLaw, PlantSpec, RateLaw, Rig};
use std::io::{Read, Write};
use std::process::{Child, Stdio};
use std::sync::mpsc::{Receiver as Channel, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

pub(crate) const TASK: Task = Task {
    name: "pil",
    does: "firmware and plant in lockstep, bit for bit; --serial DEVICE, --steps N, --lose N",
    run: |arguments| pil(arguments).map(|_| ()),
};

/// QEMU's SysTick under `-icount shift=5`: 40 ns a tick, 32 ns an instruction.
const INSTRUCTIONS_PER_TICK: f64 = 1.25;
/// A request is repeated this often before the link is given up.
const ATTEMPTS: u32 = 5;

/// What a case gave.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measured {
    /// Its name.
    pub(crate) case: &'static str,
    /// Mean instructions per step.
    pub(crate) mean: f64,
}

/// What the run gave.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// Each case.
    pub(crate) cases: Vec<Measured>,
    /// Deepest stack, bytes.
    pub(crate) stack: u32,
    /// Flash and RAM.
    pub(crate) size: Size,
}

pub(crate) fn pil(arguments: &[String]) -> Result<Outcome> {
    let (mut serial, mut steps, mut lose) = (None, 60_000_usize, 997_usize);
    let mut rest = arguments.iter();
    while let Some(option) = rest.next() {
        let value = rest
            .next()
            .with_context(|| format!("{option} needs a value"))?;
        match option.as_str() {
            "--serial" => serial = Some(value.clone()),
            "--steps" => steps = value.parse().context("--steps takes a number")?,
            "--lose" => lose = value.parse().context("--lose takes a number")?,
            _ => bail!("unknown option {option}; there are --serial, --steps, --lose"),
        }
    }
    let elf = match &serial {
        Some(_) => build("nucleo-f446re", "nucleo-pil", &[])?,
        None => build("qemu-mps2", "pil", &[])?,
    };
    let size = size(&elf)?;
    // A real board counts the cycles of its core.
    let (mut link, per_tick, unit) = match &serial {
        Some(device) => (Link::serial(device, lose)?, 1.0, "cycles"),
        None => (
            Link::qemu(&elf, lose)?,
            INSTRUCTIONS_PER_TICK,
            "instructions",
        ),
    };
    let started = Instant::now();
    let mut outcome = Outcome {
        cases: Vec::new(),
        stack: 0,
        size,
    };
    for (number, case) in CASES.iter().enumerate() {
        let (report, figures) = run_case(&mut link, number as u8, steps)?;
        let measured = Measured {
            case,
            mean: report.ticks as f64 * per_tick / f64::from(report.steps.max(1)),
        };
        println!(
            "{case}: {} steps equal bit for bit, {} switches, mean y {:.3}; \
             {:.0} {unit} a step, at most {:.0}",
            report.steps,
            figures.switches,
            figures.mean,
            measured.mean,
            f64::from(report.most) * per_tick
        );
        outcome.stack = report.stack;
        outcome.cases.push(measured);
    }
    println!(
        "link: {} bytes lost on purpose, {} requests repeated, none slipped; {:.1} s",
        link.lost,
        link.repeated,
        started.elapsed().as_secs_f64()
    );
    if let Some(first) = outcome.cases.first() {
        println!("{unit}_per_step: {:.0}", first.mean);
    }
    println!(
        "flash_bytes: {}\nram_bytes: {}\nstack_bytes: {}",
        size.flash, size.ram, outcome.stack
    );
    Ok(outcome)
}

struct Figures {
    switches: usize,
    mean: f64,
}

/// A rig with both sides of the bilinear class and the paper's delay law.
fn plant() -> Result<Rig> {
    let base = BasePlant {
        attach_s: 0.055,
        separate_s: 0.080,
        gain: 1.0,
        delay: DelayLaw::StateDependent {
            floor_s: 0.04735,
            rise_s: 0.01269,
            rate: 15.0,
        },
        rate_law: RateLaw::default(),
    };
    Ok(Rig::new(&PlantSpec::new(base, &[]), None)?)
}

fn run_case(link: &mut Link, case: u8, steps: usize) -> Result<(Report, Figures)> {
    let started = link.ask(START, &[case])?;
    if started != [1] {
        bail!("the board has no case {case}; flash the present firmware");
    }
    let mut host = Rigs::new();
    host.start(case);
    let mut plant = plant()?;
    let mut noise = 0x1234_5678_u32;
    let mut figures = Figures {
        switches: 0,
        mean: 0.0,
    };
    let mut open = false;
    let mut done = 0;
    while done < steps {
        let batch = BATCH.min(steps - done);
        // What the sensor shows during the batch: the air that arrives in it
        // left the valve before.
        let mut ahead = plant.clone();
        let mut counts = Vec::with_capacity(batch);
        for _ in 0..batch {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let scatter = f64::from(noise >> 24) / 256.0 * 0.04 - 0.02;
            let y = ahead.read() + scatter;
            figures.mean += ahead.friction() / steps as f64;
            let code = y / f64::from(SETTINGS.calibration.per_count)
                + f64::from(SETTINGS.calibration.zero);
            counts.push(code.round().clamp(0.0, 4095.0) as u16);
            ahead.advance_sample();
        }
        let bytes: Vec<u8> = counts.iter().flat_map(|c| c.to_le_bytes()).collect();
        let reply = link.ask(STEPS, &bytes)?;
        let (predictions, decisions) = reply
            .split_last_chunk::<4>()
            .context("the reply to a batch is too short")?;
        if predictions.len() != 4 * batch {
            bail!(
                "{} bytes of predictions for {batch} steps",
                predictions.len()
            );
        }
        let decisions = u32::from_le_bytes(*decisions);
        for (i, counts) in counts.iter().enumerate() {
            let (predicted, decided) = host.step(*counts);
            let bits = predictions
                .get(4 * i..4 * i + 4)
                .and_then(|bytes| bytes.try_into().ok())
                .map_or(0, u32::from_le_bytes);
            let board_open = decisions >> i & 1 == 1;
            if bits != predicted.to_bits() || board_open != decided {
                bail!(
                    "{}, step {}: board {:e} (0x{bits:08x}) {board_open}, host {predicted:e} (0x{:08x}) {decided}",
                    CASES[usize::from(case)],
                    done + i,
                    f32::from_bits(bits),
                    predicted.to_bits(),
                );
            }
            figures.switches += usize::from(board_open != open);
            open = board_open;
            plant.command(f64::from(u8::from(open)));
            plant.advance_sample();
        }
        done += batch;
    }
    let report = link.ask(REPORT, &[])?;
    let report = Report::from_bytes(&report).context("the report is too short")?;
    if report.steps as usize != steps {
        bail!("the board made {} steps, the host {steps}", report.steps);
    }
    if figures.switches < 10 {
        bail!("only {} switches: nothing was shown", figures.switches);
    }
    Ok((report, figures))
}

/// The host's end of the serial line.
struct Link {
    process: Option<Child>,
    to: Box<dyn Write>,
    from: Channel<u8>,
    receiver: Receiver,
    number: u16,
    /// Every so many bytes one is left out, to show that it is noticed; 0 never.
    lose: usize,
    sent: usize,
    lost: usize,
    repeated: usize,
}

impl Link {
    fn qemu(elf: &std::path::Path, lose: usize) -> Result<Self> {
        let mut process = crate::firmware::qemu(elf)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .context("could not start qemu-system-arm; run `cargo xtask setup`")?;
        let to = process.stdin.take().context("QEMU has no input")?;
        let from = process.stdout.take().context("QEMU has no output")?;
        Ok(Self::over(Some(process), Box::new(to), from, lose))
    }

    fn serial(device: &str, lose: usize) -> Result<Self> {
        // 115 200 baud, raw: as the boards set their UART up.
        crate::shell::run(&mut command(
            "stty",
            &["-F", device, "115200", "raw", "-echo"],
        ))?;
        let open = || {
            std::fs::OpenOptions::new()
                .read(true)
                .write(true)
                .open(device)
                .with_context(|| format!("could not open {device}"))
        };
        Ok(Self::over(None, Box::new(open()?), open()?, lose))
    }

    fn over(
        process: Option<Child>,
        to: Box<dyn Write>,
        mut from: impl Read + Send + 'static,
        lose: usize,
    ) -> Self {
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            let mut buffer = [0; 512];
            while let Ok(count @ 1..) = from.read(&mut buffer) {
                for byte in buffer.iter().take(count) {
                    if sender.send(*byte).is_err() {
                        return;
                    }
                }
            }
        });
        Self {
            process,
            to,
            from: receiver,
            receiver: Receiver::new(),
            number: 0,
            lose,
            sent: 0,
            lost: 0,
            repeated: 0,
        }
    }

    /// Sends a request until its reply has come.
    fn ask(&mut self, kind: u8, content: &[u8]) -> Result<Vec<u8>> {
        self.number = self.number.wrapping_add(1);
        let [low, high] = self.number.to_le_bytes();
        let request: Vec<u8> = [kind, low, high].iter().chain(content).copied().collect();
        let frame = Frame::new(&request);
        for attempt in 0..ATTEMPTS {
            self.repeated += usize::from(attempt > 0);
            let mut bytes = Vec::with_capacity(frame.bytes().len() + 1);
            // A zero first: whatever was cut off before ends here.
            for byte in std::iter::once(&0).chain(frame.bytes()) {
                self.sent += 1;
                if self.lose > 0 && self.sent.is_multiple_of(self.lose) {
                    self.lost += 1;
                } else {
                    bytes.push(*byte);
                }
            }
            self.to.write_all(&bytes).context("the board hung up")?;
            self.to.flush()?;
            let until = Instant::now() + Duration::from_secs(2);
            while let Some(reply) = self.reply(until)? {
                match reply.split_first_chunk::<3>() {
                    Some(([DAMAGED, ..], _)) => break,
                    Some((head, rest)) if *head == [kind, low, high] => return Ok(rest.to_vec()),
                    // The reply to an earlier sending.
                    _ => {}
                }
            }
        }
        bail!("no reply after {ATTEMPTS} requests; is the right firmware running?");
    }

    /// The next undamaged frame; `None` when time is up.
    fn reply(&mut self, until: Instant) -> Result<Option<Vec<u8>>> {
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.from.recv_timeout(left) {
                // A damaged reply is no reply: the request is repeated.
                Ok(byte) => {
                    if let Some(Ok(content)) = self.receiver.receive(byte) {
                        return Ok(Some(content.to_vec()));
                    }
                }
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                Err(RecvTimeoutError::Disconnected) => bail!("the board hung up"),
            }
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        if let Some(process) = &mut self.process {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}
