//! The command range: no jet and full jet.

use serde::{Deserialize, Serialize};

/// The commands of no jet and of a full jet, in the unit of u. A model works with fractions of a full jet, (u
/// − off)/(full − off).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandRange {
    /// The command of no jet, finite.
    pub off: f64,
    /// The command of a full jet, finite and different from `off`.
    pub full: f64,
}

impl Default for CommandRange {
    fn default() -> Self {
        Self::UNIT
    }
}

impl CommandRange {
    /// Commands that are already fractions of a full jet: 0 and 1 for an on/off actuator.
    pub const UNIT: Self = Self {
        off: 0.0,
        full: 1.0,
    };

    /// Whether commands are already fractions of a full jet.
    #[must_use]
    pub fn is_unit(&self) -> bool {
        *self == Self::UNIT
    }

    /// The fraction of a full jet for a command `u`.
    #[must_use]
    pub fn share(&self, u: f64) -> f64 {
        if self.is_unit() {
            return u;
        }
        (u - self.off) / (self.full - self.off)
    }

    /// The command for a fraction `share` of a full jet.
    #[must_use]
    pub fn command(&self, share: f64) -> f64 {
        self.off + share * (self.full - self.off)
    }

    /// Whether the two commands are finite and differ.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let size = self.full - self.off;
        size.is_finite() && size != 0.0 && self.off.is_finite() && (1.0 / size).is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_commands_are_each_other_s_inverse() {
        let inverted = CommandRange {
            off: 1.0,
            full: 0.0,
        };
        assert_eq!([1.0, 0.0].map(|u| inverted.share(u)), [0.0, 1.0]);
        let volts = CommandRange {
            off: 2.0,
            full: 7.0,
        };
        assert_eq!([2.0, 7.0].map(|u| volts.share(u)), [0.0, 1.0]);
        assert_eq!(volts.command(volts.share(3.5)), 3.5);
        assert!(
            !CommandRange {
                off: 1.0,
                full: 1.0
            }
            .is_valid()
                && volts.is_valid()
        );
    }
}
