//! Whether y responds to the command of its own row.
//!
//! In a model, and on a board, y_k is read before u_k is set, so u_k acts on y_{k+1} first. A logger that sets the
//! command, waits and then reads, or a program that steps a plant and then prints it, writes rows in which y_k responds
//! to u_k. No dead time describes that: y moves one sample before the model does. u is then moved up by one row.

use super::RULES;
use crate::data::{Record, Use};
use numerics::linalg::{dot, dots, gram, inverse_where_known};

/// `records` with u moved up by one row, if y responds to the command of its own row.
pub(super) fn in_own_row(records: &[Record]) -> Option<Vec<Record>> {
    responds(records)?.then(|| records.iter().map(moved_up).collect())
}

/// Whether u_k has a significant coefficient in y_k = c + Σ aᵢ·y_{k−i} + Σ bᵢ·u_{k−i} (i = 1, 2) + f·u_k, of the sign
/// of f + Σ bᵢ and of a large share of it. Feedback of y to u, as of a thermostat, has the opposite sign. A reading that
/// contains the command itself has a far larger share: there Σ bᵢ takes back most of f in the next row. `None` if the
/// coefficients are not identifiable.
fn responds(records: &[Record]) -> Option<bool> {
    let learning = || records.iter().filter(|r| r.role == Use::Identify);
    let rows = || learning().flat_map(|record| (2..record.len()).map(move |k| (record, k)));
    let column = |value: &dyn Fn(&Record, usize) -> f64| -> Vec<f64> {
        let values: Vec<f64> = rows().map(|(record, k)| value(record, k)).collect();
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.into_iter().map(|value| value - mean).collect()
    };
    let columns = [
        column(&|record, k| record.u[k]),
        column(&|record, k| record.u[k - 1]),
        column(&|record, k| record.u[k - 2]),
        column(&|record, k| record.y[k - 1]),
        column(&|record, k| record.y[k - 2]),
    ];
    let y = column(&|record, k| record.y[k]);
    let columns = columns.each_ref().map(Vec::as_slice);
    let size = columns.len();
    let (inverse, unknown) = inverse_where_known(&gram(&columns), size)?;
    if unknown.contains(&true) {
        return None;
    }
    let right = dots(&y, columns);
    let solution: Vec<f64> = inverse.chunks(size).map(|row| dot(row, &right)).collect();
    let (own, decay) = (solution[0], 1.0 - solution[3] - solution[4]);
    let response = solution[..3].iter().sum::<f64>();
    let left = (dot(&y, &y) - dot(&solution, &right)).max(0.0);
    let freedom = y.len().checked_sub(size + 1).filter(|free| *free > 0)?;
    let error = (inverse[0] * left / freedom as f64).sqrt();
    let [least, most] = RULES.own_row;
    let share = own / response;
    let is_share = share >= least && share <= most;
    Some(decay > 0.0 && is_share && own.abs() > RULES.off_zero * error)
}

/// A record whose row k has the command of row k + 1.
fn moved_up(record: &Record) -> Record {
    let mut moved = record.clone();
    moved.u_before = record.u_before.and(record.u.first().copied());
    moved.u.rotate_left(1);
    if let [.., last, end] = moved.u.as_mut_slice() {
        *end = *last;
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::super::Preparation;
    use super::*;

    /// First order with this time constant and dead time, samples; the command of row k acts from row k + 1 on.
    fn record(time: f64, dead_time: usize, feedback: bool) -> Record {
        let (mut u, mut y, mut x) = (vec![0.0; 600], Vec::new(), 0.0);
        for k in 0..600_u32 {
            let noise = f64::from(k.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24) - 0.5;
            let k = k as usize;
            y.push(3.0 + 2.0 * x + 0.1 * noise);
            u[k] = if feedback {
                f64::from(u8::from(y[k] < 4.0))
            } else {
                f64::from(u8::from((k / 17) % 3 == 1))
            };
            let drive = k.checked_sub(dead_time).map_or(0.0, |from| u[from]);
            x += (drive - x) * (1.0 - (-1.0 / time).exp());
        }
        Record::new("a", Use::Identify, 0.1, u, y)
    }

    #[test]
    fn a_command_that_acts_in_its_own_row_is_moved() {
        for time in [0.1, 2.0, 30.0] {
            let from_next = record(time, 0, false);
            assert_eq!(in_own_row(std::slice::from_ref(&from_next)), None);
            assert_eq!(in_own_row(&[record(time, 2, false)]), None);
            let mut same_row = from_next.clone();
            same_row.u.rotate_right(1);
            same_row.u[0] = 0.0;
            let moved = in_own_row(&[same_row]).expect("it acts in its own row");
            assert_eq!(moved[0].u[..599], from_next.u[..599]);
            // Only once.
            assert_eq!(in_own_row(&moved), None);
        }
    }

    #[test]
    fn every_command_works_on_the_moved_rows() {
        let mut same_row = record(0.1, 0, false);
        same_row.u.rotate_right(1);
        same_row.u[0] = 0.0;
        let prepared = Preparation::of(std::slice::from_ref(&same_row));
        assert!(prepared.own_row && prepared.records[0].u[..599] == same_row.u[1..]);
        assert!(prepared.remarks().iter().any(|r| r.contains("its own row")));
        assert!(!Preparation::of(&prepared.records).own_row);
    }

    #[test]
    fn a_thermostat_is_no_response() {
        assert_eq!(in_own_row(&[record(20.0, 0, true)]), None);
    }

    #[test]
    fn a_reading_that_contains_the_command_is_left_alone() {
        for (time, dead_time) in [(30.0, 0), (30.0, 9), (2.0, 9)] {
            let mut coupled = record(time, dead_time, false);
            for (y, u) in coupled.y.iter_mut().zip(&coupled.u) {
                *y += 0.4 * u;
            }
            assert_eq!(in_own_row(&[coupled]), None);
        }
    }

    #[test]
    fn without_a_response_nothing_is_moved() {
        let mut still = record(30.0, 0, false);
        still.u.fill(1.0);
        assert_eq!(in_own_row(&[still]), None);
    }
}
