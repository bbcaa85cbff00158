//! `host-fit discover`: a missing term outside the catalogue.

use std::path::{Path, PathBuf};

use anyhow::bail;
use host_fit::discover::Options;
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps;

use super::effect_files::EffectFiles;
use super::effect_names::EffectName;
use super::load::{ModelAndData, shell_word};
use super::{Console, check_outputs, page};

/// Find a missing term outside the catalogue: where it acts, what it depends on, its curve and a formula.
///
/// Curves over every coordinate at every place (jet, delay, flow, sensor) are fitted together with the model.
/// A term is reported if the validation error falls significantly and by more than additional lags achieve.
///
/// Example: host-fit discover model.toml DATASET -o new.toml
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    from: ModelAndData,
    /// File for the model with the terms added.
    #[arg(short, long, value_name = "new.toml")]
    output: Option<PathBuf>,
    /// File for the first term as an effect of your own, which every other command reads.
    #[arg(long, value_name = "own.toml")]
    effect_out: Option<PathBuf>,
    /// Write a report page with pictures.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// File for the trace: the signal at each place that would explain the error of the base model.
    #[arg(long, value_name = "trace.csv")]
    trace: Option<PathBuf>,
    /// Write the command (columns t, u) that would distinguish models that fit these records equally well.
    #[arg(long, value_name = "command.csv")]
    experiment: Option<PathBuf>,
    /// Largest number of terms to find.
    #[arg(long, value_name = "COUNT", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=6))]
    terms: u32,
    /// Leave this effect of the catalogue out of the comparison (repeatable).
    #[arg(long, value_name = "NAME", value_parser = EffectName, hide_possible_values = true)]
    without: Vec<String>,
    /// Accepted for scripts that seed every command; this one draws no random numbers.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    effect_files: EffectFiles,
}

impl Args {
    /// Adds the user's own effects to `model` and returns the options of the search.
    pub(super) fn prepare(&self, model: &mut Model) -> anyhow::Result<Options> {
        self.effect_files.define(model)?;
        for name in &self.without {
            if model.spec(name).is_none() {
                bail!("--without {name}: there is no such effect; `host-fit effects` lists them");
            }
            if model.effect_names().contains(name) {
                bail!(
                    "--without {name}: the model already contains it; start from a model without it"
                );
            }
        }
        Ok(Options {
            terms: self.terms as usize,
            without: self.without.clone(),
        })
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let outputs = args.output.iter().chain(&args.report);
    let outputs = outputs.chain(&args.effect_out).chain(&args.trace);
    check_outputs(outputs.chain(&args.experiment))?;
    let (mut model, set) = args.from.load()?;
    let options = args.prepare(&mut model)?;
    let mut found = steps::discover(&model, &set, &options, &console.watch())?;
    found.answer = match &args.output {
        // The model is written, so it can be compared.
        Some(path) if !found.answer.next.is_empty() => {
            let compare = "host-fit compare model.toml DATASET --report report.html";
            let data = shell_word(args.from.dataset());
            found
                .answer
                .next(compare)
                .with_files(&shell_word(path), &data)
        }
        _ => args.from.name_in(found.answer),
    };
    let mut written: Vec<&Path> = Vec::new();
    if let Some(path) = &args.report {
        let page = page::discovery(&model, &set, &found, &page::command_line());
        write_atomic(path, |out| out.write_all(page.as_bytes()))?;
        written.push(path);
    }
    if let Some(path) = &args.output {
        found.model.save(path)?;
        written.push(path);
    }
    if let (Some(path), Some(trace)) = (&args.trace, &found.discovery.trace) {
        write_atomic(path, |out| out.write_all(trace.csv().as_bytes()))?;
        written.push(path);
    }
    let first = found.discovery.terms.first();
    if let (Some(path), Some(term)) = (&args.effect_out, first) {
        write_atomic(path, |out| out.write_all(term.file.as_bytes()))?;
        written.push(path);
    }
    let separation = found.discovery.separation.as_ref();
    if let (Some(path), Some(separation)) = (&args.experiment, separation) {
        separation.experiment.write_csv(path)?;
        written.push(path);
    }
    console.show(&found, &[], &written)?;
    if args.experiment.is_some() && separation.is_none() {
        console.say("no experiment was written: either no other model fits these records equally well, or no command \
            distinguishes the models that fit equally well")?;
    }
    if args.trace.is_some() && found.discovery.trace.is_none() {
        console.say(
            "no trace was written: the base model is at the noise level, or its free run diverges",
        )?;
    }
    if args.effect_out.is_some() && first.is_none() {
        console.say("no effect file was written: no term was found")?;
    }
    Ok(())
}
