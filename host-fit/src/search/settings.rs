//! The settings of a search.

use super::rules::RULES;

/// Settings of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Largest number of evaluations of the objective; cached points are free.
    pub evaluations: usize,
    /// Seed of every random choice: the same seed gives the same result bit for bit.
    pub seed: u64,
    /// Number of threads that evaluate, at least 1. The result does not depend on it.
    pub threads: usize,
    /// Poll directions.
    pub poll: PollKind,
    /// First frame as a share of each variable's range, above 0 and at most 1.
    pub initial_frame: f64,
}

/// Number of directions of a poll.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PollKind {
    /// All vectors of an orthogonal basis with both signs: 2n points.
    Ortho2N,
    /// The more promising n of these vectors, and the negative of their sum: n + 1 points.
    OrthoNPlus1,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            evaluations: RULES.evaluations,
            seed: 0,
            threads: 1,
            poll: PollKind::OrthoNPlus1,
            initial_frame: RULES.initial_frame,
        }
    }
}
