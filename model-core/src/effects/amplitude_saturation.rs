//! Resistance of the flow to large amplitudes: a cubic term, hardening or softening.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// Adds −γ·s³ to the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmplitudeSaturation<T> {
    cubic: T,
}

impl<T: Real> Effect<T> for AmplitudeSaturation<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn drives(&self) -> bool {
        true
    }
    #[inline(always)]
    fn drive(&self, _state: &mut (), flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        -(self.cubic * flow.relaxation) * (flow.now * flow.now * flow.now)
    }
}

impl<T: Real> Physics<T> for AmplitudeSaturation<T> {
    const SPEC: Spec = Spec {
        name: "amplitude-saturation",
        rust: "amplitude_saturation::AmplitudeSaturation",
        place: Place::Flow,
        summary: "the growth rate of the flow saturates (or increases) with the amplitude",
        equation: "−γ·s³ is added to the drive",
        parameters: &[
            Parameter::new("cubic", Unit::PerYSquared, [-1000.0, 1000.0], &[0.1]).positive(),
        ],
        amplitude: Some(Amplitude::new("cubic", "an amplitude saturation").linear()),
        source: "Landau's amplitude equation; Stuart, J. Fluid Mech. 9 (1960)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [cubic] = take(parameters);
        Self { cubic }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{flow, prepared};

    #[test]
    fn the_cubic_sets_the_level() {
        for cubic in [-0.1, 0.0, 0.4, 3.0] {
            let effect: AmplitudeSaturation<f64> = prepared(&[cubic]);
            let s = flow(&effect, |_| 0.9)[1999];
            assert!((s + cubic * s * s * s - 0.9).abs() < 1e-9, "{cubic}: {s}");
        }
    }
}
