//! Excitation of a data set, checked before any fit.
//!
//! Two input delays that differ by d samples are distinguishable only by the samples at which u_k and u_{k−d}
//! differ. [`Excitation`] counts these: for a square wave the count vanishes if d is a multiple of the
//! period, for a single step it is d per edge. In addition the eigenvalues of the covariance of lagged inputs
//! show how many delays are linearly independent.

use crate::data::{DataSet, FilePlace, Record, Use};
use crate::rules;
use numerics::linalg::symmetric_eigenvalues;

rules! {
    /// Excitation: criteria for the commands of a data set, and limits beyond which a remark is
    /// made.
    pub struct Rules in "excitation";

    /// Number of lags in the covariance.
    lags: usize = 32, "", "judgement";
    /// An eigenvalue below this share of the largest is a direction without excitation.
    negligible: f64 = 0.01, "share of the largest", "judgement: a tenth of the amplitude";
    /// A command that separates fewer of the lags than this share excites too few directions.
    separated: f64 = 0.25, "share of the lags", "judgement";
    /// Delays count as not distinguishable if they differ at less than this share of the possible samples.
    alike: f64 = 0.1, "share of the samples", "judgement";
    /// With fewer edges than this, a dependence of the delay on the flow is not identifiable.
    fewest_edges: usize = 4, "edges", "judgement";
}

/// Requirements of a fit on the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Demand {
    /// Longest lag or delay in the model, samples.
    pub max_lag: usize,
    /// Coefficients that are estimated together.
    pub coefficients: usize,
}

/// Why the data do not permit a fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExcitationError {
    /// No estimation record.
    #[error(
        "no record is marked use = \"identify\", so there is nothing to fit on; mark at least one"
    )]
    NoIdentifyRecord,
    /// u never changes.
    #[error(
        "{place}: the command is constant ({level}) in every identify record, so its effect is not identifiable; record at least one switching of the command"
    )]
    ConstantInput {
        /// The first identify record.
        place: Box<FilePlace>,
        /// Command throughout the record.
        level: f64,
    },
    /// y never changes.
    #[error(
        "{place}: the output is constant ({level}) in every identify record; check the sensor and the column y"
    )]
    ConstantOutput {
        /// The first identify record.
        place: Box<FilePlace>,
        /// Its output.
        level: f64,
    },
    /// Records shorter than the model's memory.
    #[error(
        "{place}: the longest identify record has {longest} samples, no more than the longest lag of {max_lag}; record for longer or lower the longest lag (--max-lag)"
    )]
    TooShort {
        /// The longest identify record.
        place: Box<FilePlace>,
        /// Number of samples in that record.
        longest: usize,
        /// The longest lag asked for.
        max_lag: usize,
    },
    /// Fewer equations than unknowns.
    #[error(
        "{place}: the identify records give {equations} equations for {coefficients} coefficients; record for longer or use fewer lags"
    )]
    TooFewSamples {
        /// The longest identify record.
        place: Box<FilePlace>,
        /// Number of one-step equations.
        equations: usize,
        /// Number of unknowns.
        coefficients: usize,
    },
}

/// Switching in one record.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RecordExcitation {
    /// Name of the record.
    pub name: String,
    /// Number of samples.
    pub samples: usize,
    /// Off → on.
    pub rising_edges: usize,
    /// Number of edges from on to off.
    pub falling_edges: usize,
    /// Shortest and longest time on between two edges, samples.
    pub on_times: Option<(usize, usize)>,
    /// Shortest and longest time off between two edges, samples.
    pub off_times: Option<(usize, usize)>,
    /// Share of samples with the command on.
    pub duty: f64,
}

