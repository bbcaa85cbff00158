//! Dependence of the edge delays on the averaged output, on the direction of the edge, on both or on neither.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::law::{DelayPoint, best_rate, rate_grid};
use super::rules::RULES;
use super::spread::{Spread, spread};
use super::verdict::DelayVerdict;

/// The three tests on the points.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tests {
    pub(super) law: Option<f64>,
    pub(super) law_within: Option<f64>,
    pub(super) direction: Option<f64>,
    pub(super) offset: Option<f64>,
    /// Change of the delay over the range of ỹ by the law, and by the law with a direction offset, samples.
    change: f64,
    change_within: f64,
}

impl Tests {
    pub(super) fn of(points: &[DelayPoint], seed: u64) -> Self {
        if points.len() < RULES.tested_edges {
            return Self::default();
        }
        let (direction, offset) = match direction_test(points) {
            Some((p, offset)) => (Some(p), Some(offset)),
            None => (None, None),
        };
        Self {
            law: permutation_test(points, false, seed),
            law_within: permutation_test(points, true, seed),
            direction,
            offset,
            change: change(points, false),
            change_within: change(points, true),
        }
    }

    pub(super) fn verdict(&self, points: &[DelayPoint]) -> DelayVerdict {
        let Some(law) = self.law else {
            return DelayVerdict::TooFewEdges;
        };
        // A change below one sample disappears by rounding in a model and is within the bias of a measured delay.
        let counts = |p: Option<f64>, size: f64| {
            p.is_some_and(|p| p < RULES.significant) && size.abs() >= RULES.relevant
        };
        let delays: Vec<f64> = points.iter().map(|p| p.delay).collect();
        let noticeable = (RULES.shape_bias * spread(&delays).mean).max(RULES.relevant);
        let offset = self.offset.filter(|o| o.abs() >= noticeable);
        let differ = counts(self.direction, offset.unwrap_or(0.0))
            || direction_says_more(points, noticeable);
        let within = counts(self.law_within, self.change_within);
        match (differ, within, counts(Some(law), self.change)) {
            (true, true, _) => DelayVerdict::EdgeAndStateDependent,
            (true, false, _) => DelayVerdict::EdgeDependent,
            (false, _, true) => DelayVerdict::StateDependent,
            (false, _, false) => DelayVerdict::Fixed,
        }
    }
}

/// Change of the delay between the smallest and the largest ỹ by the best law, samples.
fn change(points: &[DelayPoint], direction: bool) -> f64 {
    let outputs = points.iter().map(|p| p.mean_output);
    let low = outputs.clone().fold(f64::INFINITY, f64::min);
    let high = outputs.fold(f64::NEG_INFINITY, f64::max);
    best_rate(points, None, direction).map_or(0.0, |(rate, fit)| {
        let p1 = fit.linear.get(1).copied().unwrap_or(0.0);
        p1 * ((-rate * low).exp() - (-rate * high).exp())
    })
}

/// Residual sum of squares when each direction has its own mean delay, and the means.
fn by_direction(points: &[DelayPoint]) -> (f64, Spread, Spread) {
    let of = |rising: bool| -> Spread {
        let delays: Vec<f64> = points
            .iter()
            .filter(|p| p.rising == rising)
            .map(|p| p.delay)
            .collect();
        spread(&delays)
    };
    let (up, down) = (of(true), of(false));
    let rss = points
        .iter()
        .map(|p| (p.delay - if p.rising { up.mean } else { down.mean }).powi(2))
        .sum();
    (rss, up, down)
}

/// Whether two constants, one per direction, describe the delays clearly better than the law (BIC by more than 10).
fn direction_says_more(points: &[DelayPoint], noticeable: f64) -> bool {
    let n = points.len() as f64;
    let (rss_direction, up, down) = by_direction(points);
    let Some((_, law)) = best_rate(points, None, false) else {
        return false;
    };
    up.count >= RULES.tested_each
        && down.count >= RULES.tested_each
        && (up.mean - down.mean).abs() >= noticeable
        && n * (rss_direction / law.rss).ln() + (2.0 - 3.0) * n.ln() < -RULES.clearly_better
}

