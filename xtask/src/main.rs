//! The project's chores; `cargo xtask help` lists them.

mod bench_law;
mod bench_search;
mod bench_step;
mod browser;
mod budgets;
mod campaigns;
mod ci;
mod elf;
mod faults;
mod firmware;
mod identified;
mod line_faults;
mod new_effect;
mod nucleo;
mod pages;
mod pil;
mod rig_day;
mod setup;
mod shell;
mod size;

use std::process::ExitCode;

/// A subcommand; each has a file of its own, but for the campaigns, which are run alike.
struct Task {
    name: &'static str,
    does: &'static str,
    run: fn(&[String]) -> anyhow::Result<()>,
}

const TASKS: &[Task] = &[
    bench_law::TASK,
    bench_step::TASK,
    bench_search::TASK,
    browser::TASK,
    ci::TASK,
    faults::TASK,
    firmware::TASK,
    campaigns::EFFECTS,
    campaigns::CALIBRATE,
    campaigns::TERMS,
    identified::TASK,
    new_effect::TASK,
    nucleo::TASK,
    pages::TASK,
    pil::TASK,
    rig_day::TASK,
    setup::TASK,
    size::TASK,
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((name, rest)) = arguments.split_first() else {
        return usage();
    };
    let Some(task) = TASKS.iter().find(|task| task.name == name) else {
        return usage();
    };
    match (task.run)(rest) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask {name}: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn usage() -> ExitCode {
    eprintln!("cargo xtask TASK [OPTIONS]");
    for task in TASKS {
        eprintln!("  {:<16} {}", task.name, task.does);
    }
    ExitCode::from(2)
}
