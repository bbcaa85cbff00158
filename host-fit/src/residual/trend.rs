//! Trend of the error after an edge with the dwell, the time between the edge and the edge before it.

use super::Where;
use super::explained::Errors;
use super::rules::RULES;
use crate::data::Record;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Correlation of the error after edges with the dwell before them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// Whether the dwell is a rest (before rising edges) or a pulse.
    pub rest: bool,
    /// Correlation of the error's size with the dwell, −1 to 1.
    pub correlation: f64,
}

/// The trend in the worst interval after edges; none for other coordinates or if not significant.
pub(super) fn from_edge_to_edge(
    errors: &Errors,
    records: &[&Record],
    found: &Where,
) -> Option<Trend> {
    let rising = found.coordinate.counts_from_rising()?;
    if found.explained_fraction == 0.0 {
        return None;
    }
    let sample = |time: f64| (time / errors.period_s).round() as usize;
    let (from, to) = (sample(found.worst_from), sample(found.worst_to));
    let (mut dwells, mut sizes) = (Vec::new(), Vec::new());
    for ((record, e), lead) in records.iter().zip(&errors.residual).zip(&errors.lead) {
        let edges = edges(&record.u);
        for (i, (at, up)) in edges.iter().enumerate() {
            // The dwell before the first edge is unknown: it may have begun before the record.
            let Some((before, _)) = i.checked_sub(1).and_then(|i| edges.get(i)) else {
                continue;
            };
            let next = edges[i + 1..].iter().find(|(_, other)| other == up);
            let end = (at + to).min(next.map_or(e.len(), |n| n.0)).min(e.len());
            let begin = (at + from).max(*lead);
            if *up == rising && end > begin {
                let mean = e[begin..end].iter().sum::<f64>() / (end - begin) as f64;
                dwells.push(((at - before) as f64).ln());
                sizes.push(mean * found.bias.signum());
            }
        }
    }
    if dwells.len() < RULES.trend_edges {
        return None;
    }
    let (correlation, p) = correlation(&dwells, &sizes)?;
    (p < RULES.trend_level && correlation.abs() > RULES.trend_weakest).then_some(Trend {
        rest: rising,
        correlation,
    })
}

/// Where the input changes, and whether upwards.
fn edges(u: &[f64]) -> Vec<(usize, bool)> {
    let pairs = u.windows(2).enumerate();
    pairs
        .filter(|(_, pair)| pair[0] != pair[1])
        .map(|(k, pair)| (k + 1, pair[1] > pair[0]))
        .collect()
}

/// Pearson's correlation and its two-sided p-value; `None` for fewer than three points, or if one of the two is
/// constant.
pub(crate) fn correlation(x: &[f64], y: &[f64]) -> Option<(f64, f64)> {
    let n = x.len() as f64;
    if x.len() < 3 {
        return None;
    }
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in x.iter().zip(y) {
        xx += (x - mx) * (x - mx);
        yy += (y - my) * (y - my);
        xy += (x - mx) * (y - my);
    }
    if xx <= 1e-9 * n || yy <= 0.0 {
        return None;
    }
    let r = (xy / (xx * yy).sqrt()).clamp(-1.0, 1.0);
    let t = r * ((n - 2.0) / (1.0 - r * r).max(1e-12)).sqrt();
    let p = StudentsT::new(0.0, 1.0, n - 2.0).ok()?.sf(t.abs()) * 2.0;
    Some((r, p))
}
