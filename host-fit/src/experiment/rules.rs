//! The rules of experiments.

use crate::rules;

rules! {
    /// Which commands are tried to tell models apart.
    pub struct Rules in "experiment";

    /// A command distinguishes two models whose free runs differ by this under it.
    distinguishes: f64 = 3.0, "standard deviations of the noise", "convention";
    /// Rest at the end of a run, so that runs can follow one another.
    rest: f64 = 0.15, "share of the run", "judgement";
    /// Periods of square waves that are tried …
    periods: u32 = 14, "", "judgement";
    /// … up to this …
    longest_period: f64 = 0.4, "share of the run", "two periods before the rest";
    /// … with these duties.
    duties: [f64; 5] = [0.15, 0.3, 0.5, 0.7, 0.85], "", "a grid";
    /// Single pulses that are tried …
    pulses: u32 = 10, "", "judgement";
    /// … up to this.
    longest_pulse: f64 = 0.5, "share of the run", "judgement";
    /// First pulses, second pulses and pauses of pairs …
    pairs: [u32; 3] = [4, 3, 6], "", "judgement";
    /// … up to this.
    longest_of_pair: f64 = 0.1, "share of the run", "judgement";
    /// Random sequences that are tried.
    sequences: usize = 24, "", "judgement";
    /// Variations of the best command that are tried in a round …
    variations: usize = 16, "", "judgement";
    /// … and rounds.
    rounds: usize = 8, "", "judgement";
}
