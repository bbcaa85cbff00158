//! The catalogue of physical effects, one file each.
//!
//! An effect's file holds its equation, parameters with units and bounds, and
//! its discrete form. A new effect is such a file and one line in the
//! `catalogue!` below.

pub mod amplitude_saturation;
pub mod attachment_hysteresis;
pub mod bouc_wen_hysteresis;
pub mod dry_friction;
pub mod echo_path;
pub mod edge_dependent_delay;
pub mod electrical_pickup;
pub mod free_stream_variation;
pub mod hot_film_lag;
pub mod hot_film_nonlinearity;
pub mod input_nonlinearity;
pub mod plenum_droop;
pub mod quadratic_drag;
pub mod rectifying_sensor;
pub mod sensor_saturation;
pub mod starting_vortex;
pub mod state_dependent_delay;
pub mod stopping_vortex;
pub mod thermal_drift;
pub mod valve_lag;
pub mod vortex_shedding;

pub use edge_dependent_delay::EdgeDependentDelay;
pub use state_dependent_delay::StateDependentDelay;

use crate::effect::{Effect, Flow, Instant, Physics, Setting, Spec};
use crate::real::Real;

/// Samples that an effect of [`AnyEffect`] remembers at most.
pub const LONGEST_BUFFER: usize = 2048;

macro_rules! catalogue {
    ($($file:ident :: $effect:ident : $type:ty),+ $(,)?) => {
        $(pub use $file::$effect;)+

        /// Any effect of the catalogue but the delay laws, chosen at run time.
        #[derive(Clone, Copy, Debug)]
        #[allow(clippy::large_enum_variant, reason = "a handful per model, on the host")]
        pub enum AnyEffect<T: Real> {
            $(#[doc = concat!("`", stringify!($file), "`")] $effect($type),)+
        }

        /// The state of [`AnyEffect`].
        #[derive(Clone, Debug)]
        #[allow(clippy::large_enum_variant, reason = "a handful per model, on the host")]
        pub enum AnyState<T: Real> {
            $(#[doc = concat!("of `", stringify!($file), "`")] $effect(<$type as Effect<T>>::State),)+
        }

        /// The catalogue in the order of the physics: jet, delay, flow, sensor.
        pub const SPECS: &[Spec] = &in_order([
            <StateDependentDelay<f64> as Physics<f64>>::SPEC,
            <EdgeDependentDelay<f64> as Physics<f64>>::SPEC,
            $({ #[allow(dead_code, reason = "not every effect has numbers")] type T = f64; <$type as Physics<f64>>::SPEC },)+
        ]);

        impl<T: Real> AnyEffect<T> {
            /// The effect called `name`, prepared; `None` for an unknown name or
            /// a delay law.
            #[must_use]
            pub fn new(name: &str, parameters: &[T], setting: &Setting<T>) -> Option<Self> {
                $(if name == <$type as Physics<T>>::SPEC.name {
                    return Some(Self::$effect(<$type as Physics<T>>::new(parameters, setting)));
                })+
                None
            }
        }

        impl<T: Real> Effect<T> for AnyEffect<T> {
            type State = AnyState<T>;
            fn start(&self) -> AnyState<T> {
                match self {
                    $(Self::$effect(effect) => AnyState::$effect(Effect::<T>::start(effect)),)+
                }
            }
            fn jet(&self, state: &mut AnyState<T>, jet: T, at: &Instant<'_, T>) -> T {
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
            fn drive(&self, state: &mut AnyState<T>, flow: &Flow<T>, at: &Instant<'_, T>) -> T {
                match (self, state) {
                    $((Self::$effect(effect), AnyState::$effect(state)) => effect.drive(state, flow, at),)+
                    _ => T::ZERO,
                }
            }
            fn sense(&self, state: &mut AnyState<T>, signal: T, at: &Instant<'_, T>) -> T {
                match (self, state) {
                    $((Self::$effect(effect), AnyState::$effect(state)) => effect.sense(state, signal, at),)+
                    _ => signal,
                }
            }
        }
    };
}

// Within a place, in the order in which the physics runs.
catalogue! {
    valve_lag::ValveLag: ValveLag<T>,
    plenum_droop::PlenumDroop: PlenumDroop<T>,
    free_stream_variation::FreeStreamVariation: FreeStreamVariation<T>,
    input_nonlinearity::InputNonlinearity: InputNonlinearity<T>,
    echo_path::EchoPath: EchoPath<T, LONGEST_BUFFER>,
    starting_vortex::StartingVortex: StartingVortex<T>,
    stopping_vortex::StoppingVortex: StoppingVortex<T>,
    attachment_hysteresis::AttachmentHysteresis: AttachmentHysteresis<T>,
    amplitude_saturation::AmplitudeSaturation: AmplitudeSaturation<T>,
    dry_friction::DryFriction: DryFriction<T>,
    quadratic_drag::QuadraticDrag: QuadraticDrag<T>,
    bouc_wen_hysteresis::BoucWenHysteresis: BoucWenHysteresis<T>,
    vortex_shedding::VortexShedding: VortexShedding<T>,
    rectifying_sensor::RectifyingSensor: RectifyingSensor,
    hot_film_nonlinearity::HotFilmNonlinearity: HotFilmNonlinearity<T>,
    hot_film_lag::HotFilmLag: HotFilmLag<T>,
    thermal_drift::ThermalDrift: ThermalDrift<T>,
    electrical_pickup::ElectricalPickup: ElectricalPickup<T>,
    sensor_saturation::SensorSaturation: SensorSaturation<T>,
}

/// The two delay laws come first in the list above; move them behind the jets.
const fn in_order<const N: usize>(specs: [Spec; N]) -> [Spec; N] {
    let mut ordered = specs;
    let mut next = 0;
    let mut place = 0;
    while place < 4 {
        let mut i = 0;
        while i < N {
            if specs[i].place as usize == place {
                ordered[next] = specs[i];
                next += 1;
            }
            i += 1;
        }
        place += 1;
    }
    ordered
}

/// The catalogue's entry for `name`.
#[must_use]
pub fn spec(name: &str) -> Option<&'static Spec> {
    SPECS.iter().find(|spec| spec.name == name)
}
