//! The rules of models.

use crate::rules;

rules! {
    /// What a model may be run on, and when it is remarked that it says little.
    pub struct Rules in "model";

    /// Sample periods that differ by no more than this are the same, printed with different digits.
    same_period: f64 = 1e-6, "share of the period", "six digits";
    /// A free run is outside what was recorded when y goes further than this beyond the records.
    outside: f64 = 0.05, "share of the recorded range", "judgement";
}
