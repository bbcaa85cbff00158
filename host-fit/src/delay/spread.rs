//! Mean, scatter and correlation of some values.

/// Mean and standard deviation of some delays, samples.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Spread {
    /// How many.
    pub count: usize,
    /// Mean, samples.
    pub mean: f64,
    /// Standard deviation (n − 1), samples.
    pub sd: f64,
}

/// Mean; 0 of an empty slice.
pub(super) fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}

/// Mean and standard deviation.
pub(super) fn spread(values: &[f64]) -> Spread {
    let n = values.len();
    let mean = mean(values);
    let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    Spread {
        count: n,
        mean,
        sd: if n > 1 {
            (square / (n - 1) as f64).sqrt()
        } else {
            0.0
        },
    }
}

/// Pearson's correlation; `None` if `a` or `b` is constant.
pub(super) fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        ab += (a - ma) * (b - mb);
        aa += (a - ma).powi(2);
        bb += (b - mb).powi(2);
    }
    (aa > 0.0 && bb > 0.0).then(|| ab / (aa * bb).sqrt())
}
