//! Monitoring of a model in operation.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Parameters of the monitoring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Test {
    /// Length of a block, s: many correlation times of the noise.
    pub block_s: f64,
    /// Number of blocks of the baseline.
    pub learn: u32,
    /// Probability of a false alarm in [`DAY_S`].
    pub false_alarms_per_day: f64,
}

/// Reference duration of the false-alarm probability, s.
pub const DAY_S: f64 = 8.0 * 3600.0;

impl Default for Test {
    fn default() -> Self {
        Self {
            block_s: 1.0,
            learn: 60,
            false_alarms_per_day: 0.01,
        }
    }
}

impl Test {
    /// Alarm threshold in standard deviations.
    #[must_use]
    pub fn threshold(&self) -> f64 {
        let blocks = (DAY_S / self.block_s).max(1.0);
        let level = self.false_alarms_per_day / blocks;
        let freedom = f64::from(self.learn.max(3)) - 1.0;
        StudentsT::new(0.0, 1.0, freedom)
            .map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - level / 2.0))
    }
}

/// State of the monitoring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "verdict", rename_all = "kebab-case")]
pub enum Verdict {
    /// The baseline is not complete.
    Learning {
        /// Blocks missing.
        blocks_left: u32,
    },
    /// The model still fits.
    True {
        /// Largest deviation of a block so far, in standard deviations of the test.
        largest: f64,
        /// Alarm threshold in standard deviations.
        threshold: f64,
    },
    /// The model no longer fits.
    Stopped {
        /// Time of the alarm, s from the start.
        at_s: f64,
        /// Mean residual of the block, y.
        residual: f64,
        /// Mean residual of the baseline, y.
        usual: f64,
        /// Deviation from the baseline, standard deviations.
        distance: f64,
        /// Alarm threshold in standard deviations.
        threshold: f64,
    },
}

/// Monitor of residuals.
#[derive(Clone, Debug)]
pub struct Alarm {
    test: Test,
    threshold: f64,
    /// Length of a block, samples.
    block: u32,
    period_s: f64,
    sum: f64,
    count: u32,
    samples: u64,
    /// Count, mean and sum of squares of the baseline blocks (Welford).
    learnt: (u32, f64, f64),
    largest: f64,
    stopped: Option<Verdict>,
}

impl Alarm {
    /// Initial state.
    #[must_use]
    pub fn new(test: Test, sample_period_s: f64) -> Self {
        Self {
            threshold: test.threshold(),
            block: (test.block_s / sample_period_s).round().max(1.0) as u32,
            period_s: sample_period_s,
            test,
            sum: 0.0,
            count: 0,
            samples: 0,
            learnt: (0, 0.0, 0.0),
            largest: 0.0,
            stopped: None,
        }
    }

    /// Missing samples: their block is not tested.
    pub fn gap(&mut self, samples: u32) {
        self.samples += u64::from(samples);
        (self.sum, self.count) = (0.0, 0);
    }

    /// Adds a residual, y. The first alarm is kept.
    pub fn push(&mut self, residual: f64) {
        self.samples += 1;
        self.sum += residual;
        self.count += 1;
        if self.count < self.block {
            return;
        }
        let mean = self.sum / f64::from(self.count);
        (self.sum, self.count) = (0.0, 0);
        let (n, usual, squares) = self.learnt;
        if n < self.test.learn {
            let n = n + 1;
            let step = mean - usual;
            let new = usual + step / f64::from(n);
            self.learnt = (n, new, squares + step * (mean - new));
            return;
        }
        let n = f64::from(n);
        let spread = (squares / (n - 1.0) * (1.0 + 1.0 / n)).sqrt();
        let distance = (mean - usual) / spread;
        self.largest = self.largest.max(distance.abs());
        // NaN counts as an alarm.
        if self.stopped.is_none() && (distance.is_nan() || distance.abs() > self.threshold) {
            self.stopped = Some(Verdict::Stopped {
                at_s: self.samples as f64 * self.period_s,
                residual: mean,
                usual,
                distance,
                threshold: self.threshold,
            });
        }
    }

    /// Present state.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if let Some(stopped) = self.stopped {
            return stopped;
        }
        match self.test.learn - self.learnt.0 {
            0 => Verdict::True {
                largest: self.largest,
                threshold: self.threshold,
            },
            blocks_left => Verdict::Learning { blocks_left },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// White 0.03 and coloured 0.035 over 20 ms: a hot film.
    struct Film {
        coloured: f64,
        rng: ChaCha8Rng,
    }

    impl Film {
        fn new(seed: u64) -> Self {
            Self {
                coloured: 0.0,
                rng: ChaCha8Rng::seed_from_u64(seed),
            }
        }
        fn sample(&mut self) -> f64 {
            let mut normal = || -> f64 { StandardNormal.sample(&mut self.rng) };
            let (white, drive) = (normal(), normal());
            let memory = (-1.0_f64 / 20.0).exp();
            self.coloured = memory * self.coloured + 0.035 * (1.0 - memory * memory).sqrt() * drive;
            0.03 * white + self.coloured
        }
    }

    /// At a false-alarm rate of a fifth per day of 200 blocks, about as many of many days have one; each day
    /// learns its own baseline.
    #[test]
    fn false_alarms_are_as_rare_as_stated() {
        let test = Test {
            block_s: 1.0,
            learn: 60,
            // 200 of the day's 28 800 blocks.
            false_alarms_per_day: 0.2 * DAY_S / 200.0,
        };
        let days = 150;
        let alarms = (0..days).filter(|seed| {
            let mut film = Film::new(*seed);
            // A constant model error is part of the baseline.
            let mut alarm = Alarm::new(test, 0.001);
            for _ in 0..260_000 {
                alarm.push(0.004 + film.sample());
            }
            matches!(alarm.verdict(), Verdict::Stopped { .. })
        });
        // 27 expected for independent normal blocks (1 − e^−0.2); 3 standard deviations.
        let alarms = alarms.count();
        assert!((12..=42).contains(&alarms), "{alarms} of {days}");
    }

    #[test]
    fn a_model_that_stops_being_true_is_found_out_soon() {
        let mut film = Film::new(3);
        let mut alarm = Alarm::new(Test::default(), 0.001);
        assert_eq!(alarm.verdict(), Verdict::Learning { blocks_left: 60 });
        for _ in 0..300_000 {
            alarm.push(film.sample());
        }
        assert!(
            matches!(alarm.verdict(), Verdict::True { .. }),
            "{:?}",
            alarm.verdict()
        );
        // A change by a twentieth of the range, invisible in a single sample.
        for _ in 0..5_000 {
            alarm.push(0.05 + film.sample());
        }
        let Verdict::Stopped { at_s, residual, .. } = alarm.verdict() else {
            panic!("{:?}", alarm.verdict());
        };
        assert!((300.0..304.0).contains(&at_s) && (residual - 0.05).abs() < 0.03);
    }

    #[test]
    fn missing_samples_spoil_their_block_only() {
        let mut alarm = Alarm::new(
            Test {
                learn: 3,
                ..Test::default()
            },
            0.001,
        );
        for k in 0..3_000 {
            alarm.push(0.01 * f64::from(k / 1000));
        }
        for _ in 0..999 {
            alarm.push(1e9);
        }
        alarm.gap(1);
        assert!(matches!(alarm.verdict(), Verdict::True { .. }));
        for _ in 0..1000 {
            alarm.push(f64::NAN);
        }
        assert!(matches!(alarm.verdict(), Verdict::Stopped { .. }));
    }
}
