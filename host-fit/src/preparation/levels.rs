//! Whether a command has only two levels.

use crate::data::Record;

/// The two levels of a command that has no others, the lower first.
pub(super) fn two_levels(records: &[Record]) -> Option<[f64; 2]> {
    let all = || records.iter().flat_map(|r| r.u.iter().copied());
    let low = all().fold(f64::INFINITY, f64::min);
    let high = all().fold(f64::NEG_INFINITY, f64::max);
    (low < high && all().all(|u| u == low || u == high)).then_some([low, high])
}
