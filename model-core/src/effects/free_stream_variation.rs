//! Variation of the free stream, which changes the relative strength of the jets.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// j = v·(1 + g·(U∞/U_ref − 1)), U∞ a measured channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeStreamVariation<T> {
    gain: T,
    channel: usize,
    reference: T,
}

impl<T: Real> Effect<T> for FreeStreamVariation<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn jet(&self, _state: &mut (), jet: T, at: &Instant<'_, T>) -> T {
        // Without a channel, its reference is used.
        let speed = at
            .channels
            .get(self.channel)
            .copied()
            .unwrap_or(self.reference);
        jet * (T::ONE + self.gain * (speed / self.reference - T::ONE))
    }
}

impl<T: Real> Physics<T> for FreeStreamVariation<T> {
    const SPEC: Spec = Spec {
        name: "free-stream-variation",
        rust: "free_stream_variation::FreeStreamVariation",
        place: Place::Jet,
        summary: "the speed of the free stream varies during the record",
        equation: "j = v·(1 + g·(U∞/U_ref − 1))",
        parameters: &[Parameter::new(
            "gain",
            Unit::None,
            [-5.0, 5.0],
            &[-1.0, 1.0],
        )],
        amplitude: Some(Amplitude::new("gain", "a gain of the free stream").linear()),
        channel: Some("u_inf"),
        source: "momentum coefficient c_mu = ρ_j U_j² A_j/(½ ρ U∞² S)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [gain] = take(parameters);
        Self {
            gain,
            channel: setting.channel,
            reference: setting.reference,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::prepared;

    fn jet(gain: f64, channels: &[f64]) -> f64 {
        let effect: FreeStreamVariation<f64> = prepared(&[gain]);
        let at = Instant {
            command: 1.0,
            flow: 0.0,
            arrived: 0.0,
            present: 0.0,
            channels,
        };
        effect.jet(&mut (), 0.5, &at)
    }

    #[test]
    fn the_jet_follows_the_stream_relative_to_its_reference() {
        assert_eq!(jet(-1.0, &[10.0]), 0.5);
        assert!((jet(-1.0, &[11.0]) - 0.45).abs() < 1e-12);
        assert!((jet(2.0, &[9.0]) - 0.4).abs() < 1e-12);
        assert_eq!(jet(2.0, &[]), 0.5);
    }
}
