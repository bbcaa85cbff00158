//! A model set up to be played commands.

use crate::model::{Footprint, Model, Prepared};
use crate::simulate::HostState;
use model_core::{Input, Output, Parts, Real, step};

/// Seconds to samples at 1 kHz, rounded up, at least 1.
pub(super) fn samples(seconds: f64) -> u32 {
    (seconds * 1000.0 - 1e-6).ceil().clamp(1.0, 1e7) as u32
}

/// A prepared model with memories that fit it and channels at their references.
pub(super) struct Player<T: Real> {
    pub(super) prepared: Prepared<T>,
    pub(super) channels: Vec<T>,
    memory: Footprint,
}

impl<T: Real> Player<T> {
    pub(super) fn of(model: &Model) -> Self {
        let memory = model.memory();
        Self {
            prepared: model.prepare(),
            channels: memory.references(),
            memory,
        }
    }

    pub(super) fn at_rest(&self) -> HostState<T> {
        self.memory.at_rest(&self.prepared)
    }

    /// One sample of a free run.
    pub(super) fn step(&self, state: &mut HostState<T>, on: bool) -> Output<T> {
        let input = Input {
            command: if on { T::ONE } else { T::ZERO },
            channels: &self.channels,
        };
        step(&self.prepared, state, &input)
    }

    /// The shortest and the longest time from a command to its first arrival,
    /// in samples, over outputs from 0 to `high`.
    pub(super) fn first_arrival(&self, high: f64) -> (u16, u16) {
        use model_core::delay::DelayLaw;
        let law = self.prepared.delay();
        let inputs = self.prepared.recursion().b.len();
        let levels = (0..=400).map(|i| T::from_f64(high * f64::from(i) / 400.0));
        let arrivals = levels.map(|level| {
            let evaluated = law.evaluate(level);
            (0..inputs)
                .map(|l| law.tap(l, evaluated).whole)
                .min()
                .unwrap_or(0)
        });
        let (shortest, longest) =
            arrivals.fold((usize::MAX, 0), |(low, high), h| (low.min(h), high.max(h)));
        let short = |h: usize| u16::try_from(h).unwrap_or(u16::MAX);
        (short(shortest), short(longest))
    }

    /// Samples from a command to half the jet strength: opening, closing.
    pub(super) fn valve(&self) -> (u16, u16) {
        use model_core::delay::DelayLaw;
        use model_core::effect::{Effect, Instant};
        /// Longer than any valve (s ≈ samples/1000).
        const LONGEST: u16 = 1000;
        let (law, effects) = (self.prepared.delay(), self.prepared.effects());
        let (mut run, mut state) = (law.start(), effects.start());
        let mut jet = |command: T| {
            let at = Instant {
                command,
                arrived: T::ZERO,
                present: T::ZERO,
                flow: T::ZERO,
                channels: &self.channels,
            };
            let command = law.command(&mut run, command);
            effects.jet(&mut state, command, &at).value()
        };
        let opening = (0..LONGEST).find(|_| jet(T::ONE) >= 0.5).unwrap_or(LONGEST);
        let open = (0..2 * LONGEST).map(|_| jet(T::ONE)).last().unwrap_or(1.0);
        let closing = (0..LONGEST).find(|_| jet(T::ZERO) <= 0.5 * open);
        (opening, closing.unwrap_or(LONGEST))
    }
}
