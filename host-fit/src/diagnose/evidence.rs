//! What held-out records say about two models: effect size, significance under
//! correlated errors, and what chance would have given.

use crate::fit::dot;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Length of the blocks whose errors count as independent, s. Sensor noise is
/// correlated over tens of milliseconds, the flow over a tenth of a second.
const BLOCK_S: f64 = 0.5;

/// The held-out error of a model: y − y_sim per record, warm-up left out.
#[derive(Clone, Debug)]
pub(super) struct HeldOut {
    pub(super) errors: Vec<Vec<f64>>,
    /// Σ e² and the number of samples.
    pub(super) sum_of_squares: f64,
    pub(super) samples: usize,
}

impl HeldOut {
    pub(super) fn new(errors: Vec<Vec<f64>>) -> Self {
        let sum_of_squares = errors.iter().map(|e| dot(e, e)).sum();
        let samples = errors.iter().map(Vec::len).sum();
        Self {
            errors,
            sum_of_squares,
            samples,
        }
    }

    /// Infinite if nothing was judged.
    pub(super) fn rmse(&self) -> f64 {
        if self.samples == 0 {
            return f64::INFINITY;
        }
        (self.sum_of_squares / self.samples as f64).sqrt()
    }
}

/// Samples of a block.
fn block(period_s: f64) -> usize {
    ((BLOCK_S / period_s).round() as usize).max(20)
}

/// One-sided p-value of "`better` has the smaller held-out error than `worse`",
/// a paired t-test on the squared errors of blocks.
pub(super) fn p_value(worse: &HeldOut, better: &HeldOut, period_s: f64) -> f64 {
    let block = block(period_s);
    let mut gains = Vec::new();
    for (worse, better) in worse.errors.iter().zip(&better.errors) {
        let (worse, better) = last_of_both(worse, better);
        for (worse, better) in worse.chunks(block).zip(better.chunks(block)) {
            gains.push(dot(worse, worse) - dot(better, better));
        }
    }
    p_above_zero(&gains)
}

/// What two series have in common at their ends: warm-ups differ.
pub(super) fn last_of_both<'a>(a: &'a [f64], b: &'a [f64]) -> (&'a [f64], &'a [f64]) {
    let n = a.len().min(b.len());
    (&a[a.len() - n..], &b[b.len() - n..])
}

/// One-sided p-value of "the mean of these independent numbers is above 0".
pub(super) fn p_above_zero(numbers: &[f64]) -> f64 {
    let n = numbers.len() as f64;
    if n < 3.0 {
        return 1.0;
    }
    let mean = numbers.iter().sum::<f64>() / n;
    let variance = numbers.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0);
    if variance <= 0.0 {
        return if mean > 0.0 { 0.0 } else { 1.0 };
    }
    let t = mean / (variance / n).sqrt();
    StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |distribution| distribution.sf(t))
}

/// Whether the error is above the noise floor: p-value of "Σ e² exceeds `margin`
/// times Σ σ²" by blocks; σ² per sample in the same shape as the errors.
pub(super) fn p_above_noise(
    held_out: &HeldOut,
    variance: &[Vec<f64>],
    period_s: f64,
    margin: f64,
) -> f64 {
    let block = block(period_s);
    let mut excess = Vec::new();
    for (errors, variance) in held_out.errors.iter().zip(variance) {
        let (errors, variance) = last_of_both(errors, variance);
        for (errors, variance) in errors.chunks(block).zip(variance.chunks(block)) {
            excess.push(dot(errors, errors) - margin * variance.iter().sum::<f64>());
        }
    }
    p_above_zero(&excess)
}

/// Fractions of the error energy that chance would have removed: what the
/// candidate changes in the free run, shifted in time or taken from another
/// record, scaled to fit the learning records and judged on the held-out ones.
pub(super) fn decoys(
    learning: (&HeldOut, &[Vec<f64>]),
    judging: (&HeldOut, &[Vec<f64>]),
    shifts: &[f64],
) -> Vec<f64> {
    let shifted = |series: &[f64], shift: f64| -> Vec<f64> {
        let by = (shift * series.len() as f64) as usize;
        let (head, tail) = series.split_at(by.min(series.len()));
        [tail, head].concat()
    };
    let decoy = |changes: &[Vec<f64>], swap: usize, shift: f64| -> Vec<Vec<f64>> {
        (0..changes.len())
            .map(|record| shifted(&changes[(record + swap) % changes.len()], shift))
            .collect()
    };
    let moments = |held_out: &HeldOut, changes: &[Vec<f64>]| {
        let pairs = held_out.errors.iter().zip(changes);
        pairs.fold((0.0, 0.0), |(cross, own), (error, change)| {
            let n = error.len().min(change.len());
            (
                cross + dot(&error[..n], &change[..n]),
                own + dot(&change[..n], &change[..n]),
            )
        })
    };
    shifts
        .iter()
        .enumerate()
        .map(|(i, shift)| {
            let (cross, own) = moments(learning.0, &decoy(learning.1, i, *shift));
            let scale = if own > 0.0 { cross / own } else { 0.0 };
            let (cross, own) = moments(judging.0, &decoy(judging.1, i, *shift));
            (2.0 * scale * cross - scale * scale * own) / judging.0.sum_of_squares
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn coloured(rng: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
        let mut state = 0.0;
        (0..n)
            .map(|_| {
                state = 0.95 * state + rng.random_range(-1.0..1.0) * 0.3;
                state + rng.random_range(-0.5..0.5)
            })
            .collect()
    }

    /// Two models that err equally, each with noise of its own: the stated
    /// false-alarm rate is the true one.
    #[test]
    fn the_p_value_is_calibrated_for_coloured_errors() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let trials = 400;
        let mut alarms = 0;
        for _ in 0..trials {
            let held_out = |rng: &mut ChaCha8Rng| {
                HeldOut::new((0..2).map(|_| coloured(rng, 10_000)).collect())
            };
            let (a, b) = (held_out(&mut rng), held_out(&mut rng));
            alarms += usize::from(p_value(&a, &b, 0.001) < 0.05);
        }
        // Binomial(400, 0.05): 20 ± 4.4.
        assert!((7..=35).contains(&alarms), "{alarms} of {trials}");
    }
}
