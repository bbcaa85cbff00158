//! Detectability of an effect: its change of the readings that no change of the flow imitates, relative to
//! the noise.

use std::ops::RangeInclusive;

use crate::plant::{BasePlant, FreeStream, PlantError, PlantSpec, Rig, SAMPLE_PERIOD_S};

/// Required change of the readings, in standard errors.
const TOTAL: f64 = 4.0;

/// Required change after refitting the flow's constants: the lowest-order base then has an error of √(1 +
/// 1.2²) = 1.56 × the noise level.
const OWN: f64 = 1.2;

/// Required weight if the base may also have a memory of any length: the best base without the effect then has √(1 +
/// 0.6²) = 1.17 × the noise level.
const BEYOND_MEMORY: f64 = 0.6;

/// Allowed range of readings (y), with a margin for noise inside the converter's −1 … 3: rigs outside are
/// rejected.
const POSSIBLE: RangeInclusive<f64> = -0.8..=2.8;

/// Relative step of the flow's constants for their sensitivities.
const STEP: f64 = 0.02;

/// Number of memory lengths: every 40 ms up to 0.48 s. Each memory is used alone and multiplied by
/// the jet.
const MEMORIES: usize = 12;
const BETWEEN_MEMORIES: usize = 40;

/// Mean friction at which the delay is evaluated to place the memories (y).
const MIDDLE: f64 = 0.5;

/// Weights of effects on one rig and command.
pub(super) struct Weight {
    levels: Vec<f64>,
    stream: Option<FreeStream>,
    standard_error: f64,
    /// The readings without the effect.
    before: Vec<f64>,
    /// Sensitivities of the offset and of the flow's constants; orthogonal.
    constants: Vec<Vec<f64>>,
    /// Sensitivities of memories, orthogonal to `constants` and to each other.
    memories: Vec<Vec<f64>>,
}

impl Weight {
    /// Samples used for effects of the catalogue.
    pub(super) const SAMPLES: usize = 5000;

    /// Prepares the weights of effects that are added to `bare`.
    pub(super) fn new(
        bare: &PlantSpec,
        levels: &[f64],
        stream: Option<FreeStream>,
        standard_error: f64,
    ) -> Result<Self, PlantError> {
        let mut weight = Self {
            levels: levels.to_vec(),
            stream,
            standard_error,
            before: vec![0.0; levels.len()],
            constants: Vec::new(),
            memories: Vec::new(),
        };
        weight.before = weight.change(bare)?;
        let mut all = vec![vec![1.0; weight.before.len()]];
        for base in moved(&bare.base) {
            all.push(weight.change(&PlantSpec {
                base,
                ..bare.clone()
            })?);
        }
        let constants = all.len();
        all.extend(weight.memories_of(&bare.base));
        // Gram–Schmidt, repeated once.
        for i in 0..all.len() {
            let (done, rest) = all.split_at_mut(i);
            for _ in 0..2 {
                take_away(done, &mut rest[0]);
            }
        }
        weight.memories = all.split_off(constants);
        weight.constants = all;
        Ok(weight)
    }

    /// Weight of the difference between `with` and the bare plant; at least 1 if it is detectable.
    pub(super) fn of(&self, with: &PlantSpec) -> Result<f64, PlantError> {
        let mut change = self.change(with)?;
        let mut readings = change.iter().zip(&self.before).map(|(d, y)| d + y);
        if !readings.all(|y| POSSIBLE.contains(&y)) {
            return Ok(0.0);
        }
        let total = rms(&change);
        take_away(&self.constants, &mut change);
        let own = rms(&change);
        take_away(&self.memories, &mut change);
        let beyond = rms(&change);
        let least = (total / TOTAL).min(own / OWN).min(beyond / BEYOND_MEMORY);
        Ok(least / self.standard_error)
    }

