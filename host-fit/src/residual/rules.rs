//! The rules of the residual analysis.

use crate::rules;

rules! {
    /// Where a model fails: significance of the error, coordinates along which it is split, and which results
    /// are reported.
    pub struct Rules in "residual";

    /// The error is above the noise if the test of the unexplained variance over blocks gives this p-value.
    above_level: f64 = 0.001, "p-value", "convention; tested by `a_perfect_model_has_nothing_to_explain` and `pure_noise_explains_nothing`";
    /// The error is above the noise only if the unexplained variance is at least this share of the noise
    /// variance, the uncertainty of `y_sd`.
    least_excess: f64 = 0.05, "share of the noise energy", "a standard deviation from 20 repeats has an error of 16 %, and one from 800 samples 2.5 %, which is 5 % of the variance";
    /// Block length in correlation times; blocks count as independent.
    correlation_times: f64 = 8.0, "correlation times", "tested in `the_p_value_is_calibrated_for_coloured_errors`";
    /// Shortest block.
    shortest_block: usize = 20, "samples", "judgement";
    /// Smallest number of blocks; limits the block length.
    fewest_blocks: usize = 24, "blocks", "judgement: a test with fewer blocks has no power";
    /// Values used to estimate a correlation time.
    plenty: usize = 4000, "values", "judgement: limits the time";
    /// Number of cross-validation folds over blocks.
    turns: usize = 5, "", "convention of cross-validation";
    /// Family-wise level of the shares of all coordinates: each is tested in two to four ways.
    share_level: f64 = 0.05, "family-wise p-value", "convention; tested in `pure_noise_explains_nothing`";
    /// Level of a share with folds over whole records; higher, because a single event per record has no reproducible mean.
    record_level: f64 = 0.16, "p-value", "judgement: one standard error";
    /// For folds over whole records, the error must also occur at the same place in this share of the
    /// records.
    agreeing_records: f64 = 2.0 / 3.0, "share of the records", "judgement";
    /// Smallest number of training samples of a bin.
    fewest_of_bin: usize = 20, "samples", "convention";

    /// Bins of a coordinate with many values.
    bins: usize = 30, "", "judgement: 300 samples a bin in a record of 10 s";
    /// Windows of past blowing: time scales of the flow, of a plenum, of a wall.
    windows: [usize; 3] = [250, 1000, 4000], "samples", "judgement: at 1 kHz the order of the time constants of a flow, a plenum and a wall";
    /// A window at least this long changes more slowly than y, so the gain may depend on it.
    slow_window: usize = 1000, "samples", "judgement: four windows of ỹ";
    /// Longest cycle of pulses that is tried.
    longest_cycle: usize = 8, "pulses", "judgement; the test plants with missing pulses drop one pulse in 3 to 5";
    /// An input that changes at more samples than this share is not piecewise constant.
    most_changes: f64 = 0.2, "share of the samples", "judgement: on/off commands change at far fewer samples, continuous ones at nearly all";

    /// Share of the unexplained variance that the reported smallest interval contains.
    concentration: f64 = 0.75, "share of the model error above the noise", "judgement";
    /// A bin must contain this share of the samples to be reported as the worst.
    worst_holds: f64 = 0.004, "share of the samples", "judgement: 40 samples in a record of 10 s";
    /// Neighbours of the worst bin are merged with it if their unexplained variance per sample is at least
    /// this share of its own.
    worst_neighbour: f64 = 0.5, "share of the worst", "convention: width at half height";
    /// A longer cycle of pulses must explain this much more than a shorter one, because multiples explain as
    /// much.
    longer_cycle: f64 = 1.05, "times", "tuned on the plants with missing pulses in the test `faults_are_pointed_at`";
    /// Pulse number is correlated with time: it must explain this much more than time to be preferred.
    pulses_are_a_clock: f64 = 1.3, "times", "simulated plants with each effect and fault of the catalogue";

    /// Segment length of spectra.
    piece: usize = 1024, "samples", "judgement: the longest lags are half as long";
    /// Smallest number of segments of a spectrum.
    fewest_pieces: usize = 6, "", "three for training and three for testing";
    /// Level at which a band's spectrum must exceed that of the noise.
    band_level: f64 = 0.001, "p-value", "convention; tested in `pure_noise_explains_nothing`";

    /// A steady oscillation: this many spectral lines on either side of a peak contain more than half of the energy of the
    /// second number of lines on either side.
    oscillation: [usize; 2] = [2, 24], "spectral lines", "a frequency between two lines is in both; the band of a resonance of damping \
         0.01 at 50 Hz is 10 lines wide in a record of 10 s; tested at half and double";

    /// Level of the test for a trend from edge to edge.
    trend_level: f64 = 0.002, "p-value", "1 % over about five tests";
    /// Weaker correlations are not reported.
    trend_weakest: f64 = 0.5, "correlation", "judgement: a quarter of the variance";
    /// Smallest number of edges of a trend.
    trend_edges: usize = 8, "edges", "convention";

    /// Without `y_sd`: length of command history that must agree for two samples to count as repeats.
    history: usize = 1000, "samples", "judgement: four windows of ỹ";
    /// Periods back that are compared, because a fault of every n-th pulse repeats only after n periods.
    periods_back: usize = 8, "periods", "the longest cycle of pulses";
    /// Smallest number of pairs of repeats for an estimate of the noise.
    fewest_histories: f64 = 2.0, "histories", "judgement; tested in `repeats_give_the_noise_even_when_every_third_pulse_is_missing`";
    /// A command is periodic if it has at least this many periods.
    fewest_periods: usize = 4, "periods", "judgement";
    /// A command is periodic if at least this share of its periods are equal, within a sample.
    alike_periods: f64 = 0.75, "share of the periods", "judgement";

    /// Coordinates with a smaller explained share are not mentioned.
    worth_saying: f64 = 0.1, "share of the model error above the noise", "judgement";
    /// Largest number of coordinates that are mentioned.
    most_said: usize = 3, "", "judgement";
    /// A mean error is reported if it is at least this share of the rms error.
    worth_saying_bias: f64 = 0.3, "share of the rms error", "judgement: 9 % of the error energy";
    /// A mean error in the worst interval is reported if it is at least this share of the rms error in the interval.
    worth_saying_worst_bias: f64 = 0.5, "share of the rms error", "judgement: a quarter of the error energy in \
         the interval";
    /// An interval is reported if it contains this many times its share of the samples.
    worth_saying_interval: f64 = 1.3, "times", "judgement";
}
