//! Where y rests before anything is blown: the sensor's zero, and whether it moves.

use super::RULES;
use super::beginning::{Beginning, range_of_y};
use super::reference::FirstOrder;
use crate::data::Record;
use crate::model::CommandRange;
use crate::residual::correlation;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use std::fmt;

/// The means of the pieces of a record through which it rests.
fn quiet_pieces(record: &Record, beginning: &Beginning) -> Vec<f64> {
    let quiet = &record.y[..beginning.rest.min(record.len())];
    quiet.chunks_exact(RULES.quiet_piece).map(mean).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Records that rest under a command of `off`, with how they begin.
fn resting<'a>(
    records: &'a [Record],
    beginnings: &'a [Beginning],
    off: f64,
) -> impl Iterator<Item = (&'a Record, &'a Beginning)> {
    let pairs = records.iter().zip(beginnings);
    pairs.filter(move |(_, beginning)| beginning.rests_at(off))
}

/// The noise of y at rest, y rms.
struct NoiseAtRest {
    /// The standard errors of y.
    stated: f64,
    /// What of them the rests do not show within themselves: noise that is slower than they are long.
    slower: f64,
}

/// None where a record does not say its standard errors.
fn noise_at_rest(resting: &[(&Record, &Beginning)]) -> Option<NoiseAtRest> {
    let (mut stated, mut within) = (Vec::new(), Vec::new());
    for (record, beginning) in resting {
        let sd = record.y_sd.as_ref()?;
        let rest = &record.y[..beginning.rest.min(record.len())];
        let level = mean(rest);
        stated.extend(sd.iter().take(rest.len()).map(|sd| sd * sd));
        within.extend(rest.iter().map(|y| (y - level).powi(2)));
    }
    // Of a variance of so many samples.
    let error = (2.0 / within.len().max(1) as f64).sqrt();
    let stated = mean(&stated);
    let slower = (1.0 - RULES.slower_by_chance * error) * stated - mean(&within);
    (stated > 0.0).then(|| NoiseAtRest {
        stated: stated.sqrt(),
        slower: slower.max(0.0).sqrt(),
    })
}

/// Mean of some pieces, and its standard error; none of fewer than count.
fn level(pieces: &[f64]) -> Option<(f64, f64)> {
    if pieces.len() < RULES.quiet_pieces {
        return None;
    }
    let (n, mean) = (pieces.len() as f64, mean(pieces));
    let variance = pieces.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (n - 1.0);
    Some((mean, (variance / n).sqrt()))
}

/// Mean y of the records while they rest under a command of `off`, 0 where it is that but for chance; none where none
/// of them does.
pub(super) fn level_of_rest(records: &[Record], beginnings: &[Beginning], off: f64) -> Option<f64> {
    let resting: Vec<(&Record, &Beginning)> = resting(records, beginnings, off).collect();
    let pieces: Vec<f64> = resting
        .iter()
        .flat_map(|(record, beginning)| quiet_pieces(record, beginning))
        .collect();
    let (mean, error) = level(&pieces).or_else(|| by_samples(&resting))?;
    // Sums of records without noise are 0 but for their rounding.
    let largest = resting
        .iter()
        .flat_map(|(record, _)| &record.y)
        .fold(0.0, |m: f64, y| m.max(y.abs()));
    let is_off = mean.abs() > RULES.off_zero * error && mean.abs() > 1e-12 * largest;
    Some(if is_off { mean } else { 0.0 })
}

/// The same of rests that are too short for pieces; their samples are taken to be independent by the `quiet_pieces`.
fn by_samples(resting: &[(&Record, &Beginning)]) -> Option<(f64, f64)> {
    let samples: Vec<f64> = resting
        .iter()
        .flat_map(|(record, beginning)| record.y.iter().take(beginning.rest).copied())
        .collect();
    if samples.is_empty() {
        return None;
    }
    let (n, mean) = (samples.len() as f64, mean(&samples));
    let variance = samples.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n;
    let independent = (n / RULES.quiet_pieces as f64).max(1.0);
    Some((mean, (variance / independent).sqrt()))
}

