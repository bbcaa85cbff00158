//! The physical effects of a plant: one file each, with name, parameters, units, limits, usual values and
//! continuous-time physics.
//!
//! A new effect is such a file with `physics!`, its `mod` and one line in `catalogue!`.

mod amplitude_saturation;
mod attachment_hysteresis;
mod bouc_wen_hysteresis;
mod dry_friction;
mod echo_path;
mod edge_dependent_delay;
mod electrical_pickup;
mod free_stream_variation;
mod hot_film_lag;
mod hot_film_nonlinearity;
mod input_nonlinearity;
mod plenum_droop;
mod quadratic_drag;
mod rectifying_sensor;
mod sensor_saturation;
mod starting_vortex;
mod state_dependent_delay;
mod stopping_vortex;
mod thermal_drift;
mod valve_lag;
mod vortex;
mod vortex_shedding;

use std::fmt::Debug;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use super::base::{BasePlant, FlowDelay};
use super::part::{Part, Place, Surroundings};

/// Why an effect could not be created.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EffectError {
    /// No effect of that name.
    #[error("there is no effect `{name}`; the names are: {known}")]
    UnknownEffect {
        /// The requested name.
        name: String,
        /// The known names.
        known: String,
    },
    /// The effect has no parameter of this name.
    #[error("`{effect}` has no parameter `{parameter}`; it has: {known}")]
    UnknownParameter {
        /// Name of the effect.
        effect: &'static str,
        /// The requested parameter.
        parameter: String,
        /// The parameters of the effect.
        known: String,
    },
    /// A parameter outside its physical range.
    #[error("`{parameter}` of `{effect}` is {value}, it must be {requirement}; give another value")]
    OutOfRange {
        /// Name of the effect.
        effect: &'static str,
        /// Name of the parameter.
        parameter: &'static str,
        /// The rejected value.
        value: f64,
        /// The allowed range.
        requirement: &'static str,
    },
}

/// A parameter of an effect: name, value, unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name as in model files and reports.
    pub name: &'static str,
    /// Value in `unit`.
    pub value: f64,
    /// Symbol of the unit; "-" when dimensionless.
    pub unit: &'static str,
}

/// Physical limits (not the usual range).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    low: f64,
    high: f64,
    requirement: &'static str,
}

impl Limits {
    pub(crate) const FINITE: Self = Self::new(f64::MIN, f64::MAX, "finite");
    pub(crate) const NOT_NEGATIVE: Self = Self::new(0.0, f64::MAX, "0 or positive");
    pub(crate) const POSITIVE: Self = Self::new(f64::MIN_POSITIVE, f64::MAX, "above 0");
    pub(crate) const TIME: Self = Self::new(1e-4, 100.0, "between 0.0001 and 100 s");
    pub(crate) const TRAVEL: Self = Self::new(1e-4, 1.0, "between 0.0001 and 1 s");
    pub(crate) const SAMPLES: Self = Self::new(0.0, 500.0, "between 0 and 500 samples");
    pub(crate) const FREQUENCY: Self = Self::new(0.01, 1000.0, "between 0.01 and 1000 Hz");
    pub(crate) const KING_RATIO: Self = Self::new(
        f64::MIN_POSITIVE,
        f64::MAX,
        "above 0 (at 0 the film does not respond to the flow)",
    );

    pub(crate) const fn new(low: f64, high: f64, requirement: &'static str) -> Self {
        Self {
            low,
            high,
            requirement,
        }
    }

    /// NaN is outside.
    fn contain(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// The card of one parameter of the effect `E`.
pub(crate) struct Card<E: 'static> {
    name: &'static str,
    unit: &'static str,
    limits: Limits,
    field: fn(&mut E) -> &mut f64,
}

impl<E: Copy> Card<E> {
    pub(crate) const fn new(
        name: &'static str,
        unit: &'static str,
        limits: Limits,
        field: fn(&mut E) -> &mut f64,
    ) -> Self {
        Self {
            name,
            unit,
            limits,
            field,
        }
    }

    fn value(&self, effect: &E) -> f64 {
        let mut copy = *effect;
        *(self.field)(&mut copy)
    }
}

/// Commands with which an effect is visible.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShowsWith {
    /// The levels off and on are sufficient.
    OnOff,
    /// Levels between off and on.
    Levels,
    /// Levels of both signs.
    SignedLevels,
}