/// Offset between rising and falling edges in addition to the law: p of its t test, and the offset in samples.
fn direction_test(points: &[DelayPoint]) -> Option<(f64, f64)> {
    let (_, up, down) = by_direction(points);
    if up.count < RULES.tested_each || down.count < RULES.tested_each {
        return None;
    }
    let (_, with) = best_rate(points, None, true)?;
    let (_, without) = best_rate(points, None, false)?;
    let free = points.len().checked_sub(4).filter(|f| *f > 0)? as f64;
    // The t value of one coefficient is the square root of the F value for the fit without this
    // coefficient.
    let t = ((without.rss - with.rss).max(0.0) * free / with.rss.max(f64::MIN_POSITIVE)).sqrt();
    let p = 2.0 * StudentsT::new(0.0, 1.0, free).ok()?.cdf(-t);
    Some((p, with.linear.get(2).copied()?))
}

/// Permutation test: probability that a law fits as well when the delays are randomly reassigned to the ỹ.
/// With `within`, the delays of rising edges and those of falling edges are reassigned separately, after
/// the mean of each group is removed. The test is exact for any noise and any number of rates tried.
fn permutation_test(points: &[DelayPoint], within: bool, seed: u64) -> Option<f64> {
    let groups: Vec<Vec<usize>> = if within {
        [true, false]
            .iter()
            .map(|&rising| {
                (0..points.len())
                    .filter(|&i| points[i].rising == rising)
                    .collect()
            })
            .collect()
    } else {
        vec![(0..points.len()).collect()]
    };
    let centred = |values: &[f64]| -> Vec<f64> {
        let mut out = values.to_vec();
        for group in &groups {
            let members: Vec<f64> = group.iter().map(|&i| values[i]).collect();
            let mean = spread(&members).mean;
            group.iter().for_each(|&i| out[i] -= mean);
        }
        out
    };
    let columns: Vec<Vec<f64>> = rate_grid(points)
        .iter()
        .filter_map(|rate| {
            let column: Vec<f64> = points
                .iter()
                .map(|p| (-rate * p.mean_output).exp())
                .collect();
            let mut column = centred(&column);
            let norm = column.iter().map(|c| c * c).sum::<f64>().sqrt();
            column.iter_mut().for_each(|c| *c /= norm);
            (norm > 1e-9).then_some(column)
        })
        .collect();
    if columns.is_empty() {
        return None;
    }
    let delays: Vec<f64> = points.iter().map(|p| p.delay).collect();
    let mut dealt = centred(&delays);
    let explained = |delays: &[f64]| -> f64 {
        columns
            .iter()
            .map(|c| {
                c.iter()
                    .zip(delays)
                    .map(|(c, d)| c * d)
                    .sum::<f64>()
                    .powi(2)
            })
            .fold(0.0, f64::max)
    };
    let found = explained(&dealt);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut as_good = 0usize;
    let mut hand = Vec::new();
    for _ in 0..RULES.shuffles {
        for group in &groups {
            hand.clear();
            hand.extend(group.iter().map(|&i| dealt[i]));
            hand.shuffle(&mut rng);
            group.iter().zip(&hand).for_each(|(&i, &d)| dealt[i] = d);
        }
        as_good += usize::from(explained(&dealt) >= found * (1.0 - 1e-12));
    }
    Some((as_good + 1) as f64 / (RULES.shuffles + 1) as f64)
}

