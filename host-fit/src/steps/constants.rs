//! A model as constants for a board.

use serde::Serialize;

use super::StepError;
use crate::codegen::{Language, write};
use crate::model::{Law, Model};

/// Constants for a board. Serialises to the keys of `codegen --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoardConstants {
    /// The file.
    #[serde(skip)]
    pub text: String,
    /// N1, N2 and N3 of the model.
    #[serde(skip)]
    pub sizes: [usize; 3],
    /// Length of the file.
    pub bytes: usize,
    /// Effects of the model.
    pub effects: Vec<String>,
    /// Law of the model.
    pub law: Option<Law>,
    /// Sensor offset, which the levels of the law do not include, y.
    #[serde(skip)]
    pub sensor_zero: f64,
}

/// Writes `model`, and its law where it has one, as Rust for a `no_std` crate on `model-core`.
///
/// ```
/// use host_fit::model::Model;
/// use host_fit::steps::constants;
///
/// let model = Model::load("../data/paper/table-2-state-dependent.toml".as_ref())?;
/// let constants = constants(&model)?;
/// assert_eq!(constants.sizes, [5, 10, 1]);
/// assert!(constants.text.contains("pub const STATE_LAGS: [u16; 5]"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError::Codegen`] with the reason why this model cannot run on a board.
pub fn constants(model: &Model) -> Result<BoardConstants, StepError> {
    written(model, &Language::Rust)
}

/// Writes `model`, and its law where it has one, in `language`.
///
/// # Errors
/// [`StepError::Codegen`] with the reason.
pub fn written(model: &Model, language: &Language) -> Result<BoardConstants, StepError> {
    let text = write(model, language)?;
    Ok(BoardConstants {
        sensor_zero: model.zero_among(&model.values()),
        sizes: [model.a.len(), model.product_lags.len(), model.b.len()],
        bytes: text.len(),
        effects: model.effect_names(),
        law: model.law.clone(),
        text,
    })
}
