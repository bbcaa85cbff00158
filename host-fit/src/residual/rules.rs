//! The rules of the residual analysis.

use crate::rules;

rules! {
    /// Where a model fails: what counts as more than noise, along which coordinates the error is split, and what is
    /// worth a sentence.
    pub struct Rules in "residual";

    /// The error is above the noise when its excess stands this many standard errors above 0 …
    excess_standard_errors: f64 = 3.0, "standard errors", "convention; held by the tests `a_perfect_model_has_nothing_to_explain` and `pure_noise_explains_nothing`";
    /// … and is at least this share of the noise energy: `y_sd` is not known better.
    least_excess: f64 = 0.05, "share of the noise energy", "a standard deviation from 20 repeats is known to 16 %, from 800 samples to 2.5 %: 5 % of its square";
    /// A single large event has no steady mean: above the noise as well when the excess is this many of the standard
    /// deviations that the energy of as many independent samples as blocks would have.
    event_deviations: f64 = 4.0, "standard deviations", "convention; held by the same tests";

    /// Length of the blocks that folds and standard errors are made of: longer than the flow remembers.
    block_s: f64 = 0.25, "s", "judgement: the window of ỹ in eq. (1) of the paper";
    /// Fewest blocks of a record, however short it is.
    fewest_blocks: usize = 10, "", "convention";
    /// Folds when blocks take turns.
    turns: usize = 5, "", "convention of cross-validation";
    /// A coordinate's share must stand this many standard errors above 0, or it counts as none: some ten coordinates
    /// are tried in three ways each.
    share_standard_errors: f64 = 2.5, "standard errors", "chosen for ten coordinates in three ways; held by `pure_noise_explains_nothing`";
    /// The same where whole records take turns: a single event per record has no steady mean …
    record_standard_errors: f64 = 1.0, "standard errors", "judgement";
    /// … but it comes at the same place in at least this share of the records.
    agreeing_records: f64 = 2.0 / 3.0, "share of the records", "judgement";
    /// Fewest samples of a bin to learn from.
    fewest_of_bin: usize = 20, "samples", "convention";

    /// Bins of a coordinate with many values.
    bins: usize = 30, "", "judgement: 300 samples a bin in a record of 10 s";
    /// Windows of past blowing: a flow time, a plenum's, a wall's.
    windows_s: [f64; 3] = [0.25, 1.0, 4.0], "s", "judgement: the order of the time constants of a flow, a plenum and a wall";
    /// A window at least this long changes slower than y, so that a gain may follow it.
    slow_window_s: f64 = 1.0, "s", "judgement: four windows of ỹ";
    /// Longest cycle of pulses that is tried.
    longest_cycle: usize = 8, "pulses", "judgement; the missing-pulse plants drop one in 3 to 5";
    /// An input that changes at more samples than this share has no edges.
    most_changes: f64 = 0.2, "share of the samples", "judgement: on/off commands change at far fewer samples, continuous ones at nearly all";

    /// The share of the excess that the smallest interval is sought for.
    concentration: f64 = 0.75, "share of the model error above the noise", "judgement: three quarters reads well";
    /// A bin must hold this share of the samples to be called the worst.
    worst_holds: f64 = 0.004, "share of the samples", "judgement: 40 samples in a record of 10 s";
    /// Neighbours of the worst bin belong to it when their excess per sample is at least this share of its own.
    worst_neighbour: f64 = 0.5, "share of the worst", "convention: width at half height";
    /// A longer cycle of pulses must explain this much more than a shorter one: a multiple explains as much.
    longer_cycle: f64 = 1.05, "times", "the missing-pulse plants of `faults_are_pointed_at`";
    /// Pulses count time as well: their number must explain this much more than time.
    pulses_are_a_clock: f64 = 1.3, "times", "the plants of `table_of_plants`";

    /// Length of the pieces that spectra are taken of.
    piece_s: f64 = 1.024, "s", "a power of two at 1 kHz";
    /// Fewest pieces.
    fewest_pieces: usize = 6, "", "three to learn from and three to test on";
    /// A band's surplus must stand this many standard errors above 0.
    band_standard_errors: f64 = 3.0, "standard errors", "convention; held by `pure_noise_explains_nothing`";

    /// Level of the test of a trend from edge to edge; a handful are made.
    trend_level: f64 = 0.002, "p-value", "1 % over a handful of tests";
    /// Weaker correlations are not worth a sentence.
    trend_weakest: f64 = 0.5, "correlation", "judgement: a quarter of the variance";
    /// Fewest edges of a trend.
    trend_edges: usize = 8, "edges", "convention";

    /// Without `y_sd`: command history that must agree before two samples count as repeats.
    history_s: f64 = 1.0, "s", "judgement: four windows of ỹ";
    /// Periods back that are compared: a fault of every n-th pulse agrees with itself only n periods earlier.
    periods_back: usize = 8, "periods", "the longest cycle of pulses";
    /// Fewest pairs of repeats that give an estimate.
    fewest_histories: f64 = 2.0, "histories", "judgement; held by `repeats_give_the_noise_even_when_every_third_pulse_is_missing`";
    /// A command has a period when it has so many of them …
    fewest_periods: usize = 4, "periods", "judgement";
    /// … and at least this share of them are alike, within a sample.
    alike_periods: f64 = 0.75, "share of the periods", "judgement";

    /// Coordinates that explain less are left out of the sentences.
    worth_saying: f64 = 0.1, "share of the model error above the noise", "judgement";
    /// Most coordinates that are read out.
    most_said: usize = 3, "", "judgement";
    /// A mean error is told when it is at least this share of the error.
    worth_saying_bias: f64 = 0.3, "share of the rms error", "judgement: 9 % of the energy";
    /// A mean error in the worst place is told when it is at least this share of the error there.
    worth_saying_worst_bias: f64 = 0.5, "share of the rms error", "judgement: a quarter of the energy there";
    /// An interval is told when it holds this many times its share of the samples.
    worth_saying_interval: f64 = 1.3, "times", "judgement";
}
