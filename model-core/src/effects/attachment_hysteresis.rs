//! Once attached the flow stays attached at a friction at which it would not have attached.

use crate::effect::{Effect, Flow, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
use crate::real::Real;


/// A relay r with memory, 0→1 when s > θ_hi and 1→0 when s < θ_lo, adds g·r to
/// the drive: in equilibrium it moves the friction by g.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttachmentHysteresis<T> {
    upper: T,
    lower: T,
    gain: T,
}

impl<T: Real> Effect<T> for AttachmentHysteresis<T> {
    /// Whether the flow counts as attached.
    type State = bool;
    fn start(&self) -> bool {
        false
    }
    #[inline]
    fn drives(&self) -> bool {
        true
    }
    #[inline]
    fn drive(&self, attached: &mut bool, flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        if flow.now > self.upper {
            *attached = true;
        } else if flow.now < self.lower {
            *attached = false;
        }
        if *attached { self.gain * flow.relaxation } else { T::ZERO }
    }
}

impl<T: Real> Physics<T> for AttachmentHysteresis<T> {
    const SPEC: Spec = Spec {
        name: "attachment-hysteresis",
        rust: "attachment_hysteresis::AttachmentHysteresis",
        place: Place::Flow,
        summary: "attachment has memory: it lets go later than it takes hold",
        equation: "relay r: 0→1 when s > θ_hi, 1→0 when s < θ_lo; adds g·r to the drive",
        parameters: &[
            Parameter { name: "upper_threshold", unit: "y", low: -0.5, high: 2.0, starts: &[0.4, 0.6, 0.8], influence: Influence::Stepwise },
            Parameter { name: "lower_threshold", unit: "y", low: -0.5, high: 2.0, starts: &[0.15, 0.35], influence: Influence::Stepwise },
            Parameter { name: "gain", unit: "y", low: -2.0, high: 2.0, starts: &[0.15], influence: Influence::Smooth },
        ],
        channel: None,
        source: "Greenblatt & Wygnanski, Prog. Aerosp. Sci. 36 (2000)",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [upper, lower, gain] = take(parameters);
        Self { upper, lower, gain }
    }
}
