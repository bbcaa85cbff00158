//! Monitoring of a model in operation: a sequential test for a change of the mean residual.
//!
//! The residual is averaged over blocks. Block k is compared with all blocks before it:
//!
//! t_k = (x_k − m)/(s·√(1 + 1/n)), with mean m and standard deviation s of the n blocks before.
//!
//! For independent normal blocks of constant mean and variance, both unknown, the t_k are independent and each
//! has Student's distribution with n − 1 degrees of freedom. So the likelihood ratio of a shift by δ standard
//! deviations, L_k = f(t_k − δ)/f(t_k), has the expectation 1 given the past. The detector is the
//! Shiryaev–Roberts sum over all possible times of the change, R_k = (R_{k−1} + 1)·L_k, averaged over shifts of
//! both signs. R_k − k is a martingale, hence P(R reaches c within N blocks) ≤ N/c, for every N and every
//! stopping rule (J. Shin, A. Ramdas, A. Rinaldo, E-detectors, New England J. Statist. Data Sci. 2023;
//! M. Pollak, Ann. Statist. 15:749, 1987).

use serde::Serialize;

/// Parameters of the monitoring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Test {
    /// Length of a block, s: many correlation times of the noise.
    pub block_s: f64,
    /// Number of blocks before the first test.
    pub learn: u32,
    /// Largest probability of a false alarm in a year of operation; n years have at most n times as much.
    pub false_alarms_per_year: f64,
}

/// A year of continuous operation, s.
pub const YEAR_S: f64 = 365.25 * 24.0 * 3600.0;

/// Shifts of the mean for which the detector is made, standard deviations of a block. The largest are for short
/// baselines, where Student's distribution has a long tail.
const SHIFTS: [f64; 12] = [
    0.5, 1.0, 2.0, 4.0, 8.0, 16.0, -0.5, -1.0, -2.0, -4.0, -8.0, -16.0,
];

impl Default for Test {
    fn default() -> Self {
        Self {
            block_s: 1.0,
            learn: 60,
            false_alarms_per_year: 0.01,
        }
    }
}

impl Test {
    /// The value of the detector that raises the alarm: blocks of a year over the false alarms of a year.
    #[must_use]
    pub fn limit(&self) -> f64 {
        (YEAR_S / self.block_s).max(1.0) / self.false_alarms_per_year
    }
}

/// State of the monitoring. Evidence is the common logarithm of the detector.
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
        /// Largest evidence of a change so far.
        largest: f64,
        /// Evidence at which the alarm is raised.
        threshold: f64,
    },
    /// The model no longer fits.
    Stopped {
        /// Time of the alarm, s from the start.
        at_s: f64,
        /// Mean residual of the block, y.
        residual: f64,
        /// Mean residual of all blocks before, y.
        usual: f64,
        /// Deviation of the block from that mean, standard deviations.
        distance: f64,
        /// Evidence at which the alarm is raised.
        threshold: f64,
    },
}

/// Monitor of residuals.
#[derive(Clone, Debug)]
pub struct Alarm {
    test: Test,
    limit: f64,
    /// Length of a block, samples.
    block: u32,
    period_s: f64,
    sum: f64,
    count: u32,
    samples: u64,
    /// Count, mean and sum of squares of the blocks so far (Welford).
    learnt: (f64, f64, f64),
    /// Shiryaev–Roberts sums, one per shift.
    sums: [f64; SHIFTS.len()],
    largest: f64,
    stopped: Option<Verdict>,
}

impl Alarm {
    /// Initial state.
    #[must_use]
    pub fn new(test: Test, sample_period_s: f64) -> Self {
        Self {
            limit: test.limit(),
            block: (test.block_s / sample_period_s).round().max(1.0) as u32,
            period_s: sample_period_s,
            test,
            sum: 0.0,
            count: 0,
            samples: 0,
            learnt: (0.0, 0.0, 0.0),
            sums: [0.0; SHIFTS.len()],
            largest: 0.0,
            stopped: None,
        }
    }

    /// Missing samples: their block is not tested.
    pub fn gap(&mut self, samples: u32) {
        self.samples += u64::from(samples);
        (self.sum, self.count) = (0.0, 0);
    }

    /// A new operating point: the model error differs there, so the baseline is learnt again. The detector keeps
    /// its value, so that the stated rate holds for the whole time.
    pub fn learn_again(&mut self) {
        (self.sum, self.count) = (0.0, 0);
        self.learnt = (0.0, 0.0, 0.0);
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
        if n >= self.needed() {
            let distance = (mean - usual) / (squares / (n - 1.0) * (1.0 + 1.0 / n)).sqrt();
            let evidence = self.accumulate(distance, n - 1.0);
            self.largest = self.largest.max(evidence.log10());
            // NaN counts as an alarm.
            let below = evidence < self.limit;
            if self.stopped.is_none() && !below {
                self.stopped = Some(Verdict::Stopped {
                    at_s: self.samples as f64 * self.period_s,
                    residual: mean,
                    usual,
                    distance,
                    threshold: self.limit.log10(),
                });
            }
        }
        let step = mean - usual;
        let new = usual + step / (n + 1.0);
        self.learnt = (n + 1.0, new, squares + step * (mean - new));
    }

