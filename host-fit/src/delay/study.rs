//! The delays of a data set: the fitted law, its statistics, and the tests on which the verdict is based.

use super::begun::Begun;
use super::dead_time::DeadTime;
use super::dependence::{Tests, words};
use super::disturbance;
use super::edge::{Edge, edges};
use super::law::{DelayLawFit, DelayPoint, fit_delay_law};
use super::linear::Series;
use super::local::{EdgeDelayed, by_trajectory, by_window};
use super::onset::{Onset, Unmeasured, half_response, measure_all};
use super::plant::Switching;
use super::pooled::{Pooled, longest_delay, spacing};
use super::rules::RULES;
use super::spread::{Spread, correlation, spread};
use super::verdict::DelayVerdict;
use crate::averages::averaged_past;
use crate::data::{DataError, DataSet, Record, Use};
use model_core::average::WINDOW;

/// Options of the measurement. `None` means: chosen from the time scales of the data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayOptions {
    /// W of the averaged output (1), samples; 250 in the paper and in every model that is fitted.
    pub window: u32,
    /// Longest delay that is searched, samples. By default the longest delay that these records can show.
    pub max_delay: Option<usize>,
    /// Samples of y used on either side of a response's start if each edge is located separately. More samples
    /// reduce the noise; fewer suit faster responses. By default three response times, or half the time between
    /// edges if that is less.
    pub reach: Option<usize>,
    /// Seed of the permutation tests.
    pub seed: u64,
}

impl Default for DelayOptions {
    fn default() -> Self {
        Self {
            window: WINDOW,
            max_delay: None,
            reach: None,
            seed: 0,
        }
    }
}

/// Method by which the delays of the edges were measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DelayMethod {
    /// One plant is fitted to whole records; the delay of an edge is found by shifting the edge in this fit.
    Trajectory,
    /// Each edge is located separately, where the slope of y changes.
    Kink,
    /// Each edge in its own window with the common time constants: for records with few samples between
    /// edges.
    Window,
}

impl DelayMethod {
    /// The method in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Trajectory => "one plant fitted to whole records",
            Self::Kink => "the start of each response, located separately",
            Self::Window => "each response separately, with common time constants",
        }
    }
}

/// The best-fitting plant of the response.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ResponsePlant {
    /// 1 or 2.
    pub order: u8,
    /// T₁ + T₂ with the command on, samples.
    pub time_constants_on: f64,
    /// T₁ + T₂ with the command off, samples.
    pub time_constants_off: f64,
    /// T₁·T₂/(T₁ + T₂)²: 0 first order, 0.25 two equal time constants, above 0.25 a plant that rings.
    pub ratio: f64,
}

/// One edge with the delay of its response.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeDelay {
    /// Record, by name.
    pub record: String,
    /// Use of the record; only identify records enter the law.
    pub role: Use,
    /// The edge.
    pub edge: Edge,
    /// Time of the edge, s.
    pub time_s: f64,
    /// The start of the response, or the reason why it is not measurable.
    pub onset: Result<Onset, Unmeasured>,
    /// ỹ (1) at the start of the response, if that was measured.
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
    /// The law evaluated at every sample of the identify records (ỹ below 0 counts as 0), as a model does.
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
    /// Method of measurement.
    pub method: DelayMethod,
    /// Longest delay that was searched, samples.
    pub max_delay: usize,
    /// Samples of y on either side of a response, where each edge was located separately.
    pub reach: usize,
    /// The plant of the response; `None` if no plant fits.
    pub plant: Option<ResponsePlant>,
    /// The dead time over all measured edges of the identify records. Its interval covers the order of the plant, or
    /// the choice of `reach`.
    pub dead_time: Option<DeadTime>,
    /// The dead time of the rising edges.
    pub rising: Option<DeadTime>,
    /// The dead time of the falling edges.
    pub falling: Option<DeadTime>,
    /// The law fitted to the measured edges of the identify records, if it is significant.
    pub law: Option<DelayLawFit>,
    /// Why there is no law, in words.
    pub law_not_kept: Option<String>,
    /// Statistics of the measured delays.
    pub statistics: Option<DelayStatistics>,
    /// The verdict of the tests.
    pub verdict: DelayVerdict,
    /// The verdict in words.
    pub words: String,
    /// p-value of the law by a permutation test: H0 is that delays do not depend on ỹ.
    pub p_law: Option<f64>,
    /// p-value of the law by permutations within the rising and within the falling edges.
    pub p_law_within_direction: Option<f64>,
    /// p-value of the difference between rising and falling edges at the same ỹ (t test).
    pub p_direction: Option<f64>,
    /// Rising minus falling at the same ỹ, samples, from the law with an offset.
    pub direction_offset: Option<f64>,
}

