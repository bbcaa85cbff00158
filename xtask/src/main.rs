//! Tasks of developers and CI; `cargo xtask help` lists them.

mod agreement;
mod bench_law;
mod bench_search;
mod bench_step;
mod book;
mod browser;
mod budgets;
mod campaigns;
mod changelog;
mod ci;
mod elf;
mod examples;
mod faults;
mod firmware;
mod fmu;
mod fuzz;
mod identified;
mod invariances;
mod kills;
mod long_run;
mod memory;
mod msrv;
mod mutants;
mod new_effect;
mod nucleo;
mod package;
mod pages;
mod periods;
mod pil;
mod random;
mod release;
mod rig_day;
mod setup;
mod shell;
mod size;
mod strangers;
mod supply;

use std::process::ExitCode;

/// A subcommand; each has its own file, except campaigns.
struct Task {
    name: &'static str,
    does: &'static str,
    run: fn(&[String]) -> anyhow::Result<()>,
}

const TASKS: &[Task] = &[
    agreement::TASK,
    bench_law::TASK,
    bench_step::TASK,
    bench_search::TASK,
    book::TASK,
    browser::TASK,
    changelog::TASK,
    ci::TASK,
    examples::TASK,
    faults::TASK,
    firmware::TASK,
    fmu::TASK,
    fuzz::TASK,
    campaigns::EFFECTS,
    campaigns::CALIBRATE,
    campaigns::TERMS,
    campaigns::LITERATURE,
    campaigns::LAWS,
    campaigns::KEPT,
    identified::TASK,
    invariances::TASK,
    kills::TASK,
    long_run::TASK,
    memory::TASK,
    msrv::TASK,
    mutants::TASK,
    new_effect::TASK,
    nucleo::TASK,
    package::TASK,
    pages::TASK,
    periods::TASK,
    pil::TASK,
    release::TASK,
    rig_day::TASK,
    setup::TASK,
    size::TASK,
    strangers::TASK,
    supply::TASK,
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
