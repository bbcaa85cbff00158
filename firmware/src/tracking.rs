//! The tracking law of `model-core` as the loop's law.

use crate::law::{Change, Designed, Unchanged};
use model_core::Parts;
use model_core::control::golden::GoldenLaw;
use model_core::control::{Tracking, TrackingState};
use model_core::history::Memory;
use model_core::model::StateOf;
use wire::reply::{NO_LIMIT, Settings};

/// State of the law.
#[derive(Clone)]
pub struct Tracked<S, const A: usize> {
    law: TrackingState<f32, S, A>,
    /// Whether the law has been idle, so that its state is outdated.
    stale: bool,
}

impl<M: Parts<f32>, Y: Memory<f32>, J: Memory<f32>, const A: usize> Designed<M, Y, J, A>
    for Tracking<f32>
{
    type State = Tracked<StateOf<f32, M, Y, J>, A>;

    fn start(&self, model: &StateOf<f32, M, Y, J>) -> Self::State {
        Tracked {
            law: Tracking::start(self, model.clone()),
            stale: false,
        }
    }

    #[inline]
    fn act(
        &self,
        state: &mut Self::State,
        model: &M,
        alone: &StateOf<f32, M, Y, J>,
        y: f32,
        channels: &[f32],
    ) -> bool {
        if state.stale {
            state.stale = false;
            state.law = Tracking::start(self, alone.clone());
        }
        self.step(model, &mut state.law, Some(y), channels).on
    }

    #[inline]
    fn idle(&self, state: &mut Self::State) {
        state.stale = true;
    }

    #[inline]
    fn reference(&self, state: &Self::State) -> f32 {
        if state.stale {
            self.reference
        } else {
            state.law.reference()
        }
    }

    fn settings(&self) -> Settings {
        Settings {
            target: self.reference,
            reachable: [self.reachable.low, self.reachable.high],
            slope: self.slope,
            air: self
                .budget
                .air
                .map_or(NO_LIMIT, |air| air.per_mille.min(NO_LIMIT.into()) as u16),
        }
    }

    fn change(&mut self, state: &mut Self::State, change: Change) -> Result<(), Unchanged> {
        match change {
            // The ramp to a target must end before another target is accepted.
            Change::Target(target) if self.reachable.check(target).is_ok() => {
                let now = Designed::<M, Y, J, A>::reference(self, state);
                if now != self.reference {
                    return Err(Unchanged::Pending);
                }
                self.set_reference(target).map_err(|_| Unchanged::Outside)
            }
            Change::Target(_) => Err(Unchanged::Outside),
            Change::Air(per_mille) => self
                .set_air(per_mille.into())
                .map_err(|_| Unchanged::Outside),
        }
    }

    fn holds(
        &self,
        golden: &GoldenLaw,
        model: &M,
        state: StateOf<f32, M, Y, J>,
        channels: &[f32],
    ) -> bool {
        golden.holds::<M, Y, J, A>(self, model, state, channels)
    }
}
