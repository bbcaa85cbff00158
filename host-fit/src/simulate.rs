//! Free runs and one-step predictions of a model over recorded signals.

use crate::data::Record;
use crate::model::{Delay, Footprint, Model, Prepared, Rounding, Start};
use crate::ring::Ring;
use crate::rules;
use model_core::effect::Spec;
use model_core::effects::{LAGGING_DRIVE, SLOW_WAKE};
use model_core::history::{Memory as _, Reaching as _};
use model_core::model::{StateOf, observe};
use model_core::{Input, Output, Parts, Real, State, pairs};
use std::borrow::Cow;
use std::ops::ControlFlow;
use thiserror::Error;

rules! {
    /// When a free run counts as diverged.
    pub struct Rules in "simulate";

    /// A flow beyond this has diverged.
    diverged: f64 = 1e3, "times the largest |y|", "judgement: far above any oscillation of a stable run";
}

/// Memory for a delay law that a search varies, samples.
const ROOM: usize = 1020;

/// Why a free run failed.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SimulateError {
    /// An effect needs a channel that the record lacks.
    #[error(
        "record `{record}` has no channel `{channel}`, which the model's effects need. \
         Add the column `{channel}` to the record's CSV file, or use a model without that effect."
    )]
    MissingChannel {
        /// The record.
        record: String,
        /// The channel.
        channel: String,
    },
    /// The model is unstable on this input.
    #[error(
        "the model's free run of record `{record}` diverges at sample {sample}. \
         The model is unstable for this input; identify it again, with fewer lags or `--objective free-run`."
    )]
    Diverged {
        /// The record.
        record: String,
        /// First sample beyond the divergence limit, from 0.
        sample: usize,
    },
}

/// The input signals of a model, from their first sample on.
#[derive(Clone, Debug)]
pub struct Signals<'a> {
    /// The command, as fraction of a full jet.
    pub u: Cow<'a, [f64]>,
    /// The measured output, if available.
    pub y: Option<&'a [f64]>,
    /// The channels in the order of [`Model::channels`].
    pub channels: Vec<&'a [f64]>,
    /// The command before the first sample, as fraction of a full jet. None: 0 for a model that starts from
    /// rest, the first value otherwise.
    pub u_before: Option<f64>,
    /// y before the first sample. If it is unknown, the first value is used.
    pub y_before: Option<f64>,
    /// y of the first samples, which the run follows.
    pub followed: &'a [f64],
}

impl<'a> Signals<'a> {
    /// The signals of `record` that `model` needs.
    ///
    /// # Errors
    /// [`SimulateError::MissingChannel`].
    pub fn of(model: &Model, record: &'a Record) -> Result<Self, SimulateError> {
        let channels = model.channels().into_iter().map(|channel| {
            let found = record.channels.get(&channel).map(Vec::as_slice);
            found.ok_or_else(|| SimulateError::MissingChannel {
                record: record.name.clone(),
                channel,
            })
        });
        Ok(Self {
            y: Some(&record.y),
            channels: channels.collect::<Result<_, _>>()?,
            u_before: record.u_before.map(|u| model.command.share(u)),
            y_before: record.y_before,
            followed: &record.followed,
            ..Self::commanded(model, &record.u)
        })
    }

    /// A command `u` in the unit of the model's records, without channels or measurements.
    #[must_use]
    pub fn commanded(model: &Model, u: &'a [f64]) -> Self {
        let u = if model.command.is_unit() {
            Cow::Borrowed(u)
        } else {
            u.iter().map(|u| model.command.share(*u)).collect()
        };
        Self {
            u,
            y: None,
            channels: Vec::new(),
            u_before: None,
            y_before: None,
            followed: &[],
        }
    }

    /// Scale of the divergence limit: the range of the measured output and its distance from 0. Without a
    /// measurement, or if the scale would be 0, it is `usual`.
    fn scale(&self, usual: f64) -> f64 {
        let largest = |y: &[f64]| y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
        let measured = self.y.map(largest).filter(|most| *most > 0.0);
        measured.unwrap_or(usual)
    }
}

/// The state of a model on the host.
pub type HostState<T> = StateOf<T, Prepared<T>, Ring<T>, Ring<T>>;

impl Footprint {
    /// The state of `prepared` at rest, with memories of the required length.
    #[must_use]
    pub fn at_rest<T: Real>(&self, prepared: &Prepared<T>) -> HostState<T> {
        let (outputs, jets) = (Ring::reaching(self.outputs), Ring::reaching(self.jets));
        State::at_rest(prepared, outputs, jets)
    }
}

