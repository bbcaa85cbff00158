//! Command line of the simulator: writes data sets with hidden effects.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand, ValueEnum};

use firmware_sim::family::{Family, NoiseKind, Nuisance, RigPlan, Units};
use firmware_sim::hidden_set::HiddenSetPlan;
use firmware_sim::literature::{Hidden, LiteraturePlan, PUBLISHED};
use firmware_sim::paper_like::{Disturbances, LagReading, paper_like_set};
use firmware_sim::plant::RateLaw;
use recordings::DataSet;
use recordings::output::write_atomic;

/// Simulated rigs and their recordings.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Writes a data set of a random rig with hidden effects or faults (none: the null case).
    HiddenSet {
        /// Effect to hide, by its catalogue name; may be given several times.
        #[arg(long)]
        effect: Vec<String>,
        /// Fault to hide; may be given several times.
        #[arg(long)]
        fault: Vec<String>,
        /// Changes a parameter of a hidden effect: EFFECT.PARAMETER=VALUE; may be given several times.
        #[arg(long, value_name = "EFFECT.PARAMETER=VALUE")]
        set: Vec<String>,
        /// Dependence of the flow's rate on jets between off and on.
        #[arg(long, value_enum, default_value_t = Rate::Switched)]
        rate_law: Rate,
        /// Repeats that are averaged.
        #[arg(long, default_value_t = 20)]
        repeats: usize,
        /// Seed of the rig, the commands and the noise.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Folder for dataset.toml and the records.
        #[arg(long)]
        out: PathBuf,
        /// File for the true effects; not part of the data set.
        #[arg(long)]
        truth: Option<PathBuf>,
    },
    /// Writes a data set of a random rig of a family, with its true effects in a separate file.
    Rig {
        /// Kind of flow: first-order, memory1, memory2, inertia, wake, rate-of-y.
        #[arg(long, value_parser = named(Family::ALL.map(Family::name)))]
        family: String,
        /// Effect to hide, from the catalogue or with another law (two-reservoirs …), or a fault; may be
        /// given several times.
        #[arg(long)]
        effect: Vec<String>,
        /// Kind of noise in the repeats.
        #[arg(long, default_value = "coloured", value_parser = named(NoiseKind::ALL.map(NoiseKind::name)))]
        noise: String,
        /// Nuisance that is not an effect and must not be diagnosed as one; may be given several times.
        #[arg(long, value_parser = named(Nuisance::ALL.map(Nuisance::name)))]
        nuisance: Vec<String>,
        /// Factor from the rig's times to recorded times.
        #[arg(long, default_value_t = 1.0)]
        time_factor: f64,
        /// Factor from the rig's y to recorded y.
        #[arg(long, default_value_t = 1.0)]
        y_factor: f64,
        /// Seed of the rig, the commands and the noise.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Folder for dataset.toml, the records and answer.toml.
        #[arg(long)]
        out: PathBuf,
    },
    /// Writes a data set of a published flow, with its true effects in a separate file.
    Literature {
        /// The published model: goman-khrabrov, wrong-way …
        #[arg(long, value_parser = named(PUBLISHED.map(|model| model.name)))]
        model: String,
        /// Effect to hide; may be given several times.
        #[arg(long, value_parser = named(Hidden::names()))]
        effect: Vec<String>,
        /// White noise only: no converter, no valve dead time, constant offset.
        #[arg(long)]
        ideal_instruments: bool,
        /// Seed of the coefficients, the commands and the noise.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Folder for dataset.toml, the records and answer.toml.
        #[arg(long)]
        out: PathBuf,
    },
    /// Writes a data set like the paper's, from its published model.
    PaperSet {
        /// Meaning of a printed lag.
        #[arg(long, value_enum, default_value_t = Lags::Literal)]
        lags: Lags,
        /// Seed of the disturbances.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Folder for dataset.toml and the records.
        #[arg(long)]
        out: PathBuf,
    },
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Rate {
    Switched,
    Interpolated,
    Bilinear,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Lags {
    Literal,
    OneStep,
}

/// Only these names.
fn named<const N: usize>(names: [&'static str; N]) -> clap::builder::PossibleValuesParser {
    names.into()
}

fn change(plan: &mut HiddenSetPlan, setting: &str) -> Result<()> {
    let parsed = setting.split_once('=').and_then(|(path, value)| {
        let (effect, parameter) = path.split_once('.')?;
        Some((effect, parameter, value.parse::<f64>().ok()?))
    });
    let (effect, parameter, value) = parsed
        .with_context(|| format!("`--set {setting}` is not of the form EFFECT.PARAMETER=VALUE"))?;
    let hidden = plan
        .plant
        .effects
        .iter_mut()
        .find(|e| e.name() == effect)
        .with_context(|| {
            format!("`--set {setting}`: `{effect}` is not hidden; add --effect {effect}")
        })?;
    *hidden = hidden.with(parameter, value)?;
    Ok(())
}

/// Exit codes: 0 done, 1 error with a message, 2 wrong usage; never a stack trace.
fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<()> {
    match command {
        Command::HiddenSet {
            effect,
            fault,
            set,
            rate_law,
            repeats,
            seed,
            out,
            truth,
        } => {
            let effects: Vec<&str> = effect.iter().map(String::as_str).collect();
            let faults: Vec<&str> = fault.iter().map(String::as_str).collect();
            let mut plan = HiddenSetPlan::draw(&effects, &faults, seed)?;
            for setting in &set {
                change(&mut plan, setting)?;
            }
            plan.plant.base.rate_law = match rate_law {
                Rate::Switched => RateLaw::Switched,
                Rate::Interpolated => RateLaw::Interpolated,
                Rate::Bilinear => RateLaw::Bilinear,
            };
            plan.instrument.repeats = repeats;
            save(&plan.build()?.data, &out)?;
            if let Some(path) = truth {
                let text = plan.answer();
                write_atomic(&path, |file| file.write_all(text.as_bytes()))?;
            }
        }
        Command::Rig {
            family,
            effect,
            noise,
            nuisance,
            time_factor,
            y_factor,
            seed,
            out,
        } => {
            let family = Family::of(&family).context("no such family")?;
            let noise = NoiseKind::of(&noise).context("no such noise")?;
            let effects: Vec<&str> = effect.iter().map(String::as_str).collect();
            let nuisances: Vec<Nuisance> =
                nuisance.iter().filter_map(|n| Nuisance::of(n)).collect();
            let units = Units {
                time: time_factor,
                y: y_factor,
            };
            let plan = RigPlan::draw(family, &effects, noise, &nuisances, seed)?.in_units(units);
            save(&plan.build()?.data, &out)?;
            let answer = plan.answer();
            write_atomic(&out.join("answer.toml"), |file| {
                file.write_all(answer.as_bytes())
            })?;
        }
        Command::Literature {
            model,
            effect,
            ideal_instruments,
            seed,
            out,
        } => {
            let effects: Vec<&str> = effect.iter().map(String::as_str).collect();
            let plan = LiteraturePlan::draw(&model, &effects, !ideal_instruments, seed)?;
            save(&plan.build()?.data, &out)?;
            let answer = plan.answer();
            write_atomic(&out.join("answer.toml"), |file| {
                file.write_all(answer.as_bytes())
            })?;
        }
        Command::PaperSet { lags, seed, out } => {
            let lags = match lags {
                Lags::Literal => LagReading::Literal,
                Lags::OneStep => LagReading::OneStep,
            };
            save(&paper_like_set(lags, Disturbances::default(), seed)?, &out)?;
        }
    }
    Ok(())
}

/// Saves a set into the folder `out`, making the folders above it if needed.
fn save(set: &DataSet, out: &Path) -> Result<()> {
    if let Some(parent) = out.parent() {
        std::fs::create_dir_all(parent)?;
    }
    Ok(set.save(out)?)
}
