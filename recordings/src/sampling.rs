//! Uniform sampling: the period of a printed time column, and its uniformity.

use crate::error::DataProblem;
use crate::thresholds::RULES;

/// Times of a record as printed, each with one unit in its last place.
#[derive(Debug, Default)]
pub(crate) struct PrintedTimes {
    pub(crate) time: Vec<f64>,
    pub(crate) unit: Vec<f64>,
}

/// A problem of a time column: its row (0 is the first) and the problem.
#[derive(Debug)]
pub(crate) struct TimeFault {
    pub(crate) row: usize,
    pub(crate) problem: DataProblem,
}

/// A stated sampling period.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stated {
    pub(crate) period_s: f64,
    /// Source of the period, as subject and verb of a sentence: ``"`sample_period_s` is"``.
    pub(crate) by: &'static str,
}

/// Sampling according to a time column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clock {
    /// Sampling period, s.
    pub(crate) period_s: f64,
    /// Set if steps differ by more than the tolerance and rounding of the printed times explains it.
    pub(crate) rounded: Option<Rounded>,
}

/// A time column with uneven steps because its times are rounded to about the sampling period or coarser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rounded {
    /// One unit in the last printed place, s.
    pub(crate) unit: f64,
    /// Shortest step, s.
    pub(crate) shortest: f64,
    /// Longest step, s.
    pub(crate) longest: f64,
    /// Number of steps that differ from the most common one by more than the tolerance.
    pub(crate) uncommon: usize,
    /// The row after the first uncommon step.
    pub(crate) row: usize,
}

impl PrintedTimes {
    /// The sampling period: `stated` after checking it against the rows, or estimated from the rows.
    ///
    /// Needs at least two rows; all times finite. Uneven steps are allowed if the rounding of the printed times
    /// explains all of them; the period is then the mean over the record.
    pub(crate) fn clock(&self, stated: Option<Stated>) -> Result<Clock, TimeFault> {
        let fault = match self.period_of_steps(stated) {
            Ok(period_s) => {
                return Ok(Clock {
                    period_s,
                    rounded: None,
                });
            }
            Err(fault) => fault,
        };
        let Some(rounded) = self.rounded() else {
            return Err(fault);
        };
        Ok(Clock {
            period_s: self.mean_period(stated)?,
            rounded: Some(rounded),
        })
    }

    /// One unit in the last place of most times, s. A column of shortest decimals contains `0` and `1` as well as
    /// `0.25`, and the rounding errors of binary numbers grow with them.
    fn resolution(&self) -> f64 {
        let mut units = self.unit.clone();
        let middle = units.len() / 2;
        match units.is_empty() {
            true => 0.0,
            false => *units.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    }

    /// Whether times k·period + offset, rounded like the printed ones, reproduce all printed times. In addition each
    /// time may deviate by the allowance for uneven steps. A few uncommon steps are evidence of rounding only if the
    /// clock counts whole seconds; a repeated time of such a clock is not evidence of rounding.
    fn rounded(&self) -> Option<Rounded> {
        let last = self.time.len().checked_sub(1).filter(|&n| n >= 2)?;
        let unit = self.resolution();
        let mean = (self.time.last()? - self.time.first()?) / last as f64;
        let steps = || self.time.windows(2).map(|w| w[1] - w[0]);
        let (shortest, longest) = steps().fold((f64::INFINITY, 0.0_f64), |(low, high), s| {
            (low.min(s), high.max(s))
        });
        if !(mean > 0.0 && unit > 0.0 && shortest >= 0.0) {
            return None;
        }
        let mut sorted: Vec<f64> = steps().collect();
        let median = *sorted.select_nth_unstable_by(last / 2, f64::total_cmp).1;
        let is_uncommon = |s: f64| (s - median).abs() > unit / 2.0;
        let uncommon = steps().filter(|&s| is_uncommon(s)).count();
        let row = steps().position(is_uncommon)? + 1;
        let is_evident = uncommon >= RULES.jumps || (unit >= RULES.coarse_s && shortest > 0.0);
        if !is_evident {
            return None;
        }
        // The spread of t − k·p as a function of p is convex: ternary search.
        let first = *self.time.first()?;
        let spread = |p: f64| {
            let off = |(k, t): (usize, &f64)| t - first - k as f64 * p;
            let offs = self.time.iter().enumerate().map(off);
            let (low, high) = offs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| {
                (low.min(r), high.max(r))
            });
            high - low
        };
        let allowed = unit + RULES.uneven * mean;
        let (mut low, mut high) = (mean - allowed / last as f64, mean + allowed / last as f64);
        for _ in 0..40 {
            let third = (high - low) / 3.0;
            if spread(low + third) < spread(high - third) {
                high -= third;
            } else {
                low += third;
            }
        }
        (spread((low + high) / 2.0) <= allowed * (1.0 + 1e-9)).then_some(Rounded {
            unit,
            shortest,
            longest,
            uncommon,
            row,
        })
    }

