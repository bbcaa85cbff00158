//! The processor in the loop: builds the program for the board, with a case for every effect and kind of law or
//! with the user's model, and runs it in lockstep with model and plant on the host (`scenarios::lockstep`).

use crate::Task;
use crate::firmware::{Size, build, qemu, size};
use crate::shell::{firmware_target, run, scenario};
use anyhow::{Context, Result, bail};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) const TASK: Task = Task {
    name: "pil",
    does: "compares firmware and plant in lockstep with the host, bit for bit; --model FILE, --periods S,S, --case NAME, --serial DEVICE, --steps N, --lose N",
    run: |arguments| pil(arguments).map(|_| ()),
};

/// Result of a run.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// Mean instructions of each case.
    pub(crate) cases: BTreeMap<String, f64>,
    /// Largest number of instructions in a sample, for each case.
    pub(crate) most: BTreeMap<String, f64>,
    /// Deepest stack, bytes.
    pub(crate) stack: f64,
    /// Flash and RAM.
    pub(crate) size: Size,
}

/// The report of the program on the host.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Report {
    stack_bytes: f64,
    instructions_per_step: BTreeMap<String, f64>,
    most_instructions: BTreeMap<String, f64>,
}

pub(crate) fn pil(arguments: &[String]) -> Result<Outcome> {
    let (mut model, mut passed, mut serial) = (None::<PathBuf>, Vec::new(), false);
    let mut periods = None::<&String>;
    let mut rest = arguments.iter();
    while let Some(option) = rest.next() {
        let value = rest
            .next()
            .with_context(|| format!("{option} needs a value"))?;
        match option.as_str() {
            "--model" => model = Some(std::path::absolute(value)?),
            "--periods" => periods = Some(value),
            "--serial" | "--steps" | "--lose" | "--case" => {
                serial |= option == "--serial";
                passed.extend([option, value]);
            }
            _ => bail!(
                "unknown option {option}; the options are --model, --periods, --case, --serial, --steps, --lose"
            ),
        }
    }
    if model.is_some() && periods.is_some() {
        bail!(
            "--periods applies to the bundled models only, and a --model file states its period: give one of the two"
        );
    }
    let constants = constants(model.as_deref(), periods)?;
    let elf = if serial {
        build("nucleo-f446re", "nucleo-pil", &[], Some(&constants))?
    } else {
        build("qemu-mps2", "pil", &[], Some(&constants))?
    };
    let size = size(&elf)?;
    let report = firmware_target().join("pil.toml");
    let mut host = scenario("pil");
    host.arg("run").arg("--report").arg(&report).args(passed);
    if let Some(model) = &model {
        host.arg("--model").arg(model);
    }
    if let Some(periods) = periods {
        host.arg("--periods").arg(periods);
    }
    if !serial {
        let qemu = qemu(&elf);
        host.arg("--").arg(qemu.get_program()).args(qemu.get_args());
    }
    run(&mut host)?;
    println!("flash_bytes: {}\nram_bytes: {}", size.flash, size.ram);
    let text = std::fs::read_to_string(&report).with_context(|| report.display().to_string())?;
    let report: Report = toml::from_str(&text).with_context(|| report.display().to_string())?;
    Ok(Outcome {
        cases: report.instructions_per_step,
        most: report.most_instructions,
        stack: report.stack_bytes,
        size,
    })
}

/// The folder of constants with which the board's program is built.
fn constants(model: Option<&Path>, periods: Option<&String>) -> Result<PathBuf> {
    if let Some(model) = model {
        return crate::identified::of(Some(model), None);
    }
    let folder = firmware_target().join(if periods.is_some() {
        "cases-at-periods"
    } else {
        "cases"
    });
    std::fs::create_dir_all(&folder)?;
    let mut write = scenario("pil");
    write.arg("constants").arg(&folder);
    if let Some(periods) = periods {
        write.arg("--periods").arg(periods);
    }
    run(&mut write)?;
    Ok(folder)
}
