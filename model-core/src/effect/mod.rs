//! Interface of a physical effect.
//!
//! Signals flow in physical order: command → jets → transport delay → flow → sensor. An effect acts at one
//! place and leaves the recursion unchanged: it shapes the jet strength before the delay, adds to the drive
//! of the flow, or changes the sensor's reading.

mod card;
mod unit;

pub use card::{
    Amplitude, Facts, Influence, LawCard, Needs, Parameter, Place, RustType, Said, Sign, Spec,
    StartValue, Starts, Turn,
};
pub use unit::Unit;

use crate::real::Real;

/// Setting of an effect on a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting<T> {
    /// Sample period, s.
    pub period: T,
    /// Index of the effect's channel in [`Instant::channels`].
    pub channel: usize,
    /// The reference of that channel, usually its mean, in its own unit; or the
    /// [calibration](Spec::calibrated) reading of a sensor.
    pub reference: T,
}

/// Signals at a sample that every effect can read.
#[derive(Clone, Copy, Debug)]
pub struct Instant<'a, T> {
    /// The command u_k.
    pub command: T,
    /// The friction of the flow, s_k: the base model's y.
    pub flow: T,
    /// The jet strength that drives the flow from this sample to the next; 0
    /// while the jets are being shaped.
    pub arrived: T,
    /// The jet strength at the flow at this instant, j(t_k − h). Differs from [`arrived`](Self::arrived) if
    /// an edge arrives between two samples.
    pub present: T,
    /// Measured channels, in the order of the model's settings.
    pub channels: &'a [T],
}

/// Signals at a sample that a flow effect can read.
#[derive(Clone, Copy, Debug)]
pub struct Flow<T> {
    /// s_k, the present friction.
    pub now: T,
    /// s_{k−1}.
    pub before: T,
    /// s_{k+1} including the flow effects before this one: effects that scale or oppose a motion depend on
    /// it.
    pub next: T,
    /// 1 − Σa − Σc·j of the lags below [`SHORTEST_MEMORY`](crate::recursion::SHORTEST_MEMORY), per sample:
    /// the relaxation rate, which converts a level into a drive.
    pub relaxation: T,
    /// The separated flow's share of `relaxation`: 1 without jets, 0 under full jets.
    pub separated: T,
    /// The separated flow's part of the motion s_{k+1} − s_k.
    pub released: T,
}

impl<T: Real> Flow<T> {
    /// The flow with `drive` added to `next`.
    #[inline]
    #[must_use]
    pub fn driven_by(&self, drive: T) -> Self {
        Self {
            next: self.next + drive,
            released: self.released + self.separated * drive,
            ..*self
        }
    }
}

/// A physical effect prepared for a sample period.
///
/// Parameters and state are separate: the effect is constant, `State` is plain data. Every hook returns its
/// signal unchanged unless the effect acts there.
pub trait Effect<T: Real> {
    /// State of the effect.
    type State: Clone;

    /// The state at rest, at the start of a record.
    fn start(&self) -> Self::State;

    /// Shapes the jet strength; called once per sample, before the delay.
    #[inline]
    fn jet(&self, _state: &mut Self::State, jet: T, _at: &Instant<'_, T>) -> T {
        jet
    }

    /// Whether [`drive`](Self::drive) can be non-zero.
    #[inline]
    fn drives(&self) -> bool {
        false
    }

    /// Contribution to s_{k+1}; called once per sample.
    #[inline]
    fn drive(&self, _state: &mut Self::State, _flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        T::ZERO
    }

    /// Reading for `signal`; called once per sample.
    #[inline]
    fn sense(&self, _state: &mut Self::State, signal: T, _at: &Instant<'_, T>) -> T {
        signal
    }
}

/// An effect with physical parameters, defined in one file of [`effects`](crate::effects).
pub trait Physics<T: Real>: Sized {
    /// The effect's identity card.
    const SPEC: Spec;

    /// Prepares the effect. `parameters` are in the units and the order of
    /// `SPEC.parameters`; missing ones count as 0.
    fn new(parameters: &[T], setting: &Setting<T>) -> Self;
}

/// The first `N` parameters; missing ones are 0.
pub(crate) fn take<T: Real, const N: usize>(parameters: &[T]) -> [T; N] {
    core::array::from_fn(|i| parameters.get(i).copied().unwrap_or(T::ZERO))
}

/// No effect.
impl<T: Real> Effect<T> for () {
    type State = ();
    #[inline]
    fn start(&self) {}
}

/// Two effects, one after the other; nested pairs hold more.
impl<T: Real, A: Effect<T>, B: Effect<T>> Effect<T> for (A, B) {
    type State = (A::State, B::State);

    #[inline]
    fn start(&self) -> Self::State {
        (self.0.start(), self.1.start())
    }
    #[inline]
    fn jet(&self, state: &mut Self::State, jet: T, at: &Instant<'_, T>) -> T {
        let jet = self.0.jet(&mut state.0, jet, at);
        self.1.jet(&mut state.1, jet, at)
    }
    #[inline]
    fn drives(&self) -> bool {
        self.0.drives() || self.1.drives()
    }
    #[inline]
    fn drive(&self, state: &mut Self::State, flow: &Flow<T>, at: &Instant<'_, T>) -> T {
        let first = self.0.drive(&mut state.0, flow, at);
        first + self.1.drive(&mut state.1, &flow.driven_by(first), at)
    }
    #[inline]
    fn sense(&self, state: &mut Self::State, signal: T, at: &Instant<'_, T>) -> T {
        let signal = self.0.sense(&mut state.0, signal, at);
        self.1.sense(&mut state.1, signal, at)
    }
}
