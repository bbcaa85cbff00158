//! The rules of identification.

use crate::rules::rules;

rules! {
    /// What kind of records a model is identified on, and what it is good for.
    pub struct Rules in "identify";

    /// A record starts at rest when its first |y| is at most this share of its largest.
    near_rest: f64 = 0.1, "share of the largest |y|", "judgement";
    /// A candidate of the search is given up when its free run goes beyond this: much sooner than a run has diverged.
    hopeless: f64 = 10.0, "times the largest |y|", "judgement: candidates that swing so far are never the best";
    /// A model whose held-out FIT is this much below that of its own records has more lags than they can tell.
    overfitted_points: f64 = 12.0, "points of FIT", "judgement: on the flow simulation sixteen lags lose 28 to 34, two lags 7 to 11";
}
