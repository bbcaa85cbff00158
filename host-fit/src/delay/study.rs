//! All delays of a data set, the law through them, their statistics, and whether the data bear the law out.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::edge::{Edge, edges, mean_output};
use super::law::{DelayLawFit, DelayPoint, best_rate, fit_delay_law, rate_grid};
use super::onset::{Onset, Unmeasured, measure_all};
use crate::data::{DataError, DataSet, Use};

/// Shuffles of the permutation tests.
const SHUFFLES: usize = 1999;
/// A test below this probability counts.
const SIGNIFICANT: f64 = 0.01;
/// A change of the delay by less than this, samples, is none for a model.
const RELEVANT: f64 = 1.0;
/// The measured start of a response depends a little on its shape, and rising and falling responses differ in shape: a
/// difference between the directions below this share of the mean delay says nothing.
const SHAPE_BIAS: f64 = 0.1;

/// How delays are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayOptions {
    /// W of the averaged output (1), samples; 250 in the paper.
    pub window: usize,
    /// Longest delay that is looked for, samples.
    pub max_delay: usize,
    /// Samples of y used on either side of the start of a response: more average away more noise, fewer cope with
    /// faster responses.
    pub reach: usize,
    /// Seed of the permutation tests.
    pub seed: u64,
}

impl Default for DelayOptions {
    fn default() -> Self {
        Self {
            window: 250,
            max_delay: 250,
            reach: 30,
            seed: 0,
        }
    }
}

/// One edge with the delay of its response.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeDelay {
    /// Record, by name.
    pub record: String,
    /// What the record is used for; only identify records enter the law.
    pub role: Use,
    /// The edge.
    pub edge: Edge,
    /// Time of the edge, s.
    pub time_s: f64,
    /// The start of the response, or why it could not be measured.
    pub onset: Result<Onset, Unmeasured>,
    /// ỹ (1) at the start of the response, where that was measured.
    pub mean_output: Option<f64>,
}

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

/// The statistics of the paper (III.A).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct DelayStatistics {
    /// All measured edges of the identify records.
    pub all: Spread,
    /// Rising edges.
    pub rising: Spread,
    /// Falling edges.
    pub falling: Spread,
    /// Correlation of the edges' delays with the command after the edge (0 or 1).
    pub correlation_input: Option<f64>,
    /// Correlation of the edges' delays with ỹ at the response.
    pub correlation_output: Option<f64>,
    /// The law evaluated at every sample of the identify records (ỹ below 0 counts as 0): the delay sequence a model uses.
    pub sequence: Option<SequenceStatistics>,
}

/// Statistics of h̃(ỹ_k) over all samples.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct SequenceStatistics {
    /// Mean and standard deviation, samples.
    pub spread: Spread,
    /// Correlation with u_k.
    pub correlation_input: Option<f64>,
    /// Correlation with y_k.
    pub correlation_output: Option<f64>,
}

/// Whether the data bear the law out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DelayVerdict {
    /// The delay depends on ỹ as the law says.
    StateDependent,
    /// No dependence on anything: a fixed delay is enough.
    Fixed,
    /// Rising and falling edges differ, and ỹ explains nothing beyond: see the effect `edge-dependent-delay`.
    EdgeDependent,
    /// Rising and falling edges differ, and within a direction the delay depends on ỹ too.
    EdgeAndStateDependent,
    /// Too few edges could be measured to say.
    TooFewEdges,
}

/// The result of [`study_delays`].
#[derive(Debug, Clone, PartialEq)]
pub struct DelayStudy {
    /// Every edge of every record.
    pub edges: Vec<EdgeDelay>,
    /// The law through the measured edges of the identify records.
    pub law: Option<DelayLawFit>,
    /// Their statistics.
    pub statistics: Option<DelayStatistics>,
    /// What the tests say.
    pub verdict: DelayVerdict,
    /// The same in words.
    pub words: String,
    /// Probability of so good a law if the delays did not depend on ỹ (permutation test).
    pub p_law: Option<f64>,
    /// The same within rising and within falling edges.
    pub p_law_within_direction: Option<f64>,
    /// Probability of so large a difference between rising and falling edges if the law were all there is (t test).
    pub p_direction: Option<f64>,
    /// Rising less falling at the same ỹ, samples, from the law with an offset.
    pub direction_offset: Option<f64>,
}

