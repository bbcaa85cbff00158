//! The level of y at rest without jet: the sensor's offset, and whether it varies between records.

use super::RULES;
use super::beginning::{Beginning, range_of_y};
use super::reference::FirstOrder;
use crate::baseline::{Baselines, SecondOrder};
use crate::data::{Record, Use};
use crate::model::CommandRange;
use crate::order;
use crate::picture::significant;
use crate::residual::correlation;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use std::fmt;

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The rests of records under one command, and the noise of y in them.
struct Rests<'a> {
    /// Each record that rests long enough, with y of its rest.
    rests: Vec<(&'a Record, &'a [f64])>,
    /// Noise of y within a rest.
    noise: Noise,
}

/// Noise around the mean of each of several series.
struct Noise {
    /// Variance of y within a rest.
    within: f64,
    /// Number of samples per independent sample.
    dependence: f64,
    /// Degrees of freedom of the variance, in independent samples.
    freedom: f64,
}

impl Noise {
    /// Estimates the noise from the `deviations` from the mean of each series.
    fn of(deviations: &[Vec<f64>]) -> Self {
        let samples: usize = deviations.iter().map(Vec::len).sum();
        let squares: f64 = deviations.iter().flatten().map(|d| d * d).sum();
        let dependence = dependence(deviations);
        Self {
            within: squares / samples.saturating_sub(deviations.len()).max(1) as f64,
            dependence,
            freedom: (samples as f64 / dependence - deviations.len() as f64).max(1.0),
        }
    }

    /// Variance of the mean of this many samples.
    fn error_of(&self, samples: usize) -> f64 {
        self.within * self.dependence / samples as f64
    }
}

impl<'a> Rests<'a> {
    /// The rests of `records` under a command of `off`; `None` if no record rests.
    fn of(records: &'a [Record], beginnings: &[Beginning], off: f64) -> Option<Self> {
        let pairs = records.iter().zip(beginnings);
        let rests: Vec<(&Record, &[f64])> = pairs
            .filter(|(_, beginning)| beginning.rests_at(off))
            .map(|(record, own)| (record, &record.y[..own.rest.min(record.len())]))
            .filter(|(_, y)| y.len() >= RULES.fewest_at_rest)
            .collect();
        if rests.is_empty() {
            return None;
        }
        let deviations: Vec<Vec<f64>> = rests
            .iter()
            .map(|(_, y)| {
                let level = mean(y);
                y.iter().map(|y| y - level).collect()
            })
            .collect();
        Some(Self {
            noise: Noise::of(&deviations),
            rests,
        })
    }

    /// Mean y of each rest.
    fn levels(&self) -> Vec<f64> {
        self.rests.iter().map(|(_, y)| mean(y)).collect()
    }

    /// Whether the whole records confirm the levels of the rests: the mean residuals of a second-order response with
    /// one common level are nearer to these levels than to a common level. Records with y_sd are usually of flows,
    /// which have no such response, and are not tested.
    fn agree_with_responses(&self) -> bool {
        let records = || self.rests.iter().map(|(record, _)| *record);
        if records().any(|record| record.y_sd.is_some()) {
            return true;
        }
        let learning: Vec<&Record> = records().filter(|r| r.role == Use::Identify).collect();
        let second = Baselines::second_order(&learning);
        let Some((means, _)) = second.and_then(|second| left_by(&second, records())) else {
            return true;
        };
        let centred = |values: &[f64]| -> Vec<f64> {
            let common = mean(values);
            values.iter().map(|value| value - common).collect()
        };
        let (levels, means) = (centred(&self.levels()), centred(&means));
        // Tests whether Σ (m − z)² < Σ m².
        let nearer = levels.iter().zip(&means).map(|(z, m)| z * (z - 2.0 * m));
        nearer.sum::<f64>() < 0.0
    }

    /// Samples of each rest.
    fn lengths(&self) -> Vec<usize> {
        self.rests.iter().map(|(_, y)| y.len()).collect()
    }
}

