//! The law of `model-core` as a controller, in the board's number type.

use crate::run::Controller;
use model_core::control::{Decision, Tracking, TrackingState};
use model_core::effect::Effect;
use model_core::history::Memory;
use model_core::model::StateOf;
use model_core::{Parts, Real};

/// Look-ahead memory of a simulated law, samples.
pub const AHEAD: usize = 640;

/// A tracking law with its state.
pub struct TrackingController<'a, T: Real, M: Parts<T>, Y, J> {
    model: &'a M,
    tracking: Tracking<T>,
    state: TrackingState<T, StateOf<T, M, Y, J>, AHEAD>,
    channels: Vec<T>,
    decision: Option<Decision<T>>,
}

impl<'a, T, M, Y, J> TrackingController<'a, T, M, Y, J>
where
    T: Real,
    M: Parts<T>,
    Y: Memory<T>,
    J: Memory<T>,
{
    /// The law on `model` from rest; channels that effects need are held at
    /// `channels`.
    pub fn new(
        model: &'a M,
        tracking: Tracking<T>,
        at_rest: StateOf<T, M, Y, J>,
        channels: Vec<T>,
    ) -> Self {
        Self {
            model,
            tracking,
            state: tracking.start(at_rest),
            channels,
            decision: None,
        }
    }

    /// The last decision.
    pub fn decision(&self) -> Option<&Decision<T>> {
        self.decision.as_ref()
    }
}

impl<T, M, Y, J> Controller for TrackingController<'_, T, M, Y, J>
where
    T: Real,
    M: Parts<T>,
    Y: Memory<T>,
    J: Memory<T>,
    <M::Effects as Effect<T>>::State: Clone,
{
    /// An unreachable reference is rejected, and the previous one stays.
    fn set_reference(&mut self, reference: f64) {
        let _ = self.tracking.set_reference(T::from_f64(reference));
    }
    fn command(&mut self, reading: Option<f64>) -> bool {
        let decision = self.tracking.step(
            self.model,
            &mut self.state,
            reading.map(T::from_f64),
            &self.channels,
        );
        self.decision = Some(decision);
        decision.on
    }
}
