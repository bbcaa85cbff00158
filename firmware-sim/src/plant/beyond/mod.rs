//! Physics outside the catalogue, for tests of the search for unknown terms.

mod bubble_memory;
mod convective_line;
mod drifting_line;
mod fading_sensitivity;
mod faster_separation;
mod hot_jet;
mod late_slip;
mod line;
mod long_rest;
mod power_law;
mod pulses;
mod quadratic_drive;
mod reluctant_separation;
mod rest_line;
mod short_rest;
mod stall_above;
mod stirred_layer;
mod strength;
mod swelling_jet;
mod tiring_jet;
mod unrest;
mod warm_gas;
mod zero_of_rate;

use rand_chacha::ChaCha8Rng;

use super::base::BasePlant;
use super::effects::{
    EffectError, Parameter, Physics, ShowsWith, catalogue, parameters, validate, with,
};
use super::part::{Part, Place, Surroundings};

/// Place of a term, in the words of `discover`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// The jet's strength.
    Jet,
    /// The path from the coil to the flow.
    Delay,
    /// The drive of the flow.
    Flow,
    /// The sensor's reading.
    Sensor,
}

impl Port {
    /// The word of a finding.
    pub fn word(self) -> &'static str {
        match self {
            Self::Jet => "jet",
            Self::Delay => "delay",
            Self::Flow => "flow",
            Self::Sensor => "sensor",
        }
    }
}

/// Region in which the physics deviates from the model: above a value of the coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// The threshold, in the rig's own units.
    pub above: f64,
}

/// Place and coordinates of a term.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// The place.
    pub port: Port,
    /// Coordinates in the words of `discover`: the first is the true one, the others are equivalent for given
    /// commands and readings. A time in brackets is the rig's (s); without one any time is accepted.
    pub coordinates: Vec<String>,
    /// The only region in which the term acts; `None` if it acts everywhere.
    pub region: Option<Region>,
}

impl Truth {
    /// A term that acts everywhere.
    pub fn new(port: Port, coordinates: &[&str]) -> Self {
        Self {
            port,
            coordinates: coordinates.iter().map(|word| (*word).to_owned()).collect(),
            region: None,
        }
    }

    fn above(self, above: f64) -> Self {
        Self {
            region: Some(Region { above }),
            ..self
        }
    }
}

/// Ratio of the time constant of an exponential memory to the length of a window with nearly the same information. With
/// the rigs' commands, a curve over one explains 84–94 % of a curve over the other; the share is largest at this ratio.
const MEMORY_PER_WINDOW: f64 = 0.6;

/// Interface of each file in this folder.
trait Hidden: Physics {
    /// The term to be found.
    fn truth(&self) -> Truth;
}

macro_rules! beyond {
    ($($file:ident :: $physics:ident),+ $(,)?) => {
        catalogue! {
            /// A physical mechanism outside the catalogue, with its parameters.
            Beyond { $($file :: $physics),+ }
        }

        impl Beyond {
            /// Channel of the air temperature (°C), in addition to that of the free stream.
            pub const TEMPERATURE: &'static str = "temperature";

            /// The term to be found.
            pub fn truth(&self) -> Truth {
                match self { $(Self::$physics(physics) => physics.truth(),)+ }
            }
        }
    };
}

beyond! {
    tiring_jet::TiringJet,
    short_rest::ShortRest,
    swelling_jet::SwellingJet,
    hot_jet::HotJet,
    warm_gas::WarmGas,
    long_rest::LongRest,
    drifting_line::DriftingLine,
    rest_line::RestLine,
    convective_line::ConvectiveLine,
    quadratic_drive::QuadraticDrive,
    faster_separation::FasterSeparation,
    stirred_layer::StirredLayer,
    reluctant_separation::ReluctantSeparation,
    bubble_memory::BubbleMemory,
    unrest::Unrest,
    stall_above::StallAbove,
    power_law::PowerLaw,
    fading_sensitivity::FadingSensitivity,
    zero_of_rate::ZeroOfRate,
    late_slip::LateSlip,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::altered::Altered;
    use crate::plant::effects::Effect;
    use crate::plant::{FreeStream, PlantSpec, Rig};
    use rand::SeedableRng;

    #[test]
    fn every_physics_draws_valid_values_changes_the_reading_and_has_a_place_and_a_coordinate() {
        for name in Beyond::NAMES {
            assert!(!Effect::NAMES.contains(name) && !Altered::NAMES.contains(name));
            let mut rng = ChaCha8Rng::seed_from_u64(0);
            let base = BasePlant::draw(&mut rng);
            let physics = Beyond::draw(name, &base, &mut rng).unwrap();
            physics.validate().unwrap();
            let truth = physics.truth();
            assert!(!truth.coordinates.is_empty() && !physics.parameters().is_empty());
            // The command is a square wave of 2 Hz, with a rest of one second at the end.
            let on = |k: usize| k < 7500 && k % 500 >= 250;
            let command: Vec<f64> = (0..8500).map(|k| f64::from(u8::from(on(k)))).collect();
            let stream = FreeStream::draw(&mut rng, command.len());
            let play = |beyond: Vec<Beyond>| {
                let plain = PlantSpec::new(base, &[]);
                let spec = PlantSpec { beyond, ..plain };
                let rig = Rig::new(&spec, Some(stream.clone()));
                rig.unwrap().play(&command)
            };
            let (without, with) = (play(Vec::new()), play(vec![physics]));
            let off = with.iter().zip(&without).map(|(a, b)| (a - b) * (a - b));
            let rms = (off.sum::<f64>() / 8500.0).sqrt();
            assert!((0.003..1.0).contains(&rms), "{name}: {rms}, {physics:?}");
        }
    }

    /// Words allowed in [`Truth::coordinates`].
    #[test]
    fn coordinates_are_told_in_the_words_of_a_finding() {
        const WORDS: &[&str] = &[
            "y",
            "reading",
            "past y",
            "mean y",
            "since rising edge",
            "since falling edge",
            "rest before",
            "pulse length",
            "pulse number",
            "blowing",
            "memory of u",
            "memory of y",
            "memory of rate",
            "time in record",
            "u_inf",
            "temperature",
        ];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let base = BasePlant::draw(&mut rng);
        for name in Beyond::NAMES {
            let truth = Beyond::draw(name, &base, &mut rng).unwrap().truth();
            for coordinate in &truth.coordinates {
                for factor in coordinate.split(" × ") {
                    let kind = factor.split(" (").next().unwrap_or(factor);
                    let kind = kind.split(" in the last ").next().unwrap_or(kind);
                    assert!(WORDS.contains(&kind), "{name}: {coordinate}");
                }
            }
        }
    }
}
