//! The rules of discovery.

use crate::rules;

rules! {
    /// When a term outside the catalogue is reported, and how its curve is drawn.
    pub struct Rules in "discover";

    /// Rounds of inserting points.
    refinements: usize = 2, "rounds", "judgement";
    /// A curve is refitted if its predicted gain is at least this share of the practical margin.
    promised: f64 = 0.5, "share", "judgement: the first-order gain is smaller than the gain after a refit";
    /// Candidates for which the flow's lags are searched again, in addition to the best of each place and each
    /// base.
    settled: usize = 2, "", "judgement: each of these searches takes as long as `identify`";
    /// Rounds in which the coordinate of the best candidate of a place is chosen again with its lags.
    rounds: usize = 2, "", "judgement: the second round never found anything new";
    /// The coordinate of a place's best candidate is chosen again (`rounds`) if its error is within this factor of
    /// the best.
    in_reach: f64 = 1.5, "times the best error", "judgement: after a search of the lags, the model with a hot jet \
         improved from 1.5 to 1.05 × the noise level";
    /// The best candidate of a place is also compared as a formula if its error is within this factor of the best.
    contends: f64 = 1.5, "times the best error", "the curve of a true quadratic term had an error of 1.066 × the noise level, a curve at a wrong place 1.025 ×";
    /// A model within this factor of the noise level gets no further term.
    at_the_floor: f64 = 1.02, "times the noise level", "the curve of a true jet term had an error of 1.05 × the noise level, that of a wrong sensor term 1.09 ×";
    /// If the noise level is known, a term must explain this share of the unexplained variance.
    least_share: f64 = 0.25, "share of the model error above the noise", "as for the surrogates of `diagnose`; on a drifting rig a wrong delay term explained 19 %";
    /// A base model with a validation error below this is near the noise level. A term must then explain the
    /// share `most_of_it`. A sensitivity, or a dependence on the time in the record, is then not reported,
    /// because record-to-record scatter and drift look like them.
    near_the_floor: f64 = 1.10, "times the noise level", "in nine families, base models of rigs without a missing term stay below this";
    /// Share of the unexplained variance that a term must explain near the noise level, and wherever the
    /// sensor has a record-to-record offset.
    most_of_it: f64 = 0.75, "share of the model error above the noise", "curves that imitate an offset drift explained 50 to 70 %, true terms at least 80 % in 16 of 17 cases";
    /// Family-wise level over all curves screened.
    level_of_search: f64 = 0.02, "p-value", "as for effects of the catalogue: at most 3 % false terms";
    /// Level of the comparison of two curves.
    level: f64 = 0.05, "p-value", "convention";
    /// A term is stable if it wins in this share of the bootstrap resamples.
    stable: f64 = 0.9, "share of the resamples", "judgement";
    /// Validation errors that differ by less than this are equal in practice.
    alike: f64 = 0.01, "share of the rms error", "judgement: twice the margin of effects, because a curve has more freedom";
    /// The error of a formula may exceed that of the curve it replaces by this much.
    formula: f64 = 0.01, "share of the rms error", "judgement";
    /// An effect of the catalogue resembles a curve if the correlation of their changes of the free run is at least
    /// this.
    resembles: f64 = 0.9, "", "judgement";
    /// Largest number of knots of a trace per record.
    knots: usize = 100, "", "judgement: limits the time";
    /// Weight of the size against the curvature in the prior of a trace.
    smallness: f64 = 0.01, "", "judgement: the size of the trace then has the same weight as its curvature over ten knots";
    /// A place is reported if its posterior probability is at least this.
    likely: f64 = 0.9, "probability", "convention";
    /// A filter time constant is fitted with a formula within this factor.
    time_of_a_formula: f64 = 10.0, "", "judgement";
}
