//! Coulomb friction: a force against the motion, whatever its speed.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Needs, Parameter, Physics, Place, RustType, Setting, Spec,
    Starts, Unit, take,
};
use crate::real::Real;

/// Adds −F·sign(ṡ), and holds the flow where the motion would be less than F a
/// sample: the sign is that of the step being taken, as in continuous time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DryFriction<T> {
    level: T,
}

impl<T: Real> Effect<T> for DryFriction<T> {
    type State = ();
    fn start(&self) {}
    #[inline]
    fn drives(&self) -> bool {
        true
    }
    #[inline]
    fn drive(&self, _state: &mut (), flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        let step = flow.next - flow.now;
        -step.at_least(-self.level).at_most(self.level)
    }
}

impl<T: Real> Physics<T> for DryFriction<T> {
    const SPEC: Spec = Spec {
        name: "dry-friction",
        rust: "dry_friction::DryFriction",
        rust_type: RustType::Numbers,
        place: Place::Flow,
        summary: "Coulomb friction acts against the motion",
        equation: "adds −F·sign(s_{k+1} − s_k)",
        parameters: &[Parameter::new(
            "level",
            Unit::YPerSample,
            [0.0, 1.0],
            &[0.001, 0.03, 0.3],
        )],
        starts: Starts::Grid,
        amplitude: Some(Amplitude::new("level", "dry friction")),
        channel: None,
        needs: Needs::Nothing,
        law: None,
        source: "Coulomb friction; Armstrong-Hélouvry et al., Automatica 30 (1994)",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [level] = take(parameters);
        Self { level }
    }
}
