//! `codegen`: Rust constants for the board from a model file.

use std::path::PathBuf;

use anyhow::Context;
use host_fit::codegen::board;
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps;

use super::Console;

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
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let model = Model::load(&args.model)?;
    if args.board {
        board::check(&model).with_context(|| format!("no board runs {}", args.model.display()))?;
    }
    let constants = steps::constants(&model)
        .with_context(|| format!("no constants from {}", args.model.display()))?;
    write_atomic(&args.output, |file| {
        file.write_all(constants.text.as_bytes())
    })?;
    console.show(&constants, &[("output", &args.output)], &[&args.output])
}
