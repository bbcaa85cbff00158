//! The flow resists large amplitudes: a cubic term, hardening or softening.

use crate::effect::{Effect, Flow, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
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
        place: Place::Flow,
        summary: "growth saturates (or stiffens) with amplitude",
        equation: "adds −γ·s³ to the drive",
        parameters: &[
            Parameter { name: "cubic", unit: "1/y²", low: -1000.0, high: 1000.0, starts: &[0.1], influence: Influence::Smooth },
        ],
        channel: None,
        source: "Landau's amplitude equation; Stuart, J. Fluid Mech. 9 (1960)",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [cubic] = take(parameters);
        Self { cubic }
    }
}
