//! Moving averages of whole records, eqs. (1), (12) and (13), summed in the same order as in `model-core`.

use model_core::average::WindowSum;

/// ỹ_k of eq. (1): the `window` − 1 values before y_k, divided by `window`; 0 before the series.
#[must_use]
pub fn averaged_past(series: &[f64], window: u32) -> Vec<f64> {
    let terms = window.saturating_sub(1);
    if terms == 0 {
        return vec![0.0; series.len()];
    }
    let mut sum = WindowSum::new();
    let each = series.iter().enumerate().map(|(k, entering)| {
        let average = sum.value() / f64::from(window);
        let leaving = past(series, k, terms).unwrap_or(0.0);
        sum.slide(*entering, leaving, terms);
        average
    });
    each.collect()
}

/// Mean of the last `window` values, eqs. (12) and (13). The values before the series are 0 or, with `held`, the first
/// value.
#[must_use]
pub fn moving_average(series: &[f64], window: u32, held: bool) -> Vec<f64> {
    let window = window.max(1);
    let level = match series.first() {
        Some(first) if held => *first,
        _ => 0.0,
    };
    let mut sum = WindowSum::new();
    let each = series.iter().enumerate().map(|(k, entering)| {
        let leaving = past(series, k, window).map_or(0.0, |leaving| leaving - level);
        sum.slide(entering - level, leaving, window);
        level + sum.value() / f64::from(window)
    });
    each.collect()
}

/// The value `lag` samples before sample `k`.
fn past(series: &[f64], k: usize, lag: u32) -> Option<f64> {
    series.get(k.checked_sub(lag as usize)?).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series() -> Vec<f64> {
        (0..900)
            .map(|k| f64::from((k + 3) * (k + 3) % 17))
            .collect()
    }

    #[test]
    fn the_averaged_past_is_equation_1_to_the_letter() {
        let y = series();
        for window in [1, 2, 7, 250] {
            for (k, mean) in averaged_past(&y, window).into_iter().enumerate() {
                let at = |s: u32| past(&y, k, s).unwrap_or(0.0);
                let sum: f64 = (1..window).map(at).sum();
                assert!((mean - sum / f64::from(window)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_mean_is_that_of_the_last_w_samples() {
        let y = series();
        for window in [1, 2, 5, 250, 1000] {
            for held in [false, true] {
                let before = if held { y[0] } else { 0.0 };
                for (k, mean) in moving_average(&y, window, held).into_iter().enumerate() {
                    let at = |s: u32| past(&y, k, s).unwrap_or(before);
                    let sum: f64 = (0..window).map(at).sum();
                    assert!((mean - sum / f64::from(window)).abs() < 1e-12);
                }
            }
        }
    }
}