/// Measures the delay of every edge and fits law (2) to those of the identify records.
///
/// # Errors
/// [`DataError`] when the command is not on/off.
pub fn study_delays(set: &DataSet, options: &DelayOptions) -> Result<DelayStudy, DataError> {
    set.require_on_off()?;
    let series: Vec<(&[f64], Vec<Edge>)> = set
        .records
        .iter()
        .map(|r| (r.y.as_slice(), edges(r)))
        .collect();
    let onsets = measure_all(&series, options.max_delay, options.reach.max(4));
    let mut found = Vec::new();
    for ((record, (y, edges)), onsets) in set.records.iter().zip(&series).zip(onsets) {
        let averaged = mean_output(y, options.window);
        for (&edge, onset) in edges.iter().zip(onsets) {
            let mean_output = onset.ok().and_then(|o| {
                let arrival = (edge.sample as f64 + o.delay).round().max(0.0) as usize;
                averaged.get(arrival).copied()
            });
            found.push(EdgeDelay {
                record: record.name.clone(),
                role: record.role,
                edge,
                time_s: record.time(edge.sample),
                onset,
                mean_output,
            });
        }
    }
    let points: Vec<DelayPoint> = found
        .iter()
        .filter(|e| e.role == Use::Identify)
        .filter_map(|e| {
            Some(DelayPoint {
                mean_output: e.mean_output?,
                delay: e.onset.ok()?.delay,
                rising: e.edge.rising,
            })
        })
        .collect();
    let law = fit_delay_law(&points);
    let statistics = statistics(&points, law.as_ref(), set, options.window);
    let kept: Vec<DelayPoint> = match &law {
        Some(law) => points
            .iter()
            .enumerate()
            .filter(|(i, _)| !law.outliers.contains(i))
            .map(|(_, p)| *p)
            .collect(),
        None => points,
    };
    let tests = Tests::of(&kept, options.seed);
    let verdict = tests.verdict(&kept);
    let words = words(verdict, &tests, &kept);
    Ok(DelayStudy {
        edges: found,
        law,
        statistics,
        verdict,
        words,
        p_law: tests.law,
        p_law_within_direction: tests.law_within,
        p_direction: tests.direction,
        direction_offset: tests.offset,
    })
}

fn spread(values: &[f64]) -> Spread {
    let n = values.len();
    let mean = values.iter().sum::<f64>() / n.max(1) as f64;
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

/// Pearson's correlation; `None` if either side does not vary.
fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let (ma, mb) = (spread(a).mean, spread(b).mean);
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        ab += (a - ma) * (b - mb);
        aa += (a - ma).powi(2);
        bb += (b - mb).powi(2);
    }
    (aa > 0.0 && bb > 0.0).then(|| ab / (aa * bb).sqrt())
}

fn statistics(
    points: &[DelayPoint],
    law: Option<&DelayLawFit>,
    set: &DataSet,
    window: usize,
) -> Option<DelayStatistics> {
    if points.is_empty() {
        return None;
    }
    let of = |keep: &dyn Fn(&DelayPoint) -> bool| -> Vec<f64> {
        points.iter().filter(|p| keep(p)).map(|p| p.delay).collect()
    };
    let delays = of(&|_| true);
    let command: Vec<f64> = points
        .iter()
        .map(|p| f64::from(u8::from(p.rising)))
        .collect();
    let output: Vec<f64> = points.iter().map(|p| p.mean_output).collect();
    let sequence = law.map(|law| {
        let (mut h, mut u, mut y) = (Vec::new(), Vec::new(), Vec::new());
        for record in set.identify() {
            h.extend(
                mean_output(&record.y, window)
                    .into_iter()
                    .map(|m| law.at(m.max(0.0))),
            );
            u.extend_from_slice(&record.u);
            y.extend_from_slice(&record.y);
        }
        SequenceStatistics {
            spread: spread(&h),
            correlation_input: correlation(&h, &u),
            correlation_output: correlation(&h, &y),
        }
    });
    Some(DelayStatistics {
        all: spread(&delays),
        rising: spread(&of(&|p| p.rising)),
        falling: spread(&of(&|p| !p.rising)),
        correlation_input: correlation(&delays, &command),
        correlation_output: correlation(&delays, &output),
        sequence,
    })
}

/// The three questions put to the points.
#[derive(Debug, Clone, Copy, Default)]
struct Tests {
    law: Option<f64>,
    law_within: Option<f64>,
    direction: Option<f64>,
    offset: Option<f64>,
    /// Change of the delay over the range of ỹ by the law, and by the law beside an offset, samples.
    change: f64,
    change_within: f64,
}

