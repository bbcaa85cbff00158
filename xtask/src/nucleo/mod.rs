//! The Nucleo's own program on QEMU's STM32F405 (`netduinoplus2`), as close to the hardware as possible without it.
//! The registers that the machine lacks are simulated through the debugger's port ([`chip`]). The program's
//! register settings are checked against the reference manual ([`manual`]).

mod chip;
mod debugger;
mod manual;
mod thumb;

use crate::Task;
use crate::firmware::build;
use crate::shell::command;
use anyhow::{Context, Result, ensure};
use chip::Chip;
use debugger::{Debugger, Stop, word};
use manual::field;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

pub(crate) const TASK: Task = Task {
    name: "nucleo",
    does: "runs the Nucleo's own program on QEMU's STM32F405: tests registers against the manual, then samples, operator and faults",
    run: |_| nucleo(),
};

/// The converters' interrupt as QEMU names it.
const CONVERTED: &str = "/machine/unattached/device[0]/adc-orirq unnamed-gpio-in 0";
/// The registers with the enabled interrupts, and the interrupts that the program enables.
const ENABLED: u32 = 0xE000_E100;
const INTERRUPTS: [u32; 2] = [18, 38];
/// Longest time for which the program may run without accessing a register.
const PATIENCE: Duration = Duration::from_secs(120);
/// The start is over when no register has been accessed for this time.
const QUIET: Duration = Duration::from_millis(300);
/// Time that a sample leaves the program for its serial line.
const BETWEEN: Duration = Duration::from_millis(2);

pub(crate) fn nucleo() -> Result<()> {
    let elf = build("nucleo-f446re", "nucleo-f446re", &[], None)?;
    let mut board = Board::start(&elf)?;
    board.begin()?;
    for line in manual::check(&board.chip)? {
        println!("{line}");
    }
    let enabled = board.debugger.memory(ENABLED, 8)?;
    let enabled = u64::from(word(&enabled).unwrap_or(0))
        | u64::from(enabled.get(4..).and_then(word).unwrap_or(0)) << 32;
    ensure!(
        enabled == INTERRUPTS.iter().map(|n| 1 << n).sum::<u64>(),
        "interrupts {enabled:#x} are enabled"
    );
    println!("interrupts: converter and USART2, no other");
    println!(
        "{} register writes before the first sample\n",
        board.chip.written.len()
    );
    for (name, step) in STEPS {
        let said = step(&mut board).with_context(|| name.to_owned())?;
        println!("{name}: {said}");
    }
    println!("{} samples", board.samples);
    Ok(())
}

