//! Edges of the command, and the averaged output (1) they are paired with.

use crate::data::Record;

/// One switching of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// The first sample with the new command.
    pub sample: usize,
    /// Off → on.
    pub rising: bool,
}

/// The edges of a record in order of time. Before the record the command is 0, so a record that starts blowing starts
/// with a rising edge. Values of the command other than 0 count as on.
#[must_use]
pub fn edges(record: &Record) -> Vec<Edge> {
    let mut on = false;
    let mut edges = Vec::new();
    for (sample, &u) in record.u.iter().enumerate() {
        if (u != 0.0) != on {
            on = u != 0.0;
            edges.push(Edge { sample, rising: on });
        }
    }
    edges
}

/// Averaged output (1): ỹ_k = (1/W) Σ_{s=1}^{W−1} y_{k−s}, one value per sample of `y`; y before the record is 0.
///
/// As printed in the ECC 2016 paper: W − 1 terms divided by W, without y_k itself.
#[must_use]
pub fn mean_output(y: &[f64], window: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(y.len() + 1);
    let mut total = 0.0;
    sums.push(total);
    for value in y {
        total += value;
        sums.push(total);
    }
    let before = |k: usize| sums.get(k).copied().unwrap_or(total);
    (0..y.len())
        .map(|k| {
            let first = (k + 1).saturating_sub(window.max(1));
            (before(k) - before(first)) / window.max(1) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    #[test]
    fn edges_with_history_zero() {
        let u = vec![1.0, 1.0, 0.0, 0.0, 1.0];
        let record = Record::new("r", Use::Identify, 0.001, u, vec![0.0; 5]);
        let found: Vec<(usize, bool)> = edges(&record)
            .iter()
            .map(|e| (e.sample, e.rising))
            .collect();
        assert_eq!(found, [(0, true), (2, false), (4, true)]);
    }

    #[test]
    fn mean_output_is_equation_1_to_the_letter() {
        let y: Vec<f64> = (0..40).map(|k| f64::from(k * k % 17)).collect();
        for window in [1, 2, 7, 250] {
            for (k, mean) in mean_output(&y, window).into_iter().enumerate() {
                let sum: f64 = (1..window)
                    .filter_map(|s| k.checked_sub(s).map(|i| y[i]))
                    .sum();
                assert!((mean - sum / window as f64).abs() < 1e-12);
            }
        }
    }
}