/// y under no command where no record rests under it: by the reference response, and 0 where that is near.
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

/// 0, or the mean of y where 0 is outside the values of y.
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

/// A zero of the sensor that is not the same in all records.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingZero {
    /// The record that rests lowest, and where, y.
    pub lowest: (String, f64),
    /// The record that rests highest, and where, y.
    pub highest: (String, f64),
    /// Share of a record's own deviation that is subtracted from it, 0 to 1.
    pub(super) share: f64,
}

impl MovingZero {
    /// Whether records rest at different levels under a command of `off`: by more than chance, and by more than slow
    /// noise makes of a rest. That is some standard errors of y where they are known, otherwise a small share of all that y
    /// does; or half as much, if they creep from each record to the next as chance seldom does. Less is enough where the
    /// noise is known to be fast; what may be noise of it stays.
    pub(super) fn of(records: &[Record], beginnings: &[Beginning], off: f64) -> Option<Self> {
        let resting: Vec<(&Record, &Beginning)> = resting(records, beginnings, off).collect();
        let levels: Vec<(&Record, (f64, f64))> = resting
            .iter()
            .filter_map(|(record, beginning)| {
                Some((*record, level(&quiet_pieces(record, beginning))?))
            })
            .collect();
        let by_level =
            |a: &&(&Record, (f64, f64)), b: &&(&Record, (f64, f64))| a.1.0.total_cmp(&b.1.0);
        let lowest = levels.iter().min_by(by_level)?;
        let highest = levels.iter().max_by(by_level)?;
        let apart = highest.1.0 - lowest.1.0;
        let (least, beside) = match noise_at_rest(&resting) {
            None => (RULES.moving_zero * range_of_y(records), None),
            Some(noise) => (
                RULES.moving_zero_noise * noise.stated,
                Between::of(&levels, noise.slower),
            ),
        };
        let error = lowest.1.1.hypot(highest.1.1);
        let apart_by = |share: f64| apart > RULES.off_zero * error && apart > share * least;
        let share = if apart_by(1.0) || (creeps(&levels) && apart_by(RULES.creeping_share)) {
            1.0
        } else {
            beside
                .filter(|beside| beside.p < RULES.moving_zero_p)?
                .share
        };
        let named = |of: &(&Record, (f64, f64))| (of.0.name.clone(), of.1.0);
        Some(Self {
            lowest: named(lowest),
            highest: named(highest),
            share,
        })
    }
}

/// The scatter of the levels of rest between the records, beside what noise makes of each.
struct Between {
    /// p-value of noise alone, by the ratio of the variances (F-test).
    p: f64,
    /// Share of a level's deviation that is not noise, as expected from that ratio.
    share: f64,
}

impl Between {
    /// `slower`: noise that is the same throughout a rest, y rms. None of fewer than two records, and without noise.
    fn of(levels: &[(&Record, (f64, f64))], slower: f64) -> Option<Self> {
        let n = levels.len() as f64;
        let mean = levels.iter().map(|(_, (level, _))| level).sum::<f64>() / n;
        let between = levels.iter().map(|(_, (level, _))| (level - mean).powi(2));
        let between = between.sum::<f64>() / (n - 1.0);
        let within = levels.iter().map(|(_, (_, error))| error * error);
        let chance = slower * slower + within.sum::<f64>() / n;
        // Each level's error is known from as many pieces at least.
        let freedom = n * (RULES.quiet_pieces as f64 - 1.0);
        let test = FisherSnedecor::new(n - 1.0, freedom).ok()?;
        let ratio = between / chance;
        ratio.is_finite().then(|| Self {
            p: test.sf(ratio),
            share: (1.0 - 1.0 / ratio).max(0.0),
        })
    }
}

