//! `host-fit discover`: a term that no catalogue has.

use std::path::{Path, PathBuf};

use anyhow::bail;
use host_fit::discover::Options;
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps;

use super::effect_files::EffectFiles;
use super::load::ModelAndData;
use super::{Console, page};

/// Find a term that no catalogue has: where it acts, on what it depends, its curve and a formula.
///
/// Curves of every coordinate at every place (jet, delay, flow, sensor) are fitted with everything else; one counts if
/// the held-out error falls by more than chance and than the flow's own memory manages.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    from: ModelAndData,
    /// File for the model with the terms added.
    #[arg(short, long, value_name = "new.toml")]
    output: Option<PathBuf>,
    /// File for the first term as an effect of your own, for `extend`, `simulate` and the rest.
    #[arg(long, value_name = "own.toml")]
    effect_out: Option<PathBuf>,
    /// Write a report page with pictures.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// File for the trace: the signal that would explain the misfit of the best base, at each place.
    #[arg(long, value_name = "trace.csv")]
    trace: Option<PathBuf>,
    /// Write the command (columns t, u) that would tell apart what these records cannot.
    #[arg(long, value_name = "command.csv")]
    experiment: Option<PathBuf>,
    /// Most terms.
    #[arg(long, value_name = "COUNT", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=6))]
    terms: u32,
    /// Forget this effect of the catalogue: no term is said to resemble it (repeatable).
    #[arg(long, value_name = "NAME")]
    without: Vec<String>,
    /// Accepted for scripts that seed every command; nothing here is drawn.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    effect_files: EffectFiles,
}

impl Args {
    /// Makes the effects of the user's own known to `model`; what to look for in it.
    pub(super) fn prepare(&self, model: &mut Model) -> anyhow::Result<Options> {
        self.effect_files.define(model)?;
        for name in &self.without {
            if model.spec(name).is_none() {
                bail!("there is no effect `{name}` to forget; `host-fit effects` lists them");
            }
            if model.effect_names().contains(name) {
                bail!(
                    "the model has `{name}`, which is to be forgotten; start from a model without it"
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
    let (mut model, set) = args.from.load()?;
    let options = args.prepare(&mut model)?;
    let found = steps::discover(&model, &set, &options, &console.watch())?;
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
        console.say("no experiment was written: there is nothing to tell apart")?;
    }
    if args.trace.is_some() && found.discovery.trace.is_none() {
        console.say(
            "no trace was written: the best base is at the noise floor, or its free run diverges",
        )?;
    }
    if args.effect_out.is_some() && first.is_none() {
        console.say("no effect file was written: no term was found")?;
    }
    Ok(())
}
