//! `host-fit simulate`: a model's free run over a command of the user's.

use std::path::PathBuf;

use anyhow::{Context, bail};
use host_fit::data::InputFile;
use host_fit::model::{Model, Start};
use host_fit::output::write_atomic;
use host_fit::simulate::Signals;

use super::Console;

/// Run a model free over a command sequence, and write t,u,y.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model.
    #[arg(value_name = "model.toml")]
    model: PathBuf,
    /// Command sequence: columns t and u, and the channels that the model's effects need. A column y is only needed
    /// by models that start from measurements.
    #[arg(value_name = "INPUT.csv")]
    input: PathBuf,
    /// File for the free run: columns t, u, y.
    #[arg(short, long, value_name = "out.csv")]
    output: PathBuf,
}

#[derive(serde::Serialize)]
struct Document<'a> {
    model: &'a std::path::Path,
    output: &'a std::path::Path,
    samples: usize,
    mean: f64,
    lowest: f64,
    highest: f64,
    outside_training: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let model = Model::load(&args.model)?;
    let input = InputFile::load(&args.input, None)?;
    let apart = (input.sample_period_s / model.sample_period_s - 1.0).abs();
    if apart > 1e-6 {
        bail!(
            "{}: the samples are {} s apart, but the model has a sample period of {} s; resample the command",
            args.input.display(),
            input.sample_period_s,
            model.sample_period_s
        );
    }
    if input.y.is_none() && model.start == Start::Measured {
        bail!(
            "{}: no column `y`, but this model starts from measurements (`start = \"measured\"`); \
             add the measured y of the first {} samples (later values are not used)",
            args.input.display(),
            model.warm_up()
        );
    }
    let channels = model.channels();
    let channels = channels.iter().map(|channel| {
        let values = input.channels.get(channel).map(Vec::as_slice);
        values.with_context(|| {
            format!(
                "{}: no column `{channel}`, which the model's effects need; add it",
                args.input.display()
            )
        })
    });
    let signals = Signals {
        u: &input.u,
        y: input
            .y
            .as_deref()
            .filter(|_| model.start == Start::Measured),
        channels: channels.collect::<Result<_, _>>()?,
    };
    let time = |k: usize| input.t0 + k as f64 * model.sample_period_s;
    let y = match model.run_free(&signals) {
        Ok(y) => y,
        Err(sample) => bail!(
            "the model's free run diverges at t = {} s of {}: it is unstable for this command; \
             identify it again, with fewer lags or `--objective free-run`",
            time(sample),
            args.input.display()
        ),
    };
    write_atomic(&args.output, |file| {
        let mut csv = csv::Writer::from_writer(file);
        csv.write_record(["t", "u", "y"])?;
        for (k, y) in y.iter().enumerate() {
            // Times as they were given: sums of a period would print 0.30000000000000004.
            let t = (time(k) * 1e9).round() / 1e9;
            csv.write_record([t.to_string(), input.u[k].to_string(), y.to_string()])?;
        }
        csv.flush()
    })?;
    let count = y.len().max(1) as f64;
    let document = Document {
        model: &args.model,
        output: &args.output,
        samples: y.len(),
        mean: y.iter().sum::<f64>() / count,
        lowest: y.iter().copied().fold(f64::INFINITY, f64::min),
        highest: y.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        outside_training: model.outside_training(&input.u, &y),
    };
    console.say(&format!(
        "{} samples ({} s): mean y {:.4}, between {:.4} and {:.4}; written to {}",
        document.samples,
        document.samples as f64 * model.sample_period_s,
        document.mean,
        document.lowest,
        document.highest,
        args.output.display()
    ))?;
    for warning in &document.outside_training {
        console.say(&format!("extrapolation: {warning}"))?;
    }
    console.document(&document)
}
