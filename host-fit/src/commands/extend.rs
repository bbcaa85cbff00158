//! `host-fit extend`: adds effects, refits everything, and shows the gain.

use std::path::{Path, PathBuf};

use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps;

use super::effect_files::EffectFiles;
use super::effect_names::EffectName;
use super::load::{ModelAndData, shell_word};
use super::{Console, check_outputs, page};

/// Add physical effects to a model, refit everything, and show the validation error before and after.
///
/// Example: host-fit extend model.toml DATASET --effect plenum-droop -o better.toml
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    from: ModelAndData,
    /// Effect to add, by its name in `host-fit effects` or in an effect file; repeatable.
    #[arg(long, value_name = "NAME", required = true, value_parser = EffectName, hide_possible_values = true)]
    effect: Vec<String>,
    /// File for the new model.
    #[arg(short, long, value_name = "new.toml")]
    output: PathBuf,
    /// Write a report page: the model before and after on every record.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    effect_files: EffectFiles,
}

impl Args {
    /// The effects to add.
    pub(crate) fn effects(&self) -> &[String] {
        &self.effect
    }

    /// Makes the user's own effects known to `model`.
    pub(super) fn define(&self, model: &mut Model) -> anyhow::Result<()> {
        self.effect_files.define(model)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    check_outputs([&args.output].into_iter().chain(&args.report))?;
    let (mut model, set) = args.from.load()?;
    args.define(&mut model)?;
    let mut extension = steps::extend(&model, &set, &args.effect, &console.show_progress())?;
    let (made, data) = (shell_word(&args.output), args.from.dataset());
    extension.answer = extension.answer.with_files(&made, &shell_word(data));
    extension.model.save(&args.output)?;
    let mut written: Vec<&Path> = vec![&args.output];
    if let Some(path) = &args.report {
        // A given model that diverges does not prevent showing the new one.
        let before = steps::compare(&model, &set).ok();
        let after = steps::compare(&extension.model, &set)?;
        let page = page::extension(&set, &extension, (&model, before.as_ref()), &after);
        write_atomic(path, |out| out.write_all(page.as_bytes()))?;
        written.push(path);
    }
    console.show(&extension, &[("model", &args.output)], &written)
}
