//! Faults of a rig outside the catalogue.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A fault that occurs in every repeat of a record, so that averaging does not remove it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// The valve ignores every n-th pulse of the record.
    MissingPulse {
        /// n, at least 2.
        every: u32,
    },
    /// The sensor holds its last value for a while.
    FreezingSensor {
        /// Time at which the sensor freezes (s from the record's start).
        from_s: f64,
        /// Time at which the sensor works again (s from the record's start).
        to_s: f64,
    },
    /// After a long opening the valve closes only half way and stays there before it closes.
    StickingValve {
        /// Shortest opening after which the valve sticks (s).
        after_open_s: f64,
        /// Time during which the valve stays half open (s).
        stuck_s: f64,
    },
}

impl Fault {
    /// Names accepted by [`Fault::draw`].
    pub const NAMES: &'static [&'static str] =
        &["missing-pulse", "freezing-sensor", "sticking-valve"];

    /// Name for reports and command lines.
    pub fn name(&self) -> &'static str {
        match self {
            Self::MissingPulse { .. } => "missing-pulse",
            Self::FreezingSensor { .. } => "freezing-sensor",
            Self::StickingValve { .. } => "sticking-valve",
        }
    }

    /// A random fault with this name; `None` for an unknown name.
    pub fn draw(name: &str, rng: &mut ChaCha8Rng) -> Option<Self> {
        match name {
            "missing-pulse" => Some(Self::MissingPulse {
                every: rng.random_range(3..=5),
            }),
            "freezing-sensor" => {
                let from_s = rng.random_range(3.0..6.0);
                Some(Self::FreezingSensor {
                    from_s,
                    to_s: from_s + rng.random_range(0.8..2.0),
                })
            }
            "sticking-valve" => Some(Self::StickingValve {
                after_open_s: rng.random_range(0.075..0.140),
                stuck_s: rng.random_range(0.060..0.150),
            }),
            _ => None,
        }
    }
}