/// 1 + 2·Σ ρ_k over the lags at which the autocorrelation of all `deviations` together is positive in pairs (the
/// initial positive sequence of Geyer 1992). It is the variance of a mean relative to that of independent samples.
fn dependence(deviations: &[Vec<f64>]) -> f64 {
    let longest = deviations.iter().map(Vec::len).max().unwrap_or(0);
    let at = |lag: usize| {
        let products = deviations
            .iter()
            .flat_map(|d| d.iter().zip(d.iter().skip(lag)));
        let (sum, count) = products.fold((0.0, 0), |(sum, n), (a, b)| (sum + a * b, n + 1));
        sum / f64::from(count.max(1))
    };
    let variance = at(0);
    if variance <= 0.0 {
        return 1.0;
    }
    let pairs = (1..longest / 4).step_by(2).map(|lag| at(lag) + at(lag + 1));
    let positive = pairs.take_while(|pair| *pair > 0.0);
    1.0 + 2.0 * positive.sum::<f64>() / variance
}

/// The noise of y at rest, y rms.
struct NoiseAtRest {
    /// All of it.
    whole: f64,
    /// The part of the noise that is not visible within the rests, because it is slower than they are long.
    slower: f64,
}

impl NoiseAtRest {
    /// Noise from the standard errors of y. For a record without them, the residual of the reference response,
    /// `left`, is an upper limit.
    fn of(rests: &Rests, left: impl FnOnce() -> f64) -> Self {
        let stated: Option<Vec<f64>> = rests
            .rests
            .iter()
            .map(|(record, y)| {
                let sd = record.y_sd.as_ref()?.iter().take(y.len());
                Some(sd.map(|sd| sd * sd).sum::<f64>())
            })
            .collect();
        let samples: usize = rests.rests.iter().map(|(_, y)| y.len()).sum();
        let whole = stated.map_or_else(
            || left().powi(2),
            |sums| sums.iter().sum::<f64>() / samples as f64,
        );
        // Relative standard error of a variance of this many samples.
        let error = (2.0 / samples as f64).sqrt();
        let slower = (1.0 - RULES.slower_by_chance * error) * whole - rests.noise.within;
        Self {
            whole: whole.sqrt(),
            slower: slower.max(0.0).sqrt(),
        }
    }
}

/// Mean y of the records while they rest under a command of `off`, or 0 if the mean is not significantly different
/// from 0. `None` if no record rests.
pub(super) fn level_of_rest(records: &[Record], beginnings: &[Beginning], off: f64) -> Option<f64> {
    let rests = Rests::of(records, beginnings, off)?;
    let samples: Vec<f64> = rests
        .rests
        .iter()
        .flat_map(|(_, y)| y.iter().copied())
        .collect();
    let (mean, error) = (mean(&samples), rests.noise.error_of(samples.len()).sqrt());
    // Sums over records without noise differ from 0 only by rounding errors.
    let whole = rests.rests.iter().flat_map(|(record, _)| &record.y);
    let largest = whole.fold(0.0, |m: f64, y| m.max(y.abs()));
    let is_off = mean.abs() > RULES.off_zero * error && mean.abs() > 1e-12 * largest;
    Some(if is_off { mean } else { 0.0 })
}

/// y without jet if no record rests without jet: from the reference response, and 0 if that is close to 0.
pub(super) fn estimated_zero(
    records: &[Record],
    command: CommandRange,
    reference: Option<&FirstOrder>,
) -> f64 {
    let Some(reference) = reference else {
        return far_level(records);
    };
    let zero = reference.at_rest(command.off);
    let response = (reference.at_rest(command.full) - zero).abs();
    if zero.abs() < RULES.near_zero * response {
        0.0
    } else {
        zero
    }
}

/// 0, or the mean of y if 0 is outside the range of y.
fn far_level(records: &[Record]) -> f64 {
    let all = || records.iter().flat_map(|r| r.y.iter().copied());
    let low = all().fold(f64::INFINITY, f64::min);
    let high = all().fold(f64::NEG_INFINITY, f64::max);
    if low <= 0.0 && high >= 0.0 {
        0.0
    } else {
        all().sum::<f64>() / all().count().max(1) as f64
    }
}