    /// The time over which the mean step is computed, s, and its number of steps. If times repeat, the span extends
    /// from one change of the printed time to another. The time of a change is known to within one step; other
    /// times are known only to within the printed unit.
    pub(crate) fn span(&self) -> (f64, usize) {
        let changes =
            || (1..self.time.len()).filter(|&row| self.time.get(row) > self.time.get(row - 1));
        let ends = match changes().count() + 1 < self.time.len() {
            true => changes().next().zip(changes().next_back()),
            false => None,
        };
        let (first, last) = match ends {
            Some((first, last)) if last > first => (first, last),
            _ => (0, self.time.len().saturating_sub(1)),
        };
        match (self.time.get(first), self.time.get(last)) {
            (Some(from), Some(to)) => (to - from, last - first),
            _ => (0.0, 0),
        }
    }

    /// The number of rows lost before each row: a step of a whole multiple of the period misses the rows between.
    /// `None` if no row is lost, or if the rounding of the printed times explains more than one long step.
    pub(crate) fn lost_rows(&self, stated: Option<Stated>) -> Option<Vec<f64>> {
        let is_gap = |fault: &TimeFault| matches!(fault.problem, DataProblem::TimeGap { .. });
        let by_steps = self.period_of_steps(stated);
        if !by_steps.is_err_and(|fault| is_gap(&fault))
            || self.rounded().is_some_and(|r| r.uncommon > 1) && self.clock(stated).is_ok()
        {
            return None;
        }
        let steps: Vec<f64> = self.time.windows(2).map(|w| w[1] - w[0]).collect();
        let mut sorted = steps.clone();
        let middle = sorted.len() / 2;
        let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
        let rounding = |row: usize| self.unit[row - 1].max(self.unit[row]);
        // The mean of the regular steps is used, because the median is rounded like the printed
        // times.
        let regular = (1..).zip(&steps);
        let regular = regular
            .filter(|&(row, s)| (s - median).abs() <= tolerance(median, rounding(row)))
            .fold((0.0, 0.0), |(sum, count), (_, s)| (sum + s, count + 1.0));
        let period = stated.map_or(regular.0 / regular.1, |s| s.period_s);
        let lost = |(row, step): (usize, &f64)| {
            let periods = (step / period).round();
            let is_whole = (step - periods * period).abs() <= tolerance(period, rounding(row));
            if is_whole {
                (periods - 1.0).max(0.0)
            } else {
                0.0
            }
        };
        Some(
            std::iter::once(0.0)
                .chain((1..).zip(&steps).map(lost))
                .collect(),
        )
    }

    fn period_of_steps(&self, stated: Option<Stated>) -> Result<f64, TimeFault> {
        let n = self.time.len();
        if n < 2 {
            return Err(fault(0, DataProblem::TooFewRows(n)));
        }
        let mut steps: Vec<f64> = self.time.windows(2).map(|w| w[1] - w[0]).collect();
        if let Some(row) = steps.iter().position(|&s| s <= 0.0) {
            return Err(fault(
                row + 1,
                DataProblem::TimeBackward {
                    before: self.time[row],
                    time: self.time[row + 1],
                },
            ));
        }
        let middle = steps.len() / 2;
        let median = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
        let rounding = |row: usize| self.unit[row - 1].max(self.unit[row]);
        // If the stated period fits no step, the statement is wrong; the error must not report a
        // gap in row 2.
        if let Some(stated) = stated
            && (median - stated.period_s).abs() > tolerance(stated.period_s, rounding(1))
        {
            return Err(fault(1, stated.contradicted_by(median)));
        }
        let period = stated.map_or(median, |s| s.period_s);
        for row in 1..n {
            let step = self.time[row] - self.time[row - 1];
            if (step - period).abs() > tolerance(period, rounding(row)) {
                let missing = (step / period).round() - 1.0;
                let (step, period) = (tidy(step, 1e-6), tidy(period, 1e-6));
                return Err(fault(
                    row,
                    if missing >= 1.0 {
                        DataProblem::TimeGap {
                            step,
                            period,
                            missing: missing as u64,
                        }
                    } else {
                        DataProblem::TimeUneven { step, period }
                    },
                ));
            }
        }
        self.mean_period(stated)
    }

