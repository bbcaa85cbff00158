//! The rules of preparation.

use crate::rules;

rules! {
    /// Properties of the records that are determined before any model: how they begin, where they rest, which
    /// samples are scored.
    pub struct Rules in "preparation";

    /// Largest number of samples to which the first-order reference is fitted; longer records are averaged over
    /// neighbours.
    reference_samples: usize = 20_000, "samples", "judgement: limits the time";
    /// Shortest time constant of the first-order reference.
    shortest_time: f64 = 0.5, "samples", "faster responses are not distinguishable from an immediate one";
    /// Rounds in which dead time and time constant of the first-order reference are refined.
    refinements: usize = 7, "", "seven halvings, to a hundredth of the first step";
    /// If the reference explains less than this share, y counts as independent of u.
    related: f64 = 0.2, "share of the variance", "judgement";

    /// y responds to the command of its own row if the response in that row is between these shares of the response
    /// in the first three rows.
    own_row: [f64; 2] = [0.25, 2.0], "share of the response", "a shift by one row gives a share of 1, a mean over a row gives 0.5, and a direct part of u in y gives more than 5";

    /// A record rests until its first edge plus this share of the dead time. An earlier response belongs to an edge
    /// before the record.
    surely_before: f64 = 0.6, "dead times", "the state-dependent delays of the bundled flows vary by less";
    /// A channel that keeps each value for at least this many samples on average counts as switched. A record rests
    /// at most until the channel switches.
    switched: usize = 20, "samples", "judgement: measured quantities change at almost every sample";
    /// A rest must last this many time constants to be distinguished from motion.
    times_of_rest: f64 = 3.0, "time constants", "a motion has then decayed to 5 %";
    /// A rest must have at least this many samples to be distinguished from motion.
    fewest_at_rest: usize = 5, "samples", "judgement";
    /// y counts as moving if its motion under a constant command exceeds this share of the residual of the
    /// reference response (an unsteady flow moves by itself), and `motion-over-noise`.
    motion_unexplained: f64 = 0.5, "times its rms", "the flow simulation moves under a constant command";
    /// y counts as moving if its motion also exceeds this many times the residual variance.
    motion_over_noise: f64 = 40.0, "times", "judgement: noise with a memory of 10 samples stays below this";
    /// Short rests under one command do not count if their levels differ by more than this.
    rests_apart: f64 = 0.03, "share of the range of y", "judgement: noise shifts the mean of a few samples by less";
    /// Length of a record's start from which it is decided whether the record begins with an edge of the command.
    early: f64 = 2.5, "dead times", "later, the responses with and without an edge are similar";
    /// A record begins with an edge if the response to the edge leaves less than this share of the residual of a
    /// relaxation to rest.
    answer: f64 = 0.95, "share of the sum of squares", "judgement: both responses have equally many parameters, but the dead time of one of them is given";
    /// In mid-run, free runs follow the measurement for twice the dead time, at most for this share of a record.
    most_followed: usize = 4, "times shorter than the record", "judgement";
    /// In mid-run, free runs also follow the measurement until slow components have decayed, at most for this share
    /// of a record.
    followed_share: usize = 10, "times shorter than the record", "if the initial state of a slow wake is unknown and the run follows the measurement for the dead time only, the true model has 1.11 × the noise level";

    /// If the largest graded command lies between this and 1, commands are fractions of a full jet of 1.
    share_of_full: f64 = 0.5, "u", "graded commands with random levels rarely reach the full jet; a supply voltage is rarely below 1 V";
    /// Graded commands that are further from 0 than this have an operating point.
    operating_point: f64 = 0.25, "times their range", "judgement";

    /// The rest level is 0 unless its mean differs from 0 by at least this.
    off_zero: f64 = 5.0, "standard errors", "convention";
    /// Upper limit of noise that is slower than a rest: the standard errors of y. Where these are unknown, it is
    /// the residual of the reference response, and at most this share of the range.
    slow_noise: f64 = 0.0075, "share of the range of y", "judgement: slow noise shifts the mean of half a \
         second by less than four times this";
    /// The sensor's offset varies between records if their rest levels differ significantly and by more than this.
    moving_zero_noise: f64 = 4.0, "noise rms", "slow noise reached 2.9 noise rms in 30 sets";
    /// The sensor's offset also varies if the F-test of the scatter of the rest levels against the noise of a rest
    /// gives this p-value.
    moving_zero_p: f64 = 0.01, "p-value", "convention; in 34 sets without an offset, p was spread evenly from 0.07 to 1";
    /// Slow noise exists if the variance that is not visible within the rests exceeds 0 by more than this.
    slower_by_chance: f64 = 2.0, "standard errors of the variance", "convention";
    /// This share of either limit suffices if the rest levels follow the order of the records (`creeping-zero`).
    creeping_share: f64 = 0.5, "", "judgement: the smallest drift of an offset in 30 sets was 2.6 standard errors";
    /// The rest levels follow the order of the records if a test gives this p-value.
    creeping_zero: f64 = 0.005, "p-value", "30 sets with a linear drift had p below 0.0013, eight of them with drifts below four standard errors; 45 sets without a drift had p above 0.0066";
    /// If no record rests, an estimated offset closer to 0 than this is 0.
    near_zero: f64 = 0.1, "size of the response", "judgement: a first-order response determines the level of a \
         bilinear flow to a tenth";

    /// The records' offsets and the reference response are fitted alternately until a round no longer lowers the memory
    /// of the residual (samples per independent sample) to this share.
    memory_falls: f64 = 0.9, "share of the preceding value", "judgement: each round removes three quarters of \
         the remaining bias";
    /// Number of residual samples per independent sample. Above it a constant of a record may be a missing effect
    /// instead of an offset.
    memoryless: f64 = 3.0, "samples", "judgement: noise of loggers has a shorter memory; a misfit of the \
         response lasts as long as the response";
}
