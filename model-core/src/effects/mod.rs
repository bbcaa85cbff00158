//! The catalogue of physical effects, one file each.
//!
//! An effect's file holds its equation, parameters with units and bounds, and
//! its discrete form. A new effect is such a file and one line in the
//! `catalogue!` below.

pub mod amplitude_saturation;
pub mod attachment_hysteresis;
#[cfg(test)]
mod bench;
pub mod bouc_wen_hysteresis;
pub mod constant_delay;
pub mod direct_part;
pub mod dispersed_delay;
pub mod dry_friction;
pub mod echo_path;
pub mod edge_dependent_delay;
pub mod electrical_pickup;
pub mod free_stream_variation;
pub mod hot_film_lag;
pub mod hot_film_nonlinearity;
pub mod input_nonlinearity;
pub mod lagging_drive;
pub mod level_rate;
mod oscillation;
pub mod plenum_droop;
pub mod quadratic_drag;
pub mod reading_curve;
pub mod rectifying_sensor;
pub mod saturating_delay;
pub mod sensor_resonance;
pub mod sensor_saturation;
pub mod slow_wake;
pub mod starting_vortex;
pub mod state_dependent_delay;
pub mod stopping_vortex;
pub mod thermal_drift;
pub mod valve_lag;
mod vortex;
pub mod vortex_shedding;
pub mod zero_offset;

use crate::delay::Transport;
use crate::effect::{Effect, Flow, Instant, Physics, Place, Setting, Spec};
use crate::history::{DelayLine, Reaching};
use crate::real::Real;

/// Longest memory of an effect, samples: half a second at 0.13 ms per sample.
pub const LONGEST_BUFFER: usize = 4096;

