//! The rules of discovery.

use crate::rules;

rules! {
    /// When a term that no catalogue has is reported, and how its curve is drawn.
    pub struct Rules in "discover";

    /// Points of a curve, at most; they lie where the coordinate spends equal times.
    points: usize = 8, "", "judgement: as many derivatives as one run carries";
    /// A coordinate with fewer distinct points than this shows no curve.
    fewest_points: usize = 3, "", "judgement: two points are a line at best";
    /// Points that a curve gets where it is steepest, if they pay …
    inserted: usize = 3, "", "judgement: a step is found four times as closely";
    /// … so often …
    refinements: usize = 2, "rounds", "judgement";
    /// … and how many it has then, at most.
    most_points: usize = 11, "", "judgement: derivatives of one run, and half as many again";
    /// Share of the samples beyond the first and the last point.
    beyond: f64 = 0.01, "share of the samples", "judgement";
    /// Points are at least this far apart.
    apart: f64 = 0.05, "of the way from the first point", "judgement: rests and times since edges span three decades";
    /// A curve is refitted if the screening promises this share of what a term must lower the error by.
    promised: f64 = 0.5, "share", "judgement: first order promises less than a refit does";
    /// Curves that are refitted for a few steps per round …
    tried: usize = 10, "", "judgement";
    /// … so many beside each base that is leaner than the best …
    tried_leaner: usize = 4, "", "judgement";
    /// … no more of them of one place and one kind of coordinate than this …
    of_a_kind: usize = 2, "", "judgement: memories of neighbouring lengths promise alike";
    /// … and how many of them are followed to the end, beside the best one of each place and each base.
    finished: usize = 4, "", "judgement";
    /// Of those, for how many the flow's own lags are searched again, beside the best one of each place and each base.
    settled: usize = 2, "", "judgement: each takes as long as `identify`";
    /// How often the coordinate of the best one at a place is chosen anew beside its lags.
    rounds: usize = 2, "", "judgement: the second found nothing new on any rig yet";
    /// … where it is no further than this behind the best of all with it.
    in_reach: f64 = 1.5, "times the best error", "judgement: lags took a hot jet from 1.5 times the floor to 1.05";
    /// The best of a place is compared as a formula too where it is no further than this behind the best of all.
    contends: f64 = 1.5, "times the best error", "straight lines through a square of y left 1.066, the wrong place 1.025";
    /// A term that leaves no more than this leaves nothing for another one.
    at_the_floor: f64 = 1.02, "times the noise level", "a sensor that stood in for a hot jet left 1.09, the jet 1.05 as a curve";
    /// Curves at one place whose errors differ by less than this are the same curve.
    twins: f64 = 0.001, "share of the rms error", "two names of one signal differ by rounding";
    /// A term must lower the held-out error of the best base without it by this fraction.
    worthwhile: f64 = 0.015, "share of the rms error", "as for effects of the catalogue";
    /// … and, where the noise floor is known, take this share of its excess at least.
    least_share: f64 = 0.25, "share of the model error above the noise", "as for the stand-ins of `diagnose`; a rig that drifted as a whole had 19 % taken by a delay";
    /// A base that leaves less than this is near the floor: a term has to take `most_of_it` there, and neither the sensor's sensitivity nor
    /// time in the record is told, as levels that scatter and zeros that drift look like them.
    near_the_floor: f64 = 1.10, "times the noise level", "`floor_margin` of `diagnose`: nulls of nine families stay below it";
    /// Share of the best base's excess that a term has to take there, and wherever the sensor's zero moves from record to record.
    most_of_it: f64 = 0.75, "share of the model error above the noise", "curves through zeros that drift or wander took 50 to 70 %, terms that were there 80 % and more in 16 of 17";
    /// Level of the whole search, with all curves that were looked at.
    level_of_search: f64 = 0.02, "p-value", "as for effects of the catalogue: three false terms in a hundred are too many";
    /// Level of comparisons of two curves.
    level: f64 = 0.05, "p-value", "convention";
    /// A term is stable if it wins in this share of the bootstrap resamples.
    stable: f64 = 0.9, "share of the resamples", "judgement";
    /// Held-out errors that differ by less than this are the same for any purpose.
    alike: f64 = 0.01, "share of the rms error", "judgement: twice what is asked of effects; a curve has more freedom";
    /// A formula may leave this much more than the curve it stands for.
    formula: f64 = 0.01, "share of the rms error", "judgement";
    /// An effect of the catalogue resembles a curve if what both change in the free run correlates so well.
    resembles: f64 = 0.9, "", "judgement";
    /// A trace has so many knots a record, at most.
    knots: usize = 100, "", "judgement: for the time it takes";
    /// How much its prior wants a trace small, beside smooth.
    smallness: f64 = 0.01, "", "judgement: bends of ten knots count as much as size";
    /// A place is said to be the one from this probability on.
    likely: f64 = 0.9, "probability", "convention";
    /// A delay may become this much longer.
    longest_delay_s: f64 = 0.1, "s at 1 kHz", "judgement: three times the delays of the rigs at hand";
    /// A fading time is fitted with a curve up to so many times shorter or longer than it was looked for …
    time_of_a_curve: f64 = 1.7, "", "half of the step to the next; a memory of y that shrank freely stood in for y";
    /// … and with a formula from there on.
    time_of_a_formula: f64 = 10.0, "", "judgement";
    /// Largest change that is searched, relative or in units of y.
    largest: f64 = 5.0, "", "judgement";
}
