//! Tests of the FMU recipe: `cargo xtask fmu` with FMPy, CI's step `examples` by calling the library.

use crate::Task;
use crate::shell::{command, output, program, root, run, target};
use anyhow::{Context, Result, ensure};
use std::path::Path;

pub(crate) const TASK: Task = Task {
    name: "fmu",
    does: "validates and simulates the recipe's FMUs with FMPy, which it installs into target/fmpy",
    run: by_fmpy,
};

const FMPY: &str = "fmpy==0.3.32";

/// Models, each with the columns of a record and its commands for no jet and a full jet.
const CASES: [(&str, &str, [u8; 2]); 3] = [
    ("data/paper/table-2-state-dependent.toml", "t,u", [0, 1]),
    (
        "firmware/identified/models/own.toml",
        "t,u,temperature",
        [0, 1],
    ),
    ("firmware/identified/models/volts.toml", "t,u", [2, 7]),
];

fn by_fmpy(arguments: &[String]) -> Result<()> {
    ensure!(arguments.is_empty(), "there are no options");
    let (environment, folder) = (target().join("fmpy"), target().join("fmu"));
    let python = environment
        .join("bin/python")
        .to_string_lossy()
        .into_owned();
    if !Path::new(&python).is_file() {
        run(command(crate::setup::python()?, &["-m", "venv"]).arg(&environment))?;
    }
    run(&mut command(
        &python,
        &["-m", "pip", "install", "--quiet", FMPY],
    ))?;
    std::fs::create_dir_all(&folder)?;
    check(&folder, &python, &["--fmpy"])
}

/// Exports each case into `folder`, makes its FMU, and compares its run with the host's, bit for bit.
pub(crate) fn check(folder: &Path, python: &str, options: &[&str]) -> Result<()> {
    for (number, (model, columns, levels)) in CASES.into_iter().enumerate() {
        let [record, host, source, fmu] = ["in.csv", "out.csv", "flow.c", "flow.fmu"]
            .map(|name| folder.join(format!("fmu-{number}-{name}")));
        std::fs::write(&record, commands(columns, levels))?;
        output(
            program()?
                .args(["simulate", model, "-o"])
                .args([&host, &record]),
        )?;
        let double = [
            "codegen",
            model,
            "--lang",
            "c",
            "--precision",
            "double",
            "-o",
        ];
        output(program()?.args(double).arg(&source))?;
        let recipe = root().join("examples/fmu/make_fmu.py");
        let made = output(command(python, &[]).arg(recipe).args([&source, &fmu]))?;
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
fn commands(columns: &str, [off, full]: [u8; 2]) -> String {
    let mut text = format!("{columns}\n");
    for k in 0..4000_u32 {
        let on = (k / 70) % 3 == 0 || k % 900 > 600;
        let u = if on { full } else { off };
        let channel = format!(",{}", 20.0 + f64::from(k / 16) / 64.0);
        let channel = if columns == "t,u" { "" } else { &channel };
        text.push_str(&format!("{},{u}{channel}\n", f64::from(k) / 1000.0));
    }
    text
}
