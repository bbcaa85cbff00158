//! The rules of recordings.

crate::rules! {
    /// What times, commands and raw recordings must keep to.
    pub struct Rules in "recordings";

    /// A step of the time column may differ from the period by this, beside the rounding of the printed times …
    uneven: f64 = 0.1, "share of the period", "judgement";
    /// … and whatever the rounding by no more than this.
    most_uneven: f64 = 0.6, "share of the period", "a missing sample is 1 off";
    /// The mean step may differ from a stated period by this.
    clock: f64 = 1e-3, "share of the period", "judgement: the clocks of a rig differ by less";
    /// A command of 0 and 1 is on/off: when no more than this share of its samples (or a single one) is something else,
    /// those are mistakes and not levels.
    stray: f64 = 0.05, "share of the samples", "judgement";

    /// The period of a raw recording is taken from so many first rows.
    head: usize = 20_000, "rows", "judgement: 20 s at 1 kHz";
    /// A row of it is on the grid of samples if its step is a whole number of periods within this.
    off_grid: f64 = 0.25, "share of the period", "judgement";
    /// Command sequences kept side by side until it is known which one is the rule.
    sequences: usize = 4, "", "judgement";
}
