//! Tests of the recipes in `examples/` with exported models: `cargo xtask examples`.

use crate::Task;
use crate::shell::{output, program, root, run};
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

pub(crate) const TASK: Task = Task {
    name: "examples",
    does: "runs examples/ on exported models and checks what they print",
    run: |_| examples(),
};

const MODEL: &str = "data/paper/table-2-state-dependent.toml";
const SET: &str = "data/paper-like";
const RECORD: &str = "step";

fn examples() -> Result<()> {
    let folder = std::env::temp_dir().join(format!("examples-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let done = in_folder(&folder);
    std::fs::remove_dir_all(&folder)?;
    done
}

fn in_folder(folder: &Path) -> Result<()> {
    let examples = root().join("examples");
    for file in ["free_run.py", "free_run.m", "loop.c"] {
        std::fs::copy(examples.join(file), folder.join(file))?;
    }
    let record = root().join(SET).join(RECORD).with_extension("csv");
    std::fs::copy(record, folder.join("record.csv"))?;
    // The law was designed for another model than the record's.
    for (language, file, model) in [
        ("python", "flow.py", MODEL),
        ("matlab", "flow.m", MODEL),
        ("c", "flow.c", "firmware/identified/models/full.toml"),
    ] {
        let mut export = program()?;
        export.args(["codegen", model, "--lang", language, "-o"]);
        run(export.arg(folder.join(file)))?;
    }
    let compared = output(program()?.args(["compare", MODEL, SET, "--json"]))?;
    let compared: Value = serde_json::from_str(&compared)?;
    let records = compared["records"].as_array().context("records")?;
    let own = records.iter().find(|record| record["name"] == RECORD);
    let fit = own
        .and_then(|record| record["fit_percent"].as_f64())
        .context("its FIT")?;
    let said = |tool: &str, arguments: &[&str]| -> Result<String> {
        let mut command = Command::new(tool);
        command.args(arguments).current_dir(folder);
        Ok(output(&mut command)?.trim().to_owned())
    };
    let python = crate::setup::python()?;
    crate::fmu::check(folder, python, &[])?;
    let expected = format!("FIT {fit:.2} %");
    for (tool, arguments) in [
        (python, &["free_run.py", "record.csv"][..]),
        ("octave-cli", &["--quiet", "free_run.m"]),
    ] {
        let found = said(tool, arguments)?;
        ensure!(
            found == expected,
            "{tool} says `{found}`, compare says `{expected}`"
        );
        println!("{tool}: {found}");
    }
    said(
        "gcc",
        &[
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            "-o",
            "loop",
            "loop.c",
            "-lm",
        ],
    )?;
    let program = folder.join("loop");
    let found = said(&program.to_string_lossy(), &[])?;
    let numbers: Vec<f64> = found
        .split([' ', ','])
        .filter_map(|word| word.parse().ok())
        .collect();
    // Within 0.01 of y, far below the error of a failing law.
    let holds = matches!(numbers[..], [mean, reference] if (mean - reference).abs() < 0.01);
    ensure!(holds, "the law in C: {found}");
    println!("C: {found}");
    Ok(())
}
