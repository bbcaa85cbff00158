//! What generated constants must satisfy, checked while they compile.

use crate::recursion::LagConvention;

/// Whether all coefficients are finite.
#[must_use]
pub const fn finite(coefficients: &[f32]) -> bool {
    let mut i = 0;
    while i < coefficients.len() {
        if !coefficients[i].is_finite() {
            return false;
        }
        i += 1;
    }
    true
}

/// Outputs that must be kept for `lags`: one more than the longest reaches back.
#[must_use]
pub const fn outputs_for(lags: &[u16], convention: LagConvention) -> usize {
    let mut longest = 0;
    let mut i = 0;
    while i < lags.len() {
        let reach = convention.behind_newest(lags[i]);
        if reach > longest {
            longest = reach;
        }
        i += 1;
    }
    longest + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_say_what_is_needed() {
        assert!(finite(&[0.0, -1.5]));
        assert!(!finite(&[0.0, f32::NAN]));
        assert!(!finite(&[f32::INFINITY]));
        assert_eq!(outputs_for(&[1, 500, 7], LagConvention::Literal), 501);
        assert_eq!(outputs_for(&[1, 500, 7], LagConvention::OneStep), 500);
    }
}
