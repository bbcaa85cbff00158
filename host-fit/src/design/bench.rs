//! A model prepared for simulating commands.

use crate::model::{Footprint, Model, Prepared};
use crate::simulate::HostState;
use closed_loop::span;
use model_core::control::HoldTimes;
use model_core::control::period::samples_at_least;
use model_core::{Input, Output, Parts, Real, step};

/// A valve's shortest times in samples of `period_s`: rounded up, and at least 1.
pub(super) fn hold_times(on_s: f64, off_s: f64, period_s: f64) -> HoldTimes {
    HoldTimes {
        on: samples_at_least(on_s, period_s),
        off: samples_at_least(off_s, period_s),
    }
}

/// A prepared model with its delay memories and channels at their references.
pub(super) struct Player<T: Real> {
    pub(super) prepared: Prepared<T>,
    pub(super) channels: Vec<T>,
    /// Sample period, s.
    pub(super) period_s: f64,
    memory: Footprint,
}

impl<T: Real> Player<T> {
    pub(super) fn of(model: &Model) -> Self {
        let memory = model.memory();
        Self {
            prepared: model.prepare(),
            channels: memory.references(),
            period_s: model.sample_period_s,
            memory,
        }
    }

    pub(super) fn at_rest(&self) -> HostState<T> {
        self.memory.at_rest(&self.prepared)
    }

    /// Length of a run of `samples` samples at the bench's period, see [`span`].
    pub(super) fn span(&self, samples: usize) -> usize {
        span(samples, self.period_s)
    }

    /// One sample of a free run.
    pub(super) fn step(&self, state: &mut HostState<T>, on: bool) -> Output<T> {
        let input = Input {
            command: if on { T::ONE } else { T::ZERO },
            channels: &self.channels,
        };
        step(&self.prepared, state, &input)
    }

    /// The shortest and the longest time from a command to its first arrival, samples, for outputs from 0 to
    /// `high`.
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
        /// Upper limit of a valve's response time, samples.
        const LONGEST: usize = 1000;
        let most = u16::try_from(span(LONGEST, self.period_s)).unwrap_or(u16::MAX);
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
        let opening = (0..most).find(|_| jet(T::ONE) >= 0.5).unwrap_or(most);
        let open = (0..2 * u32::from(most)).map(|_| jet(T::ONE)).last();
        let open = open.unwrap_or(1.0);
        let closing = (0..most).find(|_| jet(T::ZERO) <= 0.5 * open);
        (opening, closing.unwrap_or(most))
    }
}