/// Interface of each file of the catalogue.
pub(crate) trait Physics: Copy + Debug + PartialEq + Sized + 'static {
    /// Name in model files and reports.
    const NAME: &'static str;
    /// Name of the effect in the catalogue, or of the most similar effect of the catalogue.
    const RESEMBLES: &'static str = Self::NAME;
    /// Place of the effect.
    const PLACE: Place;
    /// Parameters of the effect, in the catalogue's order.
    const PARAMETERS: &'static [Card<Self>];
    /// Commands under which the effect is visible.
    const SHOWS_WITH: ShowsWith = ShowsWith::OnOff;
    /// The measured channel without which the effect is not identifiable.
    const CHANNEL: Option<&'static str> = None;

    /// Random parameters for the rig `base`: visible and plausible.
    ///
    /// The ranges were fixed from the physics (flow times 20–150 ms, friction of order 1) before any
    /// diagnosis was run on these plants.
    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self;

    /// The first constraint between parameters that is violated, and its requirement.
    fn conflict(&self) -> Option<(&'static str, &'static str)> {
        None
    }

    /// The effect in its initial state.
    fn part(&self, surroundings: &Surroundings<'_>) -> Part;
}

/// One effect: the structure with its parameters, and [`Physics`] for it.
///
/// ```text
/// physics! {
///     /// The equation.
///     Structure = "name" at Place, like Resembled { other items of Physics }
///     parameters(base, rng) {
///         /// Meaning, without unit.
///         parameter ["unit", LIMITS] = a drawn value;
///     }
///     where { statements before the values, if values depend on each other }
///     part(law, surroundings) { the effect in its initial state }
///     truth(law) { what `discover` has to find, for physics outside the catalogue }
/// }
/// ```
macro_rules! physics {
    (
        $(#[$doc:meta])*
        $effect:ident = $name:literal at $place:ident $(, like $like:ident)? $({ $($more:tt)* })?
        parameters($base:pat_param, $rng:pat_param) { $(
            $(#[$meaning:meta])*
            $parameter:ident [$unit:literal, $limits:ident] = $value:expr;
        )* }
        $(where { $($before:tt)* })?
        part($law:pat_param, $surroundings:pat_param) { $($part:tt)* }
        $(truth($hidden:pat_param) { $($truth:tt)* })?
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $effect { $(
            $(#[$meaning])*
            #[doc = concat!("(", $unit, ")")]
            pub $parameter: f64,
        )* }

        impl $crate::plant::effects::Physics for $effect {
            const NAME: &'static str = $name;
            $(const RESEMBLES: &'static str = <$like as $crate::plant::effects::Physics>::NAME;)?
            const PLACE: $crate::plant::part::Place = $crate::plant::part::Place::$place;
            const PARAMETERS: &'static [$crate::plant::effects::Card<Self>] =
                &[$($crate::plant::effects::Card::new(
                    stringify!($parameter),
                    $unit,
                    $crate::plant::effects::Limits::$limits,
                    |effect| &mut effect.$parameter,
                ),)*];
            $($($more)*)?

            fn draw(
                $base: &$crate::plant::base::BasePlant,
                $rng: &mut rand_chacha::ChaCha8Rng,
            ) -> Self {
                #[allow(unused_imports, reason = "parameters may be drawn by functions")]
                use rand::RngExt as _;
                $($($before)*)?
                Self { $($parameter: $value),* }
            }

            fn part(
                &self,
                $surroundings: &$crate::plant::part::Surroundings<'_>,
            ) -> $crate::plant::part::Part {
                let $law = self;
                $($part)*
            }
        }

        #[cfg(test)]
        impl $effect {
            /// The effect in its initial state and in constant surroundings.
            #[allow(dead_code, reason = "some are tested by means of a whole rig")]
            pub(crate) fn at_rest(&self) -> $crate::plant::part::Part {
                let surroundings = $crate::plant::part::Surroundings::default();
                $crate::plant::effects::Physics::part(self, &surroundings)
            }
        }

        $(impl $crate::plant::beyond::Hidden for $effect {
            fn truth(&self) -> $crate::plant::beyond::Truth {
                let $hidden = self;
                $($truth)*
            }
        })?
    };
}
pub(super) use physics;

pub(super) fn parameters<E: Physics>(effect: &E) -> Vec<Parameter> {
    let each = E::PARAMETERS.iter().map(|card| Parameter {
        name: card.name,
        value: card.value(effect),
        unit: card.unit,
    });
    each.collect()
}

pub(super) fn with<E: Physics>(
    mut effect: E,
    parameter: &str,
    value: f64,
) -> Result<E, EffectError> {
    let Some(card) = E::PARAMETERS.iter().find(|card| card.name == parameter) else {
        let known: Vec<&str> = E::PARAMETERS.iter().map(|card| card.name).collect();
        return Err(EffectError::UnknownParameter {
            effect: E::NAME,
            parameter: parameter.to_owned(),
            known: known.join(", "),
        });
    };
    *(card.field)(&mut effect) = value;
    Ok(effect)
}

pub(super) fn validate<E: Physics>(effect: &E) -> Result<(), EffectError> {
    let refuse = |card: &Card<E>, requirement| EffectError::OutOfRange {
        effect: E::NAME,
        parameter: card.name,
        value: card.value(effect),
        requirement,
    };
    for card in E::PARAMETERS {
        if !card.limits.contain(card.value(effect)) {
            return Err(refuse(card, card.limits.requirement));
        }
    }
    if let Some((parameter, requirement)) = effect.conflict()
        && let Some(card) = E::PARAMETERS.iter().find(|card| card.name == parameter)
    {
        return Err(refuse(card, requirement));
    }
    Ok(())
}

macro_rules! catalogue {
    ($(#[$doc:meta])* $catalogue:ident { $($file:ident :: $effect:ident),+ $(,)? }) => {
        $(pub use $file::$effect;)+

        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum $catalogue {
            $(#[doc = concat!("See [`", stringify!($effect), "`].")] $effect($effect),)+
        }

        $(impl From<$effect> for $catalogue {
            fn from(effect: $effect) -> Self {
                Self::$effect(effect)
            }
        })+

        impl $catalogue {
            /// Every name of the catalogue, in its order.
            pub const NAMES: &'static [&'static str] = &[$($effect::NAME,)+];

            /// The effect `name` with random parameters that suit the rig `base`.
            ///
            /// # Errors
            /// [`EffectError::UnknownEffect`] when the catalogue has no such name.
            pub fn draw(
                name: &str,
                base: &BasePlant,
                rng: &mut ChaCha8Rng,
            ) -> Result<Self, EffectError> {
                match name {
                    $($effect::NAME => Ok($effect::draw(base, rng).into()),)+
                    _ => Err(EffectError::UnknownEffect {
                        name: name.to_owned(),
                        known: Self::NAMES.join(", "),
                    }),
                }
            }

            /// The name used in model files and reports.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$effect(_) => $effect::NAME,)+ }
            }

            /// Place of the effect in the plant.
            pub fn place(&self) -> Place {
                match self { $(Self::$effect(_) => $effect::PLACE,)+ }
            }

            /// Position of the effect in the plant.
            pub(crate) fn order(&self) -> (Place, usize) {
                let names = Self::NAMES.iter();
                (self.place(), names.take_while(|name| **name != self.name()).count())
            }

            /// Commands under which the effect is visible.
            pub fn shows_with(&self) -> ShowsWith {
                match self { $(Self::$effect(_) => $effect::SHOWS_WITH,)+ }
            }

            /// The measured channel without which the effect is not identifiable.
            pub fn channel(&self) -> Option<&'static str> {
                match self { $(Self::$effect(_) => $effect::CHANNEL,)+ }
            }

            /// The parameters, in the catalogue's order and units.
            pub fn parameters(&self) -> Vec<Parameter> {
                match self { $(Self::$effect(effect) => parameters(effect),)+ }
            }

            /// The effect with one parameter changed.
            ///
            /// # Errors
            /// [`EffectError::UnknownParameter`] when the effect has no such parameter.
            pub fn with(self, parameter: &str, value: f64) -> Result<Self, EffectError> {
                match self {
                    $(Self::$effect(effect) => with(effect, parameter, value).map(Self::from),)+
                }
            }

            /// Checks the parameters against their physical limits (not the usual ranges).
            ///
            /// # Errors
            /// [`EffectError::OutOfRange`] naming the first bad parameter.
            pub fn validate(&self) -> Result<(), EffectError> {
                match self { $(Self::$effect(effect) => validate(effect),)+ }
            }

            /// Name of the effect in the catalogue, or of the most similar effect of the catalogue.
            pub fn resembles(&self) -> &'static str {
                match self { $(Self::$effect(_) => $effect::RESEMBLES,)+ }
            }

            pub(crate) fn part(&self, surroundings: &Surroundings<'_>) -> Part {
                match self { $(Self::$effect(effect) => effect.part(surroundings),)+ }
            }
        }
    };
}

pub(super) use catalogue;

catalogue! {
    /// One physical mechanism of the catalogue with its parameters.
    ///
    /// A "sample" is 1 ms here, whatever the integrator's step.
    Effect {
    state_dependent_delay::StateDependentDelay,
    edge_dependent_delay::EdgeDependentDelay,
    valve_lag::ValveLag,
    plenum_droop::PlenumDroop,
    free_stream_variation::FreeStreamVariation,
    echo_path::EchoPath,
    starting_vortex::StartingVortex,
    stopping_vortex::StoppingVortex,
    attachment_hysteresis::AttachmentHysteresis,
    amplitude_saturation::AmplitudeSaturation,
    vortex_shedding::VortexShedding,
    hot_film_nonlinearity::HotFilmNonlinearity,
    hot_film_lag::HotFilmLag,
    thermal_drift::ThermalDrift,
    sensor_saturation::SensorSaturation,
    electrical_pickup::ElectricalPickup,
    dry_friction::DryFriction,
    quadratic_drag::QuadraticDrag,
    rectifying_sensor::RectifyingSensor,
    input_nonlinearity::InputNonlinearity,
    bouc_wen_hysteresis::BoucWenHysteresis,
    }
}

impl Effect {
    /// Whether the effect requires commands with more levels than off and on.
    pub fn needs_levels(&self) -> bool {
        self.shows_with() != ShowsWith::OnOff
    }

    /// The transport delay of the plant, if the effect is a delay law.
    pub fn delay(&self) -> Option<FlowDelay> {
        match self.part(&Surroundings::default()) {
            Part::Delay(delay) => Some(delay),
            _ => None,
        }
    }

    /// Whether the effect and `other` act on the same part of the rig and exclude each other.
    pub fn excludes(&self, other: &Self) -> bool {
        exclude(
            (self.resembles(), self.place()),
            (other.resembles(), other.place()),
        )
    }
}

/// Whether two effects, each stated as its similar effect of the catalogue and its place, need the same part of a rig.
pub(crate) fn exclude(a: (&str, Place), b: (&str, Place)) -> bool {
    a.0 == b.0 || [a.1, b.1] == [Place::Transport; 2]
}

/// A random size with a random sign.
pub(super) fn signed(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    let size = rng.random_range(low..high);
    if rng.random_bool(0.5) { size } else { -size }
}

impl FlowDelay {
    /// The effect of the catalogue that this delay law is or resembles; none for a constant delay.
    pub fn effect(self) -> Option<&'static str> {
        match self {
            Self::Fixed { .. } => None,
            Self::StateDependent { .. } | Self::Clamped { .. } => Some(StateDependentDelay::NAME),
            Self::EdgeDependent { .. } => Some(EdgeDependentDelay::NAME),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_catalogue_has_every_name_once() {
        let mut sorted = Effect::NAMES.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), Effect::NAMES.len());
    }

    #[test]
    fn parameters_are_changed_by_name_and_checked() {
        let lag = Effect::from(ValveLag {
            opening_time: 0.01,
            closing_time: 0.02,
        });
        let slow = lag.with("closing_time", 0.03).unwrap();
        assert_eq!(slow.parameters()[1].value, 0.03);
        let message = lag.with("gain", 1.0).unwrap_err().to_string();
        assert!(
            message.contains("opening_time, closing_time"),
            "names the choices: {message}"
        );
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            let message = lag.with("closing_time", bad).unwrap().validate();
            let message = message.unwrap_err().to_string();
            assert!(message.contains("between 0.0001 and 100 s"), "{message}");
        }
    }

    #[test]
    fn every_draw_is_valid_and_repeats() {
        for name in Effect::NAMES {
            for seed in 0..200 {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let base = BasePlant::draw(&mut rng);
                let effect = Effect::draw(name, &base, &mut rng.clone()).unwrap();
                assert_eq!(effect.name(), *name);
                effect.validate().unwrap();
                assert_eq!(effect, Effect::draw(name, &base, &mut rng).unwrap());
            }
        }
    }
}
