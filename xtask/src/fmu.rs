//! The recipe that makes FMUs, tried: `cargo xtask fmu` by FMPy, CI's step `examples` by calling the library.

use crate::Task;
use crate::shell::{command, output, program, root, run, target};
use anyhow::{Context, Result, ensure};
use std::path::Path;

pub(crate) const TASK: Task = Task {
    name: "fmu",
    does: "validates and simulates the recipe's FMUs with FMPy, which it installs into target/fmpy",
    run: |arguments| {
        ensure!(arguments.is_empty(), "there are no options");
        by_fmpy()
    },
};

const FMPY: &str = "fmpy==0.3.32";

/// Models and a record for each: one of the paper, one with a channel and effects of its own, one in volts.
const CASES: [(&str, &str, &str); 3] = [
    ("data/paper/table-2-state-dependent.toml", "t,u", "on"),
    (
        "firmware/identified/models/own.toml",
        "t,u,temperature",
        "on",
    ),
    ("firmware/identified/models/volts.toml", "t,u", "volts"),
];

fn by_fmpy() -> Result<()> {
    let environment = target().join("fmpy");
    let python = environment.join("bin/python");
    if !python.is_file() {
        run(command(crate::setup::python()?, &["-m", "venv"]).arg(&environment))?;
    }
    let python = python.to_string_lossy().into_owned();
    run(&mut command(
        &python,
        &["-m", "pip", "install", "--quiet", FMPY],
    ))?;
    let folder = target().join("fmu");
    std::fs::create_dir_all(&folder)?;
    check(&folder, &python, &["--fmpy"])
}

/// Exports each case into `folder`, makes its FMU, and compares its run with the host's, bit for bit.
pub(crate) fn check(folder: &Path, python: &str, options: &[&str]) -> Result<()> {
    for (number, (model, columns, level)) in CASES.into_iter().enumerate() {
        let file = |name: &str| folder.join(format!("fmu-{number}-{name}"));
        let (record, host, source, fmu) = (
            file("in.csv"),
            file("out.csv"),
            file("flow.c"),
            file("flow.fmu"),
        );
        std::fs::write(&record, commands(columns, level))?;
        let mut simulate = program()?;
        simulate
            .args(["simulate", model])
            .arg(&record)
            .arg("-o")
            .arg(&host);
        output(&mut simulate)?;
        let mut export = program()?;
        export
            .args([
                "codegen",
                model,
                "--lang",
                "c",
                "--precision",
                "double",
                "-o",
            ])
            .arg(&source);
        output(&mut export)?;
        let recipe = root().join("examples/fmu/make_fmu.py");
        let made = output(command(python, &[]).arg(recipe).arg(&source).arg(&fmu))?;
        let script = root().join("xtask/src/fmu.py");
        let mut compare = command(python, &[]);
        compare
            .arg(script)
            .args([&fmu, &record, &host])
            .args(options);
        let said = output(&mut compare).with_context(|| format!("the FMU of {model}"))?;
        let inputs = made
            .trim()
            .rsplit_once("fmu: ")
            .map_or("", |(_, names)| names);
        println!("FMU of {model}: {inputs}; {}", said.trim());
    }
    Ok(())
}

/// Pulses of several lengths and a channel that drifts in steps, 4000 samples.
fn commands(columns: &str, level: &str) -> String {
    let mut text = format!("{columns}\n");
    let (off, full) = if level == "volts" {
        (2.0, 7.0)
    } else {
        (0.0, 1.0)
    };
    for k in 0..4000_u32 {
        let on = (k / 70) % 3 == 0 || k % 900 > 600;
        let u = if on { full } else { off };
        text.push_str(&format!("{},{u}", f64::from(k) / 1000.0));
        if columns.ends_with("temperature") {
            text.push_str(&format!(",{}", 20.0 + f64::from(k / 16) / 64.0));
        }
        text.push('\n');
    }
    text
}
