//! A vortex of the jet's front that temporarily adds to it.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::effects::vortex::{Shedding, Vortex};
use crate::real::Real;

/// ẇ = −w/τ + max(dj/dt, 0); the flow receives j + g·w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartingVortex<T> {
    shedding: Shedding<T>,
}

impl<T: Real> Effect<T> for StartingVortex<T> {
    type State = Vortex<T>;
    fn start(&self) -> Vortex<T> {
        Vortex::none()
    }
    #[inline(always)]
    fn jet(&self, vortex: &mut Vortex<T>, jet: T, _at: &Instant<'_, T>) -> T {
        jet + self.shedding.step(vortex, jet, |change| change)
    }
}

impl<T: Real> Physics<T> for StartingVortex<T> {
    const SPEC: Spec = Spec {
        name: "starting-vortex",
        rust: "starting_vortex::StartingVortex",
        place: Place::Jet,
        summary: "the front of the jet rolls up into a vortex that strengthens the jet for a while",
        equation: "ẇ = −w/τ + max(dj/dt, 0); the flow receives j + g·w",
        parameters: &[
            Parameter::new("gain", Unit::None, [0.0, 3.0], &[0.5]),
            Parameter::new(
                "decay_time",
                Unit::Second,
                [0.003, 0.2],
                &[0.008, 0.025, 0.08],
            ),
        ],
        amplitude: Some(Amplitude::new("gain", "a starting vortex").linear()),
        source: "Glezer, AIAA J. 26 (1988): starting vortex of a jet",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [gain, decay] = take(parameters);
        Self {
            shedding: Shedding::new(gain, decay, setting.period),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::prepared;
    use crate::effects::vortex::areas;

    #[test]
    fn the_vortex_of_an_edge_has_the_area_of_its_decay() {
        let vortex: StartingVortex<f64> = prepared(&[0.5, 0.030]);
        let apart = areas(&vortex).into_iter().zip([0.5 * 0.030, 0.0]);
        for (found, expected) in apart {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }
}
