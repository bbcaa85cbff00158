//! A data set like the paper's, from its published state-dependent model with disturbances.
//!
//! The recursion is implemented independently, so that the tool is not tested with data from its own code.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use recordings::{DataError, DataSet, Record, Use};

use crate::command::{Command, RUN_SAMPLES, TAIL_SAMPLES};
use crate::plant::SAMPLE_PERIOD_S;

/// Meaning of a printed lag τ when y_{k+1} is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LagReading {
    /// y_{k−τ}, as printed in (3).
    #[default]
    Literal,
    /// y_{k+1−τ}.
    OneStep,
}

/// Table II of the ECC 2016 paper (hal-01298166), state-dependent delay, with law (2).
struct TableTwo;

impl TableTwo {
    const STATE: [(usize, f64); 5] = [
        (1, 0.9759),
        (44, 0.0141),
        (123, 0.0025),
        (479, -0.0042),
        (496, 0.0055),
    ];
    const INPUT: f64 = 0.0080;
    const PRODUCT: [(usize, f64); 10] = [
        (1, -0.0228),
        (73, 0.0138),
        (242, 0.0621),
        (264, -0.0286),
        (299, -0.0186),
        (335, -0.0121),
        (414, -0.0035),
        (477, -0.0056),
        (494, 0.0189),
        (500, -0.0049),
    ];
    const WINDOW: usize = 250;

    /// Law (2) at the mean of the last samples of `y` (1), rounded to samples.
    fn delay(y: &[f64]) -> usize {
        let k = y.len() - 1;
        let sum: f64 = (1..Self::WINDOW)
            .filter_map(|s| k.checked_sub(s).and_then(|i| y.get(i)))
            .sum();
        let mean = sum / Self::WINDOW as f64;
        // In the paper the mean friction is never far below 0, where the law is undefined.
        (47.35 + 12.69 * (-20.18 * mean.max(0.0)).exp()).round() as usize
    }
}

/// Sizes of the disturbances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbances {
    /// Standard deviation of the noise that enters the recursion each sample (y).
    pub process: f64,
    /// Standard deviation of white noise on the reading (y).
    pub sensor: f64,
    /// Amplitude (y) and frequency (Hz) of a sine on the reading.
    pub sine: (f64, f64),
}

impl Default for Disturbances {
    /// Process noise 0.005, sensor noise 0.001, a sine of 0.03 at 0.7 Hz.
    fn default() -> Self {
        Self {
            process: 0.005,
            sensor: 0.001,
            sine: (0.03, 0.7),
        }
    }
}

/// Readings of the published model under a command, disturbed.
fn play(command: &[f64], lags: LagReading, size: Disturbances, mut rng: ChaCha8Rng) -> Vec<f64> {
    let shift = match lags {
        LagReading::Literal => 0,
        LagReading::OneStep => 1,
    };
    let mut gauss = |sd: f64| {
        let x: f64 = StandardNormal.sample(&mut rng);
        sd * x
    };
    let past = |x: &[f64], k: usize, lag: usize| {
        (k + shift)
            .checked_sub(lag)
            .and_then(|i| x.get(i))
            .copied()
            .unwrap_or(0.0)
    };
    let mut y = vec![0.0];
    for k in 0..command.len().saturating_sub(1) {
        let arrived = k
            .checked_sub(TableTwo::delay(&y))
            .and_then(|i| command.get(i))
            .copied()
            .unwrap_or(0.0);
        let state: f64 = TableTwo::STATE
            .iter()
            .map(|(lag, a)| a * past(&y, k, *lag))
            .sum();
        let product: f64 = TableTwo::PRODUCT
            .iter()
            .map(|(lag, c)| c * past(&y, k, *lag))
            .sum();
        y.push(state + (TableTwo::INPUT + product) * arrived + gauss(size.process));
    }
    let (amplitude, frequency) = size.sine;
    y.iter()
        .enumerate()
        .map(|(k, y)| {
            let phase = TAU * frequency * k as f64 * SAMPLE_PERIOD_S;
            y + amplitude * phase.sin() + gauss(size.sensor)
        })
        .collect()
}

