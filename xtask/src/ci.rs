//! Everything CI runs, in one command; failures are collected, not fatal.

use crate::Task;
use crate::setup::TARGETS;
use crate::shell::{cargo, firmware_cargo, run};
use anyhow::{Result, bail};
use std::time::Instant;

pub(crate) const TASK: Task = Task {
    name: "ci",
    does: "everything CI runs; goes on after a failure and lists all at the end",
    run: ci,
};

type Step = (&'static str, fn() -> Result<()>);

const STEPS: &[Step] = &[
    ("format", || {
        run(&mut cargo(&["fmt", "--all", "--check"]))?;
        run(&mut firmware_cargo(&["fmt", "--all", "--check"]))
    }),
    ("lints", || {
        run(&mut cargo(&[
            "clippy",
            "--release",
            "--workspace",
            "--all-targets",
            "--",
            "-Dwarnings",
        ]))
    }),
    // The fitter does not depend on the simulator that it is judged by.
    ("library alone", || {
        run(&mut cargo(&[
            "check",
            "--release",
            "--package=host-fit",
            "--lib",
            "--no-default-features",
        ]))
    }),
    // The README's test command; documentation examples are part of it.
    ("tests", || {
        run(&mut cargo(&["test", "--release", "--workspace"]))
    }),
    ("documentation", || {
        run(cargo(&["doc", "--release", "--workspace", "--no-deps"])
            .env("RUSTDOCFLAGS", "-Dwarnings"))
    }),
    // An effect and a delay law are one file and one line each.
    ("new effect", crate::new_effect::proof),
    ("set-up", || crate::setup::setup(&[])),
    // What a report carries is what the sources give.
    ("pages", || crate::pages::pages(&["--check".to_owned()])),
    ("browser", || crate::browser::browser(&[])),
    ("no_std", || {
        TARGETS
            .iter()
            .try_for_each(|target| crate::setup::cross_build(target, &["--package", "model-core"]))
    }),
    ("constants", || {
        crate::identified::identified(&["--check".to_owned()])
    }),
    ("firmware lints", || {
        run(&mut firmware_cargo(&[
            "clippy",
            "--release",
            "--all-targets",
            "--package=firmware",
            "--package=identified",
            "--package=log-reader",
            "--",
            "-Dwarnings",
        ]))
    }),
    ("firmware tests", || {
        run(&mut firmware_cargo(&["test", "--release"]))
    }),
    ("board lints", || {
        let mut clippy = crate::setup::cross_cargo("clippy", TARGETS[0])?;
        clippy
            .args(["--package", "board", "--package", "qemu-mps2"])
            .args(["--package", "nucleo-f446re"])
            .args(["--features", "qemu-mps2/peer", "--", "-Dwarnings"])
            .current_dir(crate::shell::root().join("firmware"))
            .env("CARGO_TARGET_DIR", crate::shell::firmware_target());
        run(&mut clippy)
    }),
    // The loop without board code, also for smaller and newer cores.
    ("firmware no_std", || {
        TARGETS
            .iter()
            .try_for_each(|target| crate::firmware::library(target))
    }),
    // Link only without panics.
    ("boards", || {
        for board in crate::firmware::BOARDS {
            crate::firmware::firmware(&["--board".to_owned(), board.to_owned()])?;
        }
        crate::firmware::build("nucleo-f446re", "nucleo-pil", &[], None).map(|_| ())
    }),
    ("faults", || crate::faults::faults(&[])),
    // Links only without panics; runs the constants; checks the budgets.
    ("pil", crate::budgets::check),
    // The whole way: what the demo found is built for the board and runs there.
    ("demo on board", demo_on_board),
    ("nucleo", crate::nucleo::nucleo),
    // The whole circle, unattended.
    ("rig-day", || {
        crate::rig_day::rig_day(&["--brief".to_owned()])
    }),
];

fn demo_on_board() -> Result<()> {
    let out = crate::shell::target().join("demo");
    run(
        cargo(&["run", "--release", "--quiet", "--package", "host-fit"])
            .args(["--", "demo", "--out"])
            .arg(&out),
    )?;
    let model = out.join("controlled.toml").to_string_lossy().into_owned();
    let with = |option: &str, value: &str| ["--model", &model, option, value].map(str::to_owned);
    crate::firmware::firmware(&with("--board", crate::firmware::BOARDS[0]))?;
    crate::pil::pil(&with("--steps", "5000")).map(|_| ())
}

fn ci(arguments: &[String]) -> Result<()> {
    if let Some(unknown) = arguments
        .iter()
        .find(|name| STEPS.iter().all(|(step, _)| step != name))
    {
        let names: Vec<&str> = STEPS.iter().map(|(name, _)| *name).collect();
        bail!(
            "no step `{unknown}`; the steps are: {} (none named: all)",
            names.join(", ")
        );
    }
    let chosen = |name: &str| arguments.is_empty() || arguments.iter().any(|a| a == name);
    let mut rows = Vec::new();
    for (name, step) in STEPS.iter().filter(|(name, _)| chosen(name)) {
        eprintln!("\n== {name}");
        let started = Instant::now();
        let result = step();
        if let Err(error) = &result {
            eprintln!("{name}: {error:#}");
        }
        rows.push((*name, started.elapsed().as_secs_f64(), result));
    }
    println!("\nci: {} steps", rows.len());
    for (name, seconds, result) in &rows {
        match result {
            Ok(()) => println!("  ok      {name:<16} {seconds:7.1} s"),
            Err(error) => println!("  FAILED  {name:<16} {seconds:7.1} s  {error:#}"),
        }
    }
    let failed = rows.iter().filter(|(.., result)| result.is_err()).count();
    if failed > 0 {
        bail!("{failed} of {} steps failed", rows.len());
    }
    Ok(())
}