/// The edges of one record with their onsets.
type Measured = Vec<(Edge, Result<Onset, Unmeasured>)>;

/// All edges of a data set, and their common quantities.
struct Measurement {
    edges: Vec<Measured>,
    method: DelayMethod,
    max_delay: usize,
    reach: usize,
    plant: Option<ResponsePlant>,
    /// The dead time of a plant that describes the records and responds.
    dead_time: Option<DeadTime>,
    /// Standard error common to all edges, samples.
    common: f64,
}

impl Measurement {
    fn of(set: &DataSet, options: &DelayOptions) -> Self {
        let begun = Begun::all(set);
        let records: Vec<&Record> = begun.iter().map(|begun| &begun.whole).collect();
        let learned: Vec<&Begun> = begun.iter().filter(|b| b.is_learned()).collect();
        let learned = match learned.is_empty() {
            true => begun.iter().collect(),
            false => learned,
        };
        let fitted: Vec<&Record> = learned.iter().map(|begun| begun.sure()).collect();
        let fitted = &fitted;
        let spacing = spacing(fitted);
        let Some(pooled) = disturbance::pooled(fitted, options.max_delay) else {
            return Self::without_response(&records, options, spacing);
        };
        let response = pooled.plant.mean_sum();
        let reach = options.reach.unwrap_or_else(|| {
            let times = (RULES.reach * response).ceil().max(1.0) as usize;
            times.min(spacing / 2).clamp(4, 10_000)
        });
        let max_delay = options.max_delay.unwrap_or_else(|| {
            // A plant that does not fit has no usable response time.
            let seen = if pooled.describes {
                2.0 * (pooled.dead_time.samples + response)
            } else {
                0.0
            };
            (seen.ceil() as usize)
                .max(4 * spacing)
                .min(longest_delay(fitted))
        });
        let series: Vec<Series> = records.iter().map(|r| pooled.series(r)).collect();
        let range = pooled.range.1 - pooled.range.0;
        let counted: Vec<Vec<(usize, Edge)>> =
            series.iter().map(|s| edges(&s.switching, range)).collect();
        let by_itself = |reach: usize, most: usize| -> Vec<Vec<Result<Onset, Unmeasured>>> {
            let cut: Vec<(&[f64], Vec<Edge>)> = records
                .iter()
                .zip(&counted)
                .map(|(record, edges)| {
                    let end = edges.get(most).map_or(record.y.len(), |(_, e)| e.sample);
                    let edges = edges.iter().take(most).map(|(_, edge)| *edge).collect();
                    (record.y.get(..end).unwrap_or_default(), edges)
                })
                .collect();
            measure_all(&cut, max_delay, reach)
        };
        let method = if pooled.describes {
            DelayMethod::Trajectory
        } else if reach >= RULES.fewest_reach || options.reach.is_some() {
            DelayMethod::Kink
        } else {
            DelayMethod::Window
        };
        let (mut found, common) = match method {
            DelayMethod::Trajectory => {
                let found = series.iter().map(|s| by_trajectory(s, &pooled)).collect();
                let found = pooled.onsets(&records, &counted, found);
                (found, pooled.dead_time.standard_error)
            }
            DelayMethod::Window => {
                let found = pooled.onsets(&records, &counted, by_window(&series, &pooled));
                (found, RULES.clock)
            }
            DelayMethod::Kink => {
                let found = by_itself(reach, usize::MAX);
                let others = [0.7, 1.4].map(|factor| {
                    let reach = (reach as f64 * factor).round().max(4.0) as usize;
                    by_itself(reach, RULES.settings_edges)
                });
                let apart = others.iter().map(|other| apart(&found, other));
                let apart = apart.fold(0.0, f64::max);
                (found, apart.hypot(RULES.clock))
            }
        };
        for onset in found.iter_mut().flatten().flatten() {
            onset.standard_error = onset.standard_error.hypot(common);
        }
        let one = pooled.describes.then_some(());
        Self {
            edges: counted
                .iter()
                .zip(found)
                .map(|(edges, found)| edges.iter().map(|e| e.1).zip(found).collect())
                .collect(),
            method,
            max_delay,
            reach,
            plant: one.map(|()| ResponsePlant {
                order: if pooled.plant.is_first_order() { 1 } else { 2 },
                time_constants_on: pooled.plant.sum[0],
                time_constants_off: pooled.plant.sum[1],
                ratio: pooled.plant.ratio,
            }),
            // Under a binary sequence no edge is measured separately, but the common dead time of
            // all edges is.
            dead_time: (method == DelayMethod::Trajectory && pooled.responds)
                .then_some(pooled.dead_time),
            common,
        }
    }

