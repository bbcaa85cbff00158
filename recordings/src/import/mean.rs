//! Means over groups of consecutive rows: a fast recording at the rate of the plant.

use crate::record::{Origin, Record};

/// The record with the mean of every `count` rows as a sample; the rest of the last rows is left out. A command with two
/// values takes the one that the most of the rows have. Standard errors and envelopes are not those of a mean and are
/// left out. `count` is at least 1.
pub(super) fn mean_of(record: Record, count: usize, remarks: &mut Vec<String>) -> Record {
    let groups = |series: &[f64]| -> Vec<f64> {
        let each = series.chunks_exact(count);
        each.map(|rows| rows.iter().sum::<f64>() / count as f64)
            .collect()
    };
    let period_s = record.sample_period_s * count as f64;
    let mut mean = Record::new(
        &record.name,
        record.role,
        period_s,
        command(&record.u, groups(&record.u)),
        groups(&record.y),
    );
    mean.t0 = record.t0 + 0.5 * (period_s - record.sample_period_s);
    mean.u_before = record.u_before;
    let channels = record.channels.iter();
    mean.channels = channels
        .map(|(name, values)| (name.clone(), groups(values)))
        .collect();
    let bounds = [&record.y_sd, &record.y_min, &record.y_max];
    if bounds.iter().any(|bound| bound.is_some()) {
        remarks.push(
            "`y_sd`, `y_min` and `y_max` are left out: they are not those of a mean of several rows"
                .to_owned(),
        );
    }
    mean
}

/// The lines of the first rows of the groups.
pub(super) fn origin_of(origin: Origin, count: usize, groups: usize) -> Origin {
    Origin {
        lines: origin
            .lines
            .into_iter()
            .step_by(count)
            .take(groups)
            .collect(),
        ..origin
    }
}

/// The means of a command; of two values, the nearer one.
fn command(u: &[f64], means: Vec<f64>) -> Vec<f64> {
    let low = u.iter().copied().fold(f64::INFINITY, f64::min);
    let high = u.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !u.iter().all(|v| *v == low || *v == high) {
        return means;
    }
    let nearer = |mean: f64| if mean - low < high - mean { low } else { high };
    means.into_iter().map(nearer).collect()
}
