//! The tracking law of `model-core` as the loop's law.

use crate::law::{Action, Law};
use model_core::control::{Tracking, TrackingState};
use model_core::history::Memory;
use model_core::model::StateOf;
use model_core::{Input, Parts, step};

/// The tracking law with its model and a look-ahead memory of `A` samples.
#[derive(Clone)]
pub struct Track<M: Parts<f32>, Y, J, const A: usize> {
    law: Tracking<f32>,
    model: M,
    state: TrackingState<f32, StateOf<f32, M, Y, J>, A>,
    /// The model left to itself. The law's own follows the sensor, also one that
    /// is ill.
    alone: StateOf<f32, M, Y, J>,
    /// Whether the law has been idle: its memory is of another time.
    stale: bool,
}

impl<M, Y, J, const A: usize> Track<M, Y, J, A>
where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
    StateOf<f32, M, Y, J>: Clone,
{
    /// The law at rest with the model in `state`.
    pub fn new(law: Tracking<f32>, model: M, state: StateOf<f32, M, Y, J>) -> Self {
        Self {
            state: law.start(state.clone()),
            law,
            model,
            alone: state,
            stale: false,
        }
    }

    /// What the model by itself says of a sample, and how far `y` is from it.
    #[inline]
    fn issue(&mut self, open: bool, y: f32) -> Action {
        let input = Input {
            command: if open { 1.0 } else { 0.0 },
            channels: &[],
        };
        let predicted = step(&self.model, &mut self.alone, &input).measured;
        Action {
            open,
            predicted,
            residual: y - predicted,
        }
    }
}

impl<M, Y, J, const A: usize> Law for Track<M, Y, J, A>
where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
    StateOf<f32, M, Y, J>: Clone,
{
    #[inline]
    fn act(&mut self, y: f32) -> Action {
        if self.stale {
            self.stale = false;
            self.state = self.law.start(self.alone.clone());
        }
        let decision = self.law.step(&self.model, &mut self.state, Some(y), &[]);
        self.issue(decision.on, y)
    }

    #[inline]
    fn idle(&mut self, y: f32) -> Action {
        self.stale = true;
        self.issue(false, y)
    }
}
