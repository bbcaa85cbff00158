//! A simulated plant in closed loop, with sensor noise, converter and lost readings.

use crate::instrument::{Converter, Noise, NoiseSignal};
use crate::plant::{Plant, Rig, SAMPLE_PERIOD_S};
use closed_loop::Controlled;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

impl Controlled for Rig {
    fn sample_period_s(&self) -> f64 {
        SAMPLE_PERIOD_S
    }
    fn step(&mut self, command: bool) -> Option<f64> {
        Some(Plant::step(self, command))
    }
    fn friction(&self) -> f64 {
        Rig::friction(self)
    }
}

/// Loss of readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lost {
    /// Share of single readings that are lost at random, 0–1.
    pub share: f64,
    /// An interval without any reading: first sample and length.
    pub stretch: Option<(usize, usize)>,
}

/// A flow measured with noise, converter and lost readings.
#[derive(Clone, Debug)]
pub struct Disturbed<F> {
    flow: F,
    noise: Option<NoiseSignal>,
    converter: Option<Converter>,
    lost: Lost,
    rng: ChaCha8Rng,
    sample: usize,
}

impl<F: Controlled> Disturbed<F> {
    /// `flow` measured with `noise` through `converter`, repeatable by `seed`.
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
            noise: noise.map(|n| NoiseSignal::new(n, ChaCha8Rng::seed_from_u64(seed))),
            converter,
            lost,
            rng,
            sample: 0,
        }
    }
}

impl<F: Controlled> Controlled for Disturbed<F> {
    fn sample_period_s(&self) -> f64 {
        self.flow.sample_period_s()
    }
    fn step(&mut self, command: bool) -> Option<f64> {
        let clean = self.flow.step(command);
        let noise = self.noise.as_mut().map_or(0.0, NoiseSignal::sample);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{BasePlant, PlantSpec};

    fn quiet() -> Rig {
        let base = BasePlant::draw(&mut ChaCha8Rng::seed_from_u64(2));
        Rig::new(&PlantSpec::new(base, &[]), None).unwrap()
    }

    fn disturbed(lost: Lost) -> Disturbed<Rig> {
        let converter = Some(Converter::TWELVE_BIT);
        Disturbed::new(quiet(), Some(Noise::HOT_FILM), converter, lost, 8)
    }

    #[test]
    fn the_rig_is_read_through_noise() {
        let (mut rig, mut bench) = (quiet(), disturbed(Lost::default()));
        let square: f64 = (0..20_000)
            .map(|k| {
                let on = (k / 200) % 2 == 0;
                let read = bench.step(on).expect("nothing is lost");
                (read - Plant::step(&mut rig, on)).powi(2)
            })
            .sum();
        let expected = Noise::HOT_FILM.standard_deviation().powi(2);
        assert!((square / 20_000.0 / expected - 1.0).abs() < 0.15);
    }

    #[test]
    fn readings_are_lost_as_often_and_where_they_are_told_to_be() {
        let lost = Lost {
            share: 0.2,
            stretch: Some((5_001, 1_000)),
        };
        let mut bench = disturbed(lost);
        let missing: Vec<bool> = (0..20_000).map(|_| bench.step(true).is_none()).collect();
        assert!(missing[5_000..6_000].iter().all(|&lost| lost));
        let elsewhere = missing[6_000..].iter().filter(|&&lost| lost).count();
        assert!((2_600..3_000).contains(&elsewhere), "{elsewhere} of 14 000");
    }
}
