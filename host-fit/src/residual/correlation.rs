//! Tests on correlated errors: blocks that count as independent, and whether their sum is above 0.

use super::rules::RULES;
use numerics::linalg::dot;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Standard deviation of a normal distribution over its median absolute deviation.
const NORMAL: f64 = 1.4826;

/// Block length in samples such that the errors of neighbouring blocks count as independent.
pub(crate) fn independent_block(errors: &[impl AsRef<[f64]>]) -> usize {
    let samples: usize = errors.iter().map(|e| e.as_ref().len()).sum();
    let thinned = (samples / RULES.plenty).max(1);
    let means = |errors: &[f64]| -> Vec<f64> {
        let each = errors.chunks_exact(thinned);
        each.map(|chunk| chunk.iter().sum::<f64>() / thinned as f64)
            .collect()
    };
    let series: Vec<Vec<f64>> = errors.iter().map(|e| means(e.as_ref())).collect();
    let covariance = |lag: usize| -> f64 {
        let pairs = series.iter().filter(|s| s.len() > lag);
        pairs.map(|s| dot(&s[lag..], &s[..s.len() - lag])).sum()
    };
    let longest = samples / RULES.fewest_blocks;
    let variance = covariance(0).max(f64::MIN_POSITIVE);
    // The autocorrelation is summed up to its first zero crossing.
    let correlations = (1..=longest / thinned).map(|lag| covariance(lag) / variance);
    let time = 1.0 + 2.0 * correlations.take_while(|rho| *rho > 0.0).sum::<f64>();
    let samples = (RULES.correlation_times * time * thinned as f64) as usize;
    samples.clamp(RULES.shortest_block, longest.max(RULES.shortest_block))
}

/// The correlation length of a block of [`independent_block`], samples; at least 1.
pub(crate) fn correlation_length(block: usize) -> f64 {
    (block as f64 / RULES.correlation_times).max(1.0)
}

/// p-value of the null hypothesis that the sum of these independent blocks is not above 0. Their scatter is
/// estimated from the median absolute deviation, so that an error in few blocks does not inflate it. 1 for fewer
/// than three blocks.
pub(crate) fn p_above(blocks: &[f64]) -> f64 {
    let n = blocks.len() as f64;
    if n < 3.0 {
        return 1.0;
    }
    let mean = blocks.iter().sum::<f64>() / n;
    let middle = median(blocks.to_vec());
    let deviation = median(blocks.iter().map(|x| (x - middle).abs()).collect());
    student(mean, NORMAL * deviation / n.sqrt(), n - 1.0)
}

/// One-sided p-value of the null hypothesis that the true value of this estimate is not above 0.
pub(crate) fn student(estimate: f64, error: f64, degrees: f64) -> f64 {
    if error <= 0.0 {
        return if estimate > 0.0 { 0.0 } else { 1.0 };
    }
    StudentsT::new(0.0, 1.0, degrees).map_or(1.0, |t| t.sf(estimate / error))
}

/// The median; 0 of an empty list.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}
