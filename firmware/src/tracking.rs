//! The tracking law of `model-core` as the loop's law.

use crate::law::{Action, Law};
use model_core::control::{Tracking, TrackingState};
use model_core::history::Memory;
use model_core::model::StateOf;
use model_core::{Effect, Input, Parts, step};

/// The tracking law with its model and a look-ahead memory of `A` samples.
#[derive(Clone)]
pub struct Track<M: Parts<f32>, Y, J, const A: usize> {
    law: Tracking<f32>,
    model: M,
    state: TrackingState<f32, StateOf<f32, M, Y, J>, A>,
    /// Whether the law has been idle: its memory is of another time.
    stale: bool,
}

impl<M, Y, J, const A: usize> Track<M, Y, J, A>
where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
{
    /// The law at rest with the model in `state`.
    pub fn new(law: Tracking<f32>, model: M, state: StateOf<f32, M, Y, J>) -> Self {
        Self {
            state: law.start(state),
            law,
            model,
            stale: false,
        }
    }
}

impl<M, Y, J, const A: usize> Law for Track<M, Y, J, A>
where
    M: Parts<f32>,
    Y: Memory<f32> + Clone,
    J: Memory<f32> + Clone,
    <M::Delay as model_core::delay::DelayLaw<f32>>::State: Clone,
    <M::Effects as Effect<f32>>::State: Clone,
{
    #[inline]
    fn act(&mut self, y: f32) -> Action {
        if self.stale {
            self.stale = false;
            self.state = self.law.start(self.state.model.clone());
        }
        let decision = self.law.step(&self.model, &mut self.state, Some(y), &[]);
        Action {
            open: decision.on,
            predicted: decision.estimate,
            residual: decision.residual,
        }
    }

    #[inline]
    fn idle(&mut self, y: f32) -> Action {
        self.stale = true;
        let input = Input {
            command: 0.0,
            channels: &[],
        };
        let predicted = step(&self.model, &mut self.state.model, &input).measured;
        Action {
            open: false,
            predicted,
            residual: y - predicted,
        }
    }
}
