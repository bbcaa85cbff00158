//! The plenum empties while the valve is open and fills again afterwards.

use crate::effect::{Effect, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
use crate::real::Real;


/// Ṗ = (1 − P)/τ_r − κ·v·P, P(0) = 1; the jet is v·P. Crank–Nicolson, which
/// keeps P positive for every period below 2/(1/τ_r + κ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlenumDroop<T> {
    /// Refilling, per sample.
    refill: T,
    /// Depletion at full opening, per sample.
    depletion: T,
}

impl<T: Real> Effect<T> for PlenumDroop<T> {
    /// P, the pressure over the supply's.
    type State = T;
    fn start(&self) -> T {
        T::ONE
    }
    #[inline]
    fn jet(&self, pressure: &mut T, jet: T, _at: &Instant<'_, T>) -> T {
        let strength = jet * *pressure;
        let half = (self.refill + self.depletion * jet) / (T::ONE + T::ONE);
        *pressure = (*pressure * (T::ONE - half) + self.refill) / (T::ONE + half);
        strength
    }
}

impl<T: Real> Physics<T> for PlenumDroop<T> {
    const SPEC: Spec = Spec {
        name: "plenum-droop",
        rust: "plenum_droop::PlenumDroop",
        place: Place::Jet,
        summary: "the supply pressure sinks while blowing",
        equation: "Ṗ = (1 − P)/τ_r − κ·v·P, P(0) = 1; j = v·P",
        parameters: &[
            Parameter { name: "recovery_time", unit: "s", low: 0.05, high: 10.0, starts: &[0.2, 1.0, 5.0], influence: Influence::Smooth },
            Parameter { name: "depletion_rate", unit: "1/s", low: 0.02, high: 5.0, starts: &[0.3, 1.5], influence: Influence::Smooth },
        ],
        channel: None,
        source: "mass balance of an isothermal plenum",
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [recovery, depletion] = take(parameters);
        Self {
            refill: setting.period / recovery,
            depletion: depletion * setting.period,
        }
    }
}
