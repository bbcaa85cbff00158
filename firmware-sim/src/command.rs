//! Valve commands of identification and validation runs, one level per millisecond.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Length of a standard run, samples.
pub const RUN_SAMPLES: usize = 10_000;

/// Rest at the end of a standard run, samples, so that runs can follow one another.
pub const TAIL_SAMPLES: usize = 1_500;

/// Rest before the first edge, samples, in which the sensor's offset is visible.
pub const LEAD_SAMPLES: usize = 300;

/// A named sequence of valve levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Name for records and files.
    pub name: String,
    /// Level held from sample k to k + 1: 0 closed, 1 open.
    pub levels: Vec<f64>,
}

impl Command {
    /// Open between the given on and off samples, closed elsewhere; pairs beyond the run are cut.
    pub fn from_switching(name: &str, samples: usize, openings: &[(usize, usize)]) -> Self {
        let mut levels = vec![0.0; samples];
        for &(on, off) in openings {
            let off = off.min(samples);
            if let Some(open) = levels.get_mut(on.min(off)..off) {
                open.fill(1.0);
            }
        }
        Self {
            name: name.to_owned(),
            levels,
        }
    }

    /// Steady blowing from the lead to the tail.
    pub fn step() -> Self {
        Self::from_switching(
            "step",
            RUN_SAMPLES,
            &[(LEAD_SAMPLES, RUN_SAMPLES - TAIL_SAMPLES)],
        )
    }

    /// A square wave of `frequency` (Hz) and `duty` (0–1); edges fall on the nearest millisecond.
    pub fn square(frequency: f64, duty: f64) -> Self {
        let name = format!("sq{frequency:.0}-{:.0}", duty * 100.0);
        let period = 1000.0 / frequency;
        let end = (RUN_SAMPLES - TAIL_SAMPLES) as f64;
        let openings: Vec<(usize, usize)> = (0..)
            .map(|n| LEAD_SAMPLES as f64 + f64::from(n) * period)
            .take_while(|on| *on < end)
            .map(|on| {
                let off = (on + duty * period).min(end);
                (on.round() as usize, off.round() as usize)
            })
            .collect();
        Self::from_switching(&name, RUN_SAMPLES, &openings)
    }

    /// Random on/off, each dwell uniform between 20 and 500 ms.
    pub fn random(name: &str, rng: &mut ChaCha8Rng) -> Self {
        Self::telegraph(name, 500, 500, rng)
    }

    /// Random on/off; openings last 20 ms to `longest_on`, rests 20 ms to `longest_off` (samples).
    pub fn telegraph(
        name: &str,
        longest_on: usize,
        longest_off: usize,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let turn = |_: &mut _, open| if open { 0.0 } else { 1.0 };
        Self::staircase(
            name,
            rng,
            turn,
            |open| {
                if open { longest_on } else { longest_off }
            },
        )
    }

    /// Random levels from `low` to `high`, each dwell uniform between 20 and 500 ms.
    pub fn random_levels(name: &str, low: f64, high: f64, rng: &mut ChaCha8Rng) -> Self {
        Self::staircase(name, rng, |rng, _| rng.random_range(low..high), |_| 500)
    }

    fn staircase(
        name: &str,
        rng: &mut ChaCha8Rng,
        mut next: impl FnMut(&mut ChaCha8Rng, bool) -> f64,
        longest: impl Fn(bool) -> usize,
    ) -> Self {
        let mut levels = vec![0.0; RUN_SAMPLES];
        let end = RUN_SAMPLES - TAIL_SAMPLES;
        let mut at = LEAD_SAMPLES;
        let mut level = 0.0;
        while at < end {
            level = next(rng, level != 0.0);
            let until = (at + rng.random_range(20..=longest(level != 0.0))).min(end);
            if let Some(dwell) = levels.get_mut(at..until) {
                dwell.fill(level);
            }
            at = until;
        }
        Self {
            name: name.to_owned(),
            levels,
        }
    }

    /// A command of this kind with levels from `low` to 1.
    #[must_use]
    pub(crate) fn graded(self, low: f64, rng: &mut ChaCha8Rng) -> Self {
        if self.name.starts_with("random") {
            let name = self.name.replace("random", "levels");
            return Self::random_levels(&name, low, 1.0, rng);
        }
        let size = rng.random_range(0.4..1.0);
        let turned = low < 0.0 && rng.random_bool(0.5);
        self.map(|u| if turned { -size * u } else { size * u })
    }

    /// The sequence with `level` applied to every level.
    pub fn map(mut self, level: impl Fn(f64) -> f64) -> Self {
        for u in &mut self.levels {
            *u = level(*u);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn runs(levels: &[f64]) -> Vec<(f64, usize)> {
        let mut runs: Vec<(f64, usize)> = Vec::new();
        for &u in levels {
            match runs.last_mut() {
                Some((level, n)) if *level == u => *n += 1,
                _ => runs.push((u, 1)),
            }
        }
        runs
    }

    #[test]
    fn squares_have_their_period_duty_and_name() {
        let four = Command::square(4.0, 0.8);
        assert_eq!(four.name, "sq4-80");
        assert_eq!(four.levels.len(), RUN_SAMPLES);
        let inner = runs(&four.levels);
        assert_eq!(inner[0], (0.0, LEAD_SAMPLES));
        assert!(inner[1..9].chunks(2).all(|c| c == [(1.0, 200), (0.0, 50)]));
        let eight = runs(&Command::square(8.0, 0.5).levels);
        assert!(eight[1..9].iter().all(|(_, n)| (62..=63).contains(n)));
    }

    #[test]
    fn every_run_ends_with_its_tail_and_random_dwells_stay_in_their_range() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let random = Command::random("random", &mut rng);
        for command in [
            Command::step(),
            Command::square(2.0, 0.3),
            random.clone(),
            Command::random_levels("levels", -1.0, 1.0, &mut rng),
        ] {
            let tail = &command.levels[RUN_SAMPLES - TAIL_SAMPLES..];
            assert!(tail.iter().all(|u| *u == 0.0), "{}", command.name);
        }
        let dwells = runs(&random.levels);
        let inner = &dwells[1..dwells.len() - 2];
        assert!(inner.len() > 20 && inner.iter().all(|(_, n)| (20..=500).contains(n)));
    }

    #[test]
    fn switching_times_beyond_the_run_are_cut() {
        let c = Command::from_switching("own", 10, &[(2, 4), (8, 99), (50, 60)]);
        assert_eq!(c.levels, [0., 0., 1., 1., 0., 0., 0., 0., 1., 1.]);
    }
}
