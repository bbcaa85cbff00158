//! The files that several commands read.

use std::path::{Path, PathBuf};

use host_fit::data::DataSet;
use host_fit::model::Model;
use host_fit::steps::Answer;

/// A model and a data set.
#[derive(Debug, clap::Args)]
pub(crate) struct ModelAndData {
    /// The model.
    #[arg(value_name = "model.toml")]
    model: PathBuf,
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
}

impl ModelAndData {
    pub(crate) fn load(&self) -> anyhow::Result<(Model, DataSet)> {
        Ok((Model::load(&self.model)?, DataSet::load(&self.dataset)?))
    }

    pub(crate) fn dataset(&self) -> &Path {
        &self.dataset
    }

    /// An answer whose next command names these files.
    pub(crate) fn name_in(&self, answer: Answer) -> Answer {
        answer.with_files(&shell_word(&self.model), &shell_word(&self.dataset))
    }
}

/// A path as a shell accepts it.
pub(crate) fn shell_word(path: &Path) -> String {
    super::page::quoted(&path.to_string_lossy())
}
