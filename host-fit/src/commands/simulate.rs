//! `host-fit simulate`: free run of a model over a given command.

use std::path::PathBuf;

use host_fit::data::InputFile;
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps;

use super::Console;

/// Simulate a model in free run over a command sequence, and write t,u,y.
///
/// Example: host-fit simulate model.toml command.csv -o run.csv
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model.
    #[arg(value_name = "model.toml")]
    model: PathBuf,
    /// Command sequence: columns t and u, and the channels that the model's effects need. A column y is
    /// needed only if the model starts from measurements.
    #[arg(value_name = "INPUT.csv")]
    input: PathBuf,
    /// File for the free run: columns t, u, y.
    #[arg(short, long, value_name = "out.csv")]
    output: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let model = Model::load(&args.model)?;
    let input = InputFile::load(&args.input, None)?;
    let run = steps::simulate(&model, &input)?;
    write_atomic(&args.output, |file| run.write_csv(file))?;
    let keys = [("model", args.model.as_path()), ("output", &args.output)];
    console.show(&run, &keys, &[&args.output])
}
