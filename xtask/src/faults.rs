//! Fault injection: the firmware under QEMU with a sensor that falls ill; each
//! fault must shut the valve, stay latched with its reason, and be cleared only
//! by the operator.

use crate::Task;
use crate::firmware::{build, qemu};
use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader, Write};
use std::process::{ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

pub(crate) const TASK: Task = Task {
    name: "faults",
    does: "fault injection under QEMU: each fault shuts the valve and is latched",
    run: faults,
};

/// What makes the sensor ill, and the reason that must be latched.
const ILLNESSES: [(&str, &str); 5] = [
    ("1", "not-finite"),
    ("2", "at-rail"),
    ("3", "stuck"),
    ("4", "residual"),
    ("5", "overrun"),
];

pub(crate) fn faults(_arguments: &[String]) -> Result<()> {
    let elf = build("qemu-mps2", "qemu-mps2")?;
    let mut process = qemu(&elf)
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
                for line in BufReader::new(from).lines().map_while(Result::ok) {
                    if sender.send(line).is_err() {
                        return;
                    }
                }
            });
            dialogue(&mut Line { to, lines })
        });
    let _ = process.kill();
    let _ = process.wait();
    result
}

fn dialogue(line: &mut Line) -> Result<()> {
    // The self-test must have passed: a fault would show instead.
    line.until("status", |answer| answer.starts_with("disarmed"))?;
    for (illness, reason) in ILLNESSES {
        line.until("arm", |answer| answer.starts_with("armed"))?;
        line.until("status", |answer| answer.contains("valve=1"))?;
        line.send(illness)?;
        let latched = |answer: &str| {
            answer.starts_with(&format!("fault={reason} ")) && answer.contains("valve=0")
        };
        let answer = line.until("status", latched)?;
        println!("{illness}: {answer}");
        // Well again: the fault stays, and arming does not help.
        line.send("0")?;
        line.until("arm", latched)?;
        line.until("disarm", |answer| answer.starts_with("disarmed"))?;
    }
    Ok(())
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

    /// Repeats `command` until the answer is as wanted.
    fn until(&mut self, command: &str, wanted: impl Fn(&str) -> bool) -> Result<String> {
        let until = Instant::now() + Duration::from_secs(30);
        let mut last = String::new();
        while Instant::now() < until {
            self.send(&format!("{command}\n"))?;
            last = self
                .lines
                .recv_timeout(Duration::from_secs(10))
                .context("the firmware does not answer")?;
            if wanted(&last) {
                return Ok(last);
            }
        }
        bail!("after `{command}` the firmware goes on saying `{last}`")
    }
}
