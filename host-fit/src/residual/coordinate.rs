//! Coordinates along which an error is split.

use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt;

use super::rules::RULES;
use crate::picture::{readable_time, significant};

/// A coordinate along which the error of a free run is split.
///
/// Serialises to the keys `coordinate` (its name, as [`Display`](fmt::Display) writes it) and `unit`.
#[derive(Clone, Debug, PartialEq)]
pub enum FailureCoordinate {
    /// Time since the last rise of the command, s.
    SinceRisingEdge,
    /// Time since the last fall of the command, s.
    SinceFallingEdge,
    /// The model's output, y.
    LevelOfY,
    /// The command, u; for graded commands.
    LevelOfU,
    /// Rate of change of the model's output, y/s; for graded commands.
    RateOfY,
    /// Fraction of the last `window_s` seconds in which the valve was open.
    Blowing {
        /// Window length, s.
        window_s: f64,
    },
    /// Mean of the command over the last `window_s` seconds; for graded commands.
    MeanInput {
        /// Window length, s.
        window_s: f64,
    },
    /// Time since the record began, s.
    TimeInRecord,
    /// A measured channel, in its own unit.
    Channel(
        /// Column of the channel.
        String,
    ),
    /// Number of the pulse that acts on the flow, from 1.
    PulseNumber,
    /// The pulse number modulo a cycle.
    PulseInCycle {
        /// Cycle length in pulses, at least 2.
        cycle: usize,
    },
    /// Frequency of the error itself, Hz: describes the error, not a cause.
    FrequencyBand,
}

impl FailureCoordinate {
    /// Unit of the coordinate; empty for a pure number and for channels.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        match self {
            Self::SinceRisingEdge | Self::SinceFallingEdge | Self::TimeInRecord => "s",
            Self::LevelOfY => "y",
            Self::LevelOfU => "u",
            Self::RateOfY => "y/s",
            Self::FrequencyBand => "Hz",
            Self::Blowing { .. }
            | Self::MeanInput { .. }
            | Self::Channel(_)
            | Self::PulseNumber
            | Self::PulseInCycle { .. } => "",
        }
    }

    /// Whether the coordinate changes more slowly than y, so that the error may be a coordinate-dependent
    /// gain times y; `period_s` is the sample period.
    #[must_use]
    pub fn is_slow(&self, period_s: f64) -> bool {
        match self {
            Self::TimeInRecord
            | Self::Channel(_)
            | Self::PulseNumber
            | Self::PulseInCycle { .. } => true,
            Self::Blowing { window_s } | Self::MeanInput { window_s } => {
                (*window_s / period_s).round() as usize >= RULES.slow_window
            }
            Self::SinceRisingEdge
            | Self::SinceFallingEdge
            | Self::LevelOfY
            | Self::LevelOfU
            | Self::RateOfY
            | Self::FrequencyBand => false,
        }
    }

    /// Whether the coordinate is the position of a pulse in a cycle.
    #[must_use]
    pub fn is_cycle(&self) -> bool {
        matches!(self, Self::PulseInCycle { .. })
    }

    /// Whether the coordinate counts from rising edges (true) or falling edges (false); `None` for other coordinates.
    #[must_use]
    pub fn counts_from_rising(&self) -> Option<bool> {
        match self {
            Self::SinceRisingEdge => Some(true),
            Self::SinceFallingEdge => Some(false),
            _ => None,
        }
    }

    /// An interval of the coordinate in words, for example `within 80 ms after rising edges`.
    #[must_use]
    pub fn stretch(&self, from: f64, to: f64) -> String {
        let (low, high) = (significant(from, 3), significant(to, 3));
        match self {
            Self::SinceRisingEdge => after_edges("rising", from, to),
            Self::SinceFallingEdge => after_edges("falling", from, to),
            Self::LevelOfY => format!("at y between {low} and {high}"),
            Self::TimeInRecord => format!("between {low} and {high} s into the records"),
            Self::FrequencyBand => format!("between {low} and {high} Hz"),
            Self::PulseNumber => format!("between pulses {low} and {high} of the records"),
            Self::PulseInCycle { cycle } => {
                // Remainder 0 is the last pulse of a cycle.
                let n = *cycle as f64;
                let first = if from == 0.0 { n } else { from };
                format!(
                    "at one pulse in {cycle} (numbers {first}, {}, {} …)",
                    first + n,
                    first + 2.0 * n
                )
            }
            Self::LevelOfU
            | Self::RateOfY
            | Self::Blowing { .. }
            | Self::MeanInput { .. }
            | Self::Channel(_) => format!("at {self} between {low} and {high}"),
        }
    }
}

fn after_edges(which: &str, from: f64, to: f64) -> String {
    let (end, unit) = readable_time(to);
    let in_unit = |seconds: f64| significant(seconds * end / to, 3);
    let last = in_unit(to);
    if from <= 0.0 {
        return format!("within {last} {unit} after {which} edges");
    }
    // Both ends in the unit of the later one.
    format!("{} to {last} {unit} after {which} edges", in_unit(from))
}

impl fmt::Display for FailureCoordinate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SinceRisingEdge => f.write_str("time since rising edge"),
            Self::SinceFallingEdge => f.write_str("time since falling edge"),
            Self::LevelOfY => f.write_str("level of y"),
            Self::LevelOfU => f.write_str("level of u"),
            Self::RateOfY => f.write_str("rate of change of y"),
            Self::Blowing { window_s } => write!(f, "duty over the last {window_s} s"),
            Self::MeanInput { window_s } => write!(f, "mean input over the last {window_s} s"),
            Self::TimeInRecord => f.write_str("time in the record"),
            Self::Channel(name) => write!(f, "channel {name}"),
            Self::PulseNumber => f.write_str("pulse number"),
            Self::PulseInCycle { cycle } => write!(f, "pulse number modulo {cycle}"),
            Self::FrequencyBand => f.write_str("frequency band"),
        }
    }
}

impl Serialize for FailureCoordinate {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(2))?;
        map.serialize_entry("coordinate", &self.to_string())?;
        map.serialize_entry("unit", self.unit())?;
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::FailureCoordinate as C;

    #[test]
    fn names_and_stretches_read_well() {
        let long = C::Blowing { window_s: 4.0 };
        assert_eq!(long.to_string(), "duty over the last 4 s");
        assert!(long.is_slow(0.001) && !C::Blowing { window_s: 0.25 }.is_slow(0.001));
        assert_eq!(
            long.stretch(0.25, 1.0),
            "at duty over the last 4 s between 0.25 and 1"
        );
        let rising = C::SinceRisingEdge;
        assert_eq!(rising.stretch(0.0, 0.08), "within 80 ms after rising edges");
        assert_eq!(rising.stretch(0.02, 0.08), "20 to 80 ms after rising edges");
        assert_eq!(rising.stretch(0.5, 20.0), "0.5 to 20 s after rising edges");
        let third = C::PulseInCycle { cycle: 3 };
        assert_eq!(
            third.stretch(0.0, 0.0),
            "at one pulse in 3 (numbers 3, 6, 9 …)"
        );
        let json = serde_json::to_value(C::Channel("u_inf".into())).unwrap();
        assert_eq!(
            json,
            serde_json::json!({"coordinate": "channel u_inf", "unit": ""})
        );
    }
}