/// One observation of the running program.
type Step = (&'static str, fn(&mut Board) -> Result<String>);

const STEPS: [Step; 5] = [
    ("natural flow", |board| {
        board.play(150)?;
        ensure!(!board.valve() && !board.lamp(), "valve or lamp is on");
        let answer = board.asked("status", "disarmed")?;
        Ok(format!("the watchdog is fed every sample; `{answer}`"))
    }),
    ("arm", |board| {
        let answer = board.asked("arm", "armed")?;
        let since = board.samples;
        while !board.valve() {
            board.play(1)?;
            ensure!(board.samples < since + 100, "the valve stays shut");
        }
        ensure!(board.lamp(), "LD2 is dark");
        Ok(format!(
            "`{answer}`, PB10 high after {} samples, LD2 lit",
            board.samples - since
        ))
    }),
    ("blue button", |board| {
        board.chip.pressed = true;
        board.play(2)?;
        board.chip.pressed = false;
        ensure!(!board.valve() && !board.lamp(), "valve or lamp is on");
        let answer = board.asked("status", "disarmed")?;
        Ok(format!("PB10 low two samples later, `{answer}`"))
    }),
    ("a broken wire", |board| {
        // The flow is at rest again, and so is the model.
        board.play(300)?;
        board.asked("arm", "armed")?;
        while !board.valve() {
            board.play(1)?;
        }
        board.broken = true;
        let since = board.samples;
        while board.valve() {
            board.play(1)?;
            ensure!(board.samples < since + 20, "the valve stays open");
        }
        let after = board.samples - since;
        board.broken = false;
        let answer = board.asked("status", "fault=at-rail")?;
        Ok(format!("PB10 low after {after} samples, `{answer}`"))
    }),
    ("a converter that stops", |board| {
        let fed = board.chip.fed;
        board.idle(Duration::from_millis(200))?;
        ensure!(board.chip.fed == fed, "the watchdog was fed");
        Ok("the watchdog gets nothing".into())
    }),
];

/// QEMU with the program, and the simulated registers.
struct Board {
    process: Child,
    debugger: Debugger,
    /// QEMU's own test port, which raises interrupts.
    test: BufReader<TcpStream>,
    serial: TcpStream,
    chip: Chip,
    samples: u32,
    friction: f64,
    broken: bool,
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Board {
    fn start(elf: &Path) -> Result<Self> {
        let (test, serial) = (
            TcpListener::bind("127.0.0.1:0")?,
            TcpListener::bind("127.0.0.1:0")?,
        );
        let mut process = command("qemu-system-arm", &["-machine", "netduinoplus2", "-S"])
            .args(["-display", "none", "-monitor", "none", "-gdb", "stdio"])
            .arg("-qtest")
            .arg(format!("tcp:{}", test.local_addr()?))
            .args(["-qtest-log", "none", "-serial", "null", "-serial"])
            .arg(format!("tcp:{},nodelay=on", serial.local_addr()?))
            .arg("-kernel")
            .arg(elf)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .context("could not start qemu-system-arm; run `cargo xtask setup`")?;
        let debugger = Debugger::over(&mut process)?;
        let serial = serial.accept()?.0;
        serial.set_read_timeout(Some(Duration::from_millis(1)))?;
        Ok(Self {
            process,
            debugger,
            serial,
            test: BufReader::new(test.accept()?.0),
            chip: Chip::after_reset(),
            samples: 0,
            friction: 0.0,
            broken: false,
        })
    }

    /// From reset until the program waits for its first sample.
    fn begin(&mut self) -> Result<()> {
        for word in Chip::words() {
            self.debugger.watch(word)?;
        }
        // The pin of LD2 is the last to be set up; the self-test runs before it.
        while field(self.chip.value(chip::GPIOA), 10, 2) != 1 {
            let access = self.run(PATIENCE)?;
            ensure!(access.is_some(), "the program does not reach its loop");
        }
        self.idle(QUIET)
    }

    /// Runs the program until no register has been accessed for `quiet`.
    fn idle(&mut self, quiet: Duration) -> Result<()> {
        while self.run(quiet)?.is_some() {}
        Ok(())
    }

    /// Runs the program to its next access, and serves it; `None` if there was no access within `patience`.
    fn run(&mut self, patience: Duration) -> Result<Option<u32>> {
        self.debugger.resume()?;
        let mut stop = self.debugger.stopped(patience)?;
        if stop.is_none() {
            self.debugger.interrupt()?;
            stop = self.debugger.stopped(Duration::from_secs(10))?;
        }
        match stop.context("the core does not stop")? {
            Stop::Access(address) => {
                self.serve(address)?;
                Ok(Some(address))
            }
            Stop::Asked => Ok(None),
        }
    }

    /// Serves the core's access to the word at `address`: stores a written value, or puts the read value into the
    /// core's register.
    fn serve(&mut self, address: u32) -> Result<()> {
        let at = self.debugger.register(15)? & !1;
        let bytes = self.debugger.memory(at, 4)?;
        let access = bytes
            .first_chunk()
            .and_then(|code| thumb::access(*code))
            .with_context(|| {
                format!("{bytes:02x?} at {at:#x} is no load or store of {address:#x}")
            })?;
        let mask = u32::MAX >> (32 - 8 * u32::from(access.size));
        if !access.load {
            let value = self.debugger.register(access.register)? & mask;
            self.chip.write(address, value);
        }
        self.debugger.step_over(address)?;
        if access.load && !Chip::is_qemus(address) {
            let value = self.chip.read(address) & mask;
            self.debugger.set_register(access.register, value)?;
        }
        Ok(())
    }

    fn valve(&self) -> bool {
        self.chip.value(chip::GPIOB + 0x14) >> 10 & 1 == 1
    }

    fn lamp(&self) -> bool {
        self.chip.value(chip::GPIOA + 0x14) >> 5 & 1 == 1
    }

    /// A flow that follows the valve in 40 ms, sampled `samples` times.
    fn play(&mut self, samples: u32) -> Result<()> {
        for _ in 0..samples {
            self.friction += (f64::from(u8::from(self.valve())) - self.friction) / 40.0;
            let noise = self.samples.wrapping_mul(0x9E37_79B9) >> 27;
            let counts = if self.broken {
                0
            } else {
                800 + (2000.0 * self.friction) as u16 + noise as u16
            };
            ensure!(self.chip.convert([counts, 2048]), "no conversion is set up");
            self.raise()?;
            let fed = self.chip.fed;
            // The button is read last; then the line is processed.
            while self
                .run(PATIENCE)?
                .context("the sample is never completed")?
                != chip::GPIOC + 0x10
            {}
            self.idle(BETWEEN)?;
            ensure!(
                self.chip.fed == fed + 1,
                "the watchdog was fed {} times in sample {}",
                self.chip.fed - fed,
                self.samples
            );
            self.samples += 1;
        }
        Ok(())
    }

    /// The converter's interrupt, once.
    fn raise(&mut self) -> Result<()> {
        for level in [1, 0] {
            let port = self.test.get_mut();
            port.write_all(format!("set_irq_in {CONVERTED} {level}\n").as_bytes())?;
            let mut answer = String::new();
            self.test.read_line(&mut answer)?;
            ensure!(answer.starts_with("OK"), "QEMU's test port says {answer}");
        }
        Ok(())
    }

    /// The operator types `line`; returns the answer that begins with `wanted`.
    fn asked(&mut self, line: &str, wanted: &str) -> Result<String> {
        self.serial.write_all(format!("\n{line}\n").as_bytes())?;
        let until = Instant::now() + Duration::from_secs(60);
        let mut heard = Vec::new();
        while Instant::now() < until {
            self.play(1)?;
            let mut buffer = [0; 256];
            if let Ok(count) = self.serial.read(&mut buffer) {
                heard.extend(buffer.iter().take(count));
            }
            // Telemetry is unsolicited and begins with `t `.
            let text = String::from_utf8_lossy(&heard);
            let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
            if let Some(answer) = whole.lines().find(|line| line.starts_with(wanted)) {
                return Ok(answer.trim_end().to_owned());
            }
        }
        anyhow::bail!(
            "after `{line}` the program says `{}`",
            String::from_utf8_lossy(&heard)
        )
    }
}
