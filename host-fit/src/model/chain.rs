//! The effects of a model, composed at run time from the catalogue and the user's own effects.

use super::{Added, Model};
use crate::ring::Ring;
use crate::user_effect::{UserEffect, UserState};
use model_core::effect::{Effect, Flow, Instant, Place, Setting};
use model_core::effects::{AnyEffect, AnyState};
use model_core::{Real, pairs};

/// An effect of the catalogue or a user's own.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "a model has few effects")]
pub enum HostEffect<T: Real> {
    /// An effect of the catalogue, `model_core::effects`.
    Catalogue(AnyEffect<T, Ring<T>>),
    /// An effect from an effect file.
    User(UserEffect<T>),
}

/// The state of a [`HostEffect`].
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "a model has few effects")]
pub enum HostState<T: Real> {
    /// State of an effect of the catalogue.
    Catalogue(AnyState<T, Ring<T>>),
    /// State of a user's effect.
    User(UserState<T>),
}

impl<T: Real> HostEffect<T> {
    /// Prepares an effect of `model`; `None` if neither the catalogue nor the model's definitions contain it.
    #[must_use]
    pub fn new(
        model: &Model,
        added: &Added,
        parameters: &[T],
        setting: &Setting<T>,
    ) -> Option<Self> {
        if let Some(definition) = model.definition(&added.name) {
            let effect = UserEffect::new(definition, parameters, setting);
            return Some(Self::User(effect));
        }
        AnyEffect::new(&added.name, parameters, setting).map(Self::Catalogue)
    }

    fn place(&self) -> Place {
        match self {
            Self::Catalogue(effect) => effect.place(),
            Self::User(effect) => effect.place(),
        }
    }
    fn start(&self) -> HostState<T> {
        match self {
            Self::Catalogue(effect) => HostState::Catalogue(effect.start()),
            Self::User(effect) => HostState::User(effect.start()),
        }
    }
    #[inline(always)]
    fn jet(&self, state: &mut HostState<T>, jet: T, at: &Instant<'_, T>) -> T {
        match (self, state) {
            (Self::Catalogue(effect), HostState::Catalogue(state)) => effect.jet(state, jet, at),
            (Self::User(effect), HostState::User(state)) => effect.jet(state, jet, at),
            _ => jet,
        }
    }
    #[inline(always)]
    fn drive(&self, state: &mut HostState<T>, flow: &Flow<T>, at: &Instant<'_, T>) -> T {
        match (self, state) {
            (Self::Catalogue(effect), HostState::Catalogue(state)) => effect.drive(state, flow, at),
            (Self::User(effect), HostState::User(state)) => effect.drive(state, flow, at),
            _ => T::ZERO,
        }
    }
    #[inline(always)]
    fn sense(&self, state: &mut HostState<T>, signal: T, at: &Instant<'_, T>) -> T {
        match (self, state) {
            (Self::Catalogue(effect), HostState::Catalogue(state)) => {
                effect.sense(state, signal, at)
            }
            (Self::User(effect), HostState::User(state)) => effect.sense(state, signal, at),
            _ => signal,
        }
    }
}

/// Effects applied one after the other, each at its place only: a sample then calls every effect once.
#[derive(Clone, Debug)]
pub struct Chain<T: Real> {
    jet: Vec<HostEffect<T>>,
    flow: Vec<HostEffect<T>>,
    sensor: Vec<HostEffect<T>>,
}

/// The states of a [`Chain`].
#[derive(Clone, Debug)]
pub struct ChainState<T: Real> {
    jet: Vec<HostState<T>>,
    flow: Vec<HostState<T>>,
    sensor: Vec<HostState<T>>,
}

impl<T: Real> Chain<T> {
    pub(super) fn new(effects: Vec<HostEffect<T>>) -> Self {
        let (mut jet, mut flow, mut sensor) = (Vec::new(), Vec::new(), Vec::new());
        for effect in effects {
            match effect.place() {
                Place::Jet => jet.push(effect),
                Place::Flow => flow.push(effect),
                Place::Sensor => sensor.push(effect),
                // A delay law is not part of the chain.
                Place::Delay => {}
            }
        }
        Self { jet, flow, sensor }
    }
}

impl<T: Real> Effect<T> for Chain<T> {
    type State = ChainState<T>;
    fn start(&self) -> ChainState<T> {
        let start = |effects: &[HostEffect<T>]| effects.iter().map(HostEffect::start).collect();
        ChainState {
            jet: start(&self.jet),
            flow: start(&self.flow),
            sensor: start(&self.sensor),
        }
    }
    #[inline(always)]
    fn jet(&self, states: &mut ChainState<T>, mut jet: T, at: &Instant<'_, T>) -> T {
        for (effect, state) in pairs(&self.jet, &mut states.jet) {
            jet = effect.jet(state, jet, at);
        }
        jet
    }
    #[inline(always)]
    fn drives(&self) -> bool {
        !self.flow.is_empty()
    }
    #[inline(always)]
    fn drive(&self, states: &mut ChainState<T>, flow: &Flow<T>, at: &Instant<'_, T>) -> T {
        let mut all = pairs(&self.flow, &mut states.flow);
        let Some((first, state)) = all.next() else {
            return T::ZERO;
        };
        let mut sum = first.drive(state, flow, at);
        for (effect, state) in all {
            sum = sum + effect.drive(state, &flow.driven_by(sum), at);
        }
        sum
    }
    #[inline(always)]
    fn sense(&self, states: &mut ChainState<T>, mut signal: T, at: &Instant<'_, T>) -> T {
        for (effect, state) in pairs(&self.sensor, &mut states.sensor) {
            signal = effect.sense(state, signal, at);
        }
        signal
    }
}