    /// The edges of records to which no plant can be fitted: y or u is constant.
    fn without_response(records: &[&Record], options: &DelayOptions, spacing: usize) -> Self {
        let levels = records.iter().flat_map(|r| r.u.iter());
        let (low, high) = levels.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &u| {
            (l.min(u), h.max(u))
        });
        let each = records.iter().map(|record| {
            let before = record.u.first().copied().unwrap_or(0.0);
            let switching = Switching::of(&record.u, before, f64::midpoint(low, high));
            let edges = edges(&switching, high - low).into_iter();
            edges
                .map(|(_, e)| (e, Err(Unmeasured::BelowNoise)))
                .collect()
        });
        Self {
            edges: each.collect(),
            method: DelayMethod::Trajectory,
            max_delay: options.max_delay.unwrap_or(spacing),
            reach: options.reach.unwrap_or(spacing),
            plant: None,
            dead_time: None,
            common: 0.0,
        }
    }
}

/// Median difference between two measurements of the same edges, samples.
fn apart(
    found: &[Vec<Result<Onset, Unmeasured>>],
    other: &[Vec<Result<Onset, Unmeasured>>],
) -> f64 {
    let pairs = found.iter().zip(other).flat_map(|(a, b)| a.iter().zip(b));
    let mut differences: Vec<f64> = pairs
        .filter_map(|(a, b)| Some((a.ok()?.delay - b.ok()?.delay).abs()))
        .collect();
    let middle = differences.len() / 2;
    if differences.is_empty() {
        return 0.0;
    }
    *differences.select_nth_unstable_by(middle, f64::total_cmp).1
}

impl Pooled {
    /// The edges with measured onsets and half-response times.
    fn onsets(
        &self,
        records: &[&Record],
        counted: &[Vec<(usize, Edge)>],
        found: Vec<Vec<Result<EdgeDelayed, Unmeasured>>>,
    ) -> Vec<Vec<Result<Onset, Unmeasured>>> {
        let settled = (RULES.response as f64 * self.plant.mean_sum()).ceil() as usize;
        let worst = RULES
            .worst_error
            .max(RULES.worst_share * self.plant.mean_sum());
        let each = records.iter().zip(counted).zip(&found);
        each.map(|((record, edges), found)| {
            let at = |place: usize| found.get(place).copied().unwrap_or(Err(Unmeasured::CutOff));
            (0..edges.len())
                .filter_map(|i| {
                    let (place, edge) = *edges.get(i)?;
                    let next = edges.get(i + 1).map(|(_, e)| e.sample);
                    Some(at(place).and_then(|measured| {
                        if measured.standard_error > worst {
                            return Err(Unmeasured::Blurred);
                        }
                        let arrival = edge.sample as f64 + measured.delay;
                        let start = arrival.round() as usize;
                        let next = next.map_or(usize::MAX, |n| n + measured.delay as usize);
                        let level = record.y.get(start).copied().unwrap_or(0.0);
                        let end = next.min(start.saturating_add(settled));
                        let half = half_response(&record.y, arrival, level, end);
                        Ok(Onset {
                            delay: measured.delay,
                            standard_error: measured.standard_error,
                            half_response: half.map(|t| t - edge.sample as f64),
                        })
                    }))
                })
                .collect()
        })
        .collect()
    }
}

