//! Coulomb friction: a force against the motion, whatever its speed.

use crate::effect::{Effect, Flow, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
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
        place: Place::Flow,
        summary: "Coulomb friction acts against the motion",
        equation: "adds −F·sign(s_k − s_{k−1})",
        parameters: &[
            Parameter { name: "level", unit: "y per sample", low: 0.0, high: 1.0, starts: &[0.001, 0.03, 0.3], influence: Influence::Smooth },
        ],
        channel: None,
        source: "Coulomb friction; Armstrong-Hélouvry et al., Automatica 30 (1994)",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [level] = take(parameters);
        Self { level }
    }
}