    /// The mean step over the record in the fewest digits that its uncertainty permits, or the stated period, with
    /// which the mean must agree.
    fn mean_period(&self, stated: Option<Stated>) -> Result<f64, TimeFault> {
        let (span, steps) = self.span();
        if steps == 0 {
            return Err(fault(0, DataProblem::TooFewRows(self.time.len())));
        }
        let mean = span / steps as f64;
        // Late times may be printed in more digits than a number has.
        let latest = self.time.iter().map(|t| t.abs()).fold(0.0, f64::max);
        let spacing = f64::EPSILON * latest;
        let rounding = self.resolution().max(spacing) / steps as f64;
        match stated {
            Some(stated) => {
                let allowed = RULES.clock * stated.period_s + rounding;
                match (mean - stated.period_s).abs() > allowed {
                    true => Err(fault(1, stated.contradicted_by(mean))),
                    false => Ok(stated.period_s),
                }
            }
            None => Ok(tidy(mean, (rounding / mean).clamp(1e-9, 1e-4))),
        }
    }
}

impl Stated {
    fn contradicted_by(self, found: f64) -> DataProblem {
        DataProblem::PeriodMismatch {
            found: tidy(found, 1e-6),
            stated: self.period_s,
            by: self.by,
        }
    }
}

/// Tolerance of a step relative to `period`, s, for times printed to within `rounding`, s.
fn tolerance(period: f64, rounding: f64) -> f64 {
    (RULES.uneven * period + rounding).min(RULES.most_uneven * period)
}

fn fault(row: usize, problem: DataProblem) -> TimeFault {
    TimeFault { row, problem }
}

