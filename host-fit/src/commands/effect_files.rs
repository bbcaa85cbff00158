//! The option `--effect-file`: a user's own effects.

use host_fit::model::Model;
use host_fit::user_effect::Definition;
use std::path::PathBuf;

/// Effect files given to a command.
#[derive(Debug, Clone, Default, clap::Args)]
pub(crate) struct EffectFiles {
    /// File that defines an effect of your own, which is then used like those of the catalogue; repeatable.
    #[arg(long, value_name = "FILE")]
    effect_file: Vec<PathBuf>,
}

impl EffectFiles {
    /// Reads the files.
    pub(crate) fn load(&self) -> anyhow::Result<Vec<&'static Definition>> {
        let each = self.effect_file.iter().map(|path| Definition::load(path));
        Ok(each.collect::<Result<_, _>>()?)
    }

    /// Makes the effects known to `model`.
    pub(crate) fn define(&self, model: &mut Model) -> anyhow::Result<()> {
        for definition in self.load()? {
            model.define(definition)?;
        }
        Ok(())
    }
}