/// A model prepared for running over records, with numbers of type `T`.
#[derive(Clone, Debug)]
pub struct Simulator<T: Real> {
    prepared: Prepared<T>,
    start: Start,
    memory: Footprint,
    /// The largest |y| of the training records; 1 if unknown.
    usual: f64,
    /// Samples after which a slow wake and a lagging drive have settled.
    fades: usize,
    /// The sensor's offset: the reading is the flow plus the offset.
    zero: T,
}

impl<T: Real> Simulator<T> {
    /// A simulator of `model` with other parameter `values` (see
    /// [`Model::coordinates`]).
    #[must_use]
    pub fn with_values(model: &Model, values: &[T], rounding: Rounding) -> Self {
        Self {
            prepared: model.prepare_with(values, rounding),
            start: model.start,
            memory: memory(model),
            usual: (model.training.y_range.iter())
                .map(|y| y.abs())
                .reduce(f64::max)
                .filter(|most| *most > 0.0)
                .unwrap_or(1.0),
            fades: wake_fades(model),
            zero: model.zero_among(values),
        }
    }

    /// Free run over `signals`; every sample is passed to `sink` until the run ends or diverges.
    ///
    /// Returns the sample of divergence, if any.
    pub fn run(
        &self,
        signals: &Signals<'_>,
        sink: impl FnMut(usize, &Output<T>) -> ControlFlow<()>,
    ) -> Option<usize> {
        // The derivatives are vectorised; the result is the same.
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || self.run_inlined(signals, sink),
        )
    }

    #[inline(always)]
    fn run_inlined(
        &self,
        signals: &Signals<'_>,
        mut sink: impl FnMut(usize, &Output<T>) -> ControlFlow<()>,
    ) -> Option<usize> {
        let mut state = self.state();
        let bound = RULES.diverged * signals.scale(self.usual);
        let window = self.prepared.averaging().window;
        let mut channels = vec![T::ZERO; signals.channels.len()];
        let begins = self.begins_held(signals);
        let first = self.held(signals).filter(|_| begins);
        if begins && first.is_none() {
            self.settle(signals, &mut state, &mut channels);
        }
        // The samples before the record have a constant command and run through the same loop.
        let held = first.map_or(0, |_| self.samples_held());
        let (before, y) = first.unwrap_or((0.0, T::ZERO));
        let (before, y) = (std::iter::repeat_n(before, held), y - self.zero);
        for (i, u) in before.chain(signals.u.iter().copied()).enumerate() {
            let k = i.saturating_sub(held);
            if i < held {
                self.advance(&mut state, y, window);
            }
            let output = self.observe(signals, &mut state, &mut channels, k, u);
            if i < held {
                continue;
            }
            if sink(k, &output).is_break() {
                return None;
            }
            let followed = signals.followed.get(k + 1);
            let next = followed.map_or(output.next, |y| T::from_f64(*y) - self.zero);
            let size = next.value().abs();
            if size > bound || size.is_nan() {
                return Some(k + 1);
            }
            self.advance(&mut state, next, window);
        }
        None
    }

    /// Predicts y_{k+1} from measured y up to y_k, for every k but the last. Sensor effects are ignored: the
    /// recursion works on readings.
    pub fn predict(&self, signals: &Signals<'_>, mut sink: impl FnMut(usize, T)) {
        let mut state = self.state();
        let window = self.prepared.averaging().window;
        let mut channels = vec![T::ZERO; signals.channels.len()];
        let y = signals.y.unwrap_or(&[]);
        if let Some(first) = y.first() {
            if self.start != Start::Measured {
                self.advance(&mut state, T::from_f64(*first), window);
            } else if let Some((u, y)) = self.held(signals) {
                for _ in 0..self.samples_held() {
                    self.advance(&mut state, y, window);
                    self.observe_apart(signals, &mut state, &mut channels, 0, u);
                }
            }
        }
        for (k, u) in signals.u.iter().enumerate() {
            let Some(measured) = y.get(k + 1) else {
                return;
            };
            let output = self.observe_apart(signals, &mut state, &mut channels, k, *u);
            sink(k + 1, output.next);
            self.advance(&mut state, T::from_f64(*measured), window);
        }
    }

    fn state(&self) -> HostState<T> {
        self.memory.at_rest(&self.prepared)
    }

    /// Stores `flow` as the newest output; the average is updated if an effect or the delay law reads it.
    #[inline(always)]
    fn advance(&self, state: &mut HostState<T>, flow: T, window: u32) {
        if self.prepared.follows_average() {
            state.advance(flow, window);
        } else {
            state.outputs.push(flow);
        }
    }

    #[inline(always)]
    fn observe(
        &self,
        signals: &Signals<'_>,
        state: &mut HostState<T>,
        channels: &mut [T],
        k: usize,
        u: f64,
    ) -> Output<T> {
        for (now, series) in pairs(&mut *channels, &signals.channels) {
            *now = series.get(k).map_or(T::ZERO, |value| T::from_f64(*value));
        }
        let input = Input {
            command: T::from_f64(u),
            channels,
        };
        observe(&self.prepared, state, &input)
    }

    /// Whether the state before the first sample differs from rest without command.
    fn begins_held(&self, signals: &Signals<'_>) -> bool {
        self.start == Start::Measured
            || !signals.followed.is_empty()
            || signals.u_before.is_some_and(|u| u != 0.0)
    }

    /// [`observe`](Self::observe) as a separate function, for runs that need not be fast.
    #[inline(never)]
    fn observe_apart(
        &self,
        signals: &Signals<'_>,
        state: &mut HostState<T>,
        channels: &mut [T],
        k: usize,
        u: f64,
    ) -> Output<T> {
        self.observe(signals, state, channels, k, u)
    }

    /// Command and measured output that are held constant before the first sample, if they are known.
    fn held(&self, signals: &Signals<'_>) -> Option<(f64, T)> {
        let u = signals.u_before.or(signals.u.first().copied())?;
        let y = signals
            .y_before
            .or_else(|| signals.followed.first().copied())
            .or_else(|| signals.y.and_then(<[f64]>::first).copied())?;
        Some((u, T::from_f64(y)))
    }

    /// Number of samples for which the signals are held constant: until the memories are filled.
    fn samples_held(&self) -> usize {
        self.memory.outputs.max(self.memory.jets).max(self.fades)
    }

    /// Runs the first command before the first sample until the model has settled.
    fn settle(&self, signals: &Signals<'_>, state: &mut HostState<T>, channels: &mut [T]) {
        let Some(u) = signals.u_before.or(signals.u.first().copied()) else {
            return;
        };
        let window = self.prepared.averaging().window;
        let full = self.memory.outputs.max(self.memory.jets);
        let (mut last, mut still) = (f64::INFINITY, 0);
        for _ in 0..SETTLED {
            let next = self.observe_apart(signals, state, channels, 0, u).next;
            let value = next.value();
            if !value.is_finite() {
                return;
            }
            still = if (value - last).abs() <= 1e-12 * value.abs() {
                still + 1
            } else {
                0
            };
            last = value;
            self.advance(state, next, window);
            if still > full {
                return;
            }
        }
    }
}

