//! A sensor that swings at the natural frequency of its mounting, such as a force balance.
//!
//! This is not a missing effect but a property of the sensor. It belongs to the base model, so that neither lags nor
//! vortex shedding imitate it.

use super::oscillation::{Transition, transition};
use crate::effect::{Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take};
use crate::real::Real;

/// ÿ + 2ζω·ẏ + ω²·y = ω²·s, exact for a signal that is linear between samples; ζ is limited to below 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorResonance<T> {
    /// 2ζ/ω and 1/ω, in samples.
    behind: T,
    turn: T,
    /// Of y − s, beside a steady slope.
    over_a_sample: Transition<T>,
}

/// The reading y, its rate ẏ/ω, and the last signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing<T> {
    shown: T,
    rate: T,
    signal: T,
}

impl<T: Real> Effect<T> for SensorResonance<T> {
    type State = Swing<T>;
    fn start(&self) -> Swing<T> {
        Swing {
            shown: T::ZERO,
            rate: T::ZERO,
            signal: T::ZERO,
        }
    }
    #[inline(always)]
    fn sense(&self, swing: &mut Swing<T>, signal: T, _at: &Instant<'_, T>) -> T {
        let change = signal - swing.signal;
        let steady = self.behind * change;
        let apart = swing.shown - swing.signal + steady;
        let rate = swing.rate - self.turn * change;
        let Transition { from_q, from_rate } = &self.over_a_sample;
        swing.shown = signal - steady + from_q[0] * apart + from_rate[0] * rate;
        swing.rate = self.turn * change + from_q[1] * apart + from_rate[1] * rate;
        swing.signal = signal;
        swing.shown
    }
}

impl<T: Real> Physics<T> for SensorResonance<T> {
    const SPEC: Spec = Spec {
        name: "sensor-resonance",
        rust: "sensor_resonance::SensorResonance",
        place: Place::Sensor,
        summary: "the sensor or its mounting swings at its natural frequency",
        equation: "ÿ + 2ζω·ẏ + ω²·y = ω²·s",
        parameters: &[
            Parameter::new(
                "frequency",
                Unit::Hertz,
                [1.0, 200.0],
                &[3.0, 5.0, 8.0, 12.0, 18.0, 27.0, 40.0, 60.0],
            ),
            // A larger damping ratio would imitate a memory of the flow.
            Parameter::new("damping_ratio", Unit::None, [0.005, 0.2], &[0.1]),
        ],
        base: true,
        source: "dynamic response of force balances: Tropea, Yarin and Foss, Handbook of Experimental Fluid Mechanics (2007), ch. 8",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [frequency, damping] = take(parameters);
        let (omega, damping, over_a_sample) = transition(frequency, damping, setting.period);
        let turn = T::ONE / (omega * setting.period);
        Self {
            behind: (damping + damping) * turn,
            turn,
            over_a_sample,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    /// A ramp from rest is followed 2ζ/ω behind once the swing has died out; a held signal is read as it is.
    #[test]
    fn it_follows_a_ramp_behind_and_ends_at_the_signal() {
        let (frequency, damping) = (20.0, 0.2);
        let balance: SensorResonance<f64> = prepared(&[frequency, damping]);
        let signal = |k: usize| 0.001 * k.min(500) as f64;
        let y = readings(&balance, signal, |_| 0.0);
        let behind = 2.0 * damping / (core::f64::consts::TAU * frequency);
        assert!((signal(499) - y[499] - behind).abs() < 1e-6);
        assert!((y[999] - 0.5).abs() < 1e-6);
    }

    /// The swing after a step against the solution of the differential equation; a step takes a sample.
    #[test]
    fn a_step_swings_at_its_frequency() {
        let (frequency, damping) = (10.0, 0.05);
        let balance: SensorResonance<f64> = prepared(&[frequency, damping]);
        let y = readings(&balance, |k| if k < 100 { 0.0 } else { 1.0 }, |_| 0.0);
        let omega = core::f64::consts::TAU * frequency;
        let damped = omega * (1.0 - damping * damping).sqrt();
        for (k, y) in y.iter().enumerate().skip(110).take(400) {
            // The middle of the ramp that the step is between samples.
            let t = (k as f64 - 99.5) * 1e-3;
            let decay = (-damping * omega * t).exp();
            let exact =
                1.0 - decay * ((damped * t).cos() + damping * omega / damped * (damped * t).sin());
            assert!((y - exact).abs() < 1e-3, "{k}: {y} {exact}");
        }
    }

    #[test]
    fn it_is_no_entry_of_the_catalogue_of_missing_effects() {
        let name = SensorResonance::<f64>::SPEC.name;
        assert!(crate::effects::SPECS.iter().all(|spec| spec.name != name));
        assert!(crate::effects::spec(name).is_some());
    }
}
