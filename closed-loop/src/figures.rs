//! Figures of a closed-loop run.

use crate::run::{Trace, span};
use serde::Serialize;

/// Figures of a run against its reference, in y and SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Mean friction gain.
    pub mean: f64,
    /// Root mean square of friction minus reference.
    pub rms: f64,
    /// Mean of friction minus reference.
    pub offset: f64,
    /// Highest minus lowest friction.
    pub peak_to_peak: f64,
    /// Valve switches per second, opening and closing counted.
    pub switches_per_s: f64,
    /// Share of time with the valve open: the air used, relative to steady blowing.
    pub air: f64,
    /// Time until the mean of the friction over whole cycles of the valve, at least 250 samples, stays within 5 % of
    /// the last reference for 1000 samples (in each case at least as many milliseconds, [`span`]); `None` if it never
    /// does.
    pub settling_s: Option<f64>,
}

/// Averaging length for the settling time, samples.
const SETTLED_MEAN: usize = 250;
/// Whole cycles of the valve are averaged if they began within this multiple of the averaging length.
const CYCLES_OF: usize = 4;
/// Required duration within the band, samples.
const SETTLED_FOR: usize = 1000;

impl Figures {
    /// The figures of `trace` from sample `from` on; the settling time counts from the start. A part without
    /// samples gives zeros.
    #[must_use]
    pub fn of(trace: &Trace, from: usize) -> Self {
        let judged = trace.samples.get(from..).unwrap_or_default();
        let count = judged.len().max(1) as f64;
        let mean = judged.iter().map(|s| s.friction).sum::<f64>() / count;
        let offset = judged.iter().map(|s| s.friction - s.reference).sum::<f64>() / count;
        let square: f64 = judged
            .iter()
            .map(|s| (s.friction - s.reference).powi(2))
            .sum();
        let (low, high) = judged.iter().fold((f64::MAX, f64::MIN), |(low, high), s| {
            (low.min(s.friction), high.max(s.friction))
        });
        let switches = judged.windows(2).filter(|w| w[0].on != w[1].on).count();
        let open = judged.iter().filter(|s| s.on).count();
        Self {
            mean,
            rms: (square / count).sqrt(),
            offset,
            peak_to_peak: (high - low).max(0.0),
            switches_per_s: switches as f64 / (count * trace.sample_period_s),
            air: open as f64 / count,
            settling_s: settling(trace),
        }
    }
}

fn settling(trace: &Trace) -> Option<f64> {
    let reference = trace.samples.last()?.reference;
    let period_s = trace.sample_period_s;
    let [mean, stays] = [SETTLED_MEAN, SETTLED_FOR].map(|samples| span(samples, period_s));
    let mut sums = vec![0.0];
    let mut openings = Vec::new();
    let (mut sum, mut was_on, mut inside) = (0.0, false, 0);
    for (k, sample) in trace.samples.iter().enumerate() {
        sum += sample.friction;
        sums.push(sum);
        if sample.on && !was_on {
            openings.push(k);
        }
        was_on = sample.on;
        // The mean is taken over whole cycles of the valve, so that the ripple does not influence
        // it.
        let cycles = openings.split_last().and_then(|(last, earlier)| {
            let first = earlier.iter().rev().find(|first| **first + mean <= *last)?;
            (k < first + CYCLES_OF * mean).then_some([*first, *last])
        });
        let [first, last] = cycles.unwrap_or([(k + 1).saturating_sub(mean), k + 1]);
        let off = (sums[last] - sums[first]) / (last - first) as f64 - reference;
        inside = if off.abs() <= 0.05 * reference.abs() && k + 1 >= mean {
            inside + 1
        } else {
            0
        };
        if inside == stays {
            return Some((k + 1 - stays) as f64 * period_s);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::Sample;

    #[test]
    fn a_square_wave_about_its_reference() {
        let sample = |k: usize| Sample {
            reference: 0.5,
            friction: match (k < 1000, k % 20 < 10) {
                (true, _) => 0.0,
                (false, high) => 0.5 + if high { 0.1 } else { -0.1 },
            },
            reading: None,
            on: k % 20 < 5,
        };
        let trace = Trace {
            sample_period_s: 0.001,
            samples: (0..5000).map(sample).collect(),
        };
        let figures = Figures::of(&trace, 1000);
        assert!((figures.mean - 0.5).abs() < 1e-12 && figures.offset.abs() < 1e-12);
        assert!((figures.rms - 0.1).abs() < 1e-12);
        assert!((figures.peak_to_peak - 0.2).abs() < 1e-12);
        assert!((figures.air - 0.25).abs() < 1e-12);
        assert!((figures.switches_per_s - 100.0).abs() < 0.5);
        assert!((figures.settling_s.unwrap() - 1.25).abs() < 0.02);
    }

    /// 250 samples are two and a half cycles of this ripple.
    #[test]
    fn a_ripple_about_the_reference_is_settled() {
        let sample = |k: usize| Sample {
            reference: 0.5,
            friction: 0.5 + if k % 100 < 50 { 0.3 } else { -0.3 },
            reading: None,
            on: k % 100 < 50,
        };
        let trace = Trace {
            sample_period_s: 0.001,
            samples: (0..5000).map(sample).collect(),
        };
        let settled = Figures::of(&trace, 0).settling_s;
        assert!(settled.is_some_and(|after| after < 0.5), "{settled:?}");
    }

    #[test]
    fn a_run_that_never_arrives_never_settles() {
        let sample = Sample {
            reference: 1.0,
            friction: 0.5,
            reading: None,
            on: true,
        };
        let trace = Trace {
            sample_period_s: 0.001,
            samples: vec![sample; 5000],
        };
        assert_eq!(Figures::of(&trace, 0).settling_s, None);
    }

    /// At a hundred times the sample period, times are multiplied by a hundred and rates divided.
    #[test]
    fn times_and_rates_go_with_the_period() {
        let sample = |k: usize| Sample {
            reference: 0.5,
            friction: if k < 1000 { 0.0 } else { 0.5 },
            reading: None,
            on: k % 20 < 5,
        };
        let of = |sample_period_s: f64| {
            let samples = (0..5000).map(sample).collect();
            let trace = Trace {
                sample_period_s,
                samples,
            };
            Figures::of(&trace, 1000)
        };
        let (fast, slow) = (of(0.001), of(0.1));
        assert!((slow.settling_s.unwrap() / fast.settling_s.unwrap() - 100.0).abs() < 1e-9);
        assert!((slow.switches_per_s * 100.0 - fast.switches_per_s).abs() < 1e-9);
        assert_eq!((slow.air, slow.rms), (fast.air, fast.rms));
        // 2000 samples of 0.2 ms are only 0.4 s.
        let short = Trace {
            sample_period_s: 2e-4,
            samples: (0..4000).map(sample).collect(),
        };
        assert_eq!(Figures::of(&short, 0).settling_s, None);
    }
}
