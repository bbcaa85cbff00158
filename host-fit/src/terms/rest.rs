//! Where y rests before anything is blown: the sensor's zero, and whether it moves.

use super::RULES;
use crate::data::Record;
use crate::residual::correlation;
use std::borrow::Cow;
use std::fmt;

/// The means of the pieces of a record before its first command.
fn quiet_pieces(record: &Record) -> Vec<f64> {
    let blown = record.u.iter().position(|u| *u != 0.0);
    let quiet = &record.y[..blown.unwrap_or(record.len())];
    let pieces = quiet.chunks_exact(RULES.quiet_piece);
    pieces.map(mean).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The standard error of y before the first commands, rms over the records; none where one does not say it.
fn noise_at_rest(records: &[Record]) -> Option<f64> {
    let mut squares = Vec::new();
    for record in records {
        let sd = record.y_sd.as_ref()?;
        let at_rest = sd.iter().zip(&record.u).take_while(|(_, u)| **u == 0.0);
        squares.extend(at_rest.map(|(sd, _)| sd * sd));
    }
    (!squares.is_empty()).then(|| mean(&squares).sqrt())
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

/// Mean y of the records before the first command, 0 where it is that but for chance;
/// none where they do not rest before it.
pub(super) fn level_of_rest(records: &[Record]) -> Option<f64> {
    let pieces: Vec<f64> = records.iter().flat_map(quiet_pieces).collect();
    let (mean, error) = level(&pieces)?;
    let is_off = mean.abs() > RULES.off_zero * error && mean.abs() > 1e-12;
    Some(if is_off { mean } else { 0.0 })
}

/// A zero of the sensor that is not the same in all records.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingZero {
    /// The record that rests lowest, and where, y.
    pub lowest: (String, f64),
    /// The record that rests highest, and where, y.
    pub highest: (String, f64),
}

impl MovingZero {
    /// Whether records rest at different levels before their first command: by more than chance, and by more than slow
    /// noise makes of a rest: some standard errors of y where they are known, otherwise a small share of all that y does;
    /// or by half as much, if they creep from each record to the next as chance seldom does.
    #[must_use]
    pub fn of(records: &[Record]) -> Option<Self> {
        let levels = records
            .iter()
            .filter_map(|record| Some((record, level(&quiet_pieces(record))?)));
        let levels: Vec<(&Record, (f64, f64))> = levels.collect();
        let by_level =
            |a: &&(&Record, (f64, f64)), b: &&(&Record, (f64, f64))| a.1.0.total_cmp(&b.1.0);
        let lowest = levels.iter().min_by(by_level)?;
        let highest = levels.iter().max_by(by_level)?;
        let apart = highest.1.0 - lowest.1.0;
        let least = noise_at_rest(records).map_or_else(
            || {
                let y = || records.iter().flat_map(|record| record.y.iter().copied());
                let range = y().fold(f64::MIN, f64::max) - y().fold(f64::MAX, f64::min);
                RULES.moving_zero * range
            },
            |noise| RULES.moving_zero_noise * noise,
        );
        let share = if creeps(&levels) {
            RULES.creeping_share
        } else {
            1.0
        };
        let error = lowest.1.1.hypot(highest.1.1);
        let moves = apart > RULES.off_zero * error && apart > share * least;
        let named = |of: &(&Record, (f64, f64))| (of.0.name.clone(), of.1.0);
        moves.then(|| Self {
            lowest: named(lowest),
            highest: named(highest),
        })
    }
}

/// Whether levels follow the order of the records, which is that of the recording as a rule.
fn creeps(levels: &[(&Record, (f64, f64))]) -> bool {
    let order: Vec<f64> = (0..levels.len()).map(|index| index as f64).collect();
    let levels: Vec<f64> = levels.iter().map(|(_, (level, _))| *level).collect();
    correlation(&order, &levels).is_some_and(|(_, p)| p < RULES.creeping_zero)
}

/// The records, each from its own zero where that moves between them: all rest where they do in the mean. Records
/// that do not rest before their first command stay as they are.
pub(crate) fn tared(records: &[Record]) -> Cow<'_, [Record]> {
    if MovingZero::of(records).is_none() {
        return Cow::Borrowed(records);
    }
    let own = |record: &Record| level(&quiet_pieces(record)).map(|(level, _)| level);
    let levels: Vec<f64> = records.iter().filter_map(own).collect();
    let common = mean(&levels);
    let tared = records.iter().map(|record| {
        let mut record = record.clone();
        if let Some(own) = own(&record) {
            let envelope = [&mut record.y_min, &mut record.y_max];
            let series = envelope.into_iter().flatten().chain([&mut record.y]);
            series.flatten().for_each(|y| *y -= own - common);
        }
        record
    });
    Cow::Owned(tared.collect())
}

impl fmt::Display for MovingZero {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ((low, lowest), (high, highest)) = (&self.lowest, &self.highest);
        write!(
            f,
            "The sensor's zero moves: before the first blowing `{low}` rests at {lowest:.3} and `{high}` at {highest:.3}. Each record is taken from its \
             own here; a model has one for all, and `compare` shows what that makes: subtract each record's own first (`import` has `--y-offset`)."
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

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
        assert_eq!(
            MovingZero::of(&[resting("a", 0.05), resting("b", 0.05)]),
            None
        );
        let found = MovingZero::of(&[resting("a", 0.0), resting("b", 0.08), resting("c", 0.03)]);
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
            MovingZero::of(&records).is_some()
        };
        assert!(moves(0.012) && !moves(0.02));
    }

    #[test]
    fn a_zero_that_creeps_is_told_by_its_order() {
        let moves = |zeros: &[f64]| {
            let noisy = |(index, zero): (usize, &f64)| Record {
                y_sd: Some(vec![0.02; 2000]),
                ..resting(&format!("{index}"), *zero)
            };
            let records: Vec<Record> = zeros.iter().enumerate().map(noisy).collect();
            MovingZero::of(&records).is_some()
        };
        assert!(moves(&[0.0, 0.011, 0.019, 0.032, 0.04, 0.05, 0.06]));
        assert!(!moves(&[0.032, 0.0, 0.05, 0.019, 0.06, 0.04, 0.011]));
        // Less than slow noise makes of two rests.
        assert!(!moves(&[0.0, 0.005, 0.01, 0.016, 0.02, 0.026, 0.03]));
    }

    #[test]
    fn each_record_is_taken_from_its_own_zero_where_that_moves() {
        let mut blown = resting("c", 0.3);
        blown.u.fill(1.0);
        let records = [resting("a", 0.0), resting("b", 0.08), blown];
        let tared = tared(&records);
        let rest = |record: &Record| level(&quiet_pieces(record)).map(|(level, _)| level);
        let (a, b) = (rest(&tared[0]).unwrap(), rest(&tared[1]).unwrap());
        assert!((a - b).abs() < 1e-12 && (a - 0.04).abs() < 0.005, "{a} {b}");
        let off = level_of_rest(&tared).expect("they rest");
        assert!((off - a).abs() < 1e-12, "{off} {a}");
        assert_eq!(tared[2], records[2]);
        let still = [resting("a", 0.05), resting("b", 0.05)];
        assert!(matches!(super::tared(&still), Cow::Borrowed(_)));
    }

    #[test]
    fn records_that_are_blown_from_the_start_say_nothing() {
        let mut record = resting("a", 0.3);
        record.u.fill(1.0);
        assert_eq!(MovingZero::of(&[record.clone(), resting("b", 0.0)]), None);
        assert_eq!(level_of_rest(&[record]), None);
    }
}
