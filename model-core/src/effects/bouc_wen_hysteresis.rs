//! A smooth hysteresis loop between displacement and restoring force.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// ż = A·ṡ − β·|ṡ|·z − γ·ṡ·|z|; adds −α·z to the drive. Rate-independent: ṡ enters through the change per
/// sample. Only α·A is identifiable, so A is 1.
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
    #[inline(always)]
    fn drives(&self) -> bool {
        true
    }
    #[inline(always)]
    fn drive(&self, z: &mut T, flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        let change = flow.now - flow.before;
        // The term that closes the loop is implicit in z, so the step is stable for any change.
        let closing = self.beta * change.abs();
        let opening = self.gamma * change;
        *z = (*z + self.stiffness * change - opening * z.abs()) / (T::ONE + closing.abs());
        -(self.alpha * *z * flow.relaxation)
    }
}

/// Only α is reported, because the size of the loop depends on the motion.
fn alpha(parameters: &[f64]) -> (f64, &'static str) {
    let [_, _, _, alpha] = take(parameters);
    (alpha, "(alpha)")
}

impl<T: Real> Physics<T> for BoucWenHysteresis<T> {
    const SPEC: Spec = Spec {
        name: "bouc-wen-hysteresis",
        rust: "bouc_wen_hysteresis::BoucWenHysteresis",
        place: Place::Flow,
        summary: "the restoring force has a smooth hysteresis loop",
        equation: "ż = A·ṡ − β·|ṡ|·z − γ·ṡ·|z|; −α·z is added to the drive",
        parameters: &[
            Parameter::new("stiffness", Unit::None, [1.0, 1.0], &[1.0]),
            Parameter::new("beta", Unit::PerY, [0.01, 1000.0], &[2.0, 10.0]),
            Parameter::new("gamma", Unit::PerY, [-1000.0, 1000.0], &[0.5]),
            Parameter::new("alpha", Unit::None, [-5.0, 5.0], &[0.3]),
        ],
        amplitude: Some(
            Amplitude::new("alpha", "a Bouc–Wen hysteresis")
                .linear()
                .said(alpha),
        ),
        source: "Wen, J. Eng. Mech. Div. 102 (1976)",
        ..Spec::PLAIN
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::prepared;

    /// z along a path of s.
    fn loop_of(path: impl Iterator<Item = f64>) -> std::vec::Vec<f64> {
        let effect: BoucWenHysteresis<f64> = prepared(&[1.0, 2.0, 0.5, -1.0]);
        let (mut z, mut before) = (0.0, 0.0);
        let at = Instant {
            command: 0.0,
            flow: 0.0,
            arrived: 0.0,
            present: 0.0,
            channels: &[],
        };
        let along = path.map(|now| {
            let seen = Flow {
                now,
                before,
                next: now,
                relaxation: 1.0,
                separated: 1.0,
                released: 0.0,
            };
            before = now;
            effect.drive(&mut z, &seen, &at)
        });
        along.collect()
    }

    #[test]
    fn it_begins_elastic_and_ends_at_its_limit() {
        let z = loop_of((1..=100_000).map(|k| f64::from(k) * 1e-4));
        // ż = ṡ for small s, and 0 where A = (β + γ)·z.
        assert!((z[9] - 1e-3).abs() < 1e-5, "{}", z[9]);
        assert!((z[99_999] - 1.0 / 2.5).abs() < 1e-3, "{}", z[99_999]);
    }

    #[test]
    fn the_loop_does_not_depend_on_the_speed() {
        let path = |n: i32| (1..=n).map(move |k| (f64::from(k) / f64::from(n) * 9.0).sin());
        let (fast, slow) = (loop_of(path(20_000)), loop_of(path(40_000)));
        for (fast, slow) in fast.iter().zip(slow.iter().skip(1).step_by(2)) {
            assert!((fast - slow).abs() < 1e-3, "{fast} {slow}");
        }
    }
}
