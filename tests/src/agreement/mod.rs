//! Whether a model says the same in every language that `codegen` writes: each bundled model, each effect and delay
//! law of the catalogue, own effects, a command range, the laws.

mod cases;
mod languages;
mod vectors;

pub use cases::{Case, cases};
pub use languages::{Tool, run};
pub use vectors::Vectors;

/// What Python and Octave may differ by, of the largest |y|.
pub const TOLERANCE: f64 = 1e-12;

/// A case in a language.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: String,
    /// The language and its numbers.
    pub language: &'static str,
    /// The largest difference, of the largest |y|; 0 where every bit agrees.
    pub difference: f64,
    /// Whether that is what is promised.
    pub agrees: bool,
}