/// Residual of the response of a second-order plant with dead time, without its mean over each record, rms.
pub(super) fn left_by_second_order(records: &[Record]) -> Option<f64> {
    let learning = || records.iter().filter(|r| r.role == Use::Identify);
    let second = Baselines::second_order(&learning().collect::<Vec<&Record>>())?;
    let (_, deviations) = left_by(&second, learning())?;
    Some(Noise::of(&deviations).within.sqrt())
}

/// An offset of the sensor that varies between records.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingZero {
    /// The record that rests lowest, and its level, y.
    pub lowest: (String, f64),
    /// The record that rests highest, and its level, y.
    pub highest: (String, f64),
    /// Variance of the offsets themselves, without noise.
    zeros: f64,
    /// Variance of noise that is constant throughout a rest.
    slower: f64,
    /// True if the offset was found from rests, false if from whole records.
    by_rests: bool,
}

impl MovingZero {
    /// Whether records rest at different levels under a command of `off`. The difference must be significant, larger
    /// than slow noise explains, and agree with the responses through whole records. Half of that suffices if the
    /// levels drift from record to record with a significant order. `left` gives the rms residual of the reference
    /// responses within records; it is used if y_sd is not stated.
    pub(super) fn of(
        records: &[Record],
        beginnings: &[Beginning],
        off: f64,
        left: impl FnOnce() -> f64,
    ) -> Option<Self> {
        let rests = Rests::of(records, beginnings, off)?;
        let levels = rests.levels();
        let by_level = |a: &usize, b: &usize| levels[*a].total_cmp(&levels[*b]);
        let lowest = (0..levels.len()).min_by(by_level)?;
        let highest = (0..levels.len()).max_by(by_level)?;
        let apart = levels[highest] - levels[lowest];
        let slow = RULES.slow_noise * range_of_y(records);
        let noise = NoiseAtRest::of(&rests, || left().min(slow));
        let error = |of: usize| rests.noise.error_of(rests.rests[of].1.len());
        let error = (error(lowest) + error(highest)).sqrt();
        let least = RULES.moving_zero_noise * noise.whole;
        let apart_by = |share: f64| apart > RULES.off_zero * error && apart > share * least;
        let certain = apart_by(1.0) || (creeps(&levels) && apart_by(RULES.creeping_share));
        let slower = if certain { 0.0 } else { noise.slower.powi(2) };
        let (p, zeros) = between(&rests.noise, &levels, &rests.lengths(), slower)?;
        let is_chance = !certain && p >= RULES.moving_zero_p;
        if is_chance || !rests.agree_with_responses() {
            return None;
        }
        let names = rests.rests.iter().map(|(record, _)| record.name.as_str());
        Some(Self {
            slower,
            by_rests: true,
            ..Self::by_levels(names, &levels, zeros)?
        })
    }
}

/// The mean residual of `second`, record by record, and the deviations from it.
fn left_by<'a>(
    second: &SecondOrder,
    records: impl Iterator<Item = &'a Record>,
) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let each = records.map(|record| {
        let run = second.simulate(record)?;
        let mut left: Vec<f64> = record.y.iter().zip(&run).map(|(y, run)| y - run).collect();
        let own = mean(&left);
        left.iter_mut().for_each(|e| *e -= own);
        Some((own, left))
    });
    each.collect::<Option<Vec<_>>>()
        .map(|each| each.into_iter().unzip())
}

impl MovingZero {
    /// As [`MovingZero::of`], but with levels from a first-order response with a level for each record; returns also the
    /// corrected records. If the levels of records differ by more than y moves within them, no response with a common
    /// level describes them, and no rest is recognised. A misfit of the response gives levels that differ by less than
    /// the misfit itself, so they must differ by much more.
    pub(super) fn by_own_levels(records: &[Record]) -> Option<(Self, Vec<Record>)> {
        if records.len() < 2 || records.iter().any(|record| record.y_sd.is_some()) {
            return None;
        }
        let mut own = FirstOrder::own_levels(records)?;
        let deviations: Vec<Vec<f64>> = own
            .iter_mut()
            .map(|own| std::mem::take(&mut own.deviations))
            .collect();
        let noise = Noise::of(&deviations);
        let levels: Vec<f64> = own.iter().map(|own| own.level).collect();
        let samples: Vec<usize> = own.iter().map(|own| own.samples).collect();
        let (p, zeros) = between(&noise, &levels, &samples, 0.0)?;
        let names = records.iter().map(|record| record.name.as_str());
        let moving = Self::by_levels(names, &levels, zeros)?;
        let apart = moving.highest.1 - moving.lowest.1;
        if p >= RULES.moving_zero_p || apart < RULES.moving_zero_noise * noise.within.sqrt() {
            return None;
        }
        let common = mean(&levels);
        let mut tared = records.to_vec();
        for (record, level) in tared.iter_mut().zip(&levels) {
            subtract(record, level - common);
        }
        Some((moving, tared))
    }

