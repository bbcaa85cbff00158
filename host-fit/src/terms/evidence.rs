//! Comparison of two models on validation records: effect size, significance under correlated errors, and the
//! gain expected under noise alone.

use crate::residual::{correlation_length, independent_block, p_above, student};
use numerics::linalg::dot;

/// Free-run error y − y_sim of a model on the validation records, without the warm-up.
#[derive(Clone, Debug)]
pub(crate) struct HeldOut {
    pub(crate) errors: Vec<Vec<f64>>,
    /// Σ e² and the number of samples.
    pub(crate) sum_of_squares: f64,
    pub(crate) samples: usize,
    /// Σ e² before errors along the level's scatter were removed.
    pub(crate) measured: f64,
    /// Block length in samples; blocks count as independent.
    block: usize,
}

impl HeldOut {
    pub(crate) fn new(errors: Vec<Vec<f64>>) -> Self {
        let sum_of_squares = errors.iter().map(|e| dot(e, e)).sum();
        let samples = errors.iter().map(Vec::len).sum();
        Self {
            block: independent_block(&errors),
            errors,
            sum_of_squares,
            samples,
            measured: sum_of_squares,
        }
    }

    /// The errors without their part along the level's scatter; `measured` is Σ e² with that part.
    pub(crate) fn beside_scatter(self, measured: f64) -> Self {
        Self { measured, ..self }
    }

    /// Root mean square of y − y_sim as measured, scatter of the level included.
    pub(crate) fn measured_rmse(&self) -> f64 {
        (self.measured / self.samples.max(1) as f64).sqrt()
    }

    /// Correlation length: number of samples per independent sample.
    pub(crate) fn correlated(&self) -> f64 {
        correlation_length(self.block)
    }

    /// Block length in samples; blocks count as independent.
    pub(crate) fn block(&self) -> usize {
        self.block
    }

    /// Root mean square error; infinite without samples.
    pub(crate) fn rmse(&self) -> f64 {
        if self.samples == 0 {
            return f64::INFINITY;
        }
        (self.sum_of_squares / self.samples as f64).sqrt()
    }
}

/// One-sided p-value of the null hypothesis that the validation error of `better` is not smaller than that of
/// `worse`.
///
/// With d the difference of the two runs and m the mean of their errors, the gain Σ e² − Σ e'² is 2 Σ m·d. It is
/// positive if the regression of m on d has a positive slope. The test is Student's t test on that slope. The
/// standard error is cluster-robust over blocks, with as many degrees of freedom as blocks in which the runs
/// differ. A paired test on the blocks' gains would lose power if the gain is concentrated in few blocks.
pub(crate) fn p_value(worse: &HeldOut, better: &HeldOut) -> f64 {
    let block = better.block;
    // Each block gives Σ m·d and Σ d·d.
    let mut blocks = Vec::new();
    for (worse, better) in worse.errors.iter().zip(&better.errors) {
        let (worse, better) = last_of_both(worse, better);
        for (worse, better) in worse.chunks(block).zip(better.chunks(block)) {
            let pairs = || worse.iter().zip(better);
            let product: f64 = pairs().map(|(w, b)| 0.5 * (w + b) * (w - b)).sum();
            let square: f64 = pairs().map(|(w, b)| (w - b) * (w - b)).sum();
            blocks.push((product, square));
        }
    }
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| blocks.iter().map(of).sum::<f64>();
    let (product, square) = (sum(&|block| block.0), sum(&|block| block.1));
    let effective = square * square / sum(&|block| block.1 * block.1).max(f64::MIN_POSITIVE);
    if blocks.len() < 3 || effective <= 1.0 {
        return 1.0;
    }
    let slope = product / square;
    let scatter = sum(&|block| (block.0 - slope * block.1).powi(2));
    let error = (scatter * effective / (effective - 1.0)).sqrt();
    student(product, error, (effective - 1.0).max(1.0))
}

/// The last samples that two series have in common; their warm-ups differ in length.
fn last_of_both<'a>(a: &'a [f64], b: &'a [f64]) -> (&'a [f64], &'a [f64]) {
    let n = a.len().min(b.len());
    (&a[a.len() - n..], &b[b.len() - n..])
}

/// p-value of the null hypothesis that Σ e² does not exceed `margin` times Σ σ², over blocks; σ² per
/// sample in the shape of the errors.
pub(crate) fn p_above_noise(held_out: &HeldOut, variance: &[Vec<f64>], margin: f64) -> f64 {
    let block = held_out.block;
    let mut excess = Vec::new();
    for (errors, variance) in held_out.errors.iter().zip(variance) {
        let (errors, variance) = last_of_both(errors, variance);
        for (errors, variance) in errors.chunks(block).zip(variance.chunks(block)) {
            excess.push(dot(errors, errors) - margin * variance.iter().sum::<f64>());
        }
    }
    p_above(&excess)
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

    /// Two equally wrong models with independent noise: the false-alarm rate is the stated one.
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
            alarms += usize::from(p_value(&a, &b) < 0.05);
        }
        // In 400 trials, 20 ± 4.4 false alarms are expected.
        assert!((7..=35).contains(&alarms), "{alarms} of {trials}");
    }

    /// Two models that differ in the first second of each record: both are equally wrong there, or one of them is
    /// right.
    #[test]
    fn a_gain_in_few_places_counts_and_a_chance_does_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let (trials, mut alarms, mut found) = (400, 0, 0);
        for _ in 0..trials {
            let noise: Vec<Vec<f64>> = (0..3).map(|_| coloured(&mut rng, 10_000)).collect();
            let off_by = |share: f64| {
                let bump = |k: usize| {
                    if k < 1000 {
                        (k as f64 / 90.0).sin()
                    } else {
                        0.0
                    }
                };
                let off = |record: &Vec<f64>| {
                    let pairs = record.iter().enumerate();
                    pairs.map(|(k, e)| e + share * bump(k)).collect()
                };
                HeldOut::new(noise.iter().map(off).collect())
            };
            alarms += usize::from(p_value(&off_by(0.5), &off_by(-0.5)) < 0.05);
            found += usize::from(p_value(&off_by(1.0), &off_by(0.0)) < 0.01);
        }
        // With six clusters the level of the test is not exact.
        assert!((5..=45).contains(&alarms), "{alarms} of {trials}");
        assert!(found > 320, "{found} of {trials}");
    }
}
