//! The rules of recordings.

crate::rules! {
    /// What times, commands and raw recordings must keep to.
    pub struct Rules in "recordings";

    /// A step of the time column may differ from the period by this, beside the rounding of the printed times …
    uneven: f64 = 0.1, "share of the period", "judgement";
    /// … and whatever the rounding by no more than this.
    most_uneven: f64 = 0.6, "share of the period", "a missing sample is 1 off";
    /// The mean step may differ from a stated period by this.
    clock: f64 = 1e-3, "share of the period", "judgement: clock differences of a rig are smaller";
    /// Times that are printed in this or a coarser unit are taken as rounded where that explains every step …
    coarse_s: f64 = 1.0, "s", "judgement: loggers with stamps of whole seconds";
    /// … finer ones only when so many steps differ from the usual one.
    jumps: usize = 3, "steps", "judgement: one or two are missing or doubled rows";
    /// Records of one data set may have periods that differ by less than this over the longest of them.
    drift: f64 = 1.0, "samples", "convention: no sample is shifted into another";
    /// A column `t` with a value beyond this is no time in seconds.
    latest_s: f64 = 1e11, "s", "3000 years; a Unix time in ms is beyond it, one in s is not";
    /// A command of 0 and 1 is on/off: when no more than this share of its samples (or a single one) is something else,
    /// those are mistakes and not levels.
    stray: f64 = 0.05, "share of the samples", "judgement";

    /// The period of a raw recording is taken from so many first rows.
    head: usize = 20_000, "rows", "judgement: 20 s at 1 kHz";
    /// A row of it is on the grid of samples if its step is a whole number of periods within this.
    off_grid: f64 = 0.25, "share of the period", "judgement";
    /// A command repeats after a time when this share of its edges has another one at that distance …
    repeats: f64 = 0.9, "share of the edges", "judgement: leaves room for broken repeats";
    /// … and that is said when the stated period would drop this share of the periods for their command.
    other_commands: f64 = 0.25, "share of the periods", "judgement: half the length drops half of them";
    /// Command sequences kept side by side until it is known which one is the rule.
    sequences: usize = 4, "", "judgement";
}