    /// Readings of a plant minus those of the plant without effects.
    fn change(&self, plant: &PlantSpec) -> Result<Vec<f64>, PlantError> {
        let mut run = Rig::new(plant, self.stream.clone())?.play(&self.levels);
        run.iter_mut().zip(&self.before).for_each(|(y, b)| *y -= b);
        Ok(run)
    }

    /// Change of the readings by a small memory of each length, alone and multiplied by the jet. The
    /// memory drives the flow like the jet.
    fn memories_of(&self, base: &BasePlant) -> Vec<Vec<f64>> {
        let delay = (base.delay.at(MIDDLE) / SAMPLE_PERIOD_S).round() as usize;
        let past = |x: &[f64], k: usize, lag: usize| k.checked_sub(lag).map_or(0.0, |k| x[k]);
        let lags = (1..=MEMORIES).map(|number| number * BETWEEN_MEMORIES);
        let each = lags.flat_map(|lag| [(lag, false), (lag, true)]);
        each.map(|(lag, times_jet)| {
            let mut added = 0.0;
            let samples = 0..self.levels.len();
            samples
                .map(|k| {
                    let now = added;
                    let jet = past(&self.levels, k, delay);
                    let felt = past(&self.before, k, lag) * if times_jet { jet } else { 1.0 };
                    let on = jet.abs();
                    let rate = on / base.attach_s + (1.0 - on) / base.separate_s;
                    added += SAMPLE_PERIOD_S * rate * (felt - added);
                    now
                })
                .collect()
        })
        .collect()
    }
}

/// The flow with each of its constants slightly increased.
fn moved(base: &BasePlant) -> Vec<BasePlant> {
    let more = 1.0 + STEP;
    vec![
        BasePlant {
            attach_s: more * base.attach_s,
            ..*base
        },
        BasePlant {
            separate_s: more * base.separate_s,
            ..*base
        },
        BasePlant {
            gain: more * base.gain,
            ..*base
        },
        BasePlant {
            delay: base.delay.scaled(more),
            ..*base
        },
    ]
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt()
}

/// Projects `x` orthogonal to `directions`.
fn take_away(directions: &[Vec<f64>], x: &mut [f64]) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(p, q)| p * q).sum::<f64>();
    for direction in directions {
        let size = dot(direction, direction);
        if size > 0.0 {
            let share = dot(direction, x) / size;
            let along = x.iter_mut().zip(direction);
            along.for_each(|(v, d)| *v -= share * d);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::Command;
    use crate::plant::{Character, Effect, PastTerm};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn what_the_flow_can_do_weighs_nothing_and_a_strong_effect_much() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let command = Command::random("random", &mut rng);
        let bare = PlantSpec::new(BasePlant::draw(&mut rng), &[]);
        let levels = &command.levels[..Weight::SAMPLES];
        let weight = Weight::new(&bare, levels, None, 0.01).unwrap();
        // A gain larger by a half changes the readings much, but only through a constant of the flow, which does not
        // count.
        let mut louder = bare.clone();
        louder.base.gain *= 1.5;
        assert!(weight.of(&louder).unwrap() < 0.05);
        let effect = Effect::draw("hot-film-nonlinearity", &bare.base, &mut rng).unwrap();
        let with = PlantSpec {
            effects: vec![effect],
            ..bare.clone()
        };
        assert!(weight.of(&with).unwrap() > 1.0);
        // A diverging plant has no weight.
        let mut away = bare.clone();
        away.base.gain *= 4.0;
        assert_eq!(weight.of(&away).unwrap(), 0.0);
        // A memory that changes the readings by several standard errors counts as a flow, not as an effect.
        let with = PlantSpec {
            character: Character::Memory(vec![PastTerm::new(0.2, -0.06, 0.1)]),
            ..bare.clone()
        };
        let total = rms(&weight.change(&with).unwrap());
        assert!(total > 0.04, "{total}");
        assert!(weight.of(&with).unwrap() < 0.5);
    }
}