    /// An offset found from whole records, with the `levels` of the records of these names. `None` without records.
    fn by_levels<'a>(
        names: impl Iterator<Item = &'a str>,
        levels: &[f64],
        zeros: f64,
    ) -> Option<Self> {
        let mut named: Vec<(&str, f64)> = names.zip(levels.iter().copied()).collect();
        order::ascending(&mut named, |(_, level)| *level);
        let of = |(name, level): &(&str, f64)| ((*name).to_owned(), *level);
        Some(Self {
            lowest: of(named.first()?),
            highest: of(named.last()?),
            zeros,
            slower: 0.0,
            by_rests: false,
        })
    }

    /// As [`MovingZero::of`], but with levels from the second-order response through whole records; returns also
    /// the corrected records. It applies only if the residual of that response is a constant per record plus noise
    /// with almost no memory, because such a constant can only be an offset. Records with y_sd are judged by their
    /// rests alone.
    pub(super) fn by_response(records: &[Record]) -> Option<(Self, Vec<Record>)> {
        if records.len() < 2 || records.iter().any(|record| record.y_sd.is_some()) {
            return None;
        }
        let mut tared = records.to_vec();
        let mut zeros = vec![0.0; records.len()];
        let mut last = f64::INFINITY;
        // Offsets bias the response from which they are estimated; each round removes most of the remaining bias.
        let (second, noise) = loop {
            let learning: Vec<&Record> = tared.iter().filter(|r| r.role == Use::Identify).collect();
            let second = Baselines::second_order(&learning)?;
            let (means, deviations) = left_by(&second, tared.iter())?;
            let noise = Noise::of(&deviations);
            let falls = noise.dependence < RULES.memory_falls * last;
            if !falls {
                break (second, noise);
            }
            last = noise.dependence;
            let common = mean(&means);
            for ((record, zero), own) in tared.iter_mut().zip(&mut zeros).zip(&means) {
                *zero += own - common;
                subtract(record, own - common);
            }
        };
        if noise.dependence > RULES.memoryless {
            return None;
        }
        let lengths: Vec<usize> = records.iter().map(Record::len).collect();
        let (p, variance) = between(&noise, &zeros, &lengths, 0.0)?;
        if p >= RULES.moving_zero_p {
            return None;
        }
        let names = records.iter().map(|record| record.name.as_str());
        let levels: Vec<f64> = zeros.iter().map(|zero| second.level + zero).collect();
        Some((Self::by_levels(names, &levels, variance)?, tared))
    }
}

/// The p-value of the hypothesis that the levels differ only by the noise of each (F-test), and the variance of
/// their scatter. `slower` is the variance of noise that is constant throughout a rest. `None` for fewer than two
/// records.
fn between(noise: &Noise, levels: &[f64], lengths: &[usize], slower: f64) -> Option<(f64, f64)> {
    let n = levels.len() as f64;
    let mean = mean(levels);
    let between = levels.iter().map(|level| (level - mean).powi(2));
    let between = between.sum::<f64>() / (n - 1.0);
    let within = lengths.iter().map(|length| noise.error_of(*length));
    let chance = slower + within.sum::<f64>() / n;
    let test = FisherSnedecor::new(n - 1.0, noise.freedom).ok()?;
    let ratio = between / chance;
    (!ratio.is_nan()).then(|| (test.sf(ratio), (between - chance).max(0.0)))
}

/// Whether levels follow the order of the records, which usually is the order of the recording.
fn creeps(levels: &[f64]) -> bool {
    let order: Vec<f64> = (0..levels.len()).map(|index| index as f64).collect();
    correlation(&order, levels).is_some_and(|(_, p)| p < RULES.creeping_zero)
}

