//! The training range of a model, and the check whether a run leaves it.

use super::{Model, RULES, Training};
use crate::data::Record;

impl Training {
    /// Ranges of y, duty and on-times over `records`; everything else has its default.
    #[must_use]
    pub fn envelope(records: &[&Record]) -> Self {
        let span = |values: &mut dyn Iterator<Item = f64>| {
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            })
        };
        let known = |range: [f64; 2]| {
            if range[0] <= range[1] {
                range
            } else {
                [0.0; 2]
            }
        };
        let on_off = records.iter().all(|record| record.is_on_off());
        let (mut times, mut gaps) = (Vec::new(), Vec::new());
        if on_off {
            for record in records {
                let seconds = |n: usize| n as f64 * record.sample_period_s;
                times.extend(runs_on(&record.u).map(seconds));
                gaps.extend(gaps_between(&record.u).map(seconds));
            }
        }
        Self {
            y_range: known(span(&mut records.iter().flat_map(|r| r.y.iter().copied()))),
            duty_range: known(span(&mut records.iter().map(|r| duty(&r.u)))),
            on_time_range_s: known(span(&mut times.into_iter())),
            off_time_range_s: known(span(&mut gaps.into_iter())),
            ..Self::default()
        }
    }
}

fn duty(u: &[f64]) -> f64 {
    u.iter().sum::<f64>() / u.len().max(1) as f64
}

/// Durations of on-times in `u`, samples.
fn runs_on(u: &[f64]) -> impl Iterator<Item = usize> {
    u.chunk_by(|a, b| a == b)
        .filter(|run| run.first() == Some(&1.0))
        .map(<[f64]>::len)
}

/// Durations of off-times in `u` between two on-times, samples.
fn gaps_between(u: &[f64]) -> impl Iterator<Item = usize> {
    let first = u.iter().position(|u| *u == 1.0).unwrap_or(u.len());
    let last = u.iter().rposition(|u| *u == 1.0).unwrap_or(first);
    let inside = u.get(first..last).unwrap_or_default();
    let runs = inside.chunk_by(|a, b| (*a == 1.0) == (*b == 1.0));
    runs.filter(|run| run.first() != Some(&1.0))
        .map(<[f64]>::len)
}

impl Training {
    /// The shortest time between two switches in the records, s; `None` if unknown.
    #[must_use]
    pub fn shortest_time_s(&self) -> Option<f64> {
        let times = [self.on_time_range_s, self.off_time_range_s];
        let known = times.iter().map(|[low, _]| *low).filter(|low| *low > 0.0);
        known.reduce(f64::min)
    }
}

impl Model {
    /// In which respect the command `u` or the model's response `y` leaves the training range: one sentence
    /// each, empty if inside or if the range is unknown.
    #[must_use]
    pub fn outside_training(&self, u: &[f64], y: &[f64]) -> Vec<String> {
        let training = &self.training;
        let mut said = Vec::new();
        let [low, high] = training.y_range;
        if low < high {
            let margin = RULES.outside * (high - low);
            let (least, most) = y.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |m, y| {
                (m.0.min(*y), m.1.max(*y))
            });
            if least < low - margin || most > high + margin {
                said.push(format!(
                    "y runs from {least:.3} to {most:.3}, the records from {low:.3} to {high:.3}"
                ));
            }
        }
        let [low, high] = training.on_time_range_s;
        if low > 0.0 {
            let period = self.sample_period_s;
            let mut shortest = f64::INFINITY;
            let mut longest: f64 = 0.0;
            for n in runs_on(u) {
                shortest = shortest.min(n as f64 * period);
                longest = longest.max(n as f64 * period);
            }
            // The tolerance of half a sample is for rounded limits.
            if shortest < low - 0.5 * period {
                said.push(format!(
                    "blowing for {shortest:.3} s, the shortest in the records is {low:.3} s"
                ));
            }
            if longest > high + 0.5 * period {
                said.push(format!(
                    "blowing for {longest:.3} s, the longest in the records is {high:.3} s"
                ));
            }
        }
        said
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    #[test]
    fn the_envelope_is_that_of_the_records() {
        let u = vec![0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0];
        let y = (0..8).map(f64::from).collect();
        let record = Record::new("r", Use::Identify, 0.1, u, y);
        let training = Training::envelope(&[&record]);
        assert_eq!(training.y_range, [0.0, 7.0]);
        assert_eq!(training.duty_range, [0.625, 0.625]);
        assert!((training.on_time_range_s[0] - 0.2).abs() < 1e-12);
        assert!((training.on_time_range_s[1] - 0.3).abs() < 1e-12);
        // Rests before the first and after the last pulse are not counted.
        assert!((training.off_time_range_s[0] - 0.1).abs() < 1e-12);
        assert_eq!(training.off_time_range_s[0], training.off_time_range_s[1]);
        assert_eq!(
            training.shortest_time_s(),
            Some(training.off_time_range_s[0])
        );
    }
}