pub(super) fn words(
    verdict: DelayVerdict,
    tests: &Tests,
    points: &[DelayPoint],
    law_not_kept: Option<&str>,
) -> String {
    let (_, up, down) = by_direction(points);
    let all: Vec<f64> = points.iter().map(|p| p.delay).collect();
    let all = spread(&all);
    let p = |p: Option<f64>| {
        p.map_or_else(
            || "unknown".into(),
            |p| {
                if p < 1e-3 {
                    "< 0.001".into()
                } else {
                    format!("= {p:.3}")
                }
            },
        )
    };
    match verdict {
        DelayVerdict::TooFewEdges => format!(
            "{} edge(s) of the identify records could be measured; at least {} are needed to test whether \
            the delay depends on y. Use a fixed delay, or record more switching.",
            all.count, RULES.tested_edges
        ),
        DelayVerdict::Fixed => format!(
            "The law is not supported by these data: {}. A fixed delay of {:.1} samples is sufficient (over {} edges \
                the standard deviation is {:.1} samples).",
            match law_not_kept {
                Some(reason) if tests.law.is_some_and(|p| p < RULES.significant) =>
                    reason.to_owned(),
                _ => format!(
                    "the delay changes by {:.1} samples over the range of the averaged output (p {}); this change is \
                        not significant, or less than one sample",
                    tests.change.abs(),
                    p(tests.law)
                ),
            },
            all.mean,
            all.count,
            all.sd
        ),
        DelayVerdict::EdgeDependent => format!(
            "The law is not supported by these data: the delay depends on the direction of the edge ({:.1} \
            samples after rising, {:.1} after falling edges) and not on the averaged output (p {}). Try the effect `edge-dependent-delay`.",
            up.mean,
            down.mean,
            p(tests.law_within)
        ),
        DelayVerdict::EdgeAndStateDependent => format!(
            "The law alone is not enough: rising edges arrive after {:.1} samples, falling ones after {:.1}, and within one direction the delay also varies with the averaged output (p {}). Try the effect `edge-dependent-delay`, and with it `state-dependent-delay`.",
            up.mean,
            down.mean,
            p(tests.law_within)
        ),
        DelayVerdict::StateDependent => format!(
            "The law is supported: the delay changes by {:.1} samples over the range of the averaged output (p \
                {}), and rising and falling edges follow the same law.",
            tests.change.abs(),
            p(tests.law)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn different_delays_up_and_down_are_told_from_a_law() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let points: Vec<DelayPoint> = (0..80)
            .map(|i| {
                let rising = i % 2 == 0;
                let z: f64 = StandardNormal.sample(&mut rng);
                let x: f64 = rng.random();
                DelayPoint {
                    mean_output: x * 0.5 + if rising { 0.1 } else { 0.4 },
                    delay: if rising { 55.0 } else { 20.0 } + z,
                    rising,
                }
            })
            .collect();
        let tests = Tests::of(&points, 0);
        assert_eq!(
            tests.verdict(&points),
            DelayVerdict::EdgeDependent,
            "{tests:?}"
        );
        let few: Vec<DelayPoint> = points[..5].to_vec();
        assert_eq!(Tests::of(&few, 0).verdict(&few), DelayVerdict::TooFewEdges);
    }

    #[test]
    fn the_permutation_tests_are_calibrated() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut alarms = [0u32; 3];
        let runs = 300;
        for seed in 0..runs {
            let points: Vec<DelayPoint> = (0..40)
                .map(|i| DelayPoint {
                    mean_output: rng.random(),
                    delay: 45.0 + Distribution::<f64>::sample(&StandardNormal, &mut rng),
                    rising: i % 2 == 0,
                })
                .collect();
            let tests = Tests::of(&points, seed);
            for (count, p) in alarms
                .iter_mut()
                .zip([tests.law, tests.law_within, tests.direction])
            {
                *count += u32::from(p.unwrap() < 0.05);
            }
        }
        // In 300 runs, 15 false alarms are expected; 5 to 28 is a range of ± 3.3 standard
        // deviations.
        assert!(
            alarms.iter().all(|a| (5..=28).contains(a)),
            "{alarms:?} of {runs}"
        );
    }
}
