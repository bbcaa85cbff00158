//! The pulses of the maximising law as a law of the loop: independent of the sensor, with the model as
//! observer.

use crate::law::Designed;
use model_core::Parts;
use model_core::control::golden::GoldenLaw;
use model_core::control::pulses::{Played, Pulses};
use model_core::history::Memory;
use model_core::model::StateOf;

impl<M, Y, J, P, const A: usize> Designed<M, Y, J, A> for Pulses<P>
where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
    P: AsRef<[(u32, u32)]> + Clone,
{
    type State = Played;

    fn start(&self, _model: &StateOf<f32, M, Y, J>) -> Played {
        Played::new()
    }

    #[inline]
    fn act(
        &self,
        state: &mut Played,
        _model: &M,
        _alone: &StateOf<f32, M, Y, J>,
        _y: f32,
        _channels: &[f32],
    ) -> bool {
        self.step(state)
    }

    #[inline]
    fn idle(&self, state: &mut Played) {
        state.shut();
    }

    fn reference(&self, _state: &Played) -> f32 {
        f32::NAN
    }

    fn holds(
        &self,
        golden: &GoldenLaw,
        _model: &M,
        _state: StateOf<f32, M, Y, J>,
        _channels: &[f32],
    ) -> bool {
        golden.holds_for_pulses(self)
    }
}
