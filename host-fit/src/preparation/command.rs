//! The commands of a data set that mean no jet and a full jet.

use super::RULES;
use super::beginning::Beginning;
use super::levels::two_levels;
use super::reference::FirstOrder;
use crate::data::Record;
use crate::model::CommandRange;

/// The range of the command of `records`.
///
/// If the command has two levels, the lower one means no jet if y rises with u, or if records rest under the lower
/// level. Otherwise the upper one means no jet (a normally open valve, an inverted relay). Graded commands are
/// fractions of a full jet if they cover enough of 0 … 1; otherwise their range is used.
pub(super) fn range_of(
    records: &[Record],
    beginnings: &[Beginning],
    reference: Option<&FirstOrder>,
) -> CommandRange {
    if let Some([low, high]) = two_levels(records) {
        let resting = |level: f64| beginnings.iter().filter(|b| b.rests_at(level)).count();
        let falls = reference.is_some_and(|reference| reference.gain < 0.0);
        let inverted = falls && resting(high) >= resting(low);
        return if inverted {
            CommandRange {
                off: high,
                full: low,
            }
        } else {
            CommandRange {
                off: low,
                full: high,
            }
        };
    }
    let all = || records.iter().flat_map(|r| r.u.iter().copied());
    let low = all().fold(f64::INFINITY, f64::min);
    let high = all().fold(f64::NEG_INFINITY, f64::max);
    let range = high - low;
    if !(range > 0.0 && range.is_finite()) {
        return CommandRange::UNIT;
    }
    if low >= 0.0 && (RULES.share_of_full..=1.0).contains(&high) {
        return CommandRange::UNIT;
    }
    // A level far from 0 is an operating point.
    if low > RULES.operating_point * range || high < -RULES.operating_point * range {
        return CommandRange {
            off: low,
            full: high,
        };
    }
    CommandRange {
        off: 0.0,
        full: high.max(-low),
    }
}