/// Whether levels follow the order of the records, which is that of the recording as a rule.
fn creeps(levels: &[(&Record, (f64, f64))]) -> bool {
    let order: Vec<f64> = (0..levels.len()).map(|index| index as f64).collect();
    let levels: Vec<f64> = levels.iter().map(|(_, (level, _))| *level).collect();
    correlation(&order, &levels).is_some_and(|(_, p)| p < RULES.creeping_zero)
}

/// Subtracts from each record this `share` (0 to 1) of its deviation from the mean level of rest. Records that do not rest
/// under a command of `off` stay as they are.
pub(super) fn tare(records: &mut [Record], beginnings: &[Beginning], off: f64, share: f64) {
    let own = |record: &Record, beginning: &Beginning| {
        let rests = beginning.rests_at(off);
        let pieces = quiet_pieces(record, beginning);
        level(&pieces).filter(|_| rests).map(|(level, _)| level)
    };
    let levels: Vec<Option<f64>> = records
        .iter()
        .zip(beginnings)
        .map(|(record, beginning)| own(record, beginning))
        .collect();
    let known: Vec<f64> = levels.iter().flatten().copied().collect();
    let common = mean(&known);
    for (record, own) in records.iter_mut().zip(levels) {
        let Some(own) = own else { continue };
        let envelope = [&mut record.y_min, &mut record.y_max];
        let series = envelope.into_iter().flatten().chain([&mut record.y]);
        series.flatten().for_each(|y| *y -= share * (own - common));
        if let Some(before) = &mut record.y_before {
            *before -= share * (own - common);
        }
    }
}

impl fmt::Display for MovingZero {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ((low, lowest), (high, highest)) = (&self.lowest, &self.highest);
        write!(
            f,
            "Record-to-record offset: at rest `{low}` reads {lowest:.3} and `{high}` {highest:.3}. Every command subtracts each \
             record's own offset; on the board, subtract the reading at rest before the law starts (`import` has `--y-offset`)."
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    const AT_REST: Beginning = Beginning {
        command: 0.0,
        rest: 600,
        follow: 0,
    };

    fn moving(records: &[Record]) -> Option<MovingZero> {
        MovingZero::of(records, &vec![AT_REST; records.len()], 0.0)
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

    /// Zeros of two days, less than a standard error of a sample apart: where the rests scatter within themselves by all of
    /// the standard error, nothing of it is slow noise.
    #[test]
    fn a_zero_that_moves_by_less_than_the_noise_is_told_where_that_is_fast() {
        let share = |sd: f64| {
            let days = [("a", 0.0), ("b", 0.004), ("c", 0.0), ("d", 0.004)];
            let records = days.map(|(name, zero)| Record {
                y_sd: Some(vec![sd; 2000]),
                ..resting(name, zero)
            });
            moving(&records).map(|moving| moving.share)
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
        // Less than slow noise makes of two rests.
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
        tare(&mut tared, &beginnings, 0.0, 1.0);
        let rest = |record: &Record| level(&quiet_pieces(record, &AT_REST)).map(|(level, _)| level);
        let (a, b) = (rest(&tared[0]).unwrap(), rest(&tared[1]).unwrap());
        assert!((a - b).abs() < 1e-12 && (a - 0.04).abs() < 0.005, "{a} {b}");
        let off = level_of_rest(&tared, &beginnings, 0.0).expect("they rest");
        assert!((off - a).abs() < 1e-12, "{off} {a}");
        assert_eq!(tared[2], records[2]);
    }

    #[test]
    fn records_that_do_not_rest_say_nothing() {
        let blown = Beginning {
            command: 1.0,
            ..AT_REST
        };
        let records = [resting("a", 0.3), resting("b", 0.0)];
        assert_eq!(MovingZero::of(&records, &[blown, AT_REST], 0.0), None);
        assert_eq!(level_of_rest(&records[..1], &[blown], 0.0), None);
    }
}
