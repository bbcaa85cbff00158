//! Places at which a term can act, and the quantity that it changes there.

use super::coordinate::Coordinate;
use crate::terms::Units;
use model_core::effect::Unit;
use serde::Serialize;

/// The place where a term acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// The jet's strength.
    Jet,
    /// The path from the jet to the flow.
    Delay,
    /// The flow's own dynamics.
    Flow,
    /// The sensor's reading.
    Sensor,
}

impl Place {
    /// Name of the place in documents.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Jet => "jet",
            Self::Delay => "delay",
            Self::Flow => "flow",
            Self::Sensor => "sensor",
        }
    }
}

/// The quantity that a term changes at its place; g is the value of the term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// The jet's strength, multiplied by 1 + g.
    Jet,
    /// The delay plus g, s.
    Delay,
    /// The steady level of the flow plus g, y.
    Level,
    /// The relaxation rate of the flow without jets, multiplied by 1 + g.
    Rate,
    /// The reading plus g, y.
    Reading,
    /// The reading, multiplied by 1 + g.
    Sensitivity,
}

impl Entry {
    /// All entries.
    pub const ALL: [Self; 6] = [
        Self::Jet,
        Self::Delay,
        Self::Level,
        Self::Rate,
        Self::Reading,
        Self::Sensitivity,
    ];

    /// Place of the term.
    #[must_use]
    pub fn place(self) -> Place {
        match self {
            Self::Jet => Place::Jet,
            Self::Delay => Place::Delay,
            Self::Level | Self::Rate => Place::Flow,
            Self::Reading | Self::Sensitivity => Place::Sensor,
        }
    }

    /// The changed quantity in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Jet => "relative change of the jet's strength",
            Self::Delay => "change of the delay",
            Self::Level => "change of the level that the flow tends to",
            Self::Rate => "relative change of the rate at which the flow separates",
            Self::Reading => "change of the reading",
            Self::Sensitivity => "relative change of the sensor's sensitivity",
        }
    }

    /// The coordinate of a term at this entry, in words. A rate and a sensitivity also act in proportion to y.
    pub(crate) fn depends_on(self, coordinate: &Coordinate) -> String {
        let own = coordinate.words();
        match self {
            Self::Rate if own != "y" => format!("{own} × y"),
            Self::Sensitivity if own != "reading" => format!("{own} × reading"),
            _ => own,
        }
    }

    /// The unit of g.
    #[must_use]
    pub fn unit(self) -> Unit {
        match self {
            Self::Jet | Self::Rate | Self::Sensitivity => Unit::None,
            Self::Delay => Unit::Second,
            Self::Level | Self::Reading => Unit::Y,
        }
    }

    /// One inner unit of g in the user's units.
    pub(crate) fn scale(self, units: &Units) -> f64 {
        self.unit().scale(units.y, units.time, 1.0)
    }

    /// Whether the base already contains a constant g.
    pub(crate) fn has_free_level(self) -> bool {
        !matches!(self, Self::Level | Self::Reading)
    }

    /// Weight of a sample for estimating g. A term of the jet shows only while a jet is blowing. A
    /// term that multiplies y has the weight y².
    pub(crate) fn shown_by(self, blowing: bool, y: f64) -> f64 {
        match self {
            Self::Jet => f64::from(u8::from(blowing)),
            Self::Rate | Self::Sensitivity => y * y,
            Self::Delay | Self::Level | Self::Reading => 1.0,
        }
    }

    /// The place in an effect file.
    pub(crate) fn of_effect(self) -> &'static str {
        match self {
            Self::Jet | Self::Delay => "jet",
            Self::Level | Self::Rate => "flow",
            Self::Reading | Self::Sensitivity => "sensor",
        }
    }

    /// The expression of an effect with this `g`. The model's delay was shortened by `shift` seconds to make
    /// room, and may become `longest` at most. A full jet has the strength `full`.
    pub(crate) fn expression(self, g: &str, shift: f64, longest: f64, full: f64) -> String {
        match self {
            Self::Jet => format!("jet * (1.0 + ({g}))"),
            Self::Delay => format!("delayed(jet, {shift:?} + ({g}), {longest:?})"),
            Self::Level => format!("relaxation * ({g})"),
            Self::Rate => {
                format!("-(relaxation * y * max(1.0 - arrived / {full:?}, 0.0)) * ({g})")
            }
            Self::Reading => format!("reading + ({g})"),
            Self::Sensitivity => format!("reading * (1.0 + ({g}))"),
        }
    }
}
