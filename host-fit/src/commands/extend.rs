//! `host-fit extend`: adds effects, refits everything, shows what it gained.

use std::path::PathBuf;

use host_fit::steps;

use super::Console;
use super::effect_files::EffectFiles;
use super::load::ModelAndData;

/// Add physical effects to a model, refit everything, and show the held-out error before and after.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    from: ModelAndData,
    /// Effect to add, by its name in `host-fit effects` or in an effect file; repeatable.
    #[arg(long, value_name = "NAME", required = true)]
    effect: Vec<String>,
    /// File for the new model.
    #[arg(short, long, value_name = "new.toml")]
    output: PathBuf,
    #[command(flatten)]
    effect_files: EffectFiles,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let (mut model, set) = args.from.load()?;
    args.effect_files.define(&mut model)?;
    let extension = steps::extend(&model, &set, &args.effect, &console.watch())?;
    extension.model.save(&args.output)?;
    console.show(&extension, &[("model", &args.output)], &[&args.output])
}
