//! The rules of the measured delays.

use crate::rules;

rules! {
    /// When a response counts as measured, and what the measured delays say about the law.
    pub struct Rules in "delay";

    /// A response must lower the residual by this many noise variances: five standard deviations.
    detection: f64 = 25.0, "noise variances", "convention: five standard deviations";
    /// A delay with a larger standard error counts as not measured.
    worst_error: f64 = 5.0, "samples", "judgement: a tenth of the paper's delays";
    /// Where the time constants are known, one with a standard error beyond this share of them counts as not measured.
    worst_share: f64 = 0.25, "share of the sum of time constants", "judgement: a quarter of a response";
    /// A change of a graded command by less than this is no edge.
    smallest_edge: f64 = 0.05, "share of the range of u", "judgement: a twentieth of the largest response";
    /// One plant describes the records when it leaves no more than this of the spread of y beyond the noise.
    plant_fits: f64 = 0.06, "share of the spread of y", "calibrated on data/ (5 to 10 % are left where delays vary from edge to edge) and on the strangers' sets (at most 5 %)";
    /// Noise counts as explained up to this many times what the second differences of y show.
    noise_allowed: f64 = 1.5, "times the standard deviation", "judgement: noise need not be white";
    /// An edge needs this many samples on either side for a search of its own; with fewer, the time constants are those
    /// of all edges.
    fewest_reach: usize = 12, "samples", "judgement: twice the fewest samples beside an arrival";
    /// Samples on either side of an arrival: this many response times, or half the time between edges if that is less.
    reach: f64 = 3.0, "response times", "judgement: 95 % of a response of first order";

    /// Fewest samples on either side of an arrival.
    least_side: usize = 6, "samples", "judgement";
    /// Arrivals are tried this far apart.
    resolution: f64 = 0.25, "samples", "judgement: a quarter of what a model rounds to";
    /// Time constants of the course before a response, of which 0 is a straight line.
    before_shapes: [f64; 9] = [0.0, 8.0, 12.0, 17.0, 25.0, 36.0, 55.0, 90.0, 180.0], "samples", "a grid in steps of about 1.5";
    /// Time constants of a response, of which 0 is a straight line.
    response_shapes: [f64; 17] = [0.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 3.0, 6.0, 11.0, 22.0, 45.0, 90.0, 180.0, 360.0], "samples", "a grid in steps of about 1.4, every other one first";
    /// The first search for the start of a response makes do with the first so many of both.
    coarse_shapes: usize = 9, "", "every other response";
    /// The autocorrelation of neighbouring residuals counts up to this value: more is a course that the fit has missed.
    most_correlation: f64 = 0.82, "", "widens a variance by 10 at most; held by the tests of `onset.rs`";

    /// Of the peaks at least this high against the highest, the soonest is the front.
    front_height: f64 = 0.8, "share of the highest", "judgement; held by the tests of `front.rs`";
    /// By this factor the first edges must prefer a later peak.
    front_clearly: f64 = 2.0, "times", "judgement; held by the tests of `front.rs`";
    /// A change of level counts for a front up to this many times the usual one.
    front_largest: f64 = 2.0, "times the median", "judgement: one large response must not outvote all others";

    /// Fewest measured edges of a law.
    law_edges: usize = 5, "edges", "two more than the law has parameters";
    /// First value of p2·(range of ỹ) that is tried, on a logarithmic grid …
    slowest_rate: f64 = 0.05, "", "a law that is straight over the range";
    /// … the last …
    fastest_rate: f64 = 300.0, "", "a law that is a step at the lowest ỹ";
    /// … and how many.
    rates: usize = 60, "", "steps of 16 %";
    /// Edges further from the robust fit than this weigh less, in proportion …
    robust: f64 = 1.345, "robust standard deviations", "convention: 95 % efficiency on normal errors (Huber 1964)";
    /// … and delays are known no better than this.
    known_to: f64 = 0.2, "samples", "judgement: closer agreement is chance";
    /// Edges further from the robust fit than this are set aside.
    outlier: f64 = 5.0, "robust standard deviations", "convention; held by the tests of `law.rs`";

    /// Probability that an interval of a dead time, or of the law's parameters, holds the true one.
    confidence: f64 = 0.95, "", "convention; held by the tests of `law.rs`";
    /// A response has its level at the latest after this.
    response: usize = 5, "times the reach", "judgement: 99 % of a response of first order";

    /// Fewest measured edges of the tests.
    tested_edges: usize = 8, "edges", "judgement";
    /// Fewest of them in each direction.
    tested_each: usize = 3, "edges", "judgement";
    /// Shuffles of the permutation tests.
    shuffles: usize = 1999, "", "convention: p is known to 0.002 at 0.01";
    /// A test below this probability counts.
    significant: f64 = 0.01, "p-value", "convention; the false-alarm rate is held by the tests of `dependence.rs`";
    /// A change of the delay by less than this is none for a model.
    relevant: f64 = 1.0, "samples", "a model rounds delays to whole samples";
    /// A difference between the directions below this share of the mean delay says nothing: the measured start of a
    /// response depends a little on its shape, and rising and falling responses differ in shape.
    shape_bias: f64 = 0.1, "share of the mean delay", "judgement";
    /// A constant per direction replaces the law when its criterion (BIC) is better by this.
    clearly_better: f64 = 10.0, "BIC", "convention: very strong evidence (Kass & Raftery 1995)";

    /// The autocorrelation of neighbouring residuals of a fit to whole records counts up to this value.
    slowest_disturbance: f64 = 0.98, "", "widens a variance by 99 at most: a disturbance over 50 samples";
    /// No standard error of a delay is smaller: loggers and simulations differ by up to a sample in what "the same
    /// sample" of u and y means.
    clock: f64 = 0.5, "samples", "judgement: an interval of ± 1 sample at least; held by the test of `dead_time.rs` on strangers";
    /// How much the choice of the reach matters is measured on so many edges of each record.
    settings_edges: usize = 12, "edges", "judgement: long records would take three times as long";
    /// Ratios of the time constants that are averaged over on either side of the best.
    ratios: usize = 10, "", "steps of at most 30 %";
}
