//! Models that are not distinguishable on the records, and the command that would discriminate them.

use super::{Experiment, Limits, RULES, separating};
use crate::model::Model;
use crate::picture::listed;
use serde::{Serialize, Serializer};

/// A discriminating experiment. Serialises to `experiment` of `diagnose --json` and `discover --json`.
#[derive(Clone, Debug)]
pub struct Separation {
    /// The effects in which the models differ.
    pub effects: Vec<String>,
    /// The models, the final one first.
    pub models: Vec<Model>,
    /// The command that separates the models most.
    pub experiment: Experiment,
}

impl Separation {
    /// The command that discriminates the first of `models` from the others within the default [`Limits`], at a
    /// noise level of `noise_rmse` (y, 0 or more). `None` if there are no others, or if no command discriminates
    /// them.
    #[must_use]
    pub fn of(
        models: Vec<Model>,
        effects: Vec<String>,
        noise_rmse: f64,
        seed: u64,
    ) -> Option<Self> {
        let noise = noise_rmse.max(f64::MIN_POSITIVE);
        let experiment = separating(&models, noise, &Limits::default(), seed).ok()?;
        let distinguishes = experiment.separation_sigmas >= RULES.distinguishes;
        distinguishes.then_some(Self {
            effects,
            models,
            experiment,
        })
    }

    /// The command to play, in a sentence.
    #[must_use]
    pub fn words(&self) -> String {
        format!(
            "Experiment that distinguishes {}: {} (`--experiment command.csv` writes it).",
            listed(&self.effects),
            self.experiment.words().trim_end_matches('.')
        )
    }
}

impl Serialize for Separation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Document<'a> {
            effects: &'a [String],
            description: &'a str,
            separation_sigmas: f64,
        }
        let document = Document {
            effects: &self.effects,
            description: &self.experiment.description,
            separation_sigmas: self.experiment.separation_sigmas,
        };
        document.serialize(serializer)
    }
}
