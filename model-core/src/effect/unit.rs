//! Units of physical parameters, as a type.

use core::fmt;

/// The unit of a parameter. y is the measured friction and u the command, in any unit; a sample is one
/// sampling period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A ratio.
    None,
    /// s.
    Second,
    /// Hz.
    Hertz,
    /// 1/s.
    PerSecond,
    /// Samples.
    Samples,
    /// The unit of y.
    Y,
    /// A reading of the sensor in the unit of y, the offset included: it moves with the zero of the readings.
    Reading,
    /// 1/y.
    PerY,
    /// 1/y².
    PerYSquared,
    /// A change of y over a sample.
    YPerSample,
    /// Converts a squared change of y per sample into a change per sample.
    SamplesPerY,
    /// 1/u.
    PerU,
    /// 1/u².
    PerUSquared,
    /// A user effect's own unit, in words.
    Other(&'static str),
}

/// Printed symbols.
const SYMBOLS: [(Unit, &str); 13] = [
    (Unit::None, "-"),
    (Unit::Second, "s"),
    (Unit::Hertz, "Hz"),
    (Unit::PerSecond, "1/s"),
    (Unit::Samples, "samples"),
    (Unit::Y, "y"),
    (Unit::Reading, "y"),
    (Unit::PerY, "1/y"),
    (Unit::PerYSquared, "1/y²"),
    (Unit::YPerSample, "y per sample"),
    (Unit::SamplesPerY, "samples/y"),
    (Unit::PerU, "1/u"),
    (Unit::PerUSquared, "1/u²"),
];

impl Unit {
    /// The unit in words, as in files and reports; "-" for a ratio.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        if let Self::Other(words) = self {
            return words;
        }
        let known = SYMBOLS.iter().find(|(unit, _)| *unit == self);
        known.map_or("-", |(_, symbol)| symbol)
    }

    /// The unit with this symbol in files.
    #[must_use]
    pub fn of(symbol: &'static str) -> Self {
        let known = SYMBOLS.iter().find(|(_, known)| *known == symbol);
        known.map_or(Self::Other(symbol), |(unit, _)| *unit)
    }

    /// Conversion factor of a value in this unit if y is multiplied by `y`, times by `time` (samples stay) and u by
    /// `u`.
    #[must_use]
    pub fn scale(self, y: f64, time: f64, u: f64) -> f64 {
        match self {
            Self::None | Self::Samples | Self::Other(_) => 1.0,
            Self::Second => time,
            Self::Hertz | Self::PerSecond => 1.0 / time,
            Self::Y | Self::Reading | Self::YPerSample => y,
            Self::PerY | Self::SamplesPerY => 1.0 / y,
            Self::PerYSquared => 1.0 / (y * y),
            Self::PerU => 1.0 / u,
            Self::PerUSquared => 1.0 / (u * u),
        }
    }

    /// `value` with its unit, in the form used in reports.
    #[must_use]
    pub fn spoken(self, value: f64) -> (f64, &'static str) {
        match self {
            Self::Second if value.abs() < 1.0 => (1000.0 * value, "ms"),
            Self::None => (100.0 * value, "%"),
            Self::Y | Self::Reading => (value, "in y"),
            unit => (value, unit.symbol()),
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.symbol())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_and_units_belong_together() {
        for (unit, symbol) in SYMBOLS {
            // A file does not say whether a value moves with the zero; the cards do.
            let read = if unit == Unit::Reading { Unit::Y } else { unit };
            assert_eq!(Unit::of(symbol), read);
            assert_eq!(unit.symbol(), symbol);
        }
        assert_eq!(Unit::of("kg"), Unit::Other("kg"));
        assert_eq!(Unit::Other("kg").symbol(), "kg");
    }

    /// A squared change times the drag coefficient is a change, in any unit of y.
    #[test]
    fn scales_follow_the_dimensions() {
        let (y, time, u) = (50.0, 20.0, 3.0);
        let scale = |unit: Unit| unit.scale(y, time, u);
        assert_eq!(scale(Unit::Y) * scale(Unit::PerY), 1.0);
        assert_eq!(scale(Unit::Second) * scale(Unit::Hertz), 1.0);
        let change = scale(Unit::YPerSample);
        assert!((scale(Unit::SamplesPerY) * change * change - change).abs() < 1e-12);
        assert!((scale(Unit::PerUSquared) * u * u - 1.0).abs() < 1e-12);
        assert_eq!(scale(Unit::Samples), 1.0);
    }
}