macro_rules! delay_laws {
    ($($file:ident :: $law:ident),+ $(,)?) => {
        $(pub use $file::$law;)+

        /// Any delay law of the catalogue, chosen at run time.
        #[derive(Clone, Copy, Debug)]
        pub enum AnyTransport<T: Real> {
            $(#[doc = concat!("`", stringify!($file), "`")] $law($law<T>),)+
        }

        /// The state of [`AnyTransport`].
        #[derive(Clone, Debug)]
        pub enum AnyTransportState<T: Real> {
            $(#[doc = concat!("of `", stringify!($file), "`")] $law(<$law<T> as Transport<T>>::State),)+
        }

        /// All delay laws, base terms included.
        pub const LAWS: &[Spec] = &[$(<$law<f64> as Physics<f64>>::SPEC),+];

        impl<T: Real> AnyTransport<T> {
            /// The delay law called `name`, prepared; `None` for an unknown name.
            #[must_use]
            pub fn new(name: &str, parameters: &[T], setting: &Setting<T>) -> Option<Self> {
                $(if name == <$law<T> as Physics<T>>::SPEC.name {
                    return Some(Self::$law(<$law<T> as Physics<T>>::new(parameters, setting)));
                })+
                None
            }
        }

        impl<T: Real> Transport<T> for AnyTransport<T> {
            type State = AnyTransportState<T>;
            fn start(&self) -> AnyTransportState<T> {
                match self {
                    $(Self::$law(law) => AnyTransportState::$law(law.start()),)+
                }
            }
            #[inline(always)]
            fn command(&self, state: &mut AnyTransportState<T>, command: T) -> T {
                match (self, state) {
                    $((Self::$law(law), AnyTransportState::$law(state)) => law.command(state, command),)+
                    _ => command,
                }
            }
            #[inline(always)]
            fn delay(&self, output: T) -> T {
                match self {
                    $(Self::$law(law) => law.delay(output),)+
                }
            }
            fn bounds(&self) -> Option<[T; 2]> {
                match self {
                    $(Self::$law(law) => law.bounds(),)+
                }
            }
            fn held_back(&self) -> [T; 2] {
                match self {
                    $(Self::$law(law) => law.held_back(),)+
                }
            }
        }
    };
}

macro_rules! catalogue {
    ($($file:ident :: $effect:ident : $type:ty),+ $(,)?) => {
        $(pub use $file::$effect;)+

        /// Any effect of the catalogue except the delay laws, chosen at run time. Effects with a memory of a signal
        /// store it in `M`.
        #[derive(Clone, Copy, Debug)]
        #[allow(clippy::large_enum_variant, reason = "a model on the host has few effects")]
        pub enum AnyEffect<T: Real, M> {
            $(#[doc = concat!("`", stringify!($file), "`")] $effect($type),)+
        }

        /// The state of [`AnyEffect`].
        #[derive(Clone, Debug)]
        #[allow(clippy::large_enum_variant, reason = "a model on the host has few effects")]
        pub enum AnyState<T: Real, M: Reaching<T>> {
            $(#[doc = concat!("of `", stringify!($file), "`")] $effect(<$type as Effect<T>>::State),)+
        }

        /// The cards of the effects except delay laws.
        const EFFECTS: &[Spec] = &[
            $({
                #[allow(dead_code, reason = "not every effect has numbers")]
                type T = f64;
                #[allow(dead_code, reason = "few effects have a memory")]
                type M = DelayLine<f64, 1>;
                <$type as Physics<f64>>::SPEC
            },)+
        ];

        impl<T: Real, M: Reaching<T>> AnyEffect<T, M> {
            /// The effect called `name`, prepared; `None` for an unknown name or a delay law.
            #[must_use]
            pub fn new(name: &str, parameters: &[T], setting: &Setting<T>) -> Option<Self> {
                $(if name == <$type as Physics<T>>::SPEC.name {
                    return Some(Self::$effect(<$type as Physics<T>>::new(parameters, setting)));
                })+
                None
            }

            /// The place on its card. An effect leaves the signals of the other places unchanged.
            #[must_use]
            pub const fn place(&self) -> Place {
                match self {
                    $(Self::$effect(_) => <$type as Physics<T>>::SPEC.place,)+
                }
            }
        }

        impl<T: Real, M: Reaching<T>> Effect<T> for AnyEffect<T, M> {
            type State = AnyState<T, M>;
            fn start(&self) -> AnyState<T, M> {
                match self {
                    $(Self::$effect(effect) => AnyState::$effect(Effect::<T>::start(effect)),)+
                }
            }
            #[inline(always)]
            fn jet(&self, state: &mut AnyState<T, M>, jet: T, at: &Instant<'_, T>) -> T {
                match (self, state) {
                    $((Self::$effect(effect), AnyState::$effect(state)) => effect.jet(state, jet, at),)+
                    _ => jet,
                }
            }
            fn drives(&self) -> bool {
                match self {
                    $(Self::$effect(effect) => Effect::<T>::drives(effect),)+
                }
            }
            #[inline(always)]
            fn drive(&self, state: &mut AnyState<T, M>, flow: &Flow<T>, at: &Instant<'_, T>) -> T {
                match (self, state) {
                    $((Self::$effect(effect), AnyState::$effect(state)) => effect.drive(state, flow, at),)+
                    _ => T::ZERO,
                }
            }
            #[inline(always)]
            fn sense(&self, state: &mut AnyState<T, M>, signal: T, at: &Instant<'_, T>) -> T {
                match (self, state) {
                    $((Self::$effect(effect), AnyState::$effect(state)) => effect.sense(state, signal, at),)+
                    _ => signal,
                }
            }
        }
    };
}

delay_laws! {
    constant_delay::ConstantDelay,
    state_dependent_delay::StateDependentDelay,
    saturating_delay::SaturatingDelay,
    edge_dependent_delay::EdgeDependentDelay,
}

// The order within a place is the physical order.
catalogue! {
    valve_lag::ValveLag: ValveLag<T>,
    plenum_droop::PlenumDroop: PlenumDroop<T>,
    free_stream_variation::FreeStreamVariation: FreeStreamVariation<T>,
    input_nonlinearity::InputNonlinearity: InputNonlinearity<T>,
    echo_path::Echo: Echo<T, M>,
    starting_vortex::StartingVortex: StartingVortex<T>,
    stopping_vortex::StoppingVortex: StoppingVortex<T>,
    dispersed_delay::DispersedDelay: DispersedDelay<T>,
    lagging_drive::LaggingDrive: LaggingDrive<T>,
    attachment_hysteresis::AttachmentHysteresis: AttachmentHysteresis<T>,
    amplitude_saturation::AmplitudeSaturation: AmplitudeSaturation<T>,
    bouc_wen_hysteresis::BoucWenHysteresis: BoucWenHysteresis<T>,
    dry_friction::DryFriction: DryFriction<T>,
    quadratic_drag::QuadraticDrag: QuadraticDrag<T>,
    slow_wake::SlowWake: SlowWake<T>,
    level_rate::LevelRate: LevelRate<T>,
    reading_curve::ReadingCurve: ReadingCurve<T>,
    direct_part::DirectPart: DirectPart<T>,
    sensor_resonance::SensorResonance: SensorResonance<T>,
    vortex_shedding::VortexShedding: VortexShedding<T>,
    rectifying_sensor::RectifyingSensor: RectifyingSensor,
    hot_film_nonlinearity::HotFilmNonlinearity: HotFilmNonlinearity<T>,
    hot_film_lag::HotFilmLag: HotFilmLag<T>,
    thermal_drift::ThermalDrift: ThermalDrift<T>,
    electrical_pickup::ElectricalPickup: ElectricalPickup<T>,
    sensor_saturation::SensorSaturation: SensorSaturation<T>,
    zero_offset::ZeroOffset: ZeroOffset<T>,
}

/// The effects that can be missing, in physical order: jet, delay, flow, sensor.
pub const SPECS: &[Spec] = &in_order::<{ lacking(LAWS) + lacking(EFFECTS) }>();

/// The card of the sensor's offset, a base term.
pub const ZERO_OFFSET: &Spec = &<ZeroOffset<f64> as Physics<f64>>::SPEC;

/// The card of a rate that depends on the level, a base term.
pub const LEVEL_RATE: &Spec = &<LevelRate<f64> as Physics<f64>>::SPEC;

/// The card of a slow wake, a base term.
pub const SLOW_WAKE: &Spec = &<SlowWake<f64> as Physics<f64>>::SPEC;

/// The card of a delay dispersed by turbulence, a base term.
pub const DISPERSED_DELAY: &Spec = &<DispersedDelay<f64> as Physics<f64>>::SPEC;

/// The card of a drive that lags the jets, possibly with inverse response; a base term.
pub const LAGGING_DRIVE: &Spec = &<LaggingDrive<f64> as Physics<f64>>::SPEC;

/// The card of a monotone curve between the flow and its reading, a base term.
pub const READING_CURVE: &Spec = &<ReadingCurve<f64> as Physics<f64>>::SPEC;

/// The card of a part of the jets that acts on the reading at once, a base term.
pub const DIRECT_PART: &Spec = &<DirectPart<f64> as Physics<f64>>::SPEC;

/// The card of a sensor that swings, a base term.
pub const SENSOR_RESONANCE: &Spec = &<SensorResonance<f64> as Physics<f64>>::SPEC;

/// Base terms between command, flow and reading: a search tries each from all starting values of its card.
pub const PATH_TERMS: [&Spec; 5] = [
    DISPERSED_DELAY,
    LAGGING_DRIVE,
    READING_CURVE,
    DIRECT_PART,
    SENSOR_RESONANCE,
];

/// The base terms with a card, in their order: after all effects of their place, because a rate acts on everything that
/// drives the flow; unless their turn is another.
pub const NUISANCES: [&Spec; 8] = [
    DISPERSED_DELAY,
    LAGGING_DRIVE,
    SLOW_WAKE,
    LEVEL_RATE,
    READING_CURVE,
    DIRECT_PART,
    SENSOR_RESONANCE,
    ZERO_OFFSET,
];

/// Number of `specs` that can be missing.
const fn lacking(specs: &[Spec]) -> usize {
    let (mut count, mut i) = (0, 0);
    while i < specs.len() {
        count += !specs[i].base as usize;
        i += 1;
    }
    count
}

const fn in_order<const N: usize>() -> [Spec; N] {
    let mut ordered = [EFFECTS[0]; N];
    let (mut next, mut place) = (0, 0);
    while place <= Place::Sensor as usize {
        let mut i = 0;
        while i < LAWS.len() + EFFECTS.len() {
            let spec = if i < LAWS.len() {
                LAWS[i]
            } else {
                EFFECTS[i - LAWS.len()]
            };
            if !spec.base && spec.place as usize == place {
                ordered[next] = spec;
                next += 1;
            }
            i += 1;
        }
        place += 1;
    }
    ordered
}

/// The card of the effect `name`: of the catalogue, or a base term.
#[must_use]
pub fn spec(name: &str) -> Option<&'static Spec> {
    SPECS.iter().chain(NUISANCES).find(|spec| spec.name == name)
}

/// The card of the delay law `name`: a base term or an effect.
#[must_use]
pub fn law(name: &str) -> Option<&'static Spec> {
    LAWS.iter().find(|spec| spec.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Starts;

    #[test]
    fn cards_are_whole() {
        let mut names = std::vec::Vec::new();
        for spec in EFFECTS.iter().chain(LAWS) {
            assert!(!names.contains(&spec.name), "{} is there twice", spec.name);
            names.push(spec.name);
            let said = [
                spec.name,
                spec.rust,
                spec.summary,
                spec.equation,
                spec.source,
            ];
            assert!(!said.contains(&""), "{}", spec.name);
            assert_eq!(
                spec.place == Place::Delay,
                spec.law.is_some(),
                "{}",
                spec.name
            );
            let file = spec.rust.split("::").next().unwrap();
            assert_eq!(file, spec.name.replace('-', "_"));
            for p in spec.parameters {
                assert!(p.low <= p.high && !p.starts.is_empty(), "{}", p.name);
                let inside = p.starts.iter().all(|s| (p.low..=p.high).contains(s));
                assert!(inside, "{}.{}", spec.name, p.name);
            }
            if let Starts::Rows(rows) = spec.starts {
                assert!(rows.iter().all(|row| row.len() == spec.parameters.len()));
            }
            if let Some(amplitude) = &spec.amplitude {
                assert!(
                    spec.parameter(amplitude.parameter).is_some(),
                    "{}",
                    spec.name
                );
            }
            if let Some(law) = &spec.law {
                assert_eq!(law.words.matches("{}").count(), spec.parameters.len());
                let fields = law.fields.map_or(spec.parameters.len(), <[_]>::len);
                assert_eq!(fields, spec.parameters.len());
            }
        }
        assert!(SPECS.is_sorted_by_key(|spec| spec.place));
        let lacking: std::vec::Vec<&str> = SPECS.iter().map(|spec| spec.name).collect();
        names.retain(|name| !lacking.contains(name));
        assert_eq!(
            names,
            [
                "dispersed-delay",
                "lagging-drive",
                "slow-wake",
                "level-rate",
                "reading-curve",
                "direct-part",
                "sensor-resonance",
                "zero-offset",
                "constant-delay",
                "saturating-delay"
            ],
            "of base models"
        );
        assert!(spec("constant-delay").is_none() && law("constant-delay").is_some());
    }
}