/// The number with the fewest digits within a relative tolerance of `value`, or whose reciprocal (a rate) has the
/// fewest digits.
pub(crate) fn tidy(value: f64, tolerance: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return value;
    }
    let shortest = |x: f64| -> Option<(usize, f64)> {
        (0..=15).find_map(|digits| {
            let rounded: f64 = format!("{x:.digits$e}").parse().ok()?;
            ((rounded / x - 1.0).abs() <= tolerance).then_some((digits, rounded))
        })
    };
    match (shortest(value), shortest(1.0 / value)) {
        (Some((d_period, _)), Some((d_rate, rate))) if d_rate + 1 < d_period => 1.0 / rate,
        (Some((_, period)), _) => period,
        _ => value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::printed::printed_unit;

    fn stated(period_s: f64) -> Option<Stated> {
        let by = "`sample_period_s` is";
        Some(Stated { period_s, by })
    }

    fn printed(n: usize, period: f64, digits: usize) -> PrintedTimes {
        printed_from(0.0, n, period, digits)
    }

    fn printed_from(t0: f64, n: usize, period: f64, digits: usize) -> PrintedTimes {
        let mut times = PrintedTimes::default();
        for k in 0..n {
            let text = format!("{:.digits$}", t0 + k as f64 * period);
            times.time.push(text.parse().unwrap());
            times.unit.push(printed_unit(text.as_bytes()));
        }
        times
    }

    #[test]
    fn period_survives_the_rounding_of_printed_times() {
        for (period, digits) in [
            (0.001, 3),
            (0.001, 6),
            (1.0 / 3.0, 3),
            (0.0016384, 7),
            (0.0016384, 3),
            (1.0, 0),
            (9.0, 0),
            (1.0 / 51200.0, 7),
        ] {
            let found = printed(10_000, period, digits)
                .clock(None)
                .ok()
                .map(|c| c.period_s)
                .unwrap();
            let allowed = 2.0 * 10f64.powi(-(digits as i32)) / 10_000.0;
            assert!(
                (found - period).abs() <= allowed,
                "{period} printed to {digits}: {found}"
            );
            assert!(
                printed(10_000, period, digits)
                    .clock(stated(period))
                    .is_ok()
            );
        }
        assert_eq!(
            printed(10_000, 0.001, 3)
                .clock(None)
                .ok()
                .map(|c| c.period_s),
            Some(0.001)
        );
        assert_eq!(
            printed(10_000, 1.0 / 3.0, 6)
                .clock(None)
                .ok()
                .map(|c| c.period_s),
            Some(1.0 / 3.0)
        );
    }

    #[test]
    fn gaps_and_steps_back_are_found_where_they_are() {
        for period in [0.001, 1.0] {
            let mut gap = printed(100, period, 3);
            gap.time.remove(40);
            gap.unit.remove(40);
            let fault = gap.clock(None).err().unwrap();
            assert_eq!(fault.row, 40);
            assert!(matches!(
                fault.problem,
                DataProblem::TimeGap { missing: 1, .. }
            ));
            let mut back = printed(100, period, 3);
            back.time[60] = back.time[59];
            let fault = back.clock(stated(period)).err().unwrap();
            assert_eq!(fault.row, 60);
            assert!(matches!(fault.problem, DataProblem::TimeBackward { .. }));
        }
        let wrong = printed(100, 0.001, 3).clock(stated(0.01)).err().unwrap();
        assert!(matches!(wrong.problem, DataProblem::PeriodMismatch { .. }));
        let slightly = printed(10_000, 0.00101, 6)
            .clock(stated(0.001))
            .err()
            .unwrap();
        assert!(matches!(
            slightly.problem,
            DataProblem::PeriodMismatch { .. }
        ));
    }

    /// Eighty days after zero, doubles are 0.9 ns apart, however many digits are printed.
    #[test]
    fn late_times_are_no_more_exact_than_doubles() {
        let period = 6.880_207_171_669_66e-8;
        let times = printed_from(6_953_183.447_965_344, 2, period, 12);
        assert_eq!(times.clock(stated(period)).unwrap().period_s, period);
        assert!(times.clock(stated(1.1 * period)).is_err());
    }

    #[test]
    fn lost_rows_are_counted_where_a_step_is_a_multiple_of_the_period() {
        let without = |mut times: PrintedTimes, rows: &[usize]| {
            for &row in rows.iter().rev() {
                times.time.remove(row);
                times.unit.remove(row);
            }
            times
        };
        let found = |times: &PrintedTimes, stated| -> Vec<(usize, f64)> {
            let lost = times.lost_rows(stated).unwrap_or_default();
            (0..).zip(lost).filter(|(_, lost)| *lost > 0.0).collect()
        };
        // At a period of 9.9 ms printed in whole milliseconds, the median step is 10 ms; a long gap
        // must not be counted in such steps.
        let long: Vec<usize> = (200..320).collect();
        let times = without(printed(1000, 0.0099, 3), &[&[40, 41], &long[..]].concat());
        assert_eq!(found(&times, None), [(40, 2.0), (198, 120.0)]);
        // For a clock of whole seconds, a single missing second is a lost row; several missing
        // seconds are due to rounding.
        let times = without(whole(600, 1.0, 1.0, 0.0), &[300]);
        assert_eq!(found(&times, None), [(300, 1.0)]);
        assert_eq!(found(&whole(600, 1.01, 1.0, 0.0), None), []);
        let times = without(whole(600, 1.0, 1.0, 0.0), &[200, 400]);
        assert_eq!(found(&times, None), []);
        assert_eq!(found(&times, stated(1.0)), [(200, 1.0), (399, 1.0)]);
        // A step of 2.4 periods is uneven.
        let mut times = printed(100, 1.0, 3);
        times.time.iter_mut().skip(50).for_each(|t| *t += 1.4);
        assert_eq!(found(&times, None), []);
    }

    /// Times of a clock with this period, printed in whole units.
    fn whole(n: usize, period: f64, unit: f64, phase: f64) -> PrintedTimes {
        let read = |k: usize| ((k as f64 + phase) * period / unit).floor() * unit;
        PrintedTimes {
            time: (0..n).map(read).collect(),
            unit: vec![unit; n],
        }
    }

    #[test]
    fn whole_second_stamps_of_any_period_miss_no_sample() {
        for (n, period) in [
            (599, 1.001_7),
            (599, 0.99),
            (4000, 1.3),
            (500, 0.25),
            (3000, 0.1),
        ] {
            let times = whole(n, period, 1.0, 0.3);
            let clock = times.clock(None).unwrap();
            let off = (clock.period_s - period).abs() * (n - 1) as f64;
            let off = if period < 1.0 {
                off / 2.0 / period
            } else {
                off
            };
            assert!(off <= 1.0, "{period}: {}", clock.period_s);
            assert!(times.clock(stated(period)).is_ok(), "{period}");
            let wrong = times.clock(stated(1.5 * period)).unwrap_err();
            assert!(matches!(wrong.problem, DataProblem::PeriodMismatch { .. }));
        }
        // Two consecutive missing samples, or single ones at irregular positions, are not explained by rounding.
        for missing in [&[200, 201][..], &[100, 150, 170]] {
            let mut times = whole(600, 1.0, 1.0, 0.0);
            for &row in missing.iter().rev() {
                times.time.remove(row);
                times.unit.remove(row);
            }
            let fault = times.clock(None).unwrap_err();
            assert!(matches!(fault.problem, DataProblem::TimeGap { .. }));
        }
        let minutes = whole(400, 10.0, 60.0, 0.0).clock(None).unwrap();
        assert!((minutes.period_s - 10.0).abs() < 0.2);
    }

    /// A clock with milliseconds does not skip steps by rounding: a step of two periods is a missing sample.
    #[test]
    fn fine_clocks_are_rounded_only_where_many_steps_say_so() {
        let slow = whole(5000, 0.001_3, 0.001, 0.0).clock(None).unwrap();
        assert!(slow.rounded.is_some() && (slow.period_s - 0.001_3).abs() < 1e-6);
    }
}
