//! The rules of fitting.

use crate::rules::rules;

rules! {
    /// How models are fitted, and what a fit is good for.
    pub struct Rules in "fit";

    /// A record starts at rest when its first |y| is at most this share of its largest.
    near_rest: f64 = 0.1, "share of the largest |y|", "judgement";
    /// A model whose held-out FIT is this much below that of its own records has more lags than they can tell.
    overfitted_points: f64 = 12.0, "points of FIT", "judgement: on the flow simulation sixteen lags lose 28 to 34, two lags 7 to 11";
}
