//! A model as constants for a board.

use serde::Serialize;

use super::StepError;
use crate::codegen::generate;
use crate::model::{Law, Model};

/// Constants for a board. Serialises to the keys of `codegen --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Constants {
    /// The Rust file.
    #[serde(skip)]
    pub text: String,
    /// Its length.
    pub bytes: usize,
    /// Effects of the model.
    pub effects: Vec<String>,
    /// Its law.
    pub law: Option<Law>,
}

/// Writes `model`, and its law where it has one, as Rust for a `no_std` crate on `model-core`.
///
/// # Errors
/// [`StepError::Codegen`] with the reason why this model cannot run on a board.
pub fn constants(model: &Model) -> Result<Constants, StepError> {
    let text = generate(model)?;
    Ok(Constants {
        bytes: text.len(),
        effects: model.effect_names(),
        law: model.law.clone(),
        text,
    })
}
