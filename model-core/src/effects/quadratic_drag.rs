//! Resistance proportional to the square of the rate of change.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// Adds −d·Δ·|Δ| with Δ the present step, s_{k+1} − s_k. This implicit form is stable for any d ≥ 0 and agrees with
/// continuous time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadraticDrag<T> {
    coefficient: T,
}

impl<T: Real> Effect<T> for QuadraticDrag<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn drives(&self) -> bool {
        true
    }
    #[inline(always)]
    fn drive(&self, _state: &mut (), flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        // Solves Δ + d·Δ·|Δ| = Δ₀ for Δ.
        let free = flow.next - flow.now;
        let two = T::ONE + T::ONE;
        let root = (T::ONE + two * two * self.coefficient * free.abs()).sqrt();
        two * free / (T::ONE + root) - free
    }
}

impl<T: Real> Physics<T> for QuadraticDrag<T> {
    const SPEC: Spec = Spec {
        name: "quadratic-drag",
        rust: "quadratic_drag::QuadraticDrag",
        place: Place::Flow,
        summary: "the resistance of the flow grows with the square of its rate of change",
        equation: "−d·(s_{k+1} − s_k)·|s_{k+1} − s_k| is added",
        parameters: &[
            Parameter::new("coefficient", Unit::SamplesPerY, [-1000.0, 1000.0], &[1.0]).positive(),
        ],
        amplitude: Some(Amplitude::new("coefficient", "quadratic drag")),
        resists: true,
        source: "Morison et al. (1950)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [coefficient] = take(parameters);
        Self { coefficient }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{flow, prepared};

    #[test]
    fn it_slows_the_way_and_leaves_the_end() {
        for coefficient in [0.0, 30.0, 1000.0] {
            let drag: QuadraticDrag<f64> = prepared(&[coefficient]);
            let s = flow(&drag, |_| 0.8);
            let mut before = 0.0;
            for s in &s {
                let (step, free): (f64, f64) = (s - before, 0.02 * (0.8 - before));
                assert!((step + coefficient * step * step.abs() - free).abs() < 1e-9);
                before = *s;
            }
            assert!((s[1999] - 0.8).abs() < 1e-3);
        }
    }
}