impl Tests {
    fn of(points: &[DelayPoint], seed: u64) -> Self {
        if points.len() < 8 {
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

    fn verdict(&self, points: &[DelayPoint]) -> DelayVerdict {
        let Some(law) = self.law else {
            return DelayVerdict::TooFewEdges;
        };
        // What is below one sample is rounded away in a model, and within the bias of any measured delay.
        let counts = |p: Option<f64>, size: f64| {
            p.is_some_and(|p| p < SIGNIFICANT) && size.abs() >= RELEVANT
        };
        let delays: Vec<f64> = points.iter().map(|p| p.delay).collect();
        let noticeable = (SHAPE_BIAS * spread(&delays).mean).max(RELEVANT);
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
    up.count >= 3
        && down.count >= 3
        && (up.mean - down.mean).abs() >= noticeable
        && n * (rss_direction / law.rss).ln() + (2.0 - 3.0) * n.ln() < -10.0
}

/// Is there an offset between rising and falling edges beside the law? p of its t test, and the offset in samples.
fn direction_test(points: &[DelayPoint]) -> Option<(f64, f64)> {
    let (_, up, down) = by_direction(points);
    if up.count < 3 || down.count < 3 {
        return None;
    }
    let (_, with) = best_rate(points, None, true)?;
    let (_, without) = best_rate(points, None, false)?;
    let free = points.len().checked_sub(4).filter(|f| *f > 0)? as f64;
    // The t value of one coefficient is the root of the F value of leaving it out.
    let t = ((without.rss - with.rss).max(0.0) * free / with.rss.max(f64::MIN_POSITIVE)).sqrt();
    let p = 2.0 * StudentsT::new(0.0, 1.0, free).ok()?.cdf(-t);
    Some((p, with.linear.get(2).copied()?))
}

/// Probability that a law fits as well as it does when the delays are dealt out to the ỹ at random; `within`: only among
/// edges of one direction, whose means are taken off first. Exact whatever the noise, and for any number of rates tried.
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
    for _ in 0..SHUFFLES {
        for group in &groups {
            hand.clear();
            hand.extend(group.iter().map(|&i| dealt[i]));
            hand.shuffle(&mut rng);
            group.iter().zip(&hand).for_each(|(&i, &d)| dealt[i] = d);
        }
        as_good += usize::from(explained(&dealt) >= found * (1.0 - 1e-12));
    }
    Some((as_good + 1) as f64 / (SHUFFLES + 1) as f64)
}

fn words(verdict: DelayVerdict, tests: &Tests, points: &[DelayPoint]) -> String {
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
            "Only {} edge(s) of the identify records could be measured; at least 8 are needed to say whether the delay depends on the flow. Record more switching, or use a fixed delay.",
            all.count
        ),
        DelayVerdict::Fixed => format!(
            "The law is not supported by these data: over the range of the averaged output the delay changes by {:.1} samples (p {}), no more than chance or rounding. A fixed delay of {:.1} samples (sd {:.1}) describes it.",
            tests.change.abs(),
            p(tests.law),
            all.mean,
            all.sd
        ),
        DelayVerdict::EdgeDependent => format!(
            "The law is not supported by these data: what differs is the direction of the edge, {:.1} samples after rising against {:.1} after falling edges, and beyond that the averaged output explains nothing (p {}). Try the effect `edge-dependent-delay`.",
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
            "The law is supported: the delay changes by {:.1} samples over the range of the averaged output (p {}), and rising and falling edges follow the same law.",
            tests.change.abs(),
            p(tests.law)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Record;
    use rand::RngExt;
    use rand_distr::{Distribution, StandardNormal};

    /// A delay equation of its own, ẏ = rate(u_arrived)·(u_arrived − y) with u_arrived(t) = u(t − h(ỹ)), 20 steps per sample.
    fn plant(u: &[f64], law: &dyn Fn(f64) -> f64) -> Vec<f64> {
        let steps = 20;
        let mut y = vec![0.0];
        let mut sum = 0.0;
        let mut value = 0.0;
        for k in 0..u.len() - 1 {
            let delay = law(sum / 250.0);
            for s in 0..steps {
                let t = k as f64 + f64::from(s) / f64::from(steps) - delay;
                let arrived = if t < 0.0 { 0.0 } else { u[t as usize] };
                let tau = if arrived > 0.5 { 40.0 } else { 70.0 };
                value += (arrived - value) / tau / f64::from(steps);
            }
            y.push(value);
            // ỹ of the next sample: y_{k−248} … y_k, 249 terms.
            sum += y[k];
            if k >= 249 {
                sum -= y[k - 249];
            }
        }
        y
    }

    fn random_command(rng: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
        let mut u = vec![0.0; 300];
        let mut on = true;
        while u.len() < n {
            let length = rng.random_range(90..500);
            u.extend(std::iter::repeat_n(f64::from(u8::from(on)), length));
            on = !on;
        }
        u.truncate(n);
        u
    }

    fn set(law: &dyn Fn(f64) -> f64, noise: f64, seed: u64) -> DataSet {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let records = (0..3)
            .map(|i| {
                let u = random_command(&mut rng, 10_000);
                let y = plant(&u, law)
                    .into_iter()
                    .map(|y| {
                        let z: f64 = StandardNormal.sample(&mut rng);
                        y + noise * z
                    })
                    .collect();
                Record::new(&format!("r{i}"), Use::Identify, 0.001, u, y)
            })
            .collect();
        DataSet::from_records(None, records).unwrap()
    }

    #[test]
    fn a_known_law_is_found_again_and_supported() {
        let law = |y: f64| 40.0 + 15.0 * (-6.0 * y).exp();
        let study = study_delays(&set(&law, 0.007, 1), &DelayOptions::default()).unwrap();
        let measured = study.edges.iter().filter(|e| e.onset.is_ok()).count();
        assert!(
            measured * 10 >= study.edges.len() * 9,
            "{measured} of {}",
            study.edges.len()
        );
        assert_eq!(
            study.verdict,
            DelayVerdict::StateDependent,
            "{}",
            study.words
        );
        let fit = study.law.unwrap();
        for y in [0.05, 0.2, 0.5, 0.8] {
            assert!(
                (fit.at(y) - law(y)).abs() < 1.0,
                "ỹ = {y}: {} against {}; {fit:?}",
                fit.at(y),
                law(y)
            );
        }
        let statistics = study.statistics.unwrap();
        assert!(statistics.correlation_output.unwrap() < -0.5);
        assert!(statistics.sequence.unwrap().spread.mean > 40.0);
    }

    #[test]
    fn a_fixed_delay_is_called_fixed() {
        let mut wrong = 0;
        for seed in 0..12 {
            let study =
                study_delays(&set(&|_| 45.0, 0.01, seed), &DelayOptions::default()).unwrap();
            wrong += usize::from(study.verdict != DelayVerdict::Fixed);
            let mean = study.statistics.unwrap().all.mean;
            assert!((mean - 45.0).abs() < 0.7, "{mean}");
        }
        assert!(wrong <= 1, "{wrong} of 12");
    }

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
        // 15 expected of 300; 5–28 is ± 3.3 standard deviations.
        assert!(
            alarms.iter().all(|a| (5..=28).contains(a)),
            "{alarms:?} of {runs}"
        );
    }

    #[test]
    fn a_command_that_is_not_on_off_is_refused() {
        let record = Record::new("r", Use::Identify, 0.001, vec![0.0, 0.5, 1.0], vec![0.0; 3]);
        let set = DataSet::from_records(None, vec![record]).unwrap();
        assert!(study_delays(&set, &DelayOptions::default()).is_err());
    }

    #[test]
    fn records_without_edges_give_a_verdict_not_a_panic() {
        let record = Record::new("r", Use::Identify, 0.001, vec![0.0; 50], vec![0.1; 50]);
        let set = DataSet::from_records(None, vec![record]).unwrap();
        let study = study_delays(&set, &DelayOptions::default()).unwrap();
        assert_eq!(study.verdict, DelayVerdict::TooFewEdges);
        assert!(study.edges.is_empty() && study.law.is_none());
    }

    #[test]
    fn the_ramp_records_show_what_their_description_says() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/ramp-cfd");
        let set = DataSet::load(&folder).unwrap();
        let study = study_delays(&set, &DelayOptions::default()).unwrap();
        let mean = |rising: bool, of: &dyn Fn(&Onset) -> Option<f64>| -> f64 {
            let mine = study.edges.iter().filter(|e| e.edge.rising == rising);
            let values: Vec<f64> = mine.filter_map(|e| of(&e.onset.ok()?)).collect();
            assert!(values.len() > 100, "{}", values.len());
            spread(&values).mean
        };
        // Described: half of the response 53–61 samples after rising and 19–21 after falling edges.
        let (up, down) = (
            mean(true, &|o| o.half_response),
            mean(false, &|o| o.half_response),
        );
        assert!(
            (53.0..61.0).contains(&up) && (19.0..22.0).contains(&down),
            "{up} {down}"
        );
        let (up, down) = (
            mean(true, &|o| Some(o.delay)),
            mean(false, &|o| Some(o.delay)),
        );
        assert!(
            (43.0..51.0).contains(&up) && (12.0..17.0).contains(&down),
            "{up} {down}"
        );
        assert_eq!(
            study.verdict,
            DelayVerdict::EdgeAndStateDependent,
            "{}",
            study.words
        );
        assert!(study.words.contains("edge-dependent-delay"));
    }
}