/// Excitation of the identify records.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Excitation {
    /// Each identify record.
    pub records: Vec<RecordExcitation>,
    /// Whether the command is 0 or 1 throughout; if not, edges are changes from and to 0.
    pub on_off: bool,
    /// Number of command changes in all identify records.
    pub changes: usize,
    /// Number of distinct on times in all identify records, to the sample.
    pub distinct_on_times: usize,
    /// Number of distinct off times.
    pub distinct_off_times: usize,
    /// For d = 0 … max_lag: Σ (u_k − u_{k−d})², summed over the identify records with u = 0 before each. For
    /// an on/off command, the number of samples at which delays d apart give different predictions.
    pub separation: Vec<f64>,
    /// Ranges of d (first, last), beyond the shortest, at which two delays d apart are not distinguishable.
    pub alike: Vec<(usize, usize)>,
    /// Number of lags compared, evenly spaced up to the longest.
    pub lags_tried: usize,
    /// Number of these lags that the commands separate (eigenvalues of their covariance above 1/100 of the largest).
    pub lags_separated: usize,
    /// Condition number of that covariance, capped at 1e16.
    pub condition: f64,
    /// Remarks for the user, most severe first.
    pub remarks: Vec<String>,
}

/// Number of command changes in `records`.
fn changes(records: &[&Record]) -> usize {
    let each = records.iter().map(|r| {
        let pairs = r.u.windows(2);
        pairs.filter(|pair| pair[0] != pair[1]).count()
    });
    each.sum()
}

/// The remark on a command with so few changes.
fn too_few(changes: usize, on_off: bool) -> Option<String> {
    let does = if on_off { "switches" } else { "changes" };
    let times = if changes == 1 { "time" } else { "times" };
    (changes < RULES.fewest_edges).then(|| {
        format!(
            "The command {does} only {changes} {times}: a delay and time constants are identifiable, but not \
                 their dependence on y."
        )
    })
}

/// A remark on records with too few command changes to identify how the response depends on a coordinate;
/// none if there are enough.
#[must_use]
pub fn says_little(records: &[Record]) -> Option<String> {
    let learning: Vec<&Record> = records.iter().filter(|r| r.role == Use::Identify).collect();
    let on_off = learning.iter().all(|r| r.is_on_off());
    too_few(changes(&learning), on_off)
}

/// Whether the records identify no more than a delay and time constants: little excitation, no other measured input, and
/// no validation record that would show over-fitting.
#[must_use]
pub fn bears_little(records: &[Record]) -> bool {
    let alone = |record: &Record| record.channels.is_empty() && record.role == Use::Identify;
    says_little(records).is_some() && records.iter().all(alone)
}

impl Excitation {
    /// Excitation of the identify records of a data set for a model with lags up to `max_lag`.
    #[must_use]
    pub fn of(set: &DataSet, max_lag: usize) -> Self {
        let records: Vec<&Record> = set.identify().collect();
        let mut on = Vec::new();
        let mut off = Vec::new();
        let described: Vec<RecordExcitation> = records
            .iter()
            .map(|r| describe(r, &mut on, &mut off))
            .collect();
        let distinct = |mut times: Vec<usize>| {
            times.sort_unstable();
            times.dedup();
            times.len()
        };
        let separation: Vec<f64> = (0..=max_lag).map(|d| separation(&records, d)).collect();
        let alike = alike_ranges(&separation);
        let (lags_tried, lags_separated, condition) = separated_lags(&records, max_lag);
        let mut found = Self {
            on_off: records.iter().all(|r| r.is_on_off()),
            changes: changes(&records),
            records: described,
            distinct_on_times: distinct(on),
            distinct_off_times: distinct(off),
            separation,
            alike,
            lags_tried,
            lags_separated,
            condition,
            remarks: Vec::new(),
        };
        found.remarks = found.remark(set.sample_period_s);
        found
    }

