//! `codegen`: Rust constants for the board from a model file.

use super::Console;
use anyhow::Context;
use host_fit::model::{Law, Model};
use host_fit::{codegen, output};
use std::path::PathBuf;

/// Write a model's constants as Rust for a no_std crate on model-core, the designed law's with them.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model file.
    model: PathBuf,
    /// The Rust file to write.
    #[arg(short, long, default_value = "identified.rs")]
    output: PathBuf,
}

pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let model = Model::load(&args.model)?;
    let text = codegen::generate(&model)
        .with_context(|| format!("no constants from {}", args.model.display()))?;
    output::write_atomic(&args.output, |file| file.write_all(text.as_bytes()))?;
    console.document(&serde_json::json!({
        "output": args.output,
        "bytes": text.len(),
        "effects": model.effect_names(),
        "law": model.law,
    }))?;
    console.say(&format!(
        "{}: N1 = {}, N2 = {}, N3 = {}, effects: {}, law: {}",
        args.output.display(),
        model.a.len(),
        model.product_lags.len(),
        model.b.len(),
        match model.effect_names().as_slice() {
            [] => "none".to_owned(),
            names => names.join(", "),
        },
        match &model.law {
            None => "none".to_owned(),
            Some(Law::Track(law)) => format!("holds {}", law.reference),
            Some(Law::Maximise(law)) => format!("pulses every {} samples", law.period),
        }
    ))
}
