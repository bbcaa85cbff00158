//! A model as the plant: the behaviour of a law without model errors.

use crate::run::Controlled;
use model_core::history::Memory;
use model_core::model::StateOf;
use model_core::{Input, Parts, Real, step};

/// A model of `model-core` as the plant.
pub struct ModelFlow<'a, T: Real, M: Parts<T>, Y, J> {
    model: &'a M,
    state: StateOf<T, M, Y, J>,
    channels: Vec<T>,
    sample_period_s: f64,
}

impl<T: Real, M: Parts<T>, Y, J> Clone for ModelFlow<'_, T, M, Y, J>
where
    StateOf<T, M, Y, J>: Clone,
{
    fn clone(&self) -> Self {
        Self {
            model: self.model,
            state: self.state.clone(),
            channels: self.channels.clone(),
            sample_period_s: self.sample_period_s,
        }
    }
}

impl<'a, T: Real, M: Parts<T>, Y: Memory<T>, J: Memory<T>> ModelFlow<'a, T, M, Y, J> {
    /// The model at rest, its channels constant at `channels`, one sample every `sample_period_s`.
    pub fn new(
        model: &'a M,
        at_rest: StateOf<T, M, Y, J>,
        channels: Vec<T>,
        sample_period_s: f64,
    ) -> Self {
        Self {
            model,
            state: at_rest,
            channels,
            sample_period_s,
        }
    }
}

impl<T: Real, M: Parts<T>, Y: Memory<T>, J: Memory<T>> Controlled for ModelFlow<'_, T, M, Y, J> {
    fn sample_period_s(&self) -> f64 {
        self.sample_period_s
    }
    /// The reading is that of the next sample, in which the command has acted. The contribution of the
    /// sensor effects is that of the present sample.
    fn step(&mut self, command: bool) -> Option<f64> {
        let input = Input {
            command: if command { T::ONE } else { T::ZERO },
            channels: &self.channels,
        };
        let output = step(self.model, &mut self.state, &input);
        let shown = output.measured.value() - output.flow.value();
        Some(output.next.value() + shown)
    }
    fn friction(&self) -> f64 {
        self.state.outputs.back(0).value()
    }
}