    fn remark(&self, sample_period_s: f64) -> Vec<String> {
        let mut remarks = Vec::new();
        let edges: usize = self
            .records
            .iter()
            .map(|r| r.rising_edges + r.falling_edges)
            .sum();
        remarks.extend(too_few(self.changes, self.on_off));
        if let Some((first, last)) = self.alike.first() {
            remarks.push(format!(
                "Input delays that differ by {first} to {last} samples ({:.3} to {:.3} s) predict nearly the same, because the command repeats: their weights are not identifiable. Add a record with random on and off times.",
                *first as f64 * sample_period_s,
                *last as f64 * sample_period_s
            ));
        }
        if edges >= RULES.fewest_edges
            && self.distinct_on_times <= 1
            && self.distinct_off_times <= 1
        {
            remarks.push(
                "All on-times are equal and all off-times are equal: a slow effect (droop, drift, hysteresis) \
                     is not distinguishable from the response itself. Add a record with other on-times and off-times.".into(),
            );
        }
        if (self.lags_separated as f64) < RULES.separated * self.lags_tried as f64 {
            remarks.push(format!(
                "Of {} input delays spread over the given lags, the commands distinguish about {}: more input \
                     delays over-fit.",
                self.lags_tried, self.lags_separated
            ));
        }
        remarks
    }
}

/// Rejects data on which a fit is impossible, and reports the excitation of the rest.
///
/// # Errors
/// [`ExcitationError`] if no record is for identification, if u or y is constant in all of them, or if they
/// are too short.
pub fn check_excitation(set: &DataSet, demand: Demand) -> Result<Excitation, ExcitationError> {
    let all = set.records.iter().enumerate();
    let records: Vec<(usize, &Record)> = all.filter(|(_, r)| r.role == Use::Identify).collect();
    let at = |index: usize| Box::new(set.place(index, None));
    let Some((first, any)) = records.first() else {
        return Err(ExcitationError::NoIdentifyRecord);
    };
    // A record that starts with blowing has an edge at its start, because the command before it
    // counts as 0.
    let varies = |r: &Record| r.u.iter().any(|u| Some(u) != r.u.first());
    if !records.iter().any(|(_, r)| varies(r)) {
        return Err(ExcitationError::ConstantInput {
            place: at(*first),
            level: any.u.first().copied().unwrap_or(0.0),
        });
    }
    let still = |r: &Record| r.y.iter().all(|y| Some(y) == r.y.first());
    if records.iter().all(|(_, r)| still(r)) {
        return Err(ExcitationError::ConstantOutput {
            place: at(*first),
            level: any.y.first().copied().unwrap_or(0.0),
        });
    }
    let longest = records.iter().max_by_key(|(_, r)| r.len());
    let (index, longest) = longest.map_or((0, 0), |(index, r)| (*index, r.len()));
    if longest <= demand.max_lag {
        return Err(ExcitationError::TooShort {
            place: at(index),
            longest,
            max_lag: demand.max_lag,
        });
    }
    let equations: usize = records.iter().map(|(_, r)| r.len() - 1).sum();
    if equations < demand.coefficients {
        return Err(ExcitationError::TooFewSamples {
            place: at(index),
            equations,
            coefficients: demand.coefficients,
        });
    }
    Ok(Excitation::of(set, demand.max_lag))
}

fn describe(record: &Record, on: &mut Vec<usize>, off: &mut Vec<usize>) -> RecordExcitation {
    let (mut rising, mut falling) = (0, 0);
    let (mut my_on, mut my_off) = (Vec::new(), Vec::new());
    let mut level = false;
    let mut since: Option<usize> = None;
    for (k, &u) in record.u.iter().enumerate() {
        let now = u != 0.0;
        if now == level {
            continue;
        }
        // Dwells cut off by the ends of the record are not counted.
        if let Some(since) = since {
            if level { &mut my_on } else { &mut my_off }.push(k - since);
        }
        *(if now { &mut rising } else { &mut falling }) += 1;
        level = now;
        since = Some(k);
    }
    let extremes = |times: &[usize]| Some((*times.iter().min()?, *times.iter().max()?));
    let described = RecordExcitation {
        name: record.name.clone(),
        samples: record.len(),
        rising_edges: rising,
        falling_edges: falling,
        on_times: extremes(&my_on),
        off_times: extremes(&my_off),
        duty: record.u.iter().filter(|u| **u != 0.0).count() as f64 / record.len().max(1) as f64,
    };
    on.append(&mut my_on);
    off.append(&mut my_off);
    described
}

