//! The rules of identification.

use crate::rules;

rules! {
    /// What kind of records a model is identified on, and what it is good for.
    pub struct Rules in "identify";

    /// A candidate of the search is given up when its free run goes beyond this: much sooner than a run has diverged.
    hopeless: f64 = 10.0, "times the largest |y|", "judgement: candidates that swing so far are never the best";
    /// A model whose validation FIT is this much below that of its own records has more lags than they can tell.
    overfitted_points: f64 = 12.0, "points of FIT", "judgement: on the flow simulation sixteen lags lose 28 to 34, two lags 7 to 11";

    /// Longest lag and input delay …
    longest_lag: u16 = 500, "samples", "the paper";
    /// … in records of so many times that length; in shorter ones the lags are shorter.
    longest_lag_fits: usize = 4, "times", "judgement";
    /// Patience of a search, in which the numbers of kicks are counted.
    patience: usize = 3, "", "chosen on sets 1 to 3 of docs/search.md";
    /// A one-step search kicks this often per unit of patience before it gives up …
    kicks: usize = 6, "kicks", "chosen on sets 1 to 3 of docs/search.md";
    /// … a free-run search this often …
    free_kicks: usize = 8, "kicks", "chosen on sets 1 to 3 of docs/search.md";
    /// … and at most this often, fruitless or not.
    most_free_kicks: usize = 12, "kicks", "chosen on sets 1 to 3 of docs/search.md";
    /// A kick moves the input delays, too, with this probability …
    kicked_inputs: f64 = 0.3, "", "chosen on sets 1 to 3 of docs/search.md";
    /// … after which a one-step search looks for them this far …
    kick_reach: f64 = 12.0, "samples", "chosen on sets 1 to 3 of docs/search.md";
    /// … and a free-run search moves them this far at most.
    free_kick_reach: f64 = 5.0, "samples", "chosen on sets 1 to 3 of docs/search.md";
    /// Lags that a kick of the free-run search replaces …
    kicked_lags: usize = 2, "lags", "chosen on sets 1 to 3 of docs/search.md";
    /// … by others further away than this.
    kick_distance: u16 = 4, "samples", "a descent reaches as far";
    /// Lags whose predicted error is lowest are simulated first, so many of a slot …
    minima: usize = 7, "lags", "judgement";
    /// … if the prediction is below this.
    promising: f64 = 1.01, "times the best error", "judgement";
    /// Steps in which input delays are walked.
    input_moves: [f64; 9] = [0.02, 0.1, 0.3, 0.5, 1.0, 2.0, 3.0, 6.0, 12.0], "samples", "a grid in steps of 2 to 5";
    /// They are walked where a descent comes this close.
    close: f64 = 1.01, "times the best error", "judgement";
    /// A sweep that gains less than this ends a descent.
    small_gain: f64 = 1e-3, "share of the error", "judgement";
    /// A descent is given up when its n-th sweep ends this much over n above the best.
    falling_behind: f64 = 0.05, "share of the best error", "judgement";
}
