//! The rules of the measured delays.

use crate::rules;

rules! {
    /// When a response counts as measured, and which tests decide on the delay law.
    pub struct Rules in "delay";

    /// A response must lower the residual by this many noise variances: five standard deviations.
    detection: f64 = 25.0, "noise variances", "convention: five standard deviations";
    /// A delay with a larger standard error counts as not measured.
    worst_error: f64 = 5.0, "samples", "judgement: a tenth of the paper's delays";
    /// With known time constants, a delay with a standard error above this share of them counts as not
    /// measured.
    worst_share: f64 = 0.25, "share of the sum of time constants", "judgement: a quarter of a response";
    /// A change of a graded command by less than this is not an edge.
    smallest_edge: f64 = 0.05, "share of the range of u", "judgement: a twentieth of the largest response";
    /// One plant describes the records if its residual is at most this share of the spread of y, beyond the
    /// noise.
    plant_fits: f64 = 0.06, "share of the spread of y", "calibrated on data/ (residual 5 to 10 % where delays vary from edge to edge) and on tests/data/strangers (at most 5 %)";
    /// The noise of a plant's residual may be this factor above the noise estimated from second differences
    /// of y.
    noise_allowed: f64 = 1.5, "times the standard deviation", "judgement: the noise may be coloured";
    /// With a slow disturbance, one plant describes the records if the dead times of single edges scatter by no more
    /// than this factor times their standard errors.
    scatter_allowed: f64 = 2.0, "times the standard error", "the factor is 0.5 and 0.7 on two records of a drifting temperature; it is 3.2 and 3.5 on data/hidden-ramp and data/paper-like, whose delay depends on y";
    /// An edge needs this many samples on either side to be located separately; with fewer, the time constants
    /// of all edges are used.
    fewest_reach: usize = 12, "samples", "judgement: twice the fewest samples on either side of an arrival";
    /// Half width of the window around an arrival: this many response times, or half the time between edges if that
    /// is less.
    reach: f64 = 3.0, "response times", "judgement: 95 % of a response of first order";

    /// Smallest number of samples on either side of an arrival.
    least_side: usize = 6, "samples", "judgement";
    /// Grid spacing of arrivals.
    resolution: f64 = 0.25, "samples", "judgement: a quarter of the rounding to whole samples";
    /// Time constants of the motion before a response; 0 is a straight line.
    before_shapes: [f64; 9] = [0.0, 8.0, 12.0, 17.0, 25.0, 36.0, 55.0, 90.0, 180.0], "samples", "a geometric grid with a factor of about 1.5";
    /// Time constants of a response; 0 is a straight line.
    response_shapes: [f64; 17] = [0.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 3.0, 6.0, 11.0, 22.0, 45.0, 90.0, 180.0, 360.0], "samples", "a geometric grid with a factor of about 1.4, every other value first";
    /// The first search for the start of a response uses only this many of the shapes before and after it.
    coarse_shapes: usize = 9, "", "every other response";
    /// Largest autocorrelation of neighbouring residuals by which a variance is corrected; if it is higher, the
    /// motion before the response is not modelled, and whole records are prewhitened.
    most_correlation: f64 = 0.82, "", "corresponds to a variance 10 times as large; tested in `onset.rs`";

    /// The earliest peak of the likelihood of at least this height, relative to the highest, is the start of the
    /// response.
    front_height: f64 = 0.8, "share of the highest", "judgement; tested in `front.rs`";
    /// A later peak is preferred if the first edges make it more likely by this factor.
    front_clearly: f64 = 2.0, "times", "judgement; tested in `front.rs`";
    /// The weight of a level change is at most this many times the median weight.
    front_largest: f64 = 2.0, "times the median", "judgement: limits the weight of one large response";

    /// Smallest number of measured edges for a law.
    law_edges: usize = 5, "edges", "the law has three parameters";
    /// First value of p2·(range of ỹ) on its logarithmic grid.
    slowest_rate: f64 = 0.05, "", "the law is almost linear over the range";
    /// Last value of p2·(range of ỹ) on its grid.
    fastest_rate: f64 = 300.0, "", "the law is almost a step at the lowest ỹ";
    /// Number of grid values of p2.
    rates: usize = 60, "", "steps of 16 %";
    /// Edges further from the robust fit than this get a proportionally lower weight.
    robust: f64 = 1.345, "robust standard deviations", "convention: 95 % efficiency on normal errors (Huber 1964)";
    /// Least scale of the robust fit, because delays are not measured more accurately than this.
    known_to: f64 = 0.2, "samples", "judgement: smaller scatter is coincidence";
    /// Edges further from the robust fit than this are excluded as outliers.
    outlier: f64 = 5.0, "robust standard deviations", "convention; tested in `law.rs`";

    /// Coverage of the intervals of a dead time and of the law's parameters.
    confidence: f64 = 0.95, "", "convention; tested in `law.rs`";
    /// A response counts as settled after this time.
    response: usize = 5, "times the reach", "judgement: 99 % of a response of first order";

    /// Smallest number of measured edges for the tests.
    tested_edges: usize = 8, "edges", "judgement";
    /// Smallest number of measured edges in each direction for the tests.
    tested_each: usize = 3, "edges", "judgement";
    /// Permutations per test.
    shuffles: usize = 1999, "", "convention: a p-value of 0.01 then has a standard error of 0.002";
    /// Significance level of the tests.
    significant: f64 = 0.01, "p-value", "convention; the false-alarm rate is tested in `dependence.rs`";
    /// A change of the delay by less than this is irrelevant for a model.
    relevant: f64 = 1.0, "samples", "a model rounds delays to whole samples";
    /// A difference between directions below this share of the mean delay is not significant: the measured
    /// start depends slightly on the shape of a response, which differs between rising and falling edges.
    shape_bias: f64 = 0.1, "share of the mean delay", "judgement";
    /// A constant delay per direction replaces the law if its criterion is better by this.
    clearly_better: f64 = 10.0, "BIC", "convention: very strong evidence (Kass & Raftery 1995)";

    /// Largest autocorrelation of neighbouring residuals by which a variance is corrected in a fit to whole
    /// records.
    slowest_disturbance: f64 = 0.98, "", "corresponds to a variance 99 times as large: a disturbance that lasts 50 samples";
    /// Least standard error of a delay: loggers and simulations differ by up to a sample in the alignment of u and y.
    clock: f64 = 0.5, "samples", "judgement: an interval of at least ± 1 sample; tested in `dead_time.rs` on tests/data/strangers";
    /// Edges per record on which the sensitivity to `reach` is measured.
    settings_edges: usize = 12, "edges", "judgement: more edges would triple the time on long records";
    /// The dead time is averaged over ratios of the time constants up to this many grid steps on either side of the
    /// best ratio.
    ratios: usize = 10, "", "steps of at most 30 %";
}
