//! Variances of fitted parameters that allow for residuals which are correlated over many samples.

use super::levenberg::Part;
use super::rules::RULES;
use crate::linalg::dot;

/// (JᵀJ)⁻¹ S (JᵀJ)⁻¹ with S the long-run covariance of J·r: residuals of a free run
/// are correlated over many samples, and standard errors that ignore it are several
/// times too small. S is estimated by batch means: sums of J·r over blocks much longer
/// than the memory of the noise are uncorrelated, and their outer products are cheap.
/// How long that memory is nobody knows: of several lengths the one that says most counts for each coordinate.
pub(super) fn sandwich(parts: &[Part], inverse: &[f64], n: usize) -> Vec<f64> {
    let each = RULES.batches.map(|batches| {
        let middle = of_batches(parts, batches, n);
        let half = product(n, |i, k| inverse[i * n + k], |k, j| middle[k * n + j]);
        product(n, |i, k| half[i * n + k], |k, j| inverse[k * n + j])
    });
    let [mut widest, longer @ ..] = each;
    let most = |i: usize| {
        let variances = longer.iter().map(|other| other[i * n + i]);
        variances.fold(widest[i * n + i], f64::max)
    };
    let wider = |i: usize| (most(i) / widest[i * n + i].max(f64::MIN_POSITIVE)).sqrt();
    let wider: Vec<f64> = (0..n).map(wider).collect();
    for i in 0..n {
        for j in 0..n {
            widest[i * n + j] *= wider[i] * wider[j];
        }
    }
    widest
}

/// Σ (J·r)(J·r)ᵀ over blocks, so many of each record.
fn of_batches(parts: &[Part], batches: usize, n: usize) -> Vec<f64> {
    let mut middle = vec![0.0; n * n];
    let mut count = 0;
    for part in parts {
        let length = part.residual.len();
        let block = (length / batches).max(1);
        let mut from = 0;
        while from < length {
            let to = (from + block).min(length);
            let score: Vec<f64> = (0..n)
                .map(|i| dot(&part.jacobian[i][from..to], &part.residual[from..to]))
                .collect();
            for i in 0..n {
                for j in 0..n {
                    middle[i * n + j] += score[i] * score[j];
                }
            }
            from = to;
            count += 1;
        }
    }
    // The gradient is 0 at a minimum: of so many sums one is known.
    let count = f64::from(count);
    middle
        .iter_mut()
        .for_each(|m| *m *= count / (count - 1.0).max(1.0));
    middle
}

/// The product of two square matrices, row-major.
pub(super) fn product(
    n: usize,
    left: impl Fn(usize, usize) -> f64,
    right: impl Fn(usize, usize) -> f64,
) -> Vec<f64> {
    let cells = (0..n * n).map(|cell| (cell / n, cell % n));
    cells
        .map(|(i, j)| (0..n).map(|k| left(i, k) * right(k, j)).sum())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight records that are each off by a level of their own: blocks of a fortieth of them know forty times too much.
    #[test]
    fn what_lasts_as_long_as_a_record_counts_as_one_draw() {
        let part = |k: usize| Part {
            residual: vec![if k.is_multiple_of(2) { 0.1 } else { -0.1 }; 4000],
            jacobian: vec![vec![1.0; 4000]],
        };
        let parts: Vec<Part> = (0..8).map(part).collect();
        let variance = sandwich(&parts, &[1.0 / 32_000.0], 1)[0];
        // Eight draws of 0.1, their mean known to 0.1/√7.
        assert!((variance - 0.01 / 7.0).abs() < 1e-9, "{variance}");
    }
}
