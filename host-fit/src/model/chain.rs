//! The effects of a model, composed at run time from the catalogue and the user's own.

use super::{Added, Model};
use crate::user_effect::{UserEffect, UserState};
use model_core::Real;
use model_core::effect::{Effect, Flow, Instant, Setting};
use model_core::effects::{AnyEffect, AnyState};

/// An effect of the catalogue or a user's own.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "a handful per model")]
pub enum HostEffect<T: Real> {
    /// From `model_core::effects`.
    Catalogue(AnyEffect<T>),
    /// From an effect file.
    User(UserEffect<T>),
}

/// The state of a [`HostEffect`].
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "a handful per model")]
pub enum HostState<T: Real> {
    /// Of an effect of the catalogue.
    Catalogue(AnyState<T>),
    /// Of a user's effect.
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
}

impl<T: Real> Effect<T> for HostEffect<T> {
    type State = HostState<T>;
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
    fn drives(&self) -> bool {
        match self {
            Self::Catalogue(effect) => effect.drives(),
            Self::User(effect) => effect.drives(),
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

/// Effects applied one after the other.
#[derive(Clone, Debug)]
pub struct Chain<T: Real> {
    effects: Vec<HostEffect<T>>,
    drives: bool,
}

impl<T: Real> Chain<T> {
    pub(super) fn new(effects: Vec<HostEffect<T>>) -> Self {
        Self {
            drives: effects.iter().any(Effect::drives),
            effects,
        }
    }
}

impl<T: Real> Effect<T> for Chain<T> {
    type State = Vec<HostState<T>>;
    fn start(&self) -> Self::State {
        self.effects.iter().map(Effect::start).collect()
    }
    #[inline(always)]
    fn jet(&self, states: &mut Self::State, mut jet: T, at: &Instant<'_, T>) -> T {
        for (effect, state) in self.effects.iter().zip(states) {
            jet = effect.jet(state, jet, at);
        }
        jet
    }
    #[inline(always)]
    fn drives(&self) -> bool {
        self.drives
    }
    #[inline(always)]
    fn drive(&self, states: &mut Self::State, flow: &Flow<T>, at: &Instant<'_, T>) -> T {
        let mut sum = T::ZERO;
        for (effect, state) in self.effects.iter().zip(states) {
            if effect.drives() {
                sum = sum + effect.drive(state, &flow.driven_by(sum), at);
            }
        }
        sum
    }
    #[inline(always)]
    fn sense(&self, states: &mut Self::State, mut signal: T, at: &Instant<'_, T>) -> T {
        for (effect, state) in self.effects.iter().zip(states) {
            signal = effect.sense(state, signal, at);
        }
        signal
    }
}
