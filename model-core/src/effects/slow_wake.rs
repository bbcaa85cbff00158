//! A slow state of the wake follows the flow and reduces its level.
//!
//! This is not a missing effect but a memory of the flow itself. It belongs to the base model, so that other
//! effects do not imitate it.

use crate::effect::{
    Amplitude, Effect, Flow, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// T·ẇ = s − w; the level that the flow tends to is lower by g·w. Exact for a flow that is constant over the
/// sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlowWake<T> {
    kept: T,
    pull: T,
}

impl<T: Real> Effect<T> for SlowWake<T> {
    type State = T;
    fn start(&self) -> T {
        T::ZERO
    }
    #[inline(always)]
    fn drives(&self) -> bool {
        true
    }
    #[inline(always)]
    fn drive(&self, wake: &mut T, flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        let drive = -(self.pull * *wake * flow.relaxation);
        *wake = flow.now + self.kept * (*wake - flow.now);
        drive
    }
}

impl<T: Real> Physics<T> for SlowWake<T> {
    const SPEC: Spec = Spec {
        name: "slow-wake",
        rust: "slow_wake::SlowWake",
        place: Place::Flow,
        summary: "a slow state of the wake follows the flow and reduces its level",
        equation: "T·ẇ = s − w; g·w is subtracted from the level that the flow tends to",
        parameters: &[
            Parameter::new("time_constant", Unit::Second, [0.05, 3.0], &[0.1, 0.3, 1.0]),
            Parameter::new("pull", Unit::None, [-0.9, 3.0], &[0.2]),
        ],
        amplitude: Some(Amplitude::new("pull", "a slow wake")),
        base: true,
        source: "a memory that fades exponentially; delayed terms of eq. (4) approximate it",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [time, pull] = take(parameters);
        Self {
            kept: (-setting.period / time).exp(),
            pull,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{flow, prepared};

    #[test]
    fn the_flow_overshoots_and_ends_where_the_wake_lets_it() {
        let wake: SlowWake<f64> = prepared(&[0.3, 0.25]);
        let s = flow(&wake, |_| 0.8);
        let highest = s.iter().copied().fold(0.0, f64::max);
        assert!(highest > 0.7, "{highest}");
        assert!((s[1999] - 0.8 / 1.25).abs() < 1e-2, "{}", s[1999]);
    }

    #[test]
    fn without_pull_the_flow_is_what_it_was() {
        let plain: SlowWake<f64> = prepared(&[0.3, 0.0]);
        let s = flow(&plain, |_| 0.8);
        assert!((s[1999] - 0.8).abs() < 1e-9);
        assert!(
            crate::effects::SPECS
                .iter()
                .all(|spec| spec.name != "slow-wake")
        );
    }
}
