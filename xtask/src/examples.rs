//! Tests of the recipes in `examples/` with exported models: `cargo xtask examples`.

use crate::Task;
use crate::shell::{cargo, output, program, root, run, target};
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

pub(crate) const TASK: Task = Task {
    name: "examples",
    does: "runs examples/ on exported models and checks their output",
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
    // The law was designed for another model than that of the record.
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
    // The mean is within 0.01 of the reference, far below the error of a failing law.
    let holds = matches!(numbers[..], [mean, reference] if (mean - reference).abs() < 0.01);
    ensure!(holds, "the law in C: {found}");
    println!("C: {found}");
    let rust = rust_loop(folder)?;
    ensure!(rust == found, "the law in Rust: {rust}, in C: {found}");
    println!("Rust: {rust}");
    scripts(folder)
}

/// The expected output of the Rust recipe, with the constants of the model of the C recipe.
fn rust_loop(folder: &Path) -> Result<String> {
    let package = folder.join("rust-loop");
    std::fs::create_dir_all(package.join("src"))?;
    let recipe = root().join("examples/rust-loop");
    std::fs::copy(recipe.join("src/main.rs"), package.join("src/main.rs"))?;
    let manifest = std::fs::read_to_string(recipe.join("Cargo.toml"))?;
    let own = format!("path = {:?}", root().join("model-core"));
    let manifest = manifest.replace("path = \"../../model-core\"", &own);
    ensure!(manifest.contains(&own), "the recipe's path of model-core");
    std::fs::write(package.join("Cargo.toml"), manifest)?;
    // The versions of the workspace, which are available offline.
    std::fs::copy(root().join("Cargo.lock"), package.join("Cargo.lock"))?;
    let mut export = program()?;
    export.args(["codegen", "firmware/identified/models/full.toml", "-o"]);
    run(export.arg(package.join("src/identified.rs")))?;
    let mut loops = cargo("run --quiet");
    loops
        .current_dir(&package)
        .env("CARGO_TARGET_DIR", target().join("examples"));
    Ok(output(&mut loops)?.trim().to_owned())
}

/// The recipes that call the program.
fn scripts(folder: &Path) -> Result<()> {
    let recipe = |name: &str, arguments: &[&Path]| -> Result<()> {
        let host_fit = program()?;
        let own = Path::new(host_fit.get_program()).parent();
        let before = std::env::var_os("PATH").unwrap_or_default();
        let paths = own.map(Path::to_owned).into_iter();
        let paths = std::env::join_paths(paths.chain(std::env::split_paths(&before)))?;
        let mut script = Command::new(root().join("examples").join(name).join("run.sh"));
        output(
            script
                .args(arguments)
                .env("PATH", paths)
                .current_dir(root()),
        )?;
        Ok(())
    };
    let fits = |models: &[&str], set: &Path| -> Result<Vec<f64>> {
        let mut compare = program()?;
        compare.arg("compare");
        compare.args(models.iter().map(|model| folder.join(model)));
        let text = output(compare.arg(set).arg("--json"))?;
        let document: Value = serde_json::from_str(&text)?;
        let models = match document["models"].as_array() {
            Some(models) => models.iter().collect(),
            None => vec![&document],
        };
        let fits = models.into_iter().map(|model| {
            let held_out = &model["validate"];
            let judged = if held_out.is_object() {
                held_out
            } else {
                &model["identify"]
            };
            judged["fit_percent"].as_f64()
        });
        fits.collect::<Option<_>>().context("a FIT")
    };
    let set = root().join("data/hidden-ramp");
    recipe("own-effect", &[&set, folder])?;
    let own = fits(&["small.toml", "extended.toml"], &set)?;
    ensure!(
        matches!(own[..], [before, after] if after > before + 2.0),
        "own effect: {own:?}"
    );
    println!("own effect: FIT {:.1} → {:.1} %", own[0], own[1]);
    recipe("heater", &[folder])?;
    let heater = fits(&["heater.toml"], &folder.join("heater"))?;
    // A first order with dead time has a FIT of 99.1 %.
    ensure!(
        matches!(heater[..], [fit] if fit > 98.5),
        "heater: {heater:?}"
    );
    println!("heater: FIT {:.1} %", heater[0]);
    ensure!(
        folder.join("heater.py").exists(),
        "the heater's model in Python"
    );
    Ok(())
}
