//! The input of the commands: small records of a simulated flow.

use crate::random::Random;
use crate::shell::run;
use anyhow::{Context, Result};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Sampling period of the records, s.
const PERIOD_S: f64 = 0.01;
/// Samples of a period of the raw recording for `average`.
const REPEAT: usize = 100;
const RECORDS: [(&str, &str); 4] = [
    ("a", "identify"),
    ("b", "identify"),
    ("c", "validate"),
    ("d", "validate"),
];
const RIG: &str = "format_version = 1
sample_period_s = 0.01
residual_envelope = 0.5
[sensor]
zero_counts = 800.0
per_count = 0.0005
lower_rail_counts = 8.0
upper_rail_counts = 4087.0
stuck_after_samples = 50
[valve]
shortest_on_s = 0.01
shortest_off_s = 0.01
";

/// Writes the input into `folder`: a data set, one of a flow with plenum droop, records without a data set, a raw
/// recording, a rig file, and a model.
pub(super) fn write(folder: &Path, program: &Path, random: &mut Random) -> Result<()> {
    set(&folder.join("set"), 0.0, random)?;
    set(&folder.join("droop"), 0.4, random)?;
    let raw = folder.join("raw");
    fs::create_dir_all(&raw)?;
    for number in 0..1 + random.below(10) {
        let (name, _) = RECORDS[number % RECORDS.len()];
        fs::copy(
            folder.join("set").join(name).with_extension("csv"),
            raw.join(format!("{name}{number}.csv")),
        )?;
    }
    let repeated: Vec<bool> = (0..REPEAT * 6)
        .map(|k| (20..60).contains(&(k % REPEAT)))
        .collect();
    fs::write(folder.join("repeats.csv"), record(&repeated, 0.0, random))?;
    fs::write(folder.join("rig.toml"), RIG)?;
    let mut identify = Command::new(program);
    identify.current_dir(folder).args(
        "identify set -o model.toml --n1 1 --n2 1 --n3 1 --max-lag 12 --evaluations 100"
            .split_whitespace(),
    );
    run(identify.stdout(std::process::Stdio::null())).context("the model for the other commands")
}

/// A data set of a flow whose gain falls by the share `droop` while the valve is open.
fn set(folder: &Path, droop: f64, random: &mut Random) -> Result<()> {
    fs::create_dir_all(folder)?;
    let mut manifest = format!("sample_period_s = {PERIOD_S}\n");
    let samples = 400 + random.below(200);
    for (name, purpose) in RECORDS {
        let _ = write!(
            manifest,
            "[[record]]\nname = \"{name}\"\nfile = \"{name}.csv\"\nuse = \"{purpose}\"\n"
        );
        let mut left = 10;
        let mut on = false;
        let command: Vec<bool> = (0..samples)
            .map(|_| {
                if left == 0 {
                    on = !on;
                    left = 8 + random.below(40);
                }
                left -= 1;
                on
            })
            .collect();
        let text = record(&command, droop, random);
        fs::write(folder.join(format!("{name}.csv")), text)?;
    }
    fs::write(folder.join("dataset.toml"), manifest)?;
    Ok(())
}

/// The record of a command as text.
fn record(command: &[bool], most_droop: f64, random: &mut Random) -> String {
    let mut text = String::from("t,u,y\n");
    let (mut y, mut droop) = (0.0, 0.0);
    for (k, on) in command.iter().enumerate() {
        let noise = 0.005 * (random.signed() + random.signed());
        let time = k as f64 * PERIOD_S;
        let _ = writeln!(text, "{time:.2},{},{:.5}", u8::from(*on), y + noise);
        let jet = match k.checked_sub(5) {
            Some(before) if command[before] => 1.0,
            _ => 0.0,
        };
        droop += (most_droop * jet - droop) / 60.0;
        y += 0.1 * (jet * (1.0 - droop) - y);
    }
    text
}
