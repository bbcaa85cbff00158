//! Options of an identification.

use super::rules::RULES;
use super::structure::Structure;
use crate::search::Settings;

/// The objective of the delay search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Objective {
    /// Norm of the one-step prediction errors.
    OneStep,
    /// ε of the free run, eq. (9), with one-step least-squares coefficients. This is the objective
    /// of the paper.
    #[default]
    FreeRun,
}

impl Objective {
    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::OneStep => "one-step",
            Self::FreeRun => "free-run",
        }
    }
}

/// Options of an identification.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifyOptions {
    /// Sizes and conventions of the model.
    pub structure: Structure,
    /// Objective of the search.
    pub objective: Objective,
    /// Budget, seed and threads of the search.
    pub search: Settings,
    /// Restarts without improvement after which the search ends; 0 for a single descent.
    pub patience: usize,
    /// Whether the coefficients are refined on the free run after a search with
    /// [`Objective::FreeRun`].
    pub refine: bool,
}

impl Default for IdentifyOptions {
    fn default() -> Self {
        Self {
            structure: Structure::default(),
            objective: Objective::default(),
            search: Settings::default(),
            patience: RULES.patience,
            refine: true,
        }
    }
}