    /// Blocks before the first test; a variance needs two.
    fn needed(&self) -> f64 {
        f64::from(self.test.learn.max(3))
    }

    /// Adds a block to the detector and returns its value.
    fn accumulate(&mut self, t: f64, freedom: f64) -> f64 {
        let mut total = 0.0;
        for (sum, shift) in self.sums.iter_mut().zip(SHIFTS) {
            let ratio = (1.0 + t * t / freedom) / (1.0 + (t - shift).powi(2) / freedom);
            *sum = (*sum + 1.0) * ratio.powf((freedom + 1.0) / 2.0);
            total += *sum;
        }
        total / SHIFTS.len() as f64
    }

    /// Present state.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if let Some(stopped) = self.stopped {
            return stopped;
        }
        let left = self.needed() - self.learnt.0;
        if left > 0.0 {
            return Verdict::Learning {
                blocks_left: left as u32,
            };
        }
        Verdict::True {
            largest: self.largest,
            threshold: self.limit.log10(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Simulated noise of a hot film: white with s.d. 0.03, plus coloured with s.d. 0.035 and a
    /// correlation time of 20 ms.
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

    /// A test with the probability `chance` of a false alarm in this many blocks of a second.
    fn test_of(chance: f64, blocks: f64, learn: u32) -> Test {
        Test {
            block_s: 1.0,
            learn,
            false_alarms_per_year: chance * YEAR_S / blocks,
        }
    }

    fn alarms(runs: u64, mut run: impl FnMut(u64) -> Alarm) -> usize {
        let mut stopped = |seed| matches!(run(seed).verdict(), Verdict::Stopped { .. });
        (0..runs).filter(|seed| stopped(*seed)).count()
    }

    /// False alarms at a stated probability of 0.2 in 200 blocks; each run learns its own baseline. The count is
    /// close to the bound N/c.
    #[test]
    fn false_alarms_are_as_rare_as_stated() {
        let test = test_of(0.2, 200.0, 60);
        let count = alarms(150, |seed| {
            let mut film = Film::new(seed);
            // A constant model error is part of the baseline.
            let mut alarm = Alarm::new(test, 0.001);
            for _ in 0..260_000 {
                alarm.push(0.004 + film.sample());
            }
            alarm
        });
        // At most 30 alarms are expected; 45 is 3 standard deviations above.
        assert!((4..=45).contains(&count), "{count} of 150");
    }

    /// The rate holds for a run a hundred times as long, with a baseline of 10 blocks: no residue of the baseline's
    /// error accumulates. A test with a fixed baseline of 10 blocks alarms in nearly every such run.
    #[test]
    fn a_long_run_has_no_more_false_alarms_than_stated() {
        let test = test_of(0.2, 20_000.0, 10);
        let count = alarms(150, |seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
            let mut alarm = Alarm::new(test, 1.0);
            for k in 0..20_000 {
                // A new operating point every 5000 blocks.
                if k % 5000 == 0 {
                    alarm.learn_again();
                }
                let noise: f64 = StandardNormal.sample(&mut rng);
                alarm.push(noise + f64::from(k / 5000));
            }
            alarm
        });
        assert!((2..=45).contains(&count), "{count} of 150");
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
        // The mean changes by a twentieth of the range, which is invisible in a single sample.
        for _ in 0..5_000 {
            alarm.push(0.05 + film.sample());
        }
        let Verdict::Stopped { at_s, residual, .. } = alarm.verdict() else {
            panic!("{:?}", alarm.verdict());
        };
        assert!((300.0..304.0).contains(&at_s) && (residual - 0.05).abs() < 0.03);
    }

    /// A shift of one standard deviation of a block, which no single block shows.
    #[test]
    fn a_small_change_is_found_by_many_blocks() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut alarm = Alarm::new(Test::default(), 1.0);
        for k in 0..2000 {
            let noise: f64 = StandardNormal.sample(&mut rng);
            alarm.push(noise + f64::from(u8::from(k >= 1000)));
        }
        let Verdict::Stopped { at_s, .. } = alarm.verdict() else {
            panic!("{:?}", alarm.verdict());
        };
        assert!((1010.0..1120.0).contains(&at_s), "{at_s}");
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
