//! Uniform sampling: what period a printed time column has, and whether it holds throughout.

use crate::error::DataProblem;
use crate::thresholds::RULES;

/// Times of a record as printed, with one unit in the last printed place of each.
#[derive(Debug, Default)]
pub(crate) struct PrintedTimes {
    pub(crate) time: Vec<f64>,
    pub(crate) unit: Vec<f64>,
}

/// A fault in a time column: the row where it shows (0 is the first row) and what it is.
pub(crate) struct TimeFault {
    pub(crate) row: usize,
    pub(crate) problem: DataProblem,
}

impl PrintedTimes {
    /// The sampling period: `stated` after checking it against the rows, or taken from the rows.
    ///
    /// Needs at least two rows; all times finite.
    pub(crate) fn period(&self, stated: Option<f64>) -> Result<f64, TimeFault> {
        let n = self.time.len();
        let (Some(first), Some(last)) = (self.time.first(), self.time.last()) else {
            return Err(fault(0, DataProblem::TooFewRows(0)));
        };
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
        // A period that fits no step at all is a wrong statement, not a gap in row 2.
        if let Some(stated) = stated
            && (median - stated).abs() > tolerance(stated, rounding(1))
        {
            return Err(fault(
                1,
                DataProblem::PeriodMismatch {
                    found: tidy(median, 1e-6),
                    stated,
                },
            ));
        }
        let period = stated.unwrap_or(median);
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
        let mean = (last - first) / (n - 1) as f64;
        let rounding =
            (self.unit[0].min(period) + self.unit[n - 1].min(period)) / 2.0 / (n - 1) as f64;
        match stated {
            Some(stated) if (mean - stated).abs() > RULES.clock * stated + rounding => Err(fault(
                1,
                DataProblem::PeriodMismatch {
                    found: tidy(mean, 1e-6),
                    stated,
                },
            )),
            Some(stated) => Ok(stated),
            None => Ok(tidy(mean, (rounding / mean).clamp(1e-9, 1e-4))),
        }
    }
}

/// By how much a step may differ from `period`, s, with times printed to within `rounding`, s.
fn tolerance(period: f64, rounding: f64) -> f64 {
    (RULES.uneven * period + rounding).min(RULES.most_uneven * period)
}

fn fault(row: usize, problem: DataProblem) -> TimeFault {
    TimeFault { row, problem }
}

/// The number with the fewest digits within a relative tolerance of `value`, as itself or as the reciprocal of a rate.
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
    use crate::rows::printed_unit;

    fn printed(n: usize, period: f64, digits: usize) -> PrintedTimes {
        let mut times = PrintedTimes::default();
        for k in 0..n {
            let text = format!("{:.digits$}", k as f64 * period);
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
            let found = printed(10_000, period, digits).period(None).ok().unwrap();
            let allowed = 2.0 * 10f64.powi(-(digits as i32)) / 10_000.0;
            assert!(
                (found - period).abs() <= allowed,
                "{period} printed to {digits}: {found}"
            );
            assert!(printed(10_000, period, digits).period(Some(period)).is_ok());
        }
        assert_eq!(printed(10_000, 0.001, 3).period(None).ok(), Some(0.001));
        assert_eq!(
            printed(10_000, 1.0 / 3.0, 6).period(None).ok(),
            Some(1.0 / 3.0)
        );
    }

    #[test]
    fn gaps_and_steps_back_are_found_where_they_are() {
        for period in [0.001, 1.0] {
            let mut gap = printed(100, period, 3);
            gap.time.remove(40);
            gap.unit.remove(40);
            let fault = gap.period(None).err().unwrap();
            assert_eq!(fault.row, 40);
            assert!(matches!(
                fault.problem,
                DataProblem::TimeGap { missing: 1, .. }
            ));
            let mut back = printed(100, period, 3);
            back.time[60] = back.time[59];
            let fault = back.period(Some(period)).err().unwrap();
            assert_eq!(fault.row, 60);
            assert!(matches!(fault.problem, DataProblem::TimeBackward { .. }));
        }
        let wrong = printed(100, 0.001, 3).period(Some(0.01)).err().unwrap();
        assert!(matches!(wrong.problem, DataProblem::PeriodMismatch { .. }));
        let slightly = printed(10_000, 0.00101, 6)
            .period(Some(0.001))
            .err()
            .unwrap();
        assert!(matches!(
            slightly.problem,
            DataProblem::PeriodMismatch { .. }
        ));
    }
}
