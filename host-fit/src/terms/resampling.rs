//! Stability of the choice of a model under bootstrap resampling of the validation records.

use super::RULES;
use super::evidence::HeldOut;
use numerics::linalg::dot;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Shares of the bootstrap resamples in which each model has the smallest validation error.
///
/// Two-stage resampling with replacement: records first, then independent blocks of each record. All models
/// get the same draws, and the draws are the same in every run.
pub(crate) fn shares_won(models: &[&HeldOut]) -> Vec<f64> {
    let Some(block) = models.iter().map(|model| model.block()).max() else {
        return Vec::new();
    };
    let records = models.iter().map(|model| model.errors.len()).min();
    let records = (0..records.unwrap_or(0)).map(|record| sums(models, record, block));
    let records: Vec<Vec<Vec<f64>>> = records.filter(|blocks| !blocks.is_empty()).collect();
    let mut won = vec![0.0; models.len()];
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    for _ in 0..RULES.resamples {
        let mut total = vec![0.0; models.len()];
        for _ in &records {
            let blocks = &records[rng.random_range(0..records.len())];
            for _ in blocks {
                let drawn = &blocks[rng.random_range(0..blocks.len())];
                for (sum, own) in total.iter_mut().zip(drawn) {
                    *sum += own;
                }
            }
        }
        let best = (0..models.len()).min_by(|a, b| total[*a].total_cmp(&total[*b]));
        if let Some(best) = best {
            won[best] += 1.0 / RULES.resamples as f64;
        }
    }
    won
}

/// Σ e² of each block of a record for each model, over the common end of the series (warm-ups differ).
fn sums(models: &[&HeldOut], record: usize, block: usize) -> Vec<Vec<f64>> {
    let ends = models.iter().map(|model| &model.errors[record][..]);
    let common = ends.clone().map(<[f64]>::len).min().unwrap_or(0);
    let ends: Vec<&[f64]> = ends
        .map(|errors| &errors[errors.len() - common..])
        .collect();
    let blocks = (0..common).step_by(block.max(1));
    let of = |errors: &&[f64], start: usize| {
        let own = &errors[start..(start + block).min(common)];
        dot(own, own)
    };
    blocks
        .map(|start| ends.iter().map(|errors| of(errors, start)).collect())
        .collect()
}

/// Whether the model at index `own` is excluded, because its share of won resamples is too far below the largest
/// share (inflated argmax of two; Adrian, Soloff and Willett, arXiv 2410.18268).
pub(crate) fn is_out(shares: &[f64], own: usize) -> bool {
    let most = shares.iter().copied().fold(0.0, f64::max);
    shares[own] <= most - RULES.inflation / std::f64::consts::SQRT_2
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u64, size: f64) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut record = || (0..4000).map(|_| rng.random_range(-size..size)).collect();
        (0..3).map(|_| record()).collect()
    }

    #[test]
    fn what_is_clearly_better_wins_and_equals_share() {
        let [a, b, far] =
            [(1, 1.0), (2, 1.0), (3, 1.3)].map(|(seed, size)| HeldOut::new(noise(seed, size)));
        let shares = shares_won(&[&a, &b, &far]);
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(
            shares[2] < 0.01 && shares[0] > 0.02 && shares[1] > 0.02,
            "{shares:?}"
        );
        assert!(is_out(&shares, 2));
        let shares = shares_won(&[&a, &far]);
        assert!(shares[0] > 0.99 && !is_out(&shares, 0));
    }

    /// The best model wins only because of one of three records. It loses in more than a quarter of the resamples,
    /// but the other models stay excluded.
    #[test]
    fn a_gain_in_one_record_is_less_stable() {
        let good = noise(4, 1.0);
        let mut worse = good.clone();
        worse[0].iter_mut().for_each(|e| *e += 0.5);
        let mut other = noise(5, 1.0);
        other[1].iter_mut().for_each(|e| *e += 0.5);
        let (good, worse, other) = (HeldOut::new(good), HeldOut::new(worse), HeldOut::new(other));
        let shares = shares_won(&[&good, &worse, &other]);
        assert!(
            shares[0] > 0.6 && is_out(&shares, 1) && is_out(&shares, 2),
            "{shares:?}"
        );
        assert!(shares[2] > 0.05, "{shares:?}");
    }
}
