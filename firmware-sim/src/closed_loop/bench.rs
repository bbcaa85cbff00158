//! Readings that get lost, noise that gets worse.

use super::Flow;
use crate::instrument::{Converter, Noise, NoiseSource};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How readings are lost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lost {
    /// Share of single readings that are lost at random, 0–1.
    pub share: f64,
    /// A stretch without any reading: first sample and length.
    pub stretch: Option<(usize, usize)>,
}

/// A flow seen through noise, a converter and a line that drops readings.
#[derive(Clone, Debug)]
pub struct Disturbed<F> {
    flow: F,
    noise: Option<NoiseSource>,
    converter: Option<Converter>,
    lost: Lost,
    rng: ChaCha8Rng,
    sample: usize,
}

impl<F: Flow> Disturbed<F> {
    /// `flow` seen with `noise` through `converter`, repeatable by `seed`.
    pub fn new(
        flow: F,
        noise: Option<Noise>,
        converter: Option<Converter>,
        lost: Lost,
        seed: u64,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(1);
        Self {
            flow,
            noise: noise.map(|n| NoiseSource::new(n, ChaCha8Rng::seed_from_u64(seed))),
            converter,
            lost,
            rng,
            sample: 0,
        }
    }
}

impl<F: Flow> Flow for Disturbed<F> {
    fn step(&mut self, command: bool) -> Option<f64> {
        let clean = self.flow.step(command);
        let noise = self.noise.as_mut().map_or(0.0, NoiseSource::sample);
        let dropped = self.rng.random_bool(self.lost.share.clamp(0.0, 1.0));
        self.sample += 1;
        let in_stretch = self
            .lost
            .stretch
            .is_some_and(|(first, length)| (first..first + length).contains(&self.sample));
        let analogue = clean.filter(|_| !dropped && !in_stretch)? + noise;
        Some(
            self.converter
                .map_or(analogue, |c| c.reading(c.code(analogue))),
        )
    }
    fn friction(&self) -> f64 {
        self.flow.friction()
    }
}