/// Measures the delay of every edge and fits law (2) to those of the identify records.
///
/// # Errors
/// [`DataError`] when an on/off command has values that are neither 0 nor 1.
pub fn study_delays(set: &DataSet, options: &DelayOptions) -> Result<DelayStudy, DataError> {
    let measurement = Measurement::of(set, options);
    let mut found = Vec::new();
    for (record, edges) in set.records.iter().zip(&measurement.edges) {
        let averaged = averaged_past(&record.y, options.window);
        for &(edge, onset) in edges {
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
    let learned: Vec<(&EdgeDelay, Onset)> = found
        .iter()
        .filter(|e| e.role == Use::Identify)
        .filter_map(|e| Some((e, e.onset.ok()?)))
        .collect();
    let points: Vec<DelayPoint> = learned
        .iter()
        .filter_map(|(e, onset)| {
            Some(DelayPoint {
                mean_output: e.mean_output?,
                delay: onset.delay,
                rising: e.edge.rising,
            })
        })
        .collect();
    let of = |keep: &dyn Fn(&EdgeDelay) -> bool| -> Option<DeadTime> {
        let own = |o: &Onset| (o.standard_error.powi(2) - measurement.common.powi(2)).max(0.0);
        let kept: Vec<(f64, f64)> = learned
            .iter()
            .filter(|(e, _)| keep(e))
            .map(|(_, o)| (o.delay, own(o).sqrt()))
            .collect();
        DeadTime::of_edges(&kept, measurement.common)
    };
    let fitted = fit_delay_law(&points);
    let kept: Vec<DelayPoint> = match &fitted {
        Some(law) => points
            .iter()
            .enumerate()
            .filter(|(i, _)| !law.outliers.contains(i))
            .map(|(_, p)| *p)
            .collect(),
        None => points.clone(),
    };
    let tests = Tests::of(&kept, options.seed);
    let verdict = tests.verdict(&kept);
    let (law, law_not_kept) = match fitted {
        None => (
            None,
            Some(format!(
                "{} edges were measured, {} are needed",
                points.len(),
                RULES.law_edges
            )),
        ),
        Some(law) => {
            let data = mean_output_range(set, options.window);
            match law.objection(verdict, data, measurement.max_delay as f64) {
                None => (Some(law), None),
                Some(reason) => (None, Some(reason)),
            }
        }
    };
    let verdict = verdict.without_law(law.is_some());
    let statistics = statistics(&points, law.as_ref(), set, options.window);
    let dead_time = measurement.dead_time.or_else(|| of(&|_| true));
    let words = words(verdict, &tests, &kept, law_not_kept.as_deref());
    let (rising, falling) = (of(&|e| e.edge.rising), of(&|e| !e.edge.rising));
    Ok(DelayStudy {
        method: measurement.method,
        max_delay: measurement.max_delay,
        reach: measurement.reach,
        plant: measurement.plant,
        dead_time,
        rising,
        falling,
        law,
        law_not_kept,
        statistics,
        verdict,
        words,
        p_law: tests.law,
        p_law_within_direction: tests.law_within,
        p_direction: tests.direction,
        direction_offset: tests.offset,
        edges: found,
    })
}

/// Smallest and largest ỹ of the identify records; ỹ below 0 counts as 0.
fn mean_output_range(set: &DataSet, window: u32) -> (f64, f64) {
    let values = set.identify().flat_map(|r| averaged_past(&r.y, window));
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v.max(0.0)), h.max(v.max(0.0)))
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

    /// A simulated plant: ẏ = rate(u_arrived)·(u_arrived − y) with u_arrived(t) = u(t − h(ỹ)), 20 steps per
    /// sample.
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
            // ỹ of the next sample is the mean over the 249 terms y_{k−248} … y_k.
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
        for seed in 0..4 {
            let study =
                study_delays(&set(&|_| 45.0, 0.01, seed), &DelayOptions::default()).unwrap();
            assert_eq!(study.verdict, DelayVerdict::Fixed, "{seed}");
            let mean = study.statistics.unwrap().all.mean;
            assert!((mean - 45.0).abs() < 0.7, "{mean}");
        }
    }

    #[test]
    fn a_graded_command_is_measured_at_every_level_change() {
        let levels = [0.2, 0.7, 0.5, 0.9, 0.1];
        let u: Vec<f64> = levels.iter().flat_map(|l| vec![*l; 200]).collect();
        let mut value = 0.2;
        let y: Vec<f64> = (0..u.len())
            .map(|k| {
                let now = 3.0 + 5.0 * value;
                let arrived = if k < 12 { 0.2 } else { u[k - 12] };
                value += (arrived - value) / 25.0;
                now
            })
            .collect();
        let record = Record::new("r", Use::Identify, 0.1, u, y);
        let set = DataSet::from_records(None, vec![record]).unwrap();
        let study = study_delays(&set, &DelayOptions::default()).unwrap();
        assert_eq!(study.edges.len(), 4);
        for edge in &study.edges {
            assert!((edge.onset.unwrap().delay - 12.0).abs() < 1.0, "{edge:?}");
        }
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
        // Expected: half of the response is reached 53–61 samples after rising edges and 19–21
        // samples after falling edges.
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
