//! The files that several commands read.

use std::path::PathBuf;

use host_fit::data::DataSet;
use host_fit::model::Model;

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
}
