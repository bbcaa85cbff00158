//! How far apart errors count as independent.

use super::rules::RULES;
use crate::linalg::dot;

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

/// The correlation time of a block of [`independent_block`], samples; at least 1.
pub(crate) fn correlation_times(block: usize) -> f64 {
    (block as f64 / RULES.correlation_times).max(1.0)
}
