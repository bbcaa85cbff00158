//! White noise of a record, and single outliers.

use crate::data::rounding_variance;

/// A sample counts as an outlier if it is this many standard deviations of the white noise away from both neighbours.
const OUTLIER: f64 = 6.0;

/// Variance of white noise in some records, from the median of the squared second differences of y: responses
/// change these only in few samples. At least the variance of the rounding of y.
pub(crate) fn white_noise<'a>(records: impl Iterator<Item = &'a [f64]> + Clone) -> f64 {
    let rounding = rounding_variance(records.clone());
    let differences = records.flat_map(|y| y.windows(3));
    let mut squares: Vec<f64> = differences
        .map(|w| (w[0] - 2.0 * w[1] + w[2]).powi(2) / 6.0)
        .collect();
    let middle = squares.len() / 2;
    if squares.is_empty() {
        return 0.0;
    }
    // The median of a squared normal deviate is 0.455 of its variance.
    let median = *squares.select_nth_unstable_by(middle, f64::total_cmp).1;
    (median / 0.455).max(rounding)
}

/// y with every outlier replaced by the mean of its neighbours. At an outlier y jumps and returns within one sample. A
/// response to a command that is held for several samples cannot do this.
pub(crate) fn without_outliers(y: &[f64]) -> Vec<f64> {
    let least = OUTLIER * white_noise(std::iter::once(y)).sqrt();
    let mut out = y.to_vec();
    // The first and the last sample have one neighbour.
    if let [first, second, .., before, last] = out.as_mut_slice() {
        for (end, neighbour) in [(first, *second), (last, *before)] {
            if least > 0.0 && (*end - neighbour).abs() > least {
                *end = neighbour;
            }
        }
    }
    for k in 1..y.len().saturating_sub(1) {
        let (before, here, after) = (y[k - 1], y[k], y[k + 1]);
        let middle = f64::midpoint(before, after);
        let jump = (here - middle).abs();
        if least > 0.0 && jump > least && (after - before).abs() < 0.5 * jump {
            out[k] = middle;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_single_samples_are_replaced() {
        // Sums of four uniform numbers, so that the tails are those of a nearly normal
        // distribution.
        let uniform = |k: usize| {
            ((k as u32).wrapping_mul(2_654_435_761) >> 8) as f64 / f64::from(1 << 24) - 0.5
        };
        let noise = |k: usize| 0.01 * (0..4).map(|i| uniform(4 * k + i + 1)).sum::<f64>();
        let mut y: Vec<f64> = (0..400)
            .map(|k| noise(k) + f64::from(u8::from(k >= 200)))
            .collect();
        let step = y.clone();
        assert_eq!(without_outliers(&step), step);
        y[50] += 0.5;
        y[300] -= 2.0;
        y[399] += 1.0;
        for (k, (cleaned, clean)) in without_outliers(&y).iter().zip(&step).enumerate() {
            assert!((cleaned - clean).abs() < 0.03, "{k}: {cleaned} {clean}");
        }
        assert_eq!(without_outliers(&[1.0, 2.0]), [1.0, 2.0]);
    }
}
