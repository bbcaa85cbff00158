//! The rules of recordings.

crate::rules! {
    /// Requirements on times, commands and raw recordings.
    pub struct Rules in "recordings";

    /// A time step may differ from the period by this, in addition to the rounding of the printed times.
    uneven: f64 = 0.1, "share of the period", "judgement";
    /// Largest difference of a time step from the period, rounding included.
    most_uneven: f64 = 0.6, "share of the period", "a missing sample makes a difference of one period";
    /// The mean step may differ from a stated period by this.
    clock: f64 = 1e-3, "share of the period", "judgement: the clocks of a rig differ by less";
    /// `import --fill-gaps` inserts lost rows up to this share of the rows in the file.
    lost: f64 = 0.1, "share of the rows", "judgement: more apparent gaps are caused by the rounding of a coarse clock";
    /// Times printed in this or a coarser unit count as rounded if rounding explains every step.
    coarse_s: f64 = 1.0, "s", "judgement: loggers with stamps of whole seconds";
    /// Times printed in a finer unit count as rounded only if at least this many steps differ from the most
    /// common one.
    jumps: usize = 3, "steps", "judgement: one or two different steps are missing or repeated rows";
    /// The periods of the records of one data set may differ, if their sample times differ by less than
    /// this at the end of the longest record.
    drift: f64 = 1.0, "samples", "convention: no sample is shifted onto another";
    /// A column `t` with a larger value is not in seconds.
    latest_s: f64 = 1e11, "s", "3000 years; a Unix time in ms is beyond it, one in s is not";
    /// A command of 0 and 1 is on/off: other values in at most this share of its samples (or in a single one)
    /// are errors, not levels.
    stray: f64 = 0.05, "share of the samples", "judgement";

    /// Rows from which the period of a raw recording is estimated.
    head: usize = 20_000, "rows", "judgement: 20 s at 1 kHz";
    /// A row of a raw recording is on the sampling grid if its step is a multiple of the period within this.
    off_grid: f64 = 0.25, "share of the period", "judgement";
    /// A command repeats with a period if this share of its edges has an equal edge at that distance.
    repeats: f64 = 0.9, "share of the edges", "judgement: allows some faulty repeats";
    /// A wrong stated period is reported if it would drop this share of the periods for their command.
    other_commands: f64 = 0.25, "share of the periods", "judgement: a stated period of half the true length drops \
         half of the periods";
    /// Command sequences averaged in parallel until the most frequent one is known.
    sequences: usize = 4, "", "judgement";
}