/// The paper's runs: step, 4 Hz 50 %, 4 Hz 80 %, 8 Hz 50 % for estimation (40 000 samples), a second constant
/// run and 8 Hz 80 % for validation. Blowing starts with the record and ends 1.5 s before its end.
///
/// # Errors
/// [`DataError`] when the disturbances make the model diverge.
pub fn paper_like_set(
    lags: LagReading,
    size: Disturbances,
    seed: u64,
) -> Result<DataSet, DataError> {
    let end = RUN_SAMPLES - TAIL_SAMPLES;
    let square = |name: &str, period: usize, on: f64| {
        let openings: Vec<(usize, usize)> = (0..end)
            .step_by(period)
            .map(|at| {
                let off = at + (on * period as f64).round() as usize;
                (at, off.min(end))
            })
            .collect();
        Command::from_switching(name, RUN_SAMPLES, &openings)
    };
    let runs = [
        (square("step", end, 1.0), Use::Identify),
        (square("sq4-50", 250, 0.5), Use::Identify),
        (square("sq4-80", 250, 0.8), Use::Identify),
        (square("sq8-50", 125, 0.5), Use::Identify),
        (square("step-2", end, 1.0), Use::Validate),
        (square("sq8-80", 125, 0.8), Use::Validate),
    ];
    let records = runs
        .into_iter()
        .zip(0_u64..)
        .map(|((command, role), number)| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(number);
            let y = play(&command.levels, lags, size, rng);
            Record::new(&command.name, role, SAMPLE_PERIOD_S, command.levels, y)
        })
        .collect();
    let title = format!("Table II of hal-01298166 with disturbances, run {seed}");
    DataSet::from_records(Some(title), records)
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUIET: Disturbances = Disturbances {
        process: 0.0,
        sensor: 0.0,
        sine: (0.0, 0.7),
    };

    fn rms(x: &[f64]) -> f64 {
        (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt()
    }

    #[test]
    fn the_quiet_step_has_the_published_steps_response() {
        // Values of y at 0.1, 0.2, 0.5, 1, 2 s, computed independently for both conventions.
        for (lags, expected) in [
            (LagReading::Literal, [0.11, 0.23, 0.54, 0.79, 0.99]),
            (LagReading::OneStep, [0.15, 0.27, 0.62, 0.84, 1.02]),
        ] {
            let set = paper_like_set(lags, QUIET, 1).unwrap();
            let y = &set.records[0].y;
            for (k, value) in [100, 200, 500, 1000, 2000].into_iter().zip(expected) {
                assert!((y[k] - value).abs() < 0.01, "{lags:?} at {k}: {}", y[k]);
            }
        }
    }

    #[test]
    fn the_first_edge_arrives_after_the_delay_of_separated_flow() {
        let set = paper_like_set(LagReading::Literal, QUIET, 1).unwrap();
        let first = set.records[1].y.iter().position(|y| *y != 0.0);
        // round(47.35 + 12.69) = 60 samples; y_{k+1} responds to the arrival at k.
        assert_eq!(first, Some(61));
    }

    #[test]
    fn disturbances_have_their_size_and_the_set_its_shape() {
        let made = |size| paper_like_set(LagReading::Literal, size, 5).unwrap();
        let loud = made(Disturbances::default());
        assert_eq!(loud.hash, made(Disturbances::default()).hash);
        let quiet = made(QUIET);
        let identify: usize = loud.identify().map(Record::len).sum();
        assert_eq!(identify, 40_000);
        for (a, b) in loud.records.iter().zip(&quiet.records) {
            assert!(a.u[RUN_SAMPLES - TAIL_SAMPLES..].iter().all(|u| *u == 0.0));
            let off: Vec<f64> = a.y.iter().zip(&b.y).map(|(p, q)| p - q).collect();
            // The sine alone has an rms of 0.021; process noise is amplified by the nearly
            // integrating model.
            assert!(
                (0.021..0.08).contains(&rms(&off)),
                "{}: {}",
                a.name,
                rms(&off)
            );
        }
    }
}
