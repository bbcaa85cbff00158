//! `host-fit compare`: indicators of models on a data set, and where one fails.

use std::path::{Path, PathBuf};

use anyhow::Context;
use host_fit::data::DataSet;
use host_fit::model::Model;
use host_fit::output::{Staging, write_atomic};
use host_fit::steps;

use super::drawings::overlays;
use super::load::shell_word;
use super::words::describe;
use super::{Console, page};

/// Compare the free run of one or several models with every record: FIT, RMSE, residual tests, and where one model fails.
///
/// Example: host-fit compare fixed.toml state.toml DATASET --report models.html
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The models: one, or several side by side.
    #[arg(value_name = "model.toml", required = true, num_args = 1..)]
    models: Vec<PathBuf>,
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// Write a report page with pictures.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// Write one picture (SVG) per record into this folder.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let loaded = args.models.iter().map(|path| Model::load(path));
    let loaded: Vec<Model> = loaded.collect::<Result<_, _>>()?;
    let set = DataSet::load(&args.dataset)?;
    let written = args.report.iter().chain(&args.pictures);
    let written: Vec<&Path> = written.map(PathBuf::as_path).collect();
    if let [model] = loaded.as_slice() {
        let mut found = steps::compare(model, &set)?;
        let names = args
            .models
            .first()
            .map_or_else(String::new, |path| shell_word(path));
        found.answer = found.answer.with_files(&names, &shell_word(&args.dataset));
        args.draw(model, &set, &[("model", &found.runs)])?;
        args.write(|| page::comparison(model, &set, &found, &page::command_line()))?;
        console.say(&format!("{}\n", describe(model)))?;
        return console.show(&found, &[], &written);
    }
    let models: Vec<(String, &Model)> = labels(&args.models).into_iter().zip(&loaded).collect();
    let found = steps::compare_several(&models, &set);
    let mut found = found.map_err(|(name, error)| anyhow::Error::new(error).context(name))?;
    let best = found.best().map(|best| best.model.clone());
    let best = models
        .iter()
        .position(|(name, _)| Some(name) == best.as_ref());
    if let Some(path) = best.and_then(|index| args.models.get(index)) {
        let answer = std::mem::take(&mut found.answer);
        found.answer = answer.with_files(&shell_word(path), &shell_word(&args.dataset));
    }
    let runs = found.models.iter();
    let runs: Vec<(&str, &[Vec<f64>])> = runs
        .map(|named| (named.model.as_str(), named.comparison.runs.as_slice()))
        .collect();
    let first = models.first().context("no model")?.1;
    args.draw(first, &set, &runs)?;
    args.write(|| page::side_by_side(&models, &set, &found, &page::command_line()))?;
    console.show(&found, &[], &written)
}

impl Args {
    /// Draws the pictures, if requested.
    fn draw(
        &self,
        model: &Model,
        set: &DataSet,
        runs: &[(&str, &[Vec<f64>])],
    ) -> anyhow::Result<()> {
        let Some(folder) = &self.pictures else {
            return Ok(());
        };
        let pictures = overlays(&model.targets(&set.records), runs);
        let mut staging = Staging::new(folder)?;
        for (index, (name, svg)) in pictures.iter().enumerate() {
            let file = format!("{}-{}.svg", index + 1, file_name(name));
            staging.write(&file, |out| out.write_all(svg.as_bytes()))?;
        }
        staging.commit()?;
        Ok(())
    }

    /// Writes the page, if requested.
    fn write(&self, page: impl FnOnce() -> String) -> anyhow::Result<()> {
        if let Some(path) = &self.report {
            write_atomic(path, |out| out.write_all(page().as_bytes()))?;
        }
        Ok(())
    }
}

/// Names of the files without ending; whole paths if two names would be equal.
fn labels(paths: &[PathBuf]) -> Vec<String> {
    let stem = |path: &PathBuf| {
        path.file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let short: Vec<String> = paths.iter().map(stem).collect();
    let label = |(path, name): (&PathBuf, &String)| {
        if short.iter().filter(|other| *other == name).count() > 1 {
            path.display().to_string()
        } else {
            name.clone()
        }
    };
    paths.iter().zip(&short).map(label).collect()
}

/// A record's name reduced to characters that every file system accepts.
fn file_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || c == '-' || c == '_' {
            c
        } else {
            '_'
        }
    };
    name.chars().map(plain).collect()
}
