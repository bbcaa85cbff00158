//! Called by `cargo xtask pil`: once for the constants with which the board is built, and once, with the board's
//! program, for the lockstep run.

use anyhow::{Context, Result};
use clap::Parser;
use host_fit::model::Model;
use scenarios::lockstep::{Case, Link, Measured, cases, run_case};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

/// QEMU's SysTick under `-icount shift=5`: 40 ns a tick, 32 ns an instruction.
const INSTRUCTIONS_PER_TICK: f64 = 1.25;

/// The processor clock of the Nucleo-F446RE in this project, cycles per ms.
const CYCLES_PER_MS: f64 = 84_000.0;

/// Commands of the lockstep run.
#[derive(Parser)]
enum Task {
    /// Writes the constants of all cases.
    Constants {
        /// Output folder.
        folder: PathBuf,
        /// This model instead of the usual cases.
        #[arg(long)]
        model: Option<PathBuf>,
        /// Cases at these loop periods, s, instead of the usual ones.
        #[arg(long, value_delimiter = ',', conflicts_with = "model")]
        periods: Vec<f64>,
    },
    /// Runs the cases.
    Run {
        /// This model instead of the usual cases.
        #[arg(long)]
        model: Option<PathBuf>,
        /// Cases at these loop periods, s, instead of the usual ones.
        #[arg(long, value_delimiter = ',', conflicts_with = "model")]
        periods: Vec<f64>,
        /// A board at this serial device; else the command behind `--` starts QEMU.
        #[arg(long)]
        serial: Option<String>,
        /// Steps of every case.
        #[arg(long)]
        steps: Option<usize>,
        /// Drop one byte in this many, to test error detection; 0 for none.
        #[arg(long, default_value_t = 997)]
        lose: usize,
        /// Only this case.
        #[arg(long)]
        case: Option<String>,
        /// File for the measured figures, for `firmware/budgets.toml`.
        #[arg(long)]
        report: PathBuf,
        /// The command that starts QEMU.
        #[arg(last = true)]
        qemu: Vec<String>,
    },
}

fn main() -> Result<()> {
    match Task::parse() {
        Task::Constants {
            folder,
            model,
            periods,
        } => cases::write(&chosen(model, &periods)?, &folder),
        Task::Run {
            model,
            periods,
            serial,
            steps,
            lose,
            case,
            report,
            qemu,
        } => {
            let mut cases = chosen(model, &periods)?;
            for case in &mut cases {
                case.steps = steps.unwrap_or(case.steps);
            }
            // A real board counts core cycles.
            let (link, per_tick, unit) = match &serial {
                Some(device) => (Link::serial(device, lose)?, 1.0, "cycles"),
                None => (
                    Link::qemu(&qemu, lose)?,
                    INSTRUCTIONS_PER_TICK,
                    "instructions",
                ),
            };
            let text = run(link, &cases, case.as_deref(), (per_tick, unit))?;
            std::fs::write(&report, text).with_context(|| report.display().to_string())
        }
    }
}

fn chosen(model: Option<PathBuf>, periods_s: &[f64]) -> Result<Vec<Case>> {
    match model {
        None if periods_s.is_empty() => cases::all(),
        None => cases::at(periods_s),
        Some(path) => Ok(vec![Case::new("on_board", Model::load(&path)?)]),
    }
}

/// Runs all cases and prints the table; gives the report.
fn run(
    mut link: Link,
    cases: &[Case],
    only: Option<&str>,
    (per_tick, unit): (f64, &str),
) -> Result<String> {
    let started = Instant::now();
    let (mut means, mut most) = (BTreeMap::new(), BTreeMap::new());
    let (mut stack, mut base) = (0, None);
    println!(
        "{:<30} {:>6} {:>8} {:>6} {:>7} {:>7} {:>6}  law, effects",
        "equal bit for bit", "steps", "switches", "y", "mean", "most", "kHz"
    );
    let chosen = |case: &Case| only.is_none_or(|only| only == case.name);
    for (number, case) in cases.iter().enumerate().filter(|(_, case)| chosen(case)) {
        let measured = run_case(&mut link, u8::try_from(number)?, case)?;
        let Measured { report, .. } = &measured;
        let mean = report.ticks as f64 * per_tick / f64::from(report.steps.max(1));
        let worst = f64::from(report.most) * per_tick;
        println!(
            "{:<30} {:>6} {:>8} {:>6.3} {:>7.0} {:>7.0} {:>6.1}  {}",
            case.name,
            report.steps,
            measured.switches,
            measured.friction,
            mean,
            worst,
            CYCLES_PER_MS / worst.max(1.0),
            words(&case.model),
        );
        if base.is_none() || case.name == "base" {
            base = Some(mean);
        }
        stack = report.stack;
        means.insert(&case.name, mean);
        most.insert(&case.name, worst);
    }
    let cycles = match unit {
        "instructions" => ", if an instruction takes one cycle",
        _ => "",
    };
    println!(
        "mean and most: {unit} of a sample; kHz: the loop rate at which the worst sample fills a core of 84 MHz{cycles}"
    );
    println!(
        "link: {} bytes lost on purpose, {} requests repeated, no wrong answer; {:.1} s",
        link.lost,
        link.repeated,
        started.elapsed().as_secs_f64()
    );
    println!("{unit}_per_step: {:.0}", base.unwrap_or(f64::NAN));
    println!("stack_bytes: {stack}");
    let mut text = format!("stack_bytes = {stack}\n\n[instructions_per_step]\n");
    for (name, mean) in means {
        text.push_str(&format!("{name} = {mean:.1}\n"));
    }
    text.push_str("\n[most_instructions]\n");
    for (name, most) in most {
        text.push_str(&format!("{name} = {most:.1}\n"));
    }
    Ok(text)
}

fn words(model: &Model) -> String {
    use host_fit::model::Law;
    let law = match &model.law {
        None => "relay",
        Some(Law::Track(_)) => "tracking",
        Some(Law::Maximise(_)) => "pulses",
    };
    let averaged = if model.averaging.averaged_model {
        ", averaged model"
    } else {
        ""
    };
    let effects = model.effect_names();
    format!("{law}{averaged}; {}", effects.join(", "))
}