impl Simulator<f64> {
    /// The readings of a free run over `signals`.
    ///
    /// # Errors
    /// The sample of divergence.
    pub fn readings(&self, signals: &Signals<'_>) -> Result<Vec<f64>, usize> {
        let mut y = Vec::with_capacity(signals.u.len());
        let left = self.run(signals, |_, output: &Output<f64>| {
            y.push(output.measured);
            ControlFlow::Continue(())
        });
        left.map_or(Ok(y), Err)
    }
}

fn memory(model: &Model) -> Footprint {
    match model.delay {
        Delay::Fixed { .. } => model.memory(),
        // The memory has room for the longer delays that a search of the law may try.
        Delay::Law(_) => model.memory_for(model.longest_delay().max(ROOM)),
    }
}

/// Number of samples that are simulated before the first sample.
pub(crate) fn held_samples(model: &Model) -> usize {
    let memory = memory(model);
    memory.outputs.max(memory.jets).max(wake_fades(model))
}

/// Settling time of a wake or a lagging drive in time constants: 5 % remain.
const WAKE_FADES: f64 = 3.0;

fn wake_fades(model: &Model) -> usize {
    let time_of = |spec: &Spec, parameter: usize| {
        let added = model.effects.iter().find(|e| e.name == spec.name);
        let time = added.and_then(|e| e.parameters.get(parameter));
        time.copied().unwrap_or(0.0)
    };
    let time_s = time_of(SLOW_WAKE, 0).max(time_of(LAGGING_DRIVE, 1));
    let samples = (WAKE_FADES * time_s / model.sample_period_s).ceil() as usize;
    samples.min(SETTLED)
}

/// Largest settling time of a model that starts without measurements, and of a slow wake, samples.
const SETTLED: usize = 200_000;

impl Model {
    /// The free run over signals, measured or not: the predicted reading.
    ///
    /// # Errors
    /// The sample of divergence.
    pub fn run_free(&self, signals: &Signals<'_>) -> Result<Vec<f64>, usize> {
        Simulator::with_values(self, &self.values(), Rounding::Samples).readings(signals)
    }

    /// The free run over a record: the predicted reading y_sim.
    ///
    /// # Errors
    /// A missing channel, or divergence.
    pub fn free_run(&self, record: &Record) -> Result<Vec<f64>, SimulateError> {
        let signals = Signals::of(self, record)?;
        self.run_free(&signals)
            .map_err(|sample| SimulateError::Diverged {
                record: record.name.clone(),
                sample,
            })
    }
}
