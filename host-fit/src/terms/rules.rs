//! The rules of the search over terms.

use crate::rules;

rules! {
    /// Which terms a model needs: what a term must earn to stay, and when the search ends.
    pub struct Rules in "terms";

    /// What each parameter of a term must take off the held-out rms error, as a share of it.
    price: f64 = 0.004, "share of the rms error", "nulls of six families of flows: coloured noise of 20 repeats makes 0.001 to 0.003 of a needless parameter";
    /// A model within this factor of the noise floor has nothing left to find.
    at_the_floor: f64 = 1.005, "times the noise level", "two standard deviations of what three records of 10 s say";
    /// Where the best model is further from the floor than this, a second one is followed as well.
    near_the_floor: f64 = 1.05, "times the noise level", "judgement: half of the margin to which `y_sd` is known";
    /// The second one is followed if its error is within this factor of the best one's.
    rival: f64 = 2.0, "times the best error", "rigs with memory: the right first step was never further behind";
    /// Delays between samples are rounded where that costs no more than this.
    rounding: f64 = 0.015, "share of the rms error", "what an effect must take to be named";
    /// An effect with a parameter so near to the end of its range stands in for something else.
    bound: f64 = 0.01, "share of the range", "a ring of 0.95 of critical damping was named where the flow has a second lag";
    /// Rounds of screening and refitting.
    rounds: usize = 6, "", "two effects and two memories take three";
    /// Rounds without a gain that end the search.
    patience: usize = 2, "rounds", "judgement: for the time it takes";
    /// Where this much or more is left when the search ends, it goes on once with what promised less …
    much: f64 = 1.25, "times the noise level", "what is named leaves less";
    /// … for so many more rounds …
    rounds_after: usize = 3, "rounds", "judgement: for the time it takes";
    /// … of which the first refits so many times as much.
    wider: usize = 4, "", "the flow over a ramp: separate delays of the edges promise little before there are vortices, and the other way round";
    /// Proposals with effects that are refitted per model …
    with_effects: usize = 5, "", "the truth was within the first three on 80 rigs of six families";
    /// … and proposals without.
    without_effects: usize = 4, "", "a rate that depends on y was the fourth beside lags of all kinds";
    /// … of them of one kind.
    of_one_kind: usize = 2, "", "judgement: lags are moved to where they belong";
    /// Of what was refitted for a few steps, how many are followed to the end.
    finished: usize = 4, "", "the same rigs";
    /// A given structure of more terms than this is no place to set out from.
    most_given: usize = 6, "terms", "judgement: each has to be tried without at the end";
    /// Effects that are tried in the place of another term.
    in_its_place: usize = 3, "", "judgement: the truth leads the screening or is next to the leader";
    /// … if the screening promises no more than this …
    promising: f64 = 2.0, "times the error", "eight rigs: after a few steps no less than 0.7 of what the screening promised was left";
    /// … and those that are followed to the end: what is further behind after a few steps does not catch up.
    in_reach: f64 = 1.2, "times the error", "judgement: the lag of a valve in the place of a film's is 1.15 after the first steps";
    /// A base that is worse by no more than this, its parameters paid for, takes the place of a second name.
    as_well: f64 = 0.01, "share of the rms error", "a lag of the film and a second lag of the flow are one model where the delay is fixed, and the second costs a parameter more";
    /// Steps that every proposal is followed for.
    brief: usize = 6, "iterations", "fewer leave thresholds where they were";
    /// Of more starts than this, the best so many are followed for the second half of them.
    followed: usize = 3, "starts", "judgement: for the time it takes";
    /// What costs this many times its price after those steps without it is needed.
    far_from_needless: f64 = 5.0, "times the price", "judgement: the steps that follow take half of the loss at most";
    /// Level of the tests.
    level: f64 = 0.05, "p-value", "convention";
    /// The base that effects have to beat must have been given this many more parameters than they have.
    head_start: usize = 2, "parameters", "a memory costs three, an effect one to four";
    /// Longest lag that is tried …
    longest_lag_s: f64 = 0.5, "s at 1 kHz", "the paper's lags";
    /// … and no more than this share of the shortest record.
    longest_lag_share: f64 = 0.25, "share of a record", "judgement";
    /// Steps between the lags that are screened.
    lag_step: usize = 8, "samples", "a wrong lag of half a step leaves a tenth of what the right one takes";

    /// A linear model whose inputs take back what others do is set out from where it errs less than the best structure by this.
    linear_better: f64 = 0.03, "share of the rms error", "judgement: a first response in the wrong direction errs by more";
    /// Evaluations of the mesh adaptive direct search that settles the delays of a chosen structure, at most …
    settling: usize = 300, "", "judgement: each is a brief fit; a structure of five delays needs 60 to 150";
    /// … the iterations of the fit at each …
    settling_iterations: usize = 2, "iterations", "judgement: the start is the best fit so far";
    /// … how far a lag may go …
    settling_reach: f64 = 0.25, "share of the lag", "judgement: what is further off the search over terms has tried";
    /// … at least …
    settling_least: usize = 8, "samples", "the step of the grid that lags are screened on";
    /// … and the first frame.
    settling_frame: f64 = 0.25, "share of each variable's range", "judgement: the start is near";
    /// A delay law that differs by less than this over the levels of the records is a constant delay …
    least_rise: f64 = 1.0, "samples", "what rounding to samples hides";
    /// … and so is one that no test tells from it at this level.
    law_level: f64 = 0.01, "p-value", "convention: one of a hundred constant delays gets a law";

    /// Points along a parameter's range where it is the only one that is free, one of two, of more …
    grid: [usize; 3] = [12, 4, 3], "", "judgement";
    /// … along a range of frequencies: a weakly damped mode is narrow …
    grid_of_frequencies: usize = 28, "", "judgement";
    /// … and, for levels of y, between its 5 and 95 % quantiles.
    grid_of_levels: [f64; 6] = [0.1, 0.25, 0.4, 0.55, 0.7, 0.88], "share of the range", "a grid";

    /// y is of size 1 where this share of all samples is closer to the level of rest than that.
    full: f64 = 0.995, "share of the samples", "judgement: what is beyond is noise";

    /// Series are screened with so many numbers at most: longer ones are averaged over neighbours.
    longest_series: usize = 24_000, "values", "judgement: for the time it takes";
    /// Lags that are screened below the regular steps …
    short_lags: [usize; 6] = [3, 5, 8, 12, 16, 20], "samples", "a grid";
    /// … which begin here.
    regular_lags: u16 = 26, "samples", "the next of that grid";
    /// Second lags of the flow that are screened.
    second_lags: [f64; 5] = [1.5, 4.0, 10.0, 20.0, 40.0], "samples", "a grid in steps of 2 to 3";
    /// Slow wakes that are screened.
    wakes_s: [f64; 5] = [0.1, 0.2, 0.4, 0.8, 1.6], "s at 1 kHz", "a grid in steps of 2";
    /// Change of the rate with the level, and pull of a wake, by which their effect is seen.
    slope: f64 = 0.1, "", "judgement: small, and far above rounding";
    /// A term whose effect is not proportional must be wanted at least this many times.
    some: f64 = 0.1, "times its size in the grid", "judgement";
    /// Points of a curve that are hardly ever met stay where they are: the ridge that holds them there.
    ridge: f64 = 1e-4, "share of the mean square of the points", "judgement";
    /// Candidates whose changes of the free run correlate so well may do for each other.
    alike: f64 = 0.85, "", "theory 4.3: above it no fit of the paper's structure tells effects apart";
    /// Grid points of an effect that are kept for sets …
    kept_points: usize = 2, "", "judgement: for the time it takes";
    /// … of a kind of lag …
    kept_lags: usize = 5, "", "judgement: for the time it takes";
    /// … and how far apart those are.
    lags_apart: usize = 20, "samples", "judgement: neighbours say the same";
    /// Grid points of a jet effect that are tried with every response to part jets.
    regraded: usize = 3, "", "judgement, on the rigs of six families";
    /// Single candidates from which pairs are made.
    paired: usize = 24, "", "judgement: for the time it takes";
    /// Samples by which a lag is moved to see where it should be …
    lag_probe: u16 = 2, "samples", "judgement";
    /// … the longest move at a time …
    longest_move: f64 = 12.0, "samples", "judgement: one and a half steps of the grid";
    /// … and what a move must promise.
    worth_moving: f64 = 2e-4, "share of the error energy", "judgement: a twentieth of the price of a parameter";
    /// Rounds of moving all lags of a model …
    lag_rounds: usize = 6, "", "judgement";
    /// … the steps of a fit after each move …
    lag_iterations: usize = 1, "iterations", "without one, far from the floor, lags stay where they are: a converter, a ball screw and the flow over a ramp";
    /// … and what a move must gain.
    lag_gain: f64 = 1e-4, "share of the mean square error", "judgement";
    /// Delay laws are compared at this level, where nothing better is known.
    middle: f64 = 0.5, "size of y", "the middle of the range";

    /// Signs are drawn for records, or for pieces of records where there are fewer records than this.
    fewest_pieces: usize = 8, "", "2⁸ patterns of signs: a p-value of 0.01 can be told";
    /// Errors that are noise alone, against which the best of all candidates has to stand.
    draws: usize = 199, "", "a p-value of 0.005 is the least that can be said";
    /// Errors of blocks of so many correlation times count as independent …
    correlation_times: f64 = 8.0, "correlation times", "held by `the_p_value_is_calibrated_for_coloured_errors`";
    /// … of so many samples at least …
    shortest_block: usize = 20, "samples", "judgement";
    /// … and not so long that there are fewer than this.
    fewest_blocks: usize = 24, "blocks", "judgement: a test of fewer has no power";
    /// Values that are enough to estimate a correlation time from.
    plenty: usize = 4000, "values", "judgement: for the time it takes";
    /// Resamples of what is held out, records first and blocks of them then.
    resamples: usize = 400, "", "shares are known to 0.025";
    /// A model that resamples choose less often than the best by this over √2 is out of the question.
    inflation: f64 = 0.1, "share of the resamples", "the ε of the inflated argmax (Adrian, Soloff and Willett, arXiv 2410.18268)";
    /// Most folds of a cross-validation.
    most_folds: usize = 4, "", "judgement: for the time it takes";
    /// What is learned from of the only record.
    learned_share: f64 = 0.6, "share of the record", "judgement";
    /// A run that diverges counts as so far off.
    diverged: f64 = 10.0, "times the largest |y|", "judgement: worse than any that stays";
}
