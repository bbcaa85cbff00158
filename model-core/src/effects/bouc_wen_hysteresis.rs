//! A smooth hysteresis loop between displacement and restoring force.

use crate::effect::{Effect, Flow, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
use crate::real::Real;


/// ż = A·ṡ − β·|ṡ|·z − γ·ṡ·|z|; adds −α·z to the drive. Rate-independent,
/// so ṡ enters through the change over a sample. Only α·A can be told from data:
/// A is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoucWenHysteresis<T> {
    stiffness: T,
    beta: T,
    gamma: T,
    alpha: T,
}

impl<T: Real> Effect<T> for BoucWenHysteresis<T> {
    /// z, the hysteretic part.
    type State = T;
    fn start(&self) -> T {
        T::ZERO
    }
    #[inline]
    fn drives(&self) -> bool {
        true
    }
    #[inline]
    fn drive(&self, z: &mut T, flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        let change = flow.now - flow.before;
        // Implicit in z where the loop closes: stable for any change.
        let closing = self.beta * change.abs();
        let opening = self.gamma * change;
        *z = (*z + self.stiffness * change - opening * z.abs()) / (T::ONE + closing.abs());
        -(self.alpha * *z * flow.relaxation)
    }
}

impl<T: Real> Physics<T> for BoucWenHysteresis<T> {
    const SPEC: Spec = Spec {
        name: "bouc-wen-hysteresis",
        rust: "bouc_wen_hysteresis::BoucWenHysteresis",
        place: Place::Flow,
        summary: "a smooth hysteresis loop in the restoring force",
        equation: "ż = A·ṡ − β·|ṡ|·z − γ·ṡ·|z|; adds −α·z",
        parameters: &[
            Parameter { name: "stiffness", unit: "-", low: 1.0, high: 1.0, starts: &[1.0], influence: Influence::Smooth },
            Parameter { name: "beta", unit: "1/y", low: 0.01, high: 1000.0, starts: &[2.0, 10.0], influence: Influence::Smooth },
            Parameter { name: "gamma", unit: "1/y", low: -1000.0, high: 1000.0, starts: &[0.5], influence: Influence::Smooth },
            Parameter { name: "alpha", unit: "-", low: -5.0, high: 5.0, starts: &[0.3], influence: Influence::Smooth },
        ],
        channel: None,
        source: "Wen, J. Eng. Mech. Div. 102 (1976)",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [stiffness, beta, gamma, alpha] = take(parameters);
        Self {
            stiffness,
            beta,
            gamma,
            alpha,
        }
    }
}
