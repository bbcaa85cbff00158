//! Covariance of fitted parameters, robust to correlated residuals and unmodelled disturbances.
//!
//! Free-run residuals are correlated; standard errors for white residuals are several times too small. Two
//! robust estimates are computed, and the larger counts for each coordinate. Sums of J·r over blocks much
//! longer than the correlation time are uncorrelated; their outer products give the *sandwich* estimate
//! (batch means), which misses disturbances longer than a block. The *jackknife* over records, to first
//! order, includes such long disturbances, because each record would give different parameters. With few
//! records the jackknife is uncertain; Student's t allows for this (MacKinnon, Nielsen and Webb 2023, J.
//! Econometrics 232:272, advise this for few clusters).

use super::levenberg::Part;
use super::rules::RULES;
use numerics::linalg::{dot, dots, gram, inverse_where_known};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};
use std::ops::Range;

/// Covariance of `n` coordinates, row-major, from the last linearisation and its JᵀJ, scaled so that ±1.96
/// standard errors are a 95 % interval; NaN on the diagonal for coordinates that are not identifiable. `None`
/// if a decomposition fails.
pub(super) fn covariance(parts: &[Part], information: &[f64], n: usize) -> Option<Vec<f64>> {
    let (inverse, unknown) = inverse_where_known(information, n)?;
    let each = RULES
        .batches
        .map(|batches| sandwich(parts, batches, &inverse, n));
    let left_out = jackknife(parts, information, n);
    let [mut covariance, longer] = each;
    let wider = |i: usize| {
        let own = covariance[i * n + i];
        // An undefined jackknife variance (NaN) is ignored.
        let most = own.max(longer[i * n + i]).max(left_out[i]);
        (most / own.max(f64::MIN_POSITIVE)).sqrt()
    };
    let wider: Vec<f64> = (0..n).map(wider).collect();
    for i in 0..n {
        for j in 0..n {
            covariance[i * n + j] *= wider[i] * wider[j];
        }
        if unknown[i] {
            covariance[i * n + i] = f64::NAN;
        }
    }
    Some(covariance)
}

/// (JᵀJ)⁻¹ S (JᵀJ)⁻¹ with S = Σ (J·r)(J·r)ᵀ over `batches` blocks of each record.
fn sandwich(parts: &[Part], batches: usize, inverse: &[f64], n: usize) -> Vec<f64> {
    let mut middle = vec![0.0; n * n];
    let mut count = 0;
    for part in parts {
        for block in pieces(part.residual.len(), batches) {
            let score = score(part, &block);
            for i in 0..n {
                for j in 0..n {
                    middle[i * n + j] += score[i] * score[j];
                }
            }
            count += 1;
        }
    }
    // The gradient is 0 at a minimum, which removes one degree of freedom.
    let count = f64::from(count);
    middle
        .iter_mut()
        .for_each(|m| *m *= count / (count - 1.0).max(1.0));
    let half = product(n, |i, k| inverse[i * n + k], |k, j| middle[k * n + j]);
    product(n, |i, k| half[i * n + k], |k, j| inverse[k * n + j])
}

/// Jackknife variances: the first-order change of each coordinate when one record is left out, or a piece of
/// it if records are few. NaN where the remaining records do not identify it.
fn jackknife(parts: &[Part], information: &[f64], n: usize) -> Vec<f64> {
    let each = RULES.left_out.div_ceil(parts.len().max(1));
    let groups: Vec<(&Part, Range<usize>)> = (parts.iter())
        .flat_map(|part| pieces(part.residual.len(), each).map(move |piece| (part, piece)))
        .collect();
    let mut sums = vec![0.0; n];
    for (part, piece) in &groups {
        let columns = part.jacobian.iter().map(|column| &column[piece.clone()]);
        let own = gram(&columns.collect::<Vec<_>>());
        let others: Vec<f64> = information.iter().zip(own).map(|(a, b)| a - b).collect();
        let Some((inverse, unknown)) = inverse_where_known(&others, n) else {
            return vec![f64::NAN; n];
        };
        let score = score(part, piece);
        for (i, sum) in sums.iter_mut().enumerate() {
            let moved = dot(&inverse[i * n..(i + 1) * n], &score);
            *sum += if unknown[i] { f64::NAN } else { moved * moved };
        }
    }
    let degrees = groups.len() as f64 - 1.0;
    let Ok(students) = StudentsT::new(0.0, 1.0, degrees) else {
        return vec![f64::NAN; n];
    };
    let wider = students.inverse_cdf(0.975) / Normal::standard().inverse_cdf(0.975);
    let scale = wider * wider * degrees / (degrees + 1.0);
    sums.iter().map(|sum| scale * sum).collect()
}

