//! `codegen`: a model file as Rust constants for the board, or as C, Python or MATLAB.

use std::path::PathBuf;

use anyhow::{Context, anyhow};
use host_fit::codegen::portable::{Precision, function_name};
use host_fit::codegen::{Language, board};
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps;
use rig_line::RigFile;

use super::{Console, rig_constants};

/// Write a model, its effects and its law as Rust constants, C, Python or MATLAB.
///
/// Rust: constants for a no_std crate on model-core. C: C99 without a heap, `model_step` and `law_step`,
/// bit-identical to the host. Python: classes `Model` and `Law` for NumPy. MATLAB: a function file that GNU Octave
/// runs too.
///
/// Example: host-fit codegen model.toml --lang python -o flow.py
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model file.
    model: PathBuf,
    /// The file to write; identified.rs, model.c, model.py or identified_model.m if not given.
    #[arg(short, long, visible_alias = "out")]
    output: Option<PathBuf>,
    /// The language.
    #[arg(long, value_enum, default_value_t = Lang::Rust)]
    lang: Lang,
    /// Precision of the numbers in C.
    #[arg(long, value_enum, default_value_t = Numbers::Single)]
    precision: Numbers,
    /// Refuse a model that the boards of this project cannot run: without a law, with more than one measured
    /// channel, or too large.
    #[arg(long)]
    board: bool,
    /// Rig file. A rig that contradicts the model is refused; its constants are written next to the output as
    /// `rig.rs`.
    #[arg(long, value_name = "rig.toml")]
    rig: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Lang {
    Rust,
    C,
    Python,
    Matlab,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Numbers {
    Single,
    Double,
}

impl Args {
    /// The output file and its language. A MATLAB function must have the name of its file.
    fn target(&self) -> (PathBuf, Language) {
        let usual = match self.lang {
            Lang::Rust => "identified.rs",
            Lang::C => "model.c",
            Lang::Python => "model.py",
            Lang::Matlab => "identified_model.m",
        };
        let output = self.output.clone().unwrap_or_else(|| usual.into());
        match self.lang {
            Lang::Rust => (output, Language::Rust),
            Lang::C => {
                let precision = match self.precision {
                    Numbers::Single => Precision::Single,
                    Numbers::Double => Precision::Double,
                };
                (output, Language::C(precision))
            }
            Lang::Python => (output, Language::Python),
            Lang::Matlab => {
                let stem = output.file_stem().unwrap_or_default();
                let name = function_name(&stem.to_string_lossy());
                (
                    output.with_file_name(format!("{name}.m")),
                    Language::Matlab(name),
                )
            }
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let model = Model::load(&args.model)?;
    if args.board {
        board::check(&model)
            .with_context(|| format!("a board cannot run {}", args.model.display()))?;
    }
    let rig = args.rig.as_deref().map(RigFile::load).transpose()?;
    if let (Some(rig), Some(file)) = (&rig, &args.rig) {
        rig_constants::fits(rig, &model).map_err(|reason| {
            let (rig, model) = (file.display(), args.model.display());
            anyhow!("{rig} contradicts {model}: {reason}")
        })?;
    }
    let (output, language) = args.target();
    let constants = steps::written(&model, &language)
        .with_context(|| format!("{} was not written", args.model.display()))?;
    if let Some(rig) = &rig {
        let text = rig_constants::rust(rig);
        let path = output.with_file_name("rig.rs");
        write_atomic(&path, |file| file.write_all(text.as_bytes()))?;
    }
    write_atomic(&output, |file| file.write_all(constants.text.as_bytes()))?;
    console.show(&constants, &[("output", &output)], &[&output])
}
