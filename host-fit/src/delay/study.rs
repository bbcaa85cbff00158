//! All delays of a data set, the law through them, their statistics, and whether the data bear the law out.

use super::dependence::{DelayVerdict, Tests, words};
use super::edge::{Edge, edges};
use super::law::{DelayLawFit, DelayPoint, fit_delay_law};
use super::onset::{Onset, Unmeasured, measure_all};
use super::spread::{Spread, correlation, spread};
use crate::averages::averaged_past;
use crate::data::{DataError, DataSet, Use};
use model_core::average::WINDOW;

/// How delays are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayOptions {
    /// W of the averaged output (1), samples; 250 in the paper.
    pub window: u32,
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
            window: WINDOW,
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
        let averaged = averaged_past(y, options.window);
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

fn statistics(
    points: &[DelayPoint],
    law: Option<&DelayLawFit>,
    set: &DataSet,
    window: u32,
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
                averaged_past(&record.y, window)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Record;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
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
