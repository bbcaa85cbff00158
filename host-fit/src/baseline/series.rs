//! Records scaled by their own scatter, whole or decimated for the search of starting points.

use crate::data::Record;

/// Offsets and scales that make u and y numbers of size 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scaling {
    pub(super) u_mean: f64,
    pub(super) u_scale: f64,
    pub(super) y_mean: f64,
    pub(super) y_scale: f64,
}

/// An interval of a record, scaled.
#[derive(Clone, Debug, Default)]
pub(super) struct Series {
    pub(super) u: Vec<f64>,
    pub(super) y: Vec<f64>,
    /// The command before the first sample.
    pub(super) before: f64,
    /// Unscored samples at the front.
    pub(super) lead: usize,
}

fn mean_and_scale(values: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().map(|v| v / count).sum::<f64>();
    let variance = values.map(|v| (v - mean).powi(2) / count).sum::<f64>();
    let scale = variance.sqrt();
    // Rounding errors of a constant do not count as variation.
    (scale.is_finite() && scale > 1e-12 * mean.abs() && scale > 0.0).then_some((mean, scale))
}

impl Scaling {
    /// The scaled records; `None` if u or y is constant.
    pub(super) fn of(records: &[&Record]) -> Option<Self> {
        let (u_mean, u_scale) = mean_and_scale(records.iter().flat_map(|r| r.u.iter().copied()))?;
        let (y_mean, y_scale) = mean_and_scale(records.iter().flat_map(|r| r.y.iter().copied()))?;
        Some(Self {
            u_mean,
            u_scale,
            y_mean,
            y_scale,
        })
    }

    pub(super) fn scaled(&self, record: &Record) -> Series {
        let u_of = |u: f64| (u - self.u_mean) / self.u_scale;
        let u = record.u.iter().map(|u| u_of(*u));
        let y = record.y.iter().map(|y| (y - self.y_mean) / self.y_scale);
        Series {
            u: u.collect(),
            y: y.collect(),
            before: u_of(command_before(record)),
            lead: record.lead,
        }
    }
}

/// The command before a record: the stated value, or its first value.
pub(super) fn command_before(record: &Record) -> f64 {
    let first = record.u.first().copied().unwrap_or(0.0);
    record.u_before.unwrap_or(first)
}

impl Series {
    pub(super) fn len(&self) -> usize {
        self.y.len()
    }

    /// Decimates the series; one sample replaces `factor` original ones: u averaged over the time that it is
    /// held, y over an equally long interval around the instant.
    pub(super) fn thinned(&self, factor: usize) -> Self {
        if factor <= 1 {
            return self.clone();
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let half = factor / 2;
        let starts = (0..self.len() / factor).map(|block| block * factor);
        let (mut u, mut y) = (Vec::new(), Vec::new());
        for start in starts {
            u.push(mean(self.u.get(start..start + factor).unwrap_or_default()));
            let from = start.saturating_sub(half);
            let to = (start + half + 1).min(self.len());
            y.push(mean(self.y.get(from..to).unwrap_or_default()));
        }
        Self {
            u,
            y,
            before: self.before,
            lead: self.lead / factor,
        }
    }

    /// The interval of `samples` with the largest variation of u, with up to `lead` samples before it.
    pub(super) fn liveliest(&self, samples: usize, lead: usize) -> Self {
        if self.len() <= samples {
            return self.clone();
        }
        let hop = (samples / 4).max(1);
        let starts = (0..=self.len() - samples).step_by(hop);
        let variance = |from: usize| {
            let part = self.u.get(from..from + samples).unwrap_or_default();
            let mean = part.iter().sum::<f64>() / samples as f64;
            part.iter().map(|u| (u - mean).powi(2)).sum::<f64>()
        };
        let best = starts
            .map(|from| (variance(from), from))
            .fold(
                (-1.0, 0),
                |best, next| if next.0 > best.0 { next } else { best },
            );
        let (from, to) = (best.1.saturating_sub(lead), best.1 + samples);
        let cut = |values: &[f64]| values.get(from..to).unwrap_or_default().to_vec();
        Self {
            u: cut(&self.u),
            y: cut(&self.y),
            before: from
                .checked_sub(1)
                .and_then(|k| self.u.get(k))
                .map_or(self.before, |u| *u),
            lead: self.lead.clamp(best.1, to) - from,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    #[test]
    fn scaled_records_have_mean_0_and_scatter_1() {
        let u: Vec<f64> = (0..100).map(|k| f64::from(k % 2)).collect();
        let y: Vec<f64> = u.iter().map(|u| 2100.0 + 3.0 * u).collect();
        let record = Record::new("r", Use::Identify, 1.0, u, y);
        let scaling = Scaling::of(&[&record]).expect("both change");
        let series = scaling.scaled(&record);
        assert!(series.y.iter().all(|y| (y.abs() - 1.0).abs() < 1e-9));
        let still = Record::new("r", Use::Identify, 1.0, vec![0.1; 100], vec![1.0; 100]);
        assert_eq!(Scaling::of(&[&still]), None);
    }

    #[test]
    fn the_liveliest_stretch_has_what_came_before_it() {
        let u: Vec<f64> = (0..1000)
            .map(|k| f64::from(u8::from((700..750).contains(&k))))
            .collect();
        let series = Series {
            y: u.clone(),
            u,
            ..Series::default()
        };
        let part = series.liveliest(100, 40);
        assert_eq!((part.len(), part.lead), (140, 40));
        assert!(part.u[part.lead..].iter().sum::<f64>() > 45.0);
    }

    #[test]
    fn thinning_keeps_the_instants() {
        let y: Vec<f64> = (0..100).map(f64::from).collect();
        let thin = Series {
            u: y.clone(),
            y,
            ..Series::default()
        }
        .thinned(5);
        assert_eq!(thin.len(), 20);
        assert!((thin.y[7] - 35.0).abs() < 1e-12 && (thin.u[7] - 37.0).abs() < 1e-12);
    }
}