/// Subtracts from each record its own offset, as estimated from its level of rest: the deviation from the mean
/// level, multiplied by the share that is not noise according to both variances. Records that do not rest under a
/// command of `off` stay unchanged.
pub(super) fn tare(
    records: &mut [Record],
    beginnings: &[Beginning],
    off: f64,
    moving: &MovingZero,
) {
    let Some(rests) = Rests::of(records, beginnings, off) else {
        return;
    };
    let common = mean(&rests.levels());
    let own: Vec<Option<f64>> = records
        .iter()
        .map(|record| {
            let mut rested = rests.rests.iter();
            let (_, y) = rested.find(|(of, _)| std::ptr::eq(*of, record))?;
            let noise = moving.slower + rests.noise.error_of(y.len());
            Some((mean(y) - common) * moving.zeros / (moving.zeros + noise))
        })
        .collect();
    for (record, own) in records.iter_mut().zip(own) {
        let Some(own) = own else { continue };
        subtract(record, own);
    }
}

/// Shifts y of a record, and the quantities that depend on its level.
fn subtract(record: &mut Record, zero: f64) {
    let envelope = [&mut record.y_min, &mut record.y_max];
    let series = envelope.into_iter().flatten().chain([&mut record.y]);
    series.flatten().for_each(|y| *y -= zero);
    if let Some(before) = &mut record.y_before {
        *before -= zero;
    }
}

