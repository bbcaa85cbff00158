//! The rules of curves.

use crate::rules;

rules! {
    /// How a curve is drawn, and which curves are fitted.
    pub struct Rules in "curves";

    /// Largest number of points of a curve. The coordinate spends equal times between neighbouring points.
    points: usize = 8, "", "judgement: limits the number of derivatives per run";
    /// A coordinate with fewer distinct points than this is not screened.
    fewest_points: usize = 3, "", "judgement: a curve needs more than the two points of a line";
    /// Points inserted in one round where a curve is steepest, if they lower the error enough.
    inserted: usize = 3, "", "judgement: three points locate a step four times more closely";
    /// Largest number of points of a curve after insertion.
    most_points: usize = 11, "", "judgement: a run then has 1.5 times as many derivatives";
    /// Share of the samples outside the first and the last point.
    beyond: f64 = 0.01, "share of the samples", "judgement";
    /// Least distance of a point to the next, relative to its distance from the first point.
    apart: f64 = 0.05, "share of the distance from the first point", "judgement: rests and times since edges span three decades";
    /// Largest number of curves fitted for a few iterations that have the same place and kind of coordinate.
    of_a_kind: usize = 2, "", "judgement: memories of neighbouring lengths have similar gains";
    /// Curves refitted in full, in addition to the best of each place and each base.
    finished: usize = 4, "", "judgement";
    /// A term must lower the validation error of the best base without it by this fraction.
    worthwhile: f64 = 0.015, "share of the rms error", "as for effects of the catalogue";
    /// Longest extension of a delay.
    longest_delay_s: f64 = 0.1, "s at 1 kHz", "judgement: three times the delays of the simulated rigs";
    /// A filter time constant is fitted with a curve within this factor of its grid value.
    time_of_a_curve: f64 = 1.7, "", "half a grid step; with a larger range the filter time of a memory of y can shrink to 0";
    /// Largest change that is searched, relative or in units of y.
    largest: f64 = 5.0, "", "judgement";
    /// Curves at one place whose errors differ by less than this are the same curve.
    twins: f64 = 0.001, "share of the rms error", "equal coordinates differ by rounding only";
    /// Curves that are fitted for a few iterations per round, and in place of each effect that is tested against curves.
    tried: usize = 10, "", "judgement; with 4, the curve that replaces a false hysteresis was not among them";
    /// Curves that are fitted for a few iterations, for each base of lower order than the best.
    tried_leaner: usize = 4, "", "judgement";
}
