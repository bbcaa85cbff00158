//! The minimisation problem of a search.

use super::variable::{Point, Variable};

/// Outcome of one evaluation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Evaluation {
    /// The exact value; `f64::INFINITY` for a point without a value.
    Value(f64),
    /// A lower bound of the value, because the evaluation stopped early.
    AtLeast(f64),
}

/// A function of integers and granular reals to be minimised.
///
/// [`evaluate`](Self::evaluate) must depend only on the point and on [`prepare`](Self::prepare), and be callable
/// from several threads. Then a search is repeatable whatever the number of threads.
pub trait Problem: Sync {
    /// The variables, in the order of a point's coordinates.
    fn variables(&self) -> &[Variable];

    /// The cache key of a point. Points that are equivalent for the problem (permuted or repeated delays) should share
    /// one key.
    fn canonical(&self, point: &[i64]) -> Point {
        point.to_vec()
    }

    /// Sets of coordinates that are polled separately, because moving them together is rarely useful or much more
    /// expensive. Default: all in one.
    fn groups(&self) -> Vec<Vec<usize>> {
        vec![(0..self.variables().len()).collect()]
    }

    /// Called in order, on one thread, before a block of points is evaluated:
    /// the place to build tables they share.
    fn prepare(&mut self, _points: &[&Point]) {}

    /// Value at a point. May return [`Evaluation::AtLeast`] as soon as the value
    /// is known not to be below `give_up_at`.
    fn evaluate(&self, point: &Point, give_up_at: f64) -> Evaluation;
}
