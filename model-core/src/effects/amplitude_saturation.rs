//! The flow resists large amplitudes: a cubic term, hardening or softening.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Needs, Parameter, Physics, Place, RustType, Setting, Spec,
    Starts, Unit, take,
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
    #[inline]
    fn drives(&self) -> bool {
        true
    }
    #[inline]
    fn drive(&self, _state: &mut (), flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        -(self.cubic * flow.relaxation) * (flow.now * flow.now * flow.now)
    }
}

impl<T: Real> Physics<T> for AmplitudeSaturation<T> {
    const SPEC: Spec = Spec {
        name: "amplitude-saturation",
        rust: "amplitude_saturation::AmplitudeSaturation",
        rust_type: RustType::Numbers,
        place: Place::Flow,
        summary: "growth saturates (or stiffens) with amplitude",
        equation: "adds −γ·s³ to the drive",
        parameters: &[Parameter::new(
            "cubic",
            Unit::PerYSquared,
            [-1000.0, 1000.0],
            &[0.1],
        )],
        starts: Starts::Grid,
        amplitude: Some(Amplitude::new("cubic", "an amplitude saturation").linear()),
        channel: None,
        needs: Needs::Nothing,
        law: None,
        source: "Landau's amplitude equation; Stuart, J. Fluid Mech. 9 (1960)",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [cubic] = take(parameters);
        Self { cubic }
    }
}
