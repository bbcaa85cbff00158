//! `codegen`: Rust constants for the board from a model file.

use std::path::PathBuf;

use anyhow::{Context, anyhow};
use host_fit::codegen::board;
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps;
use rig_line::RigFile;

use super::{Console, rig_constants};

/// Write a model's constants as Rust for a no_std crate on model-core, the designed law's with them.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model file.
    model: PathBuf,
    /// The Rust file to write.
    #[arg(short, long, default_value = "identified.rs")]
    output: PathBuf,
    /// Refuse what the boards of this project cannot run: a model without a law, with more
    /// than one measured channel, or too large.
    #[arg(long)]
    board: bool,
    /// The rig that it is for: one that contradicts the model is refused, and its constants are
    /// written beside the output, as `rig.rs`.
    #[arg(long, value_name = "rig.toml")]
    rig: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let model = Model::load(&args.model)?;
    if args.board {
        board::check(&model).with_context(|| format!("no board runs {}", args.model.display()))?;
    }
    let rig = args.rig.as_deref().map(RigFile::load).transpose()?;
    if let (Some(rig), Some(file)) = (&rig, &args.rig) {
        rig_constants::fits(rig, &model).map_err(|reason| {
            let (rig, model) = (file.display(), args.model.display());
            anyhow!("{rig} contradicts {model}: {reason}")
        })?;
    }
    let constants = steps::constants(&model)
        .with_context(|| format!("no constants from {}", args.model.display()))?;
    if let Some(rig) = &rig {
        let text = rig_constants::rust(rig);
        let path = args.output.with_file_name("rig.rs");
        write_atomic(&path, |file| file.write_all(text.as_bytes()))?;
    }
    write_atomic(&args.output, |file| {
        file.write_all(constants.text.as_bytes())
    })?;
    console.show(&constants, &[("output", &args.output)], &[&args.output])
}
