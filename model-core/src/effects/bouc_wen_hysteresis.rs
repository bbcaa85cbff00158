//! A smooth hysteresis loop between displacement and restoring force.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Needs, Parameter, Physics, Place, RustType, Setting, Spec,
    Starts, Unit, take,
};
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

/// α stands for itself: the share of what it multiplies depends on the loop.
fn alpha(parameters: &[f64]) -> (f64, &'static str) {
    let [_, _, _, alpha] = take(parameters);
    (alpha, "(alpha)")
}

impl<T: Real> Physics<T> for BoucWenHysteresis<T> {
    const SPEC: Spec = Spec {
        name: "bouc-wen-hysteresis",
        rust: "bouc_wen_hysteresis::BoucWenHysteresis",
        rust_type: RustType::Numbers,
        place: Place::Flow,
        summary: "a smooth hysteresis loop in the restoring force",
        equation: "ż = A·ṡ − β·|ṡ|·z − γ·ṡ·|z|; adds −α·z",
        parameters: &[
            Parameter::new("stiffness", Unit::None, [1.0, 1.0], &[1.0]),
            Parameter::new("beta", Unit::PerY, [0.01, 1000.0], &[2.0, 10.0]),
            Parameter::new("gamma", Unit::PerY, [-1000.0, 1000.0], &[0.5]),
            Parameter::new("alpha", Unit::None, [-5.0, 5.0], &[0.3]),
        ],
        starts: Starts::Grid,
        amplitude: Some(
            Amplitude::new("alpha", "a Bouc–Wen hysteresis")
                .linear()
                .said(alpha),
        ),
        channel: None,
        needs: Needs::Nothing,
        law: None,
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
