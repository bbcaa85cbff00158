//! Whether an effect matters: what no change of the flow's own constants imitates, against the noise.

use crate::command::Command;
use crate::plant::{BasePlant, PlantError, PlantSpec, Rig};

/// An effect should change the readings by this many standard errors …
const TOTAL: f64 = 4.0;

/// … and by this many, after the flow's constants have done what they can.
const OWN: f64 = 2.0;

/// How far the flow's constants are moved to see what they do, relative.
const STEP: f64 = 0.02;

/// Samples that are looked at.
const SAMPLES: usize = 5000;

/// Weighs effects on one command.
pub(super) struct Weight {
    levels: Vec<f64>,
    standard_error: f64,
}

impl Weight {
    pub(super) fn new(command: &Command, standard_error: f64) -> Self {
        let levels = command.levels.iter().copied().take(SAMPLES).collect();
        Self {
            levels,
            standard_error,
        }
    }

    /// At least 1 if what `with` has more than `bare` matters.
    pub(super) fn of(&self, bare: &PlantSpec, with: &PlantSpec) -> Result<f64, PlantError> {
        let play = |plant: &PlantSpec| Rig::new(plant, None).map(|mut rig| rig.play(&self.levels));
        let before = play(bare)?;
        let less = |mut run: Vec<f64>| {
            run.iter_mut().zip(&before).for_each(|(y, b)| *y -= b);
            run
        };
        let mut change = less(play(with)?);
        let total = rms(&change);
        let mut directions = vec![vec![1.0; self.levels.len()]];
        for base in moved(&bare.base) {
            directions.push(less(play(&PlantSpec {
                base,
                ..bare.clone()
            })?));
        }
        // Gram–Schmidt, twice as is enough.
        for i in 0..directions.len() {
            let (done, rest) = directions.split_at_mut(i);
            for _ in 0..2 {
                for other in &*done {
                    take_away(other, &mut rest[0]);
                }
            }
            take_away(&rest[0], &mut change);
        }
        let own = rms(&change);
        Ok((own / OWN).min(total / TOTAL) / self.standard_error)
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

/// Takes the part along `direction` out of `x`.
fn take_away(direction: &[f64], x: &mut [f64]) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(p, q)| p * q).sum::<f64>();
    let size = dot(direction, direction);
    if size > 0.0 {
        let share = dot(direction, x) / size;
        x.iter_mut()
            .zip(direction)
            .for_each(|(v, d)| *v -= share * d);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::Effect;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn what_the_constants_can_do_weighs_nothing_and_a_strong_effect_much() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let command = Command::random("random", &mut rng);
        let weight = Weight::new(&command, 0.01);
        let bare = PlantSpec::new(BasePlant::draw(&mut rng), &[]);
        // A gain of half as much again is loud, and a change of the constants.
        let mut louder = bare.clone();
        louder.base.gain *= 1.5;
        assert!(weight.of(&bare, &louder).unwrap() < 0.02);
        let effect = Effect::draw("hot-film-nonlinearity", &bare.base, &mut rng).unwrap();
        let with = PlantSpec {
            effects: vec![effect],
            ..bare.clone()
        };
        assert!(weight.of(&bare, &with).unwrap() > 1.0);
    }
}
