//! The rules of structure selection.

use crate::rules;

rules! {
    /// Which terms a model needs: by how much a term must lower the error to be kept, and when the search ends.
    pub struct Rules in "terms";

    /// Penalty per parameter of a term, as a share of the validation rms error.
    price: f64 = 0.004, "share of the rms error", "in cases without an effect of six families, a superfluous parameter lowers the error by 0.001 to 0.003 on coloured noise of 20 repeats";
    /// Free runs are not restarted, whatever the poles of the given model, if the first-order reference explains at
    /// least this share with a time constant well below the length of the records.
    self_regulates: f64 = 0.5, "share of the variance", "judgement: half";
    /// Largest number of measured channels that are candidates of a diagnosis.
    inputs: usize = 4, "channels", "judgement: limits the time";
    /// A channel is not an input if its correlation with y, the command or time exceeds this. It is then the same
    /// quantity in another unit, a copy of the command, or a clock.
    same_quantity: f64 = 0.95, "correlation", "judgement: a second heater with its own lag has a lower correlation";
    /// A model within this factor of the noise level is searched no further.
    at_the_floor: f64 = 1.005, "times the noise level", "two standard deviations of the error of three records of 10 s";
    /// If the best model is above this factor of the noise level, the second-best is followed as well, effects are tried
    /// in place of base terms even if it has effects, and the verdict says that an error remains.
    near_the_floor: f64 = 1.05, "times the noise level", "judgement: half of the uncertainty of `y_sd`";
    /// The second-best model is followed, and terms are removed from the best model without effects, if its error is within
    /// this factor of the best.
    rival: f64 = 2.0, "times the best error", "simulated rigs with a memory: the correct first step was always \
         within this factor";
    /// Delays between samples are rounded to whole samples if the error rises by no more than this.
    rounding: f64 = 0.015, "share of the rms error", "equal to the practical margin of effects";
    /// An effect with a parameter this close to the end of its range is a surrogate.
    bound: f64 = 0.01, "share of the range", "without this rule, vortex shedding with a damping ratio of 0.95 was \
         named on a flow with a second lag";
    /// Number of rounds of screening and refitting.
    rounds: usize = 6, "", "models with two effects and two memories need three rounds";
    /// The search ends after this many rounds without a gain.
    patience: usize = 2, "rounds", "judgement: limits the time";
    /// The search stops refitting further models when the refitted ones had this many parameters in total.
    effort: f64 = 1600.0, "parameters", "two minutes of processor time on five records of 10 000 samples";
    /// If the error is at least this factor of the noise level when the search ends, the search is extended
    /// to less promising candidates.
    much: f64 = 1.25, "times the noise level", "models with a named effect have a smaller error";
    /// Rounds of the extension of a search whose error is still high.
    rounds_after: usize = 3, "rounds", "judgement: limits the time";
    /// Factor on the number of refits in the first round of the extension.
    wider: usize = 4, "", "flow over a ramp: edge-dependent delays and vortices lower the error only together";
    /// Proposals with effects that are refitted per model and round.
    with_effects: usize = 5, "", "the true effect was among the first three on 80 rigs of six families";
    /// Proposals without effects that are refitted per model and round.
    without_effects: usize = 4, "", "a level-dependent rate was the fourth best candidate, after lags";
    /// Largest number of refitted proposals without effects that are of one kind.
    of_one_kind: usize = 2, "", "judgement: the fit can move the lags";
    /// Number of proposals that are refitted in full, of those fitted for a few iterations.
    finished: usize = 4, "", "80 rigs of six families";
    /// A given structure with more terms than this is not used as a starting point.
    most_given: usize = 6, "terms", "judgement: each of them is tested for removal at the end";
    /// An effect is fitted further in place of base terms if its error after a brief fit is below this factor.
    promising: f64 = 2.0, "times the error", "judgement: base terms that imitate the effect are still in the model";
    /// An effect in place of base terms is refitted in full if its error after further iterations is within this factor
    /// of the model's.
    in_reach: f64 = 1.2, "times the error", "judgement: a valve lag in place of a film lag has 1.15 times the error after the first iterations";
    /// Iterations of the brief fit of each proposal.
    brief: usize = 6, "iterations", "with fewer iterations, thresholds stay at their starting values";
    /// Number of starting points, the best ones, that are continued after half of the iterations.
    followed: usize = 3, "starts", "judgement: limits the time";
    /// A term is needed if removing it costs more than this factor of its penalty after a brief fit.
    far_from_needless: f64 = 5.0, "times the price", "judgement: further iterations recover at most half of the loss";
    /// Level of the tests.
    level: f64 = 0.05, "p-value", "convention";
    /// The base model that effects must beat was offered at least this many additional parameters for each parameter of
    /// the effects.
    head_start: usize = 2, "parameters", "a memory has three parameters, an effect one to four";
    /// Longest lag that is tried.
    longest_lag_s: f64 = 0.5, "s at 1 kHz", "the paper's lags";
    /// Longest lag as a share of the shortest record.
    longest_lag_share: f64 = 0.25, "share of a record", "judgement";
    /// Steps between the lags that are screened.
    lag_step: usize = 8, "samples", "a lag that is half a step off explains 90 % of what the right lag explains";

    /// A linear model whose inputs cancel each other is used as a starting point if its error is smaller than the
    /// best structure's by this. A first- or second-order model is preferred if its error is larger by at most this
    /// and no test distinguishes the two.
    linear_better: f64 = 0.03, "share of the rms error", "judgement: an inverse response has a larger error";
    /// Largest number of evaluations of the mesh adaptive direct search for the delays of a chosen structure.
    settling: usize = 300, "", "judgement: each evaluation is a brief fit; a structure with five delays needs 60 to 150";
    /// Iterations of the parameter fit at each evaluation of the direct search for the delays.
    settling_iterations: usize = 2, "iterations", "judgement: each fit starts from the best parameters so far";
    /// Largest move of a lag in the direct search for the delays.
    settling_reach: f64 = 0.25, "share of the lag", "judgement: larger moves are made by the search over terms";
    /// Least range of the moves of a lag in the direct search for the delays.
    settling_least: usize = 8, "samples", "the step of the grid on which lags are screened";
    /// Initial frame size of the direct search for the delays.
    settling_frame: f64 = 0.25, "share of each variable's range", "judgement: the starting point is near the optimum";
    /// A delay law whose delay varies by less than this over the levels of the records is a constant delay.
    least_rise: f64 = 1.0, "samples", "rounding to whole samples hides a smaller variation";
    /// A delay law counts as a constant delay if a test at this level does not distinguish them. In the same way
    /// longer lags count as a first or second order.
    law_level: f64 = 0.01, "p-value", "convention: 1 % of the plants with a constant delay get a delay law";

    /// Grid points along the range of a parameter if one, two, or more parameters of the effect are free.
    grid: [usize; 3] = [12, 4, 3], "", "judgement";
    /// Grid points along a range of frequencies, finer because a lightly damped mode is narrow.
    grid_of_frequencies: usize = 28, "", "judgement";
    /// Grid of levels of y for an effect whose card does not list its starting points.
    grid_of_levels: [f64; 6] = [0.1, 0.25, 0.4, 0.55, 0.7, 0.88], "share of the range between the 5 and 95 % quantiles", "a grid";

    /// The inner unit of y: this share of all samples is within one unit of the rest level.
    full: f64 = 0.995, "share of the samples", "judgement: larger values are noise";

    /// Largest number of values of a series in the screening; longer series are averaged over neighbours.
    longest_series: usize = 24_000, "values", "judgement: limits the time";
    /// Lags that are screened below the regular grid.
    short_lags: [usize; 6] = [3, 5, 8, 12, 16, 20], "samples", "a grid";
    /// First lag of the regular grid.
    regular_lags: u16 = 26, "samples", "continues the grid of the short lags";
    /// Time constants of a second lag of the flow that are screened.
    second_lags: [f64; 5] = [1.5, 4.0, 10.0, 20.0, 40.0], "samples", "a grid with factors of 2 to 3";
    /// Time constants of a slow wake that are screened.
    wakes_s: [f64; 5] = [0.1, 0.2, 0.4, 0.8, 1.6], "s at 1 kHz", "a geometric grid with a factor of 2";
    /// Step by which the change of the rate with the level, and the strength of a wake, are perturbed for a
    /// derivative.
    slope: f64 = 0.1, "", "judgement: small, and far above rounding errors";
    /// A term whose effect is not proportional to its amplitude must be predicted to need at least this
    /// multiple of its grid size.
    some: f64 = 0.1, "times the amplitude in the grid", "judgement";
    /// Ridge regularisation of curve points that the data rarely visit.
    ridge: f64 = 1e-4, "share of the mean square of the points", "judgement";
    /// Grid points kept per effect for sets of candidates.
    kept_points: usize = 2, "", "judgement: limits the time";
    /// Lags kept per kind for sets of candidates.
    kept_lags: usize = 5, "", "judgement: limits the time";
    /// Least distance between kept lags.
    lags_apart: usize = 20, "samples", "judgement: neighbouring lags have the same effect";
    /// Grid points of a jet effect that are tried with every response to jets of part strength.
    regraded: usize = 3, "", "judgement, on rigs of six families";
    /// Number of single candidates from which pairs are formed.
    paired: usize = 24, "", "judgement: limits the time";
    /// Shift of a lag for its finite-difference derivative.
    lag_probe: u16 = 2, "samples", "judgement";
    /// Longest move of a lag in one step.
    longest_move: f64 = 12.0, "samples", "judgement: one and a half steps of the grid";
    /// Least predicted gain for which the lags are moved.
    worth_moving: f64 = 2e-4, "share of the error energy", "judgement: a twentieth of the price of a parameter";
    /// Rounds of moving all lags of a model.
    lag_rounds: usize = 6, "", "judgement";
    /// Fit iterations after each move of the lags.
    lag_iterations: usize = 1, "iterations", "needed if the error is far above the noise level, because the lags do \
         not move otherwise (buck converter, ball screw, flow over a ramp)";
    /// Least gain for which a move of the lags is accepted.
    lag_gain: f64 = 1e-4, "share of the mean square error", "judgement";
    /// Level of y at which delay laws are compared if no level is given.
    middle: f64 = 0.5, "size of y", "the middle of the range";

    /// The scatter of an effect's gain is estimated from at least this many records; if there are fewer, from
    /// pieces of them.
    fewest_pieces: usize = 8, "", "judgement: the scatter of fewer pieces is uncertain by more than a third";
    /// Bootstrap resamples of the validation samples: records first, then blocks.
    resamples: usize = 400, "", "the standard error of a share is then at most 0.025";
    /// A model is excluded if its share of won resamples is smaller than the share of the best model by more than this
    /// value divided by √2.
    inflation: f64 = 0.1, "share of the resamples", "the ε of the inflated argmax (Adrian, Soloff and Willett, arXiv 2410.18268)";
    /// Largest number of folds of a cross-validation.
    most_folds: usize = 4, "", "judgement: limits the time";
    /// Share of the only record that is used for estimation.
    learned_share: f64 = 0.6, "share of the record from its first edge on", "judgement";
    /// Error assigned to a diverging run.
    diverged: f64 = 10.0, "times the largest |y|", "judgement: larger than the error of any bounded run";
}
