//! A vortex rolls up after switch-off and the friction undershoots.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// ẇ = −w/τ + max(−dj/dt, 0); the flow receives j − g·w.
///
/// `strength` is the mean of w over the sample, which is what a flow that
/// integrates its drive receives; so a change within a sample or at its start
/// gives the same vortex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoppingVortex<T> {
    gain: T,
    /// Decay over a sample.
    kept: T,
    /// Mean over a sample of a vortex born at its start.
    mean: T,
}

/// The vortex and the jet that made it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vortex<T> {
    strength: T,
    jet: T,
}

impl<T: Real> Effect<T> for StoppingVortex<T> {
    type State = Vortex<T>;
    fn start(&self) -> Vortex<T> {
        Vortex {
            strength: T::ZERO,
            jet: T::ZERO,
        }
    }
    #[inline]
    fn jet(&self, vortex: &mut Vortex<T>, jet: T, _at: &Instant<'_, T>) -> T {
        let change = (vortex.jet - jet).at_least(T::ZERO);
        vortex.jet = jet;
        vortex.strength = vortex.strength * self.kept + change * self.mean;
        jet - self.gain * vortex.strength
    }
}

impl<T: Real> Physics<T> for StoppingVortex<T> {
    const SPEC: Spec = Spec {
        name: "stopping-vortex",
        rust: "stopping_vortex::StoppingVortex",
        place: Place::Jet,
        summary: "a vortex rolls up after switch-off and the friction undershoots",
        equation: "ẇ = −w/τ + max(−dj/dt, 0); the flow receives j − g·w",
        parameters: &[
            Parameter::new("gain", Unit::None, [0.0, 3.0], &[0.5]),
            Parameter::new(
                "decay_time",
                Unit::Second,
                [0.003, 0.3],
                &[0.008, 0.025, 0.08],
            ),
        ],
        amplitude: Some(Amplitude::new("gain", "a stopping vortex").linear()),
        source: "Darabi & Wygnanski, J. Fluid Mech. 510 (2004): separation of a flow after forcing stops",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [gain, decay] = take(parameters);
        let kept = (-setting.period / decay).exp();
        Self {
            gain,
            kept,
            mean: (T::ONE - kept) * decay / setting.period,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{jets, prepared};

    /// ∫w dt = τ for an edge of 1, however long the samples are.
    #[test]
    fn the_vortex_of_an_edge_has_the_area_of_its_decay() {
        let vortex: StoppingVortex<f64> = prepared(&[0.5, 0.030]);
        let jet = |k| if (100..600).contains(&k) { 1.0 } else { 0.0 };
        let j = jets(&vortex, jet);
        let added = |from: usize, to: usize| -> f64 {
            (from..to).map(|k| j[k] - jet(k)).sum::<f64>() * 0.001
        };
        let (rising, falling) = (added(100, 600), added(600, 1000));
        let area = -0.5 * 0.030;
        assert!((falling - area).abs() < 1e-6, "{rising} {falling}");
        assert!(rising.abs() < 1e-6);
    }
}
