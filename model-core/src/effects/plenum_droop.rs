//! Depletion of the plenum while the valve is open, and recovery afterwards.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// Ṗ = (1 − P)/τ_r − κ·v·P, P(0) = 1; the jet is v·P. Crank–Nicolson, which
/// keeps P positive for every period below 2/(1/τ_r + κ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlenumDroop<T> {
    /// Refill rate per sample.
    refill: T,
    /// Depletion rate at full opening, per sample.
    depletion: T,
}

impl<T: Real> Effect<T> for PlenumDroop<T> {
    /// P, the pressure relative to the supply.
    type State = T;
    fn start(&self) -> T {
        T::ONE
    }
    #[inline(always)]
    fn jet(&self, pressure: &mut T, jet: T, _at: &Instant<'_, T>) -> T {
        let strength = jet * *pressure;
        let half = (self.refill + self.depletion * jet) / (T::ONE + T::ONE);
        *pressure = (*pressure * (T::ONE - half) + self.refill) / (T::ONE + half);
        strength
    }
}

/// Pressure loss under steady blowing, a more intuitive number than the rate.
fn loss(parameters: &[f64]) -> (f64, &'static str) {
    let [recovery, depletion] = take(parameters);
    let loss = depletion * recovery;
    (100.0 * loss / (1.0 + loss), "%")
}

impl<T: Real> Physics<T> for PlenumDroop<T> {
    const SPEC: Spec = Spec {
        name: "plenum-droop",
        rust: "plenum_droop::PlenumDroop",
        place: Place::Jet,
        summary: "the supply pressure falls while the jets blow and recovers at rest",
        equation: "Ṗ = (1 − P)/τ_r − κ·v·P, P(0) = 1; j = v·P",
        parameters: &[
            Parameter::new(
                "recovery_time",
                Unit::Second,
                [0.05, 10.0],
                &[0.2, 1.0, 5.0],
            ),
            Parameter::new("depletion_rate", Unit::PerSecond, [0.02, 5.0], &[0.3, 1.5]),
        ],
        amplitude: Some(Amplitude::new("depletion_rate", "a plenum droop").said(loss)),
        source: "mass balance of an isothermal plenum",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [recovery, depletion] = take(parameters);
        Self {
            refill: setting.period / recovery,
            depletion: depletion * setting.period,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{jets, prepared};

    #[test]
    fn steady_blowing_costs_the_loss_that_is_spoken_of() {
        let parameters = [0.05, 5.0];
        let plenum: PlenumDroop<f64> = prepared(&parameters);
        let j = jets(&plenum, |_| 1.0);
        let (percent, unit) = loss(&parameters);
        assert_eq!((percent, unit), (20.0, "%"));
        assert!((j[999] - 0.8).abs() < 1e-9, "{}", j[999]);
        assert!(j[0] == 1.0 && j.windows(2).all(|pair| pair[1] <= pair[0]));
    }

    #[test]
    fn the_pressure_comes_back_and_stays_positive() {
        let plenum: PlenumDroop<f64> = prepared(&[0.1, 500.0]);
        let j = jets(
            &plenum,
            |k| if (100..=900).contains(&k) { 0.0 } else { 1.0 },
        );
        assert!(j.iter().all(|j| *j >= 0.0));
        assert!(j[99] < 0.05 && (j[901] - 1.0).abs() < 1e-3);
    }
}
