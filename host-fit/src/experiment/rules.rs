//! The rules of experiments.

use crate::rules;

rules! {
    /// Commands that are tried to discriminate models.
    pub struct Rules in "experiment";

    /// A command discriminates two models if their free runs differ by at least this.
    distinguishes: f64 = 3.0, "standard deviations of the noise", "convention";
    /// Rest at the end of a run, after which the next run can follow.
    rest: f64 = 0.15, "share of the run", "judgement";
    /// Number of periods of square waves that are tried.
    periods: u32 = 14, "", "judgement";
    /// Longest period of a square wave.
    longest_period: f64 = 0.4, "share of the run", "two periods fit before the rest at the end";
    /// Duty cycles of square waves.
    duties: [f64; 5] = [0.15, 0.3, 0.5, 0.7, 0.85], "", "a grid";
    /// Number of single pulses that are tried.
    pulses: u32 = 10, "", "judgement";
    /// Longest single pulse.
    longest_pulse: f64 = 0.5, "share of the run", "judgement";
    /// Numbers of first pulses, second pulses and pauses of pairs that are tried.
    pairs: [u32; 3] = [4, 3, 6], "", "judgement";
    /// Longest pulse or pause of a pair.
    longest_of_pair: f64 = 0.1, "share of the run", "judgement";
    /// Random sequences that are tried.
    sequences: usize = 24, "", "judgement";
    /// Variations of the best command per round.
    variations: usize = 16, "", "judgement";
    /// Rounds of variations.
    rounds: usize = 8, "", "judgement";
}