/// J·r summed over a piece.
fn score(part: &Part, piece: &Range<usize>) -> Vec<f64> {
    let columns = part.jacobian.iter();
    dots(
        &part.residual[piece.clone()],
        columns.map(|column| &column[piece.clone()]),
    )
}

/// About `count` equal pieces of `samples` samples.
fn pieces(samples: usize, count: usize) -> impl Iterator<Item = Range<usize>> {
    let length = (samples / count).max(1);
    (0..samples)
        .step_by(length)
        .map(move |from| from..(from + length).min(samples))
}

/// The product of two square matrices, row-major.
fn product(
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
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn information(parts: &[Part], n: usize) -> Vec<f64> {
        let cell = |i: usize, j: usize| {
            let each = parts
                .iter()
                .map(|part| dot(&part.jacobian[i], &part.jacobian[j]));
            each.sum::<f64>()
        };
        (0..n * n).map(|at| cell(at / n, at % n)).collect()
    }

    /// Eight records with an individual level each: treating blocks of a fortieth as independent would give
    /// far too small an error.
    #[test]
    fn what_lasts_as_long_as_a_record_counts_as_one_draw() {
        let part = |k: usize| Part {
            residual: vec![if k.is_multiple_of(2) { 0.1 } else { -0.1 }; 4000],
            jacobian: vec![vec![1.0; 4000]],
        };
        let parts: Vec<Part> = (0..8).map(part).collect();
        let variance = jackknife(&parts, &[32_000.0], 1)[0];
        // Eight draws with standard deviation 0.1: the mean has the standard error 0.1/√7, multiplied by Student's
        // t with 7 degrees of freedom.
        let wider: f64 = 2.3646 / 1.96;
        assert!(
            (variance / (0.01 / 7.0) - wider * wider).abs() < 1e-3,
            "{variance}"
        );
        let counts = covariance(&parts, &[32_000.0], 1).expect("symmetric");
        assert!((counts[0] / variance - 1.0).abs() < 1e-9, "{counts:?}");
    }

    /// A coordinate that only one record identifies gets its interval from blocks. A coordinate that no record
    /// identifies gets none.
    #[test]
    fn what_one_record_alone_tells_has_an_interval_all_the_same() {
        let part = |tells: f64| Part {
            residual: (0..4000)
                .map(|k| 0.1 * f64::from(k * 7919 % 11 - 5))
                .collect(),
            jacobian: vec![vec![1.0; 4000], vec![tells; 4000], vec![0.0; 4000]],
        };
        let parts: Vec<Part> = [2.0, 0.0, 0.0, 0.0, 0.0].map(part).into();
        let covariance = covariance(&parts, &information(&parts, 3), 3).expect("symmetric");
        assert!(
            covariance[4] > 0.0 && covariance[4].is_finite(),
            "{covariance:?}"
        );
        assert!(covariance[8].is_nan());
    }

    /// A mean and a wave in five records with 30 ms correlated noise and individual levels: the 95 %
    /// intervals have the stated coverage.
    #[test]
    fn intervals_from_five_records_hold_the_truth_as_often_as_they_say() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut normal = move || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
        let (trials, mut held) = (300, [0, 0]);
        for _ in 0..trials {
            let mut part = || {
                let (level, mut noise) = (normal(), 0.0);
                let mut sample = |_| {
                    noise = 0.967 * noise + 0.25 * normal();
                    level + noise
                };
                Part {
                    residual: (0..1000).map(&mut sample).collect(),
                    jacobian: vec![
                        vec![1.0; 1000],
                        (0..1000).map(|k| (f64::from(k) / 90.0).sin()).collect(),
                    ],
                }
            };
            let mut parts: Vec<Part> = (0..5).map(|_| part()).collect();
            let information = information(&parts, 2);
            let gradient: Vec<f64> = (0..2)
                .map(|i| parts.iter().map(|p| dot(&p.jacobian[i], &p.residual)).sum())
                .collect();
            let (inverse, _) = inverse_where_known(&information, 2).expect("symmetric");
            let found: Vec<f64> = (0..2)
                .map(|i| dot(&inverse[2 * i..2 * i + 2], &gradient))
                .collect();
            for part in &mut parts {
                let Part { residual, jacobian } = part;
                for (k, r) in residual.iter_mut().enumerate() {
                    *r -= found[0] * jacobian[0][k] + found[1] * jacobian[1][k];
                }
            }
            let covariance = covariance(&parts, &information, 2).expect("symmetric");
            for i in 0..2 {
                held[i] += usize::from(found[i].abs() <= 1.96 * covariance[3 * i].sqrt());
            }
        }
        // Of 300 intervals, 285 ± 3.8 are expected to contain the true value. Blocks count the levels as noise,
        // which widens the interval of the wave.
        let [mean, wave] = held;
        assert!(
            (274..=296).contains(&mean) && wave >= 274,
            "{held:?} of {trials}"
        );
    }
}