/// Σ (u_k − u_{k−d})² over the records, u = 0 before each.
fn separation(records: &[&Record], d: usize) -> f64 {
    records
        .iter()
        .map(|r| {
            let head: f64 = r.u.iter().take(d).map(|u| u * u).sum();
            let rest = r.u.iter().skip(d).zip(&r.u);
            head + rest.map(|(a, b)| (a - b).powi(2)).sum::<f64>()
        })
        .sum()
}

/// Ranges of d in which the separation has fallen back to a small share of its previous maximum.
fn alike_ranges(separation: &[f64]) -> Vec<(usize, usize)> {
    let mut reached: f64 = 0.0;
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for (d, &s) in separation.iter().enumerate() {
        reached = reached.max(s);
        if s < RULES.alike * reached {
            match ranges.last_mut() {
                Some(range) if range.1 + 1 == d => range.1 = d,
                _ => ranges.push((d, d)),
            }
        }
    }
    ranges
}

/// Lags spread over 0 … max_lag: their number, the number that the covariance separates, and its condition
/// number.
fn separated_lags(records: &[&Record], max_lag: usize) -> (usize, usize, f64) {
    let count = RULES.lags.min(max_lag + 1);
    let step = max_lag as f64 / (count - 1).max(1) as f64;
    let lags: Vec<usize> = (0..count)
        .map(|i| (i as f64 * step).round() as usize)
        .collect();
    let mut covariance = vec![0.0; count * count];
    let n: usize = records.iter().map(|r| r.len()).sum();
    let shifted_sum = |lag: usize| -> f64 {
        let sums = records
            .iter()
            .map(|r| r.u.iter().take(r.len().saturating_sub(lag)).sum::<f64>());
        sums.sum()
    };
    for (i, &a) in lags.iter().enumerate() {
        for (j, &b) in lags.iter().enumerate().skip(i) {
            // Σ u_{k−a} u_{k−b} over k, with a ≤ b.
            let product: f64 = records
                .iter()
                .map(|r| {
                    let late = r.u.iter().skip(b - a);
                    let shared = r.len().saturating_sub(b);
                    late.zip(&r.u).take(shared).map(|(x, y)| x * y).sum::<f64>()
                })
                .sum();
            let value = product - shifted_sum(a) * shifted_sum(b) / n.max(1) as f64;
            for at in [i * count + j, j * count + i] {
                if let Some(target) = covariance.get_mut(at) {
                    *target = value;
                }
            }
        }
    }
    // If the decomposition fails, no lag counts as separated.
    let eigenvalues = symmetric_eigenvalues(&covariance, count).unwrap_or_default();
    let largest = eigenvalues.iter().copied().fold(0.0, f64::max);
    let smallest = eigenvalues.iter().copied().fold(f64::INFINITY, f64::min);
    let separated = eigenvalues
        .iter()
        .filter(|e| **e > RULES.negligible * largest && largest > 0.0)
        .count();
    let condition = if smallest > 0.0 {
        (largest / smallest).min(1e16)
    } else {
        1e16
    };
    (count, separated, condition)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn set(u: Vec<f64>) -> DataSet {
        let y = (0..u.len()).map(|k| (k as f64 * 0.01).sin()).collect();
        let record = Record::new("r", Use::Identify, 0.001, u, y);
        DataSet::from_records(None, vec![record]).unwrap()
    }

    fn square(n: usize) -> Vec<f64> {
        (0..n).map(|k| f64::from(u8::from(k % 250 < 125))).collect()
    }

    fn random(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut u = Vec::new();
        while u.len() < n {
            let (on, off) = (rng.random_range(20..300), rng.random_range(20..300));
            u.extend(std::iter::repeat_n(1.0, on));
            u.extend(std::iter::repeat_n(0.0, off));
        }
        u.truncate(n);
        u
    }

    #[test]
    fn a_square_wave_cannot_tell_delays_a_period_apart() {
        let found = Excitation::of(&set(square(10_000)), 500);
        // u_k and u_{k−d} differ at 2 d samples per period of 250 while d ≤ 125 (the start adds a few).
        assert!((found.separation[50] / (40.0 * 2.0 * 50.0) - 1.0).abs() < 0.02);
        assert!(
            found.alike.iter().any(|(a, b)| (*a..=*b).contains(&250)),
            "{:?}",
            found.alike
        );
        assert!(found.remarks.iter().any(|r| r.contains("not identifiable")));
        assert!(
            found
                .remarks
                .iter()
                .any(|r| r.contains("on-times are equal"))
        );
        assert_eq!((found.distinct_on_times, found.distinct_off_times), (1, 1));
        assert_eq!(found.records[0].on_times, Some((125, 125)));
        assert_eq!(
            (found.records[0].rising_edges, found.records[0].duty),
            (40, 0.5)
        );
    }

    #[test]
    fn three_changes_of_a_graded_command_say_little_and_four_do_not() {
        let levels = |levels: &[f64]| {
            let each = levels.iter().flat_map(|u| std::iter::repeat_n(*u, 50));
            says_little(&set(each.collect()).records)
        };
        let three = levels(&[0.2, 0.4, 1.0, 0.2]).expect("a remark");
        assert!(three.contains("changes only 3 times"), "{three}");
        let one = levels(&[0.0, 1.0]).expect("a remark");
        assert!(one.contains("switches only 1 time:"), "{one}");
        assert_eq!(levels(&[0.2, 0.4, 1.0, 0.2, 0.6]), None);
    }

    #[test]
    fn random_switching_separates_more_than_a_square_wave_and_a_step() {
        let random = Excitation::of(&set(random(10_000, 1)), 500);
        assert!(
            random.alike.is_empty() && random.remarks.is_empty(),
            "{:?}",
            random.remarks
        );
        let square = Excitation::of(&set(square(10_000)), 500);
        let step = Excitation::of(
            &set((0..10_000).map(|k| f64::from(u8::from(k > 500))).collect()),
            500,
        );
        assert!(
            random.lags_separated > square.lags_separated,
            "{} {}; {} {}; {} {}",
            random.lags_separated,
            square.lags_separated,
            random.condition,
            square.condition,
            step.lags_separated,
            step.condition
        );
        assert!(random.condition < square.condition);
        assert!(step.remarks[0].contains("1 time"), "{:?}", step.remarks);
    }

    #[test]
    fn hopeless_data_are_refused_with_the_reason() {
        let demand = Demand {
            max_lag: 100,
            coefficients: 16,
        };
        let error = |set: &DataSet, demand| check_excitation(set, demand).unwrap_err().to_string();
        assert!(error(&set(vec![1.0; 500]), demand).contains("constant (1)"));
        assert!(
            error(
                &set(square(101).into_iter().take(100).chain([0.0]).collect()),
                Demand {
                    max_lag: 101,
                    ..demand
                }
            )
            .contains("--max-lag")
        );
        assert!(
            error(
                &set(square(130)),
                Demand {
                    max_lag: 5,
                    coefficients: 500
                }
            )
            .contains("129 equations")
        );
        let mut flat = set(square(500)).records;
        flat[0].y = vec![0.5; 500];
        let flat = DataSet::from_records(None, flat).unwrap();
        assert!(error(&flat, demand).contains("check the sensor"));
        let mut held_out = flat.records;
        held_out[0].role = Use::Validate;
        let held_out = DataSet::from_records(None, held_out).unwrap();
        assert!(error(&held_out, demand).contains("identify"));
        assert!(check_excitation(&set(square(500)), demand).is_ok());
    }
}
