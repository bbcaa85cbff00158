//! Coulomb friction: a constant force against the motion.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// Adds −F·sign(ṡ), and holds the flow if the motion would be less than F per sample. The sign is that of the
/// present step, as in continuous time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DryFriction<T> {
    level: T,
}

impl<T: Real> Effect<T> for DryFriction<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn drives(&self) -> bool {
        true
    }
    #[inline(always)]
    fn drive(&self, _state: &mut (), flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        let step = flow.next - flow.now;
        -step.at_least(-self.level).at_most(self.level)
    }
}

impl<T: Real> Physics<T> for DryFriction<T> {
    const SPEC: Spec = Spec {
        name: "dry-friction",
        rust: "dry_friction::DryFriction",
        place: Place::Flow,
        summary: "Coulomb friction opposes every change of the flow",
        equation: "−F·sign(s_{k+1} − s_k) is added to the drive",
        parameters: &[Parameter::new(
            "level",
            Unit::YPerSample,
            [0.0, 1.0],
            &[0.001, 0.03, 0.3],
        )],
        amplitude: Some(Amplitude::new("level", "dry friction")),
        resists: true,
        source: "Coulomb friction; Armstrong-Hélouvry et al., Automatica 30 (1994)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [level] = take(parameters);
        Self { level }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{flow, prepared};

    #[test]
    fn it_holds_the_flow_where_the_push_is_less_than_the_friction() {
        let friction: DryFriction<f64> = prepared(&[0.004]);
        // The drive is 0.02 of the remaining distance.
        let s = flow(&friction, |k| if k < 1000 { 0.19 } else { 0.9 });
        assert!(s[..1000].iter().all(|s| *s == 0.0));
        // The flow stops where 0.02·(0.9 − s) equals the friction, without chattering.
        assert!((s[1999] - 0.7).abs() < 1e-3, "{}", s[1999]);
        assert!(s.windows(2).all(|pair| pair[1] >= pair[0]));
        let down = flow(&friction, |_| -0.9);
        assert!((down[1999] + 0.7).abs() < 1e-3, "both ways");
    }
}
