//! Agreement of the exported models between all languages of `codegen`: each bundled model, each effect and
//! delay law of the catalogue, user effects, a command range, the control laws.

mod cases;
mod languages;
mod pace;
mod vectors;

pub use cases::{Case, Gradings, cases};
pub use languages::{Tool, run};
pub use pace::{Pace, pace};
pub use vectors::Vectors;

/// Tolerance for Python and Octave, relative to the largest |y|.
pub const TOLERANCE: f64 = 1e-12;

/// A case in a language.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: String,
    /// The language and its numbers.
    pub language: &'static str,
    /// The largest difference relative to the largest |y|; 0 for bit equality.
    pub difference: f64,
    /// Whether the largest difference is within the promised tolerance.
    pub agrees: bool,
    /// Instructions of a sample, if a board ran it.
    pub instructions: Option<f64>,
}
