//! `host-fit diagnose`: which physical effect is missing.

use std::path::{Path, PathBuf};

use host_fit::diagnose::Options;
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps;

use super::effect_files::EffectFiles;
use super::load::ModelAndData;
use super::{Console, check_outputs, page};

/// Find the physical effect that a model lacks, by the error of its free run on the validation records.
///
/// Every effect of the catalogue is refitted together with the model. An effect is named if there is significantly more
/// evidence for the model with it than for every model without it (family-wise p-value over all models tried).
///
/// Example: host-fit diagnose model.toml DATASET -o better.toml --report diagnosis.html
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    from: ModelAndData,
    /// Write a report page with pictures.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// File for the model with the missing effects added.
    #[arg(short, long, value_name = "new.toml")]
    output: Option<PathBuf>,
    /// Write the command (columns t, u) that would distinguish models that fit these records equally well.
    #[arg(long, value_name = "command.csv")]
    experiment: Option<PathBuf>,
    /// Largest number of effects to add.
    #[arg(long, value_name = "COUNT", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=12))]
    most_effects: u32,
    /// Seed of the random signs of the significance test.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    effect_files: EffectFiles,
}

impl Args {
    pub(super) fn options(&self) -> Options {
        Options {
            most_effects: self.most_effects as usize,
            seed: self.seed,
        }
    }

    /// Makes the user's own effects known to `model`.
    pub(super) fn define(&self, model: &mut Model) -> anyhow::Result<()> {
        self.effect_files.define(model)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let outputs = args.output.iter().chain(&args.report);
    check_outputs(outputs.chain(&args.experiment))?;
    let (mut model, set) = args.from.load()?;
    args.define(&mut model)?;
    let mut finding = steps::diagnose(&model, &set, &args.options(), &console.watch())?;
    finding.answer = args.from.name_in(finding.answer);
    let mut written: Vec<&Path> = Vec::new();
    if let Some(path) = &args.report {
        let page = page::finding(&model, &set, &finding, args.seed, &page::command_line());
        write_atomic(path, |out| out.write_all(page.as_bytes()))?;
        written.push(path);
    }
    if let Some(path) = &args.output {
        finding.model.save(path)?;
        written.push(path);
    }
    let separation = finding.diagnosis.separation.as_ref();
    if let (Some(path), Some(separation)) = (&args.experiment, separation) {
        separation.experiment.write_csv(path)?;
        written.push(path);
    }
    console.show(&finding, &[], &written)?;
    if args.experiment.is_some() && separation.is_none() {
        console.say("no experiment was written: either no other model fits these records equally well, or no command \
            distinguishes the models that fit equally well")?;
    }
    Ok(())
}
