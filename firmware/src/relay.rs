//! A relay, for commissioning a rig and for models without a law.

use crate::law::Designed;
use model_core::Parts;
use model_core::control::golden::GoldenLaw;
use model_core::control::{Hold, HoldTimes};
use model_core::history::Memory;
use model_core::model::StateOf;

/// A relay with hysteresis and hold times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relay {
    /// The valve opens below this level, y.
    pub opens_below: f32,
    /// The valve closes above this level, y.
    pub shuts_above: f32,
    /// Shortest times, samples.
    pub hold: HoldTimes,
}

impl<M: Parts<f32>, Y: Memory<f32>, J: Memory<f32>, const A: usize> Designed<M, Y, J, A> for Relay {
    type State = Hold;

    fn start(&self, _model: &StateOf<f32, M, Y, J>) -> Hold {
        Hold::closed()
    }

    #[inline]
    fn act(
        &self,
        hold: &mut Hold,
        _model: &M,
        _alone: &StateOf<f32, M, Y, J>,
        y: f32,
        _channels: &[f32],
    ) -> bool {
        let wanted = if hold.is_on() {
            y <= self.shuts_above
        } else {
            y < self.opens_below
        };
        hold.pass(&self.hold, wanted)
    }

    #[inline]
    fn idle(&self, hold: &mut Hold) {
        hold.shut();
    }

    /// The middle of the relay's two thresholds.
    fn reference(&self, _hold: &Hold) -> f32 {
        0.5 * (self.opens_below + self.shuts_above)
    }

    /// The relay has no constants to check, because it is not generated.
    fn holds(
        &self,
        _golden: &GoldenLaw,
        _model: &M,
        _state: StateOf<f32, M, Y, J>,
        _channels: &[f32],
    ) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Driven, Law, driven};
    use identified::full;
    use model_core::average::MovingAverage;

    #[test]
    fn hold_times_are_kept_under_any_reading() {
        let relay = Relay {
            opens_below: 0.45,
            shuts_above: 0.55,
            hold: HoldTimes { on: 15, off: 10 },
        };
        let model = full::model();
        let mut relay: driven!(Relay, full) =
            Driven::new(relay, model, full::state(&model), MovingAverage::new());
        let mut seed = 7_u32;
        let (mut open, mut held, mut switches) = (false, u32::MAX, 0);
        for _ in 0..20_000 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let action = relay.act((seed >> 8) as f32 / (1 << 24) as f32, &[]);
            if action.open == open {
                held = held.saturating_add(1);
            } else {
                assert!(held >= if open { 15 } else { 10 }, "{held}");
                (open, held, switches) = (action.open, 1, switches + 1);
            }
        }
        assert!(switches > 500);
    }
}
