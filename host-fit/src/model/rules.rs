//! The rules of models.

use crate::rules;

rules! {
    /// Compatibility of data with a model, and when a run counts as extrapolation.
    pub struct Rules in "model";

    /// Sample periods that differ by at most this are equal (printed with different digits).
    same_period: f64 = 1e-6, "share of the period", "six digits";
    /// A free run leaves the training range if y exceeds the records by more than this.
    outside: f64 = 0.05, "share of the recorded range", "judgement";
}
