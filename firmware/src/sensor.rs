//! The sensor's reading, and its plausibility check.

use crate::fault::Fault;

/// Conversion from converter counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Counts at the value 0. For the sensor this is the natural flow, y = 0.
    pub zero: f32,
    /// y, or the channel's unit, per count.
    pub per_count: f32,
}

impl Calibration {
    /// The value of a reading in counts.
    #[inline]
    #[must_use]
    pub fn value(&self, counts: f32) -> f32 {
        (counts - self.zero) * self.per_count
    }

    /// The counts of a `value`.
    #[inline]
    #[must_use]
    pub fn counts(&self, value: f32) -> f32 {
        self.zero + value / self.per_count
    }
}

/// Limits of a healthy sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Readings at or below this level are at the lower rail, counts.
    pub lower_rail: f32,
    /// Readings at or above this level are at the upper rail, counts.
    pub upper_rail: f32,
    /// Equal readings in a row that count as a stuck sensor: noise changes a healthy reading by a count from time
    /// to time.
    pub stuck_after: u32,
}

/// A measured channel that the model's effects need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channel {
    /// Conversion from counts to the channel's unit.
    pub calibration: Calibration,
    /// Limits of a healthy channel.
    pub range: Range,
    /// Value used without a reading, in the channel's unit.
    pub reference: f32,
}

impl Channel {
    /// The rig file's channel, whose usual value is `reference`. Without a channel in the rig file,
    /// [`around`](Self::around) `reference`.
    #[must_use]
    pub const fn of(reference: f32) -> Self {
        let Some([zero, per_count, lower_rail, upper_rail]) = identified::rig::CHANNEL else {
            return Self::around(reference);
        };
        Self {
            calibration: Calibration { zero, per_count },
            range: Range {
                lower_rail,
                upper_rail,
                // A slow quantity may be constant.
                stuck_after: u32::MAX,
            },
            reference,
        }
    }

    /// A default channel whose middle counts are its reference and whose range is twice the reference, or 2
    /// units if that is more; to be replaced by a calibration.
    #[must_use]
    pub const fn around(reference: f32) -> Self {
        const MIDDLE: f32 = 2048.0;
        let half = if reference.abs() > 1.0 {
            reference.abs()
        } else {
            1.0
        };
        let per_count = half / MIDDLE;
        Self {
            calibration: Calibration {
                zero: MIDDLE - reference / per_count,
                per_count,
            },
            range: Range {
                lower_rail: 8.0,
                upper_rail: 4087.0,
                // A slow quantity may be constant.
                stuck_after: u32::MAX,
            },
            reference,
        }
    }
}

/// Plausibility check of readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watch {
    last: f32,
    equal: u32,
}

impl Watch {
    /// Initial state.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            last: f32::NAN,
            equal: 0,
        }
    }

    /// Checks a reading in counts; returns the fault, if any.
    #[inline]
    pub fn check(&mut self, range: &Range, counts: f32) -> Option<Fault> {
        if counts == self.last {
            self.equal = self.equal.saturating_add(1);
        } else {
            self.equal = 0;
        }
        self.last = counts;
        if !counts.is_finite() {
            Some(Fault::NotFinite)
        } else if counts <= range.lower_rail || counts >= range.upper_rail {
            Some(Fault::AtRail)
        } else if self.equal >= range.stuck_after {
            Some(Fault::Stuck)
        } else {
            None
        }
    }
}

impl Default for Watch {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RANGE: Range = Range {
        lower_rail: 8.0,
        upper_rail: 4087.0,
        stuck_after: 3,
    };

    #[test]
    fn each_illness_has_its_name() {
        let check = |readings: &[f32]| {
            let mut watch = Watch::new();
            readings
                .iter()
                .map(|counts| watch.check(&RANGE, *counts))
                .last()
                .flatten()
        };
        assert_eq!(check(&[100.0, 101.0]), None);
        assert_eq!(check(&[100.0, f32::NAN]), Some(Fault::NotFinite));
        assert_eq!(check(&[f32::NEG_INFINITY]), Some(Fault::NotFinite));
        assert_eq!(check(&[8.0]), Some(Fault::AtRail));
        assert_eq!(check(&[4095.0]), Some(Fault::AtRail));
        assert_eq!(check(&[100.0, 100.0, 100.0]), None);
        assert_eq!(check(&[100.0, 100.0, 100.0, 100.0]), Some(Fault::Stuck));
        assert_eq!(check(&[100.0, 100.0, 100.0, 101.0, 101.0]), None);
    }
}
