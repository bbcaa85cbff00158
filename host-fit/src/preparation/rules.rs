//! The rules of preparation.

use crate::rules;

rules! {
    /// What is decided about records before any model: how they begin, where they rest, which samples are scored.
    pub struct Rules in "preparation";

    /// The first-order reference is fitted to so many samples at most: longer records are averaged over neighbours.
    reference_samples: usize = 20_000, "samples", "judgement: for the time it takes";
    /// Its shortest time constant.
    shortest_time: f64 = 0.5, "samples", "faster responses cannot be told from none";
    /// Rounds in which its dead time and time constant are refined.
    refinements: usize = 7, "", "halving: to a hundredth of the first step";
    /// Less than this explained by it, and y is taken not to follow u.
    related: f64 = 0.2, "share of the variance", "judgement";

    /// A record rests until its first edge and this much of the dead time longer; what answers sooner answers an edge before it.
    surely_before: f64 = 0.6, "dead times", "delays that follow the state differ by less on the bundled flows";
    /// A channel that keeps each value for so many samples on average is switched; a record rests until it is.
    switched: usize = 20, "samples", "judgement: measured quantities change at almost every sample";
    /// So many time constants are enough to tell rest from motion.
    times_of_rest: f64 = 3.0, "time constants", "5 % are left of a motion";
    /// Fewer samples do not tell rest from motion.
    fewest_at_rest: usize = 5, "samples", "judgement";
    /// y moves if its motion under a constant command is more than this part of what the reference response leaves, as an
    /// unsteady flow moves by itself …
    motion_unexplained: f64 = 0.5, "times its rms", "the flow simulation moves at rest";
    /// … and more than so many times the variance that is left.
    motion_over_noise: f64 = 40.0, "times", "judgement: noise with 10 samples of memory stays below";
    /// Short rests under one command that are further apart than this are no rests.
    rests_apart: f64 = 0.03, "share of the range of y", "judgement: more than noise makes of the mean of a few samples";
    /// A record may begin with an edge of the command; its first so many dead times decide whether it does: …
    early: f64 = 2.5, "dead times", "what comes later looks alike";
    /// … it does if the response to such an edge leaves less than this share of the residual of a relaxation to rest.
    answer: f64 = 0.95, "share of the sum of squares", "judgement: both have as many parameters, one of two is told its dead time";
    /// In mid-run free runs follow the measurement for twice the dead time, and for no more than this part of a record …
    most_followed: usize = 4, "th of a record", "judgement";
    /// … and until what is slow has faded, if that is no more than this part.
    followed_share: usize = 10, "th of a record", "a slow wake whose beginning nobody saw leaves 1.11 times the noise of a true model where only the dead time is followed";

    /// Graded commands whose largest is no less than this, up to 1, are shares of a full jet of 1.
    share_of_full: f64 = 0.5, "u", "graded commands that draw levels seldom draw the full one; a supply in volts is seldom below 1";
    /// Graded commands further from 0 than this have an operating point of their own.
    operating_point: f64 = 0.25, "times their range", "judgement";

    /// The level of rest is 0 unless its mean is off by so much.
    off_zero: f64 = 5.0, "standard errors", "convention";
    /// Noise that is slower than a rest is no more than the standard errors of y; where they are not stated, no more than what
    /// the reference response leaves, and this.
    slow_noise: f64 = 0.0075, "share of the range of y", "judgement: what slow noise makes of the mean of half a second stays below four times it";
    /// The zero moves if records rest further apart than so much noise, and than chance, …
    moving_zero_noise: f64 = 4.0, "noise rms", "in 30 sets slow noise reached 2.9";
    /// … or if the F-test of their scatter against what noise makes of a rest gives this p-value; slow noise is what of the
    /// variance the rests do not show within themselves, …
    moving_zero_p: f64 = 0.01, "p-value", "convention; in 34 sets whose zero does not move p was spread evenly from 0.07 to 1";
    /// … by more than so much.
    slower_by_chance: f64 = 2.0, "standard errors of that variance", "convention";
    /// This share of either is enough where the rests follow the order of the records …
    creeping_share: f64 = 0.5, "", "judgement: zeros that drifted began at 2.6 standard errors in 30 sets";
    /// … with this p-value.
    creeping_zero: f64 = 0.005, "p-value", "all of 30 zeros that drifted in a straight line lay below 0.0013, eight of them less than four standard errors apart; all of 45 that did not lay above 0.0066";
    /// Where no record rests, an estimated zero nearer to 0 than this is 0.
    near_zero: f64 = 0.1, "size of the response", "judgement: a first-order response knows a bilinear flow's level to a tenth";

    /// Zeros of records and the response that they are read from are fitted in turn until the memory of its residual no
    /// longer falls to this share.
    memory_falls: f64 = 0.9, "share of the samples before", "judgement: each round takes three quarters of the bias that is left";
    /// Samples of that residual that are worth an independent one, above which a constant of a record may be physics that is
    /// missing.
    memoryless: f64 = 3.0, "samples", "judgement: noise of loggers; what a response lacks lasts as long as the response";
}
