//! The rules of identification.

use crate::rules;

rules! {
    /// Records for identification, and quality criteria of the model.
    pub struct Rules in "identify";

    /// The simulation of a candidate stops when its free run exceeds this, well below the limit of divergence.
    hopeless: f64 = 10.0, "times the largest |y|", "judgement: such candidates are never the best";
    /// A model whose validation FIT is this much below its estimation FIT is reported as over-fitted.
    overfitted_points: f64 = 12.0, "points of FIT", "judgement: on the flow simulation models with sixteen lags lose 28 to 34 points, and models with two lags 7 to 11";

    /// Longest lag and input delay.
    longest_lag: u16 = 500, "samples", "the paper";
    /// Records shorter than this multiple of the longest lag get shorter lags.
    longest_lag_fits: usize = 4, "times", "judgement";
    /// Patience of a search: the unit in which numbers of kicks (random perturbations) are given.
    patience: usize = 3, "", "tuned on sets 1 to 3 of docs/search.md";
    /// A one-step search ends after this many kicks without improvement, per unit of patience.
    kicks: usize = 6, "kicks", "tuned on sets 1 to 3 of docs/search.md";
    /// A free-run search ends after this many kicks without improvement, per unit of patience.
    free_kicks: usize = 8, "kicks", "tuned on sets 1 to 3 of docs/search.md";
    /// Largest number of kicks of a free-run search per unit of patience.
    most_free_kicks: usize = 12, "kicks", "tuned on sets 1 to 3 of docs/search.md";
    /// Probability that a kick also moves the input delays.
    kicked_inputs: f64 = 0.3, "", "tuned on sets 1 to 3 of docs/search.md";
    /// After a kick that moves the input delays, a one-step search scans them within this distance.
    kick_reach: f64 = 12.0, "samples", "tuned on sets 1 to 3 of docs/search.md";
    /// Largest move of input delays in a kick of the free-run search.
    free_kick_reach: f64 = 5.0, "samples", "tuned on sets 1 to 3 of docs/search.md";
    /// Lags that a kick of the free-run search replaces.
    kicked_lags: usize = 2, "lags", "tuned on sets 1 to 3 of docs/search.md";
    /// Least distance between a lag and its replacement in a kick of the free-run search.
    kick_distance: u16 = 4, "samples", "the descent reaches nearer lags without a kick";
    /// Number of predicted minima per slot that are simulated.
    minima: usize = 7, "lags", "judgement";
    /// A predicted minimum is simulated if it is below this.
    promising: f64 = 1.01, "times the best error", "judgement";
    /// Steps of the line search over input delays.
    input_moves: [f64; 9] = [0.02, 0.1, 0.3, 0.5, 1.0, 2.0, 3.0, 6.0, 12.0], "samples", "a grid with factors of 2 to 5";
    /// Input delays are searched when a descent comes within this factor of the best.
    close: f64 = 1.01, "times the best error", "judgement";
    /// A descent ends with a sweep that gains less than this.
    small_gain: f64 = 1e-3, "share of the error", "judgement";
    /// A descent is stopped if its error after sweep n exceeds the best by more than this over n.
    falling_behind: f64 = 0.05, "share of the best error", "judgement";
}
