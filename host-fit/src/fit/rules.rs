//! The rules of fitting.

use crate::rules;

rules! {
    /// Output-error fits: iterations, starting points and standard errors.
    pub struct Rules in "fit";

    /// A fit without a better step has converged if the cosines between the residual and all derivatives are below
    /// this.
    stationary: f64 = 1e-6, "cosine", "judgement; tested in `levenberg.rs`";
    /// Largest number of iterations of a fit.
    iterations: usize = 30, "", "judgement";
    /// A fit ends when an iteration lowers the sum of squares by less than this.
    tolerance: f64 = 1e-5, "share of the sum of squares", "judgement: far below the resolution of a diagnosis";
    /// If a fit finds no descent, it continues with the delays held constant, at most this often.
    held_delays: usize = 3, "", "judgement: every continuation must lower the error";
    /// Iterations from every starting point before the best are chosen.
    brief: usize = 4, "", "on a rig of the campaign with seed 33000, a hysteresis is found with four iterations, but not with one";
    /// Iterations after moving a fixed delay by one step.
    settling: usize = 3, "", "judgement";
    /// Steps by which a fixed delay is moved.
    delay_steps: [f64; 4] = [8.0, 4.0, 2.0, 1.0], "samples", "halving";
    /// Half width of the secant for parameters with a stepwise influence.
    secant: f64 = 0.01, "share of its range", "judgement";
    /// Largest change of a logarithmic parameter in one iteration.
    leap: f64 = 2.0, "ln", "judgement: a factor of 7";
    /// Number of blocks of a record over which standard errors are summed. The block length with the larger error
    /// counts, because noise may vary slowly.
    batches: [usize; 2] = [40, 10], "", "with 40 blocks alone, 94 of 126 intervals of 95 % contained the true value";
    /// Standard errors are at least those of the jackknife over records, because unmodelled disturbances may last
    /// as long as a record. If there are fewer records than this, pieces of records are used.
    left_out: usize = 5, "records", "13 rigs of seed 313131: 22 of 24 intervals contain the true value, without the jackknife 18";

    /// Starting points that are fitted in full, in addition to the best with each response to jets of part
    /// strength.
    followed: usize = 2, "", "judgement, on simulated rigs";
    /// Starting points that are tried with each response to jets of part strength.
    regraded: usize = 4, "", "judgement, on simulated rigs";
    /// Largest number of starting points of an effect.
    most_starts: usize = 12, "", "judgement, on simulated rigs";
    /// Starting points of a measured input's effect that are tried with every fresh start of the lowest order.
    input_starts: usize = 4, "", "judgement: both signs and several lags";
    /// Starting points of a delay law.
    law_starts: usize = 3, "", "judgement, on simulated rigs";
    /// Initial time constants of the lowest-order model.
    time_constants_s: [f64; 3] = [0.02, 0.06, 0.2], "s", "judgement: a factor of 3 apart";
    /// Longest of the eight initial delays of the lowest-order model.
    longest_start_s: f64 = 0.12, "s", "twice the paper's delay";
    /// Lower limit of the largest value of a signal of order 1, for which the catalogue's ranges are valid; other
    /// signals are scaled.
    order_one_low: f64 = 0.3, "", "judgement: friction gains are inside this range";
    /// Upper limit of the largest value of a signal of order 1.
    order_one_high: f64 = 3.0, "", "judgement: friction gains are inside this range";
    /// An input above this share of its maximum is strong: y/u is then near its steady value.
    strong_input: f64 = 0.5, "share of the largest |u|", "judgement";
    /// The percentile of y/u under a strong input that is taken as the steady value.
    settled_percentile: usize = 95, "%", "judgement: higher values are noise";

    /// The scatter of the level between repeats is estimated from at least this many records.
    records_of_scatter: usize = 3, "records", "judgement: with fewer records the variation is not measurable";
    /// The scatter of the level is modelled if it is at least this share of the noise.
    share_of_scatter: f64 = 0.05, "share of the variance", "judgement: a smaller scatter is negligible";
    /// The scatter of the level must vary between records by at least this. Noise that grows with the level in the same
    /// way in all records does not.
    scatter_differs: f64 = 0.12, "share of its mean", "in 20 repeats the scatter of a level varies by 0.3; in 10 000 samples coloured noise (40 ms) varies by 0.03";
    /// The remaining noise is at least this share of the variance.
    noise_beside_scatter: f64 = 0.1, "share of the variance", "judgement: a standard error from 20 repeats is \
         uncertain by 16 %";
    /// Correlation length assumed for the remaining noise.
    correlated: f64 = 40.0, "samples", "a hot film at 1 kHz; a value four times as large doubles the weight of errors along y";

    /// Number of runs that a record of a drifting plant is divided into.
    pieces: usize = 20, "", "judgement; the ball screw EMPS in docs/history/diagnosis.md";
    /// A piece is at least this multiple of the longest lag or delay. Before each piece the run follows the measurement
    /// for the length of a piece divided by this number; these samples are not scored.
    memories: usize = 8, "", "judgement";
    /// A plant counts as drifting if more than this share of an initial disturbance remains after a whole
    /// record.
    drifts: f64 = 0.37, "share", "judgement; tested in `an_integrator_drifts_and_a_damped_rig_does_not`";
}