impl fmt::Display for MovingZero {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ((low, lowest), (high, highest)) = (&self.lowest, &self.highest);
        // The numbers have as many digits as are needed to distinguish the two levels.
        let apart = (highest - lowest).abs().max(f64::MIN_POSITIVE);
        let digits = 2
            + (lowest.abs().max(highest.abs()) / apart)
                .log10()
                .ceil()
                .clamp(0.0, 12.0) as usize;
        let [lowest, highest] = [lowest, highest].map(|level| significant(*level, digits));
        let where_read = match self.by_rests {
            true => "at rest",
            false => "without command (estimated by a response fitted to whole records)",
        };
        write!(
            f,
            "Record-to-record offset: {where_read} `{low}` reads {lowest} and `{high}` {highest}. Each \
             record's own offset is subtracted; on the board, subtract the reading at rest before the law \
             starts (`import` has `--y-offset`)."
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT_REST: Beginning = Beginning {
        command: 0.0,
        rest: 600,
        follow: 0,
    };

    fn moving(records: &[Record]) -> Option<MovingZero> {
        MovingZero::of(records, &vec![AT_REST; records.len()], 0.0, || 1.0)
    }

    fn resting(name: &str, zero: f64) -> Record {
        let u: Vec<f64> = (0..2000).map(|k| f64::from(u8::from(k > 600))).collect();
        let y = (0..2000_u32).map(|k| {
            let noise = f64::from(k.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24) - 0.5;
            zero + 0.02 * noise + f64::from(u8::from(k > 640))
        });
        Record::new(name, Use::Identify, 0.001, u, y.collect())
    }

    #[test]
    fn a_zero_that_moves_is_told_and_one_that_is_off_is_not() {
        assert_eq!(moving(&[resting("a", 0.05), resting("b", 0.05)]), None);
        let found = moving(&[resting("a", 0.0), resting("b", 0.08), resting("c", 0.03)]);
        let found = found.expect("0.08 of a range of 1");
        assert_eq!(
            (found.lowest.0.as_str(), found.highest.0.as_str()),
            ("a", "b")
        );
        assert!(
            (found.highest.1 - found.lowest.1 - 0.08).abs() < 0.005,
            "{found:?}"
        );
        assert!(found.to_string().contains("--y-offset"));
    }

    #[test]
    fn slow_noise_of_the_size_of_its_standard_error_is_no_zero_that_moves() {
        let noisy = |name: &str, zero: f64, sd: f64| Record {
            y_sd: Some(vec![sd; 2000]),
            ..resting(name, zero)
        };
        let moves = |sd: f64| {
            let records = [noisy("a", 0.0, sd), noisy("b", 0.06, sd)];
            moving(&records).is_some()
        };
        assert!(moves(0.012) && !moves(0.02));
    }

    /// Offsets of two days that differ by less than a standard error of a sample. If the scatter within the rests
    /// equals the standard error, no part of it is slow noise.
    #[test]
    fn a_zero_that_moves_by_less_than_the_noise_is_told_where_that_is_fast() {
        let share = |sd: f64| {
            let days = [("a", 0.0), ("b", 0.004), ("c", 0.0), ("d", 0.004)];
            let records = days.map(|(name, zero)| Record {
                y_sd: Some(vec![sd; 2000]),
                ..resting(name, zero)
            });
            moving(&records).map(|moving| {
                let mut tared = records.to_vec();
                tare(&mut tared, &[AT_REST; 4], 0.0, &moving);
                let apart = |of: &[Record]| mean(&of[1].y[..600]) - mean(&of[0].y[..600]);
                1.0 - apart(&tared) / apart(&records)
            })
        };
        // Uniform noise of ±0.01 has a standard deviation of 0.0058.
        assert!(share(0.0058).is_some_and(|share| share > 0.9));
        assert_eq!(share(0.012), None);
    }

    #[test]
    fn a_zero_that_creeps_is_told_by_its_order() {
        let moves = |zeros: &[f64]| {
            let noisy = |(index, zero): (usize, &f64)| Record {
                y_sd: Some(vec![0.02; 2000]),
                ..resting(&format!("{index}"), *zero)
            };
            let records: Vec<Record> = zeros.iter().enumerate().map(noisy).collect();
            moving(&records).is_some()
        };
        assert!(moves(&[0.0, 0.011, 0.019, 0.032, 0.04, 0.05, 0.06]));
        assert!(!moves(&[0.032, 0.0, 0.05, 0.019, 0.06, 0.04, 0.011]));
        // The offsets differ by less than two rests that are affected by slow noise.
        assert!(!moves(&[0.0, 0.005, 0.01, 0.016, 0.02, 0.026, 0.03]));
    }

    #[test]
    fn each_record_is_taken_from_its_own_zero_where_that_moves() {
        let blown = Beginning {
            command: 1.0,
            ..AT_REST
        };
        let beginnings = [AT_REST, AT_REST, blown];
        let records = [resting("a", 0.0), resting("b", 0.08), resting("c", 0.3)];
        let mut tared = records.clone();
        let moving = MovingZero::of(&tared, &beginnings, 0.0, || 1.0).expect("0.08 of 1");
        tare(&mut tared, &beginnings, 0.0, &moving);
        let rest = |record: &Record| mean(&record.y[..AT_REST.rest]);
        let (a, b) = (rest(&tared[0]), rest(&tared[1]));
        assert!((a - b).abs() < 1e-4 && (a - 0.04).abs() < 0.005, "{a} {b}");
        let off = level_of_rest(&tared, &beginnings, 0.0).expect("they rest");
        assert!((off - a).abs() < 1e-4, "{off} {a}");
        assert_eq!(tared[2], records[2]);
    }

    /// Short rests without standard errors: the noise of a level is that within the rests, or slower noise as large as the
    /// residual of the reference response.
    #[test]
    fn zeros_of_short_rests_are_told_where_the_records_show_no_slower_noise() {
        let short = Beginning {
            rest: 40,
            ..AT_REST
        };
        let records = [("a", 0.0), ("b", 0.006), ("c", -0.005)].map(|(n, zero)| resting(n, zero));
        let moves = |left: f64| MovingZero::of(&records, &[short; 3], 0.0, || left).is_some();
        assert!(moves(0.006));
        // The slow noise is as large as the difference of the offsets.
        assert!(!moves(0.02));
    }

    /// Levels of short rests that differ accidentally: the whole records show one level.
    #[test]
    fn levels_of_rests_that_whole_records_contradict_are_no_zeros() {
        let short = Beginning {
            rest: 40,
            ..AT_REST
        };
        let moves = |zero: f64| {
            let records = [("a", 0.006), ("b", 0.0), ("c", -0.005)].map(|(name, rest)| {
                let mut record = resting(name, zero * rest);
                record.y[..40]
                    .iter_mut()
                    .for_each(|y| *y += (1.0 - zero) * rest);
                record
            });
            MovingZero::of(&records, &[short; 3], 0.0, || 0.006).is_some()
        };
        assert!(moves(1.0));
        assert!(!moves(0.0));
    }

    #[test]
    fn samples_that_depend_on_each_other_count_less() {
        let fast: Vec<f64> = resting("a", 0.0).y[..600].to_vec();
        let slow: Vec<f64> = fast.windows(10).map(mean).collect();
        assert!(dependence(&[fast]) < 1.5);
        let of_ten = dependence(&[slow]);
        assert!((2.0..15.0).contains(&of_ten), "{of_ten}");
    }

    #[test]
    fn records_that_do_not_rest_say_nothing() {
        let blown = Beginning {
            command: 1.0,
            ..AT_REST
        };
        let records = [resting("a", 0.3), resting("b", 0.0)];
        assert_eq!(
            MovingZero::of(&records, &[blown, AT_REST], 0.0, || 1.0),
            None
        );
        assert_eq!(level_of_rest(&records[..1], &[blown], 0.0), None);
    }

    /// Rests of a third of the time constant, then switching, with white noise of 0.01; y = zero + x. With `bent`,
    /// the time constant is twice as long while the command is off.
    fn switched_early(name: &str, zero: f64, bent: bool, hold: usize) -> Record {
        let u: Vec<f64> = (0..900)
            .map(|k| f64::from(u8::from(k > 25 && (k / hold).is_multiple_of(2))))
            .collect();
        let mut x = 0.0;
        let y = (0..900_u32).map(|k| {
            let spread = (0..4_u32).map(|i| {
                let mixed = (4 * k + i + hold as u32).wrapping_mul(2_654_435_761);
                f64::from((mixed ^ (mixed >> 15)).wrapping_mul(2_246_822_519) >> 8)
                    / f64::from(1 << 24)
                    - 0.5
            });
            let noise: f64 = spread.sum();
            let y = zero + x + 0.017 * noise;
            let drive = if k < 10 { 0.0 } else { u[k as usize - 10] };
            let time = if bent && drive < 0.5 { 150.0 } else { 75.0 };
            x += (drive - x) / time;
            y
        });
        let y = y.collect();
        Record::new(name, Use::Identify, 0.001, u, y)
    }

    fn three_switched_early(zeros: [f64; 3], bent: bool) -> Vec<Record> {
        let holds = [160, 210, 130];
        let each = zeros.into_iter().zip(holds).zip(["a", "b", "c"]);
        each.map(|((zero, hold), name)| switched_early(name, zero, bent, hold))
            .collect()
    }

    /// The levels are further apart than y moves, as of a battery at different charges. A misfit of the response does not
    /// give such levels.
    #[test]
    fn levels_further_apart_than_y_moves_are_zeros() {
        let records = three_switched_early;
        let (moving, tared) = MovingZero::by_own_levels(&records([0.0, 3.0, -2.0], true)).unwrap();
        assert_eq!((&*moving.lowest.0, &*moving.highest.0), ("c", "b"));
        let apart = moving.highest.1 - moving.lowest.1;
        assert!((apart - 5.0).abs() < 0.1, "{apart}");
        assert!(MovingZero::by_own_levels(&tared).is_none());
        assert!(MovingZero::by_own_levels(&records([0.3; 3], true)).is_none());
    }

    #[test]
    fn zeros_of_records_with_short_rests_are_read_from_the_response() {
        let records = three_switched_early;
        let (moving, tared) = MovingZero::by_response(&records([0.0, 0.05, 0.02], false)).unwrap();
        assert_eq!((&*moving.lowest.0, &*moving.highest.0), ("a", "b"));
        let apart = moving.highest.1 - moving.lowest.1;
        assert!((apart - 0.05).abs() < 0.005, "{apart}");
        // In the corrected records no offset moves.
        assert!(MovingZero::by_response(&tared).is_none());
        assert!(MovingZero::by_response(&records([0.3; 3], false)).is_none());
        // A misfit of the response may look like an offset, so no offset is reported.
        assert!(MovingZero::by_response(&records([0.0, 0.05, 0.02], true)).is_none());
    }
}
