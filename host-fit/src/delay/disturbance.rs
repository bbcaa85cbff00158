//! A slow disturbance of y, such as the temperature of a room, hides or biases the responses. Records are prewhitened
//! for it (Cochrane and Orcutt 1949).

use super::local::by_trajectory;
use super::pooled::Pooled;
use super::rules::RULES;
use super::spread::spread;
use crate::data::Record;

/// One plant fitted to `records`, prewhitened if the residual is correlated and the prewhitened records are described by
/// one dead time. `None` where the command never changes.
pub(crate) fn pooled(records: &[&Record], max_delay: Option<usize>) -> Option<Pooled> {
    let found = Pooled::of(records, max_delay, 0.0)?;
    let is_disturbed = found.correlation > RULES.most_correlation;
    if is_disturbed || (!found.describes && found.correlation > 0.0) {
        let whitened = Pooled::of(records, max_delay, found.correlation)
            .filter(|whitened| whitened.describes && has_one_dead_time(whitened, records));
        if whitened.is_some() {
            return whitened;
        }
    }
    Some(found)
}

/// Whether the dead times of single edges scatter by no more than their errors explain, and most are measured.
fn has_one_dead_time(pooled: &Pooled, records: &[&Record]) -> bool {
    let series = records.iter().map(|record| pooled.series(record));
    let edges: Vec<_> = series.flat_map(|s| by_trajectory(&s, pooled)).collect();
    let known: Vec<_> = edges.iter().flatten().collect();
    let delays: Vec<f64> = known.iter().map(|edge| edge.delay).collect();
    let square: f64 = known.iter().map(|edge| edge.standard_error.powi(2)).sum();
    let expected = (square / known.len().max(1) as f64).sqrt();
    2 * known.len() > edges.len() && spread(&delays).sd <= RULES.scatter_allowed * expected
}
