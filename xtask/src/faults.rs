//! Fault injection: the firmware under QEMU with a faulty sensor, a loop that is late or hangs, and damaged
//! constants. Each fault must close the valve, stay latched with its reason, and leave a message in the log.

use crate::Task;
use crate::firmware::{build, qemu};
use crate::shell::{firmware_cargo, output, run, scenario};
use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

pub(crate) const TASK: Task = Task {
    name: "faults",
    does: "injects faults under QEMU, also on the serial line; each fault must close the valve, be latched and be \
         logged; --model FILE",
    run: faults,
};

/// Faults injected into the armed loop, with the reason that must be latched.
const INJECTED: [(&str, &str); 6] = [
    ("1", "not-finite"),
    ("2", "at-rail"),
    ("3", "stuck"),
    ("4", "residual"),
    ("5", "overrun"),
    ("6", "watchdog"),
];
/// Restarts with damaged constants: injection, and expected log message.
const DAMAGED: [(&str, &str); 2] = [("7", "self-test: Checksum"), ("8", "self-test: Golden")];

pub(crate) fn faults(arguments: &[String]) -> Result<()> {
    let constants = match arguments {
        [] => None,
        [option, model] if option == "--model" => {
            Some(crate::identified::of(Some(Path::new(model)), None)?)
        }
        _ => bail!("the only option is --model FILE"),
    };
    on_the_line(constants.as_deref(), &[])?;
    on_the_board(constants.as_deref())
}

/// The faults that depend on the period of the loop, on the board with these constants.
pub(crate) fn of_the_period(constants: &Path) -> Result<()> {
    on_the_line(Some(constants), &["--timed"])?;
    on_the_board(Some(constants))
}

/// Every fault that is injected into the board.
fn on_the_board(constants: Option<&Path>) -> Result<()> {
    let elf = build(
        "qemu-mps2",
        "qemu-mps2",
        &["--features", "defmt"],
        constants,
    )?;
    let log = elf.with_extension("log");
    let mut process = qemu(&elf)
        .args(["-semihosting-config", "enable=on,target=native,chardev=log"])
        .arg("-chardev")
        .arg(format!("file,id=log,path={}", log.display()))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("could not start qemu-system-arm; run `cargo xtask setup`")?;
    let result = process
        .stdin
        .take()
        .zip(process.stdout.take())
        .context("QEMU has no serial line")
        .and_then(|(to, from)| {
            let (sender, lines) = channel();
            std::thread::spawn(move || {
                let lines = BufReader::new(from).lines().map_while(Result::ok);
                // Telemetry is unsolicited; only answers count here.
                for line in lines.filter(|line| !line.starts_with("t ")) {
                    if sender.send(line).is_err() {
                        return;
                    }
                }
            });
            dialogue(&mut Line { to, lines })
        });
    let _ = process.kill();
    let _ = process.wait();
    result?;
    let messages = output(
        // The test runs for a second; full optimisation would take minutes.
        firmware_cargo(
            "run --release --quiet --package log-reader \
                --config=profile.release.opt-level=0 --config=profile.release.lto=\"off\" \
                --config=profile.release.codegen-units=16 --",
        )
        .arg(&elf)
        .arg(&log),
    )?;
    print!("{messages}");
    let injected = INJECTED.map(|(_, reason)| format!("latched: {reason}"));
    let damaged = DAMAGED.map(|(_, message)| message.to_owned());
    for expected in injected.iter().chain(&damaged) {
        if !messages.contains(expected.as_str()) {
            bail!("the log does not say `{expected}`");
        }
    }
    Ok(())
}

/// Faults between host and board.
fn on_the_line(constants: Option<&Path>, options: &[&str]) -> Result<()> {
    let rig = build("qemu-mps2", "qemu-rig", &[], constants)?;
    run(scenario("line-faults").arg(&rig).args(options))
}

fn dialogue(line: &mut Line) -> Result<()> {
    // The self-test must have passed, otherwise its fault is shown.
    line.until("status", |answer| answer.starts_with("disarmed"))?;
    for (injection, reason) in INJECTED {
        line.until("arm", |answer| answer.starts_with("armed"))?;
        // The law must hold the flow first; before that, a stuck sensor would be detected by the residual
        // and not as stuck.
        line.until("status", |answer| {
            answer.contains("valve=1") && friction(answer).is_some_and(|y| y > 0.4)
        })?;
        line.send(injection)?;
        let answer = line.until("status", latched(reason))?;
        println!("{injection}: {answer}");
        // The sensor has recovered: the fault stays latched, and arming is refused.
        line.send("0")?;
        line.until("arm", latched(reason))?;
        line.until("disarm", |answer| answer.starts_with("disarmed"))?;
    }
    for (injection, _) in DAMAGED {
        line.send(injection)?;
        let answer = line.until("status", latched("self-test"))?;
        println!("{injection}: {answer}");
        // Damaged constants persist: the operator cannot clear this fault.
        line.until("disarm", latched("self-test"))?;
        line.until("arm", latched("self-test"))?;
    }
    line.send("9")?;
    line.until("arm", |answer| answer.starts_with("armed"))?;
    Ok(())
}

/// The friction in a status line.
fn friction(answer: &str) -> Option<f32> {
    let y = answer.split(' ').find_map(|word| word.strip_prefix("y="))?;
    y.parse().ok()
}

fn latched(reason: &str) -> impl Fn(&str) -> bool {
    let begins = format!("fault={reason} ");
    move |answer| answer.starts_with(&begins) && answer.contains("valve=0")
}

struct Line {
    to: ChildStdin,
    lines: Receiver<String>,
}

impl Line {
    fn send(&mut self, bytes: &str) -> Result<()> {
        self.to.write_all(bytes.as_bytes())?;
        Ok(self.to.flush()?)
    }

    /// Repeats `command` until the answer matches. A restarting board does not answer meanwhile.
    fn until(&mut self, command: &str, wanted: impl Fn(&str) -> bool) -> Result<String> {
        // On a busy machine the emulated clock is slow.
        let until = Instant::now() + Duration::from_secs(120);
        let mut last = String::new();
        while Instant::now() < until {
            self.send(&format!("\n{command}\n"))?;
            match self.lines.recv_timeout(Duration::from_secs(1)) {
                Ok(answer) if wanted(&answer) => return Ok(answer),
                Ok(answer) => last = answer,
                Err(_) => last.clear(),
            }
        }
        bail!("after `{command}` the firmware still answers `{last}`")
    }
}
