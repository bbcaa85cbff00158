//! Jets excite the flow's own oscillation, which the sensor measures in addition to the friction.

use super::oscillation::{Transition, transition};
use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// q̈ + 2ζω·q̇ + ω²·q = ω²·j(t − h); g·(q − j(t − h)) is added to y. Exact for a jet that is constant over the
/// sample; ζ is limited to below 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VortexShedding<T> {
    gain: T,
    /// Of q − j.
    over_a_sample: Transition<T>,
}

/// The oscillation q and its rate q̇/ω.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillation<T> {
    q: T,
    rate: T,
}

impl<T: Real> Effect<T> for VortexShedding<T> {
    type State = Oscillation<T>;
    fn start(&self) -> Oscillation<T> {
        Oscillation {
            q: T::ZERO,
            rate: T::ZERO,
        }
    }
    #[inline(always)]
    fn sense(&self, state: &mut Oscillation<T>, signal: T, at: &Instant<'_, T>) -> T {
        let shown = signal + self.gain * (state.q - at.present);
        let apart = state.q - at.arrived;
        let rate = state.rate;
        let Transition { from_q, from_rate } = &self.over_a_sample;
        state.q = at.arrived + from_q[0] * apart + from_rate[0] * rate;
        state.rate = from_q[1] * apart + from_rate[1] * rate;
        shown
    }
}

impl<T: Real> Physics<T> for VortexShedding<T> {
    const SPEC: Spec = Spec {
        name: "vortex-shedding",
        rust: "vortex_shedding::VortexShedding",
        place: Place::Sensor,
        summary: "the jets excite vortex shedding, which is visible in the friction as a damped oscillation",
        equation: "q̈ + 2ζω·q̇ + ω²·q = ω²·j(t − h); g·(q − j(t − h)) is added to y",
        parameters: &[
            Parameter::new(
                "frequency",
                Unit::Hertz,
                [1.0, 200.0],
                &[3.0, 6.0, 10.0, 16.0, 25.0, 40.0],
            ),
            // A larger damping ratio would give a lag, not an oscillation.
            Parameter::new("damping_ratio", Unit::None, [0.005, 0.3], &[0.05, 0.2]),
            Parameter::new("gain", Unit::Y, [-2.0, 2.0], &[0.15]),
        ],
        amplitude: Some(Amplitude::new("gain", "vortex shedding").linear()),
        source: "Cattafesta & Sheplak, Annu. Rev. Fluid Mech. 43 (2011)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [frequency, damping, gain] = take(parameters);
        let (_, _, over_a_sample) = transition(frequency, damping, setting.period);
        Self {
            gain,
            over_a_sample,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    #[test]
    fn an_edge_rings_at_its_frequency_and_dies_out() {
        let (frequency, damping) = (20.0, 0.05);
        let shedding: VortexShedding<f64> = prepared(&[frequency, damping, 0.3]);
        let y = readings(&shedding, |_| 0.5, |k| if k < 1 { 0.0 } else { 1.0 });
        let ringing = |k: usize| y[k] - 0.5;
        // At the edge itself q is 0 while the jet is 1.
        assert!((ringing(1) + 0.3).abs() < 1e-12);
        let damped = frequency * (1.0 - damping * damping).sqrt();
        let period = (1000.0 / damped).round() as usize;
        // After one period the phase is the same and the amplitude is smaller by exp(−2πζ/√(1 −
        // ζ²)).
        let left = (-core::f64::consts::TAU * damping * frequency / damped).exp();
        assert!((ringing(1 + period) / ringing(1) - left).abs() < 0.02);
        assert!(ringing(999).abs() < 1e-2 * 0.3);
    }
}
