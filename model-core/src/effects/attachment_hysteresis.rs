//! Hysteresis of attachment: an attached flow stays attached at a friction at which a separated flow
//! would not attach.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Parameter, Physics, Place, Setting, Spec, StartValue, Starts,
    Unit, take,
};
use crate::real::Real;

/// A relay r with hysteresis, 0→1 when s > θ_hi and 1→0 when s < θ_lo, adds g·r to the drive; in equilibrium
/// it raises the friction by g.
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
    #[inline(always)]
    fn drives(&self) -> bool {
        true
    }
    #[inline(always)]
    fn drive(&self, attached: &mut bool, flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        if flow.now > self.upper {
            *attached = true;
        } else if flow.now < self.lower {
            *attached = false;
        }
        if *attached {
            self.gain * flow.relaxation
        } else {
            T::ZERO
        }
    }
}

/// A starting point with thresholds at these levels of the records.
const fn thresholds(upper: f64, lower: f64) -> [StartValue; 3] {
    [
        StartValue::Level(upper),
        StartValue::Level(lower),
        StartValue::Number(0.15),
    ]
}

impl<T: Real> Physics<T> for AttachmentHysteresis<T> {
    const SPEC: Spec = Spec {
        name: "attachment-hysteresis",
        rust: "attachment_hysteresis::AttachmentHysteresis",
        place: Place::Flow,
        summary: "the flow has two states; it attaches above an upper level of y and separates below a lower one",
        equation: "relay r switches 0→1 at s > θ_hi and 1→0 at s < θ_lo, with θ_lo < θ_hi; g·r is added to the drive",
        parameters: &[
            Parameter::new("upper_threshold", Unit::Y, [-0.5, 2.0], &[0.4, 0.6, 0.8]).stepwise(),
            Parameter::new("lower_threshold", Unit::Y, [-0.5, 2.0], &[0.15, 0.35])
                .stepwise()
                .below("upper_threshold"),
            Parameter::new("gain", Unit::Y, [-2.0, 2.0], &[0.15]),
        ],
        amplitude: Some(Amplitude::new("gain", "an attachment hysteresis").linear()),
        starts: Starts::Rows(&[
            &thresholds(0.25, 0.1),
            &thresholds(0.4, 0.1),
            &thresholds(0.4, 0.25),
            &thresholds(0.55, 0.1),
            &thresholds(0.55, 0.25),
            &thresholds(0.55, 0.4),
            &thresholds(0.7, 0.1),
            &thresholds(0.7, 0.25),
            &thresholds(0.7, 0.4),
            &thresholds(0.7, 0.55),
            &thresholds(0.88, 0.1),
            &thresholds(0.88, 0.25),
            &thresholds(0.88, 0.4),
            &thresholds(0.88, 0.55),
            &thresholds(0.88, 0.7),
        ]),
        source: "Greenblatt & Wygnanski, Prog. Aerosp. Sci. 36 (2000)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [upper, lower, gain] = take(parameters);
        Self { upper, lower, gain }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{flow, prepared};

    #[test]
    fn between_the_thresholds_the_flow_stays_what_it_was() {
        let relay: AttachmentHysteresis<f64> = prepared(&[0.6, 0.3, 0.2]);
        // The level is raised to 0.45, then above the upper threshold, then lowered to 0.45.
        let s = flow(
            &relay,
            |k| if (600..1200).contains(&k) { 0.7 } else { 0.45 },
        );
        assert!((s[599] - 0.45).abs() < 1e-4, "{}", s[599]);
        assert!((s[1199] - 0.9).abs() < 1e-4, "{}", s[1199]);
        assert!((s[1999] - 0.65).abs() < 1e-4, "{}", s[1999]);
        let s = flow(&relay, |k| if k < 800 { 0.7 } else { 0.0 });
        // With a target of 0 the equilibrium of the attached flow is the gain: the flow detaches below the lower
        // threshold.
        assert!(s[1999].abs() < 1e-4, "{}", s[1999]);
    }
}
