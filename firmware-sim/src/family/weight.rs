//! Whether an effect matters: what no change of the flow imitates, against the noise.

use std::ops::RangeInclusive;

use crate::plant::{BasePlant, FreeStream, PlantError, PlantSpec, Rig, SAMPLE_PERIOD_S};

/// An effect should change the readings by this many standard errors …
const TOTAL: f64 = 4.0;

/// … by this many, after the flow's constants have done what they can: the leanest base is then left at
/// √(1 + 1.2²) = 1.56 times the noise floor …
const OWN: f64 = 1.2;

/// … and by this many, after the flow has been given a memory of any length too: without the effect, the
/// best base is then left at √(1 + 0.6²) = 1.17 times the noise floor.
const BEYOND_MEMORY: f64 = 0.6;

/// Where readings have to stay (y), with room for noise inside the converter's −1 … 3: a rig with an effect that
/// drives it out of there is not taken.
const POSSIBLE: RangeInclusive<f64> = -0.8..=2.8;

/// How far the flow's constants are moved to see what they do, relative.
const STEP: f64 = 0.02;

/// The memories that the flow is given, alone and times the jet: every 40 ms up to 0.48 s.
const MEMORIES: usize = 12;
const BETWEEN_MEMORIES: usize = 40;

/// Mean friction at which the delay is taken to place the memories (y).
const MIDDLE: f64 = 0.5;

/// Weighs effects of one rig on one command.
pub(super) struct Weight {
    levels: Vec<f64>,
    stream: Option<FreeStream>,
    standard_error: f64,
    /// The readings without the effect.
    before: Vec<f64>,
    /// What the zero and the flow's constants can do; orthogonal.
    constants: Vec<Vec<f64>>,
    /// What memories can do beyond that; orthogonal.
    memories: Vec<Vec<f64>>,
}

impl Weight {
    /// Samples that are enough for effects of the catalogue.
    pub(super) const SAMPLES: usize = 5000;

    /// For effects that are added to `bare`.
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
        // Gram–Schmidt, twice as is enough.
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

    /// At least 1 if what `with` has more than the bare plant matters.
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

    /// What a plant reads beyond the bare one.
    fn change(&self, plant: &PlantSpec) -> Result<Vec<f64>, PlantError> {
        let mut run = Rig::new(plant, self.stream.clone())?.play(&self.levels);
        run.iter_mut().zip(&self.before).for_each(|(y, b)| *y -= b);
        Ok(run)
    }

    /// What a little memory of each length adds, alone and times the jet: it drives the flow as the jet does.
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

/// The flow with each of its constants a little larger.
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

/// Takes what lies along the orthogonal `directions` out of `x`.
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
        // A gain of half as much again is loud, and a change of the constants.
        let mut louder = bare.clone();
        louder.base.gain *= 1.5;
        assert!(weight.of(&louder).unwrap() < 0.05);
        let effect = Effect::draw("hot-film-nonlinearity", &bare.base, &mut rng).unwrap();
        let with = PlantSpec {
            effects: vec![effect],
            ..bare.clone()
        };
        assert!(weight.of(&with).unwrap() > 1.0);
        // What runs away is none.
        let mut away = bare.clone();
        away.base.gain *= 4.0;
        assert_eq!(weight.of(&away).unwrap(), 0.0);
        // A memory that changes the readings by several standard errors is no effect.
        let with = PlantSpec {
            character: Character::Memory(vec![PastTerm::new(0.2, -0.06, 0.1)]),
            ..bare.clone()
        };
        let total = rms(&weight.change(&with).unwrap());
        assert!(total > 0.04, "{total}");
        assert!(weight.of(&with).unwrap() < 0.5);
    }
}
