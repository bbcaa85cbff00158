//! The flow attaches or separates at a rate that depends on its level.
//!
//! This is not a missing effect but a property of the flow itself. It belongs to the base model, so that other
//! effects do not imitate it.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// Multiplies the part of the separated flow in a step by 1 + p·s, and the part of the attached flow by 1 + q·s.
/// With the jets off or full, one of these parts is the whole step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelRate<T> {
    separating: T,
    attaching: T,
}

impl<T: Real> Effect<T> for LevelRate<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn drives(&self) -> bool {
        true
    }
    #[inline(always)]
    fn drive(&self, _state: &mut (), flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        let attached = flow.next - flow.now - flow.released;
        flow.now * (self.separating * flow.released + self.attaching * attached)
    }
}

impl<T: Real> Physics<T> for LevelRate<T> {
    const SPEC: Spec = Spec {
        name: "level-rate",
        rust: "level_rate::LevelRate",
        place: Place::Flow,
        summary: "the relaxation rate of the flow depends on its level",
        equation: "s_k·(p·Δs_off + q·Δs_on) is added; Δs_off and Δs_on are the parts of s_{k+1} − s_k without \
             and with jet",
        parameters: &[
            Parameter::new("separating", Unit::PerY, [-3.0, 3.0], &[0.0]),
            Parameter::new("attaching", Unit::PerY, [-3.0, 3.0], &[0.0]),
        ],
        amplitude: Some(Amplitude::new("separating", "a level-dependent rate")),
        base: true,
        source: "expansion of the rate of eq. (3) to first order in y",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [separating, attaching] = take(parameters);
        Self {
            separating,
            attaching,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::AttachmentHysteresis;
    use crate::effects::bench::{flow, prepared};

    #[test]
    fn the_rate_changes_and_the_end_does_not() {
        let end = |slope: f64| {
            let rate: LevelRate<f64> = prepared(&[slope, slope]);
            flow(&rate, |_| 0.8)
        };
        let (slow, plain, fast) = (end(-0.5), end(0.0), end(0.5));
        for s in [&slow, &plain, &fast] {
            assert!((s[1999] - 0.8).abs() < 1e-6);
        }
        // The first step starts from 0, where the rate is unchanged.
        assert_eq!(slow[0], plain[0]);
        assert!(slow[40] < plain[40] && plain[40] < fast[40]);
    }

    #[test]
    fn it_is_no_entry_of_the_catalogue_of_missing_effects() {
        let name = LevelRate::<f64>::SPEC.name;
        assert!(crate::effects::SPECS.iter().all(|spec| spec.name != name));
        assert_eq!(crate::effects::spec(name).map(|spec| spec.name), Some(name));
    }

    /// A latch that is always on raises the level of the flow by 0.3. The flow must approach this
    /// level as if the jet had raised it.
    #[test]
    fn it_is_the_rate_of_what_other_effects_drive_too() {
        let latch: AttachmentHysteresis<f64> = prepared(&[-0.5, -0.6, 0.3]);
        let rate: LevelRate<f64> = prepared(&[0.8, 0.8]);
        let raised = flow(&(latch, rate), |_| 0.5);
        let plain = flow(&rate, |_| 0.8);
        for (raised, plain) in raised.iter().zip(&plain) {
            assert!((raised - plain).abs() < 1e-12, "{raised} {plain}");
        }
    }
}
