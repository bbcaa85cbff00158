//! The initial state of a free run, estimated from the start of the record.

use numerics::linalg::dot;
use std::ops::Range;

/// Smallest number of samples of a record from which its initial state is estimated.
const FEWEST: usize = 20;
/// Share of a record from which its initial state is estimated.
const SHARE: f64 = 0.05;
/// Largest share of a record, used for processes with long time constants.
const LONGEST: f64 = 0.25;

/// Free responses of a process to its initial state. The initial state is estimated from the first twentieth of the
/// record, at least 20 samples. If the shortest time constant is longer than half of this interval, up to a quarter of
/// the record is used. In a record that begins in mid-run the first dead time is left out, because y then responds to
/// commands that were not recorded.
#[derive(Clone, Debug)]
pub(super) struct InitialState {
    /// Free responses, orthonormal over the start of the record.
    columns: Vec<Vec<f64>>,
    beginning: Range<usize>,
}

/// Inner product of two series over the length of the shorter one.
pub(super) fn inner(a: &[f64], b: &[f64]) -> f64 {
    let both = a.len().min(b.len());
    dot(
        a.get(..both).unwrap_or_default(),
        b.get(..both).unwrap_or_default(),
    )
}

impl InitialState {
    /// The free responses for a record of `samples`; `fastest` is the shortest time of the process, samples.
    pub(super) fn new(free: Vec<Vec<f64>>, samples: usize, fastest: f64) -> Self {
        Self::between(free, samples, fastest, 0..0)
    }

    /// The free responses, with the initial state estimated from sample `known.start` on and at least up to
    /// `known.end`.
    pub(super) fn between(
        free: Vec<Vec<f64>>,
        samples: usize,
        fastest: f64,
        known: Range<usize>,
    ) -> Self {
        let mut beginning = FEWEST.max((SHARE * samples as f64) as usize);
        // The interval is doubled, so that it does not change with small changes of the time
        // constant.
        while (beginning as f64) < (LONGEST * samples as f64).min(2.0 * fastest) {
            beginning *= 2;
        }
        beginning = beginning.min(FEWEST.max((LONGEST * samples as f64) as usize));
        let mut new = Self {
            columns: Vec::new(),
            beginning: known.start..(known.start + beginning).max(known.end).min(samples),
        };
        for mut column in free {
            let size = new.over_the_beginning(&column, &column).sqrt();
            // Gram–Schmidt is applied twice, because columns may be nearly parallel.
            for _ in 0..2 {
                new.remove_from(&mut column);
            }
            let left = new.over_the_beginning(&column, &column).sqrt();
            if left > 1e-9 * size && left > 0.0 {
                column.iter_mut().for_each(|value| *value /= left);
                new.columns.push(column);
            }
        }
        new
    }

    fn over_the_beginning(&self, a: &[f64], b: &[f64]) -> f64 {
        let both = a.len().min(b.len()).min(self.beginning.end);
        let from = self.beginning.start.min(both);
        inner(&a[from..both], &b[from..both])
    }

    /// Subtracts from `values` the free response with the least squared error at their start.
    pub(super) fn remove_from(&self, values: &mut [f64]) {
        let share = |column: &Vec<f64>| self.over_the_beginning(column, values);
        let shares: Vec<f64> = self.columns.iter().map(share).collect();
        for (column, share) in self.columns.iter().zip(shares) {
            for (value, response) in values.iter_mut().zip(column) {
                *value -= share * response;
            }
        }
    }

    /// `run` plus the free response that fits the start of `y` best.
    pub(super) fn added_to(&self, run: &[f64], y: &[f64]) -> Vec<f64> {
        let mut errors: Vec<f64> = y.iter().zip(run).map(|(y, run)| y - run).collect();
        self.remove_from(&mut errors);
        y.iter().zip(errors).map(|(y, error)| y - error).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::response::{Response, Shape};
    use super::*;

    #[test]
    fn a_run_begins_where_the_record_does_and_forgets_it() {
        let response = Response::new(Shape::of_time_constants(30.0, 10.0), 0.0);
        let free = response.free(300);
        let y: Vec<f64> = (0..300)
            .map(|k| 2.0 * free[0].get(k).unwrap_or(&0.0) - free[1].get(k).unwrap_or(&0.0))
            .collect();
        let initial = InitialState::new(free, 300, 10.0);
        let run = initial.added_to(&[0.0; 300], &y);
        assert!(run.iter().zip(&y).all(|(run, y)| (run - y).abs() < 1e-9));
        // Later samples do not influence the estimate.
        let mut late = y.clone();
        late[100..].iter_mut().for_each(|y| *y = 7.0);
        let other = initial.added_to(&[0.0; 300], &late);
        assert!(run.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    #[test]
    fn a_slow_process_has_a_long_beginning() {
        let beginning = |fastest| InitialState::new(Vec::new(), 1000, fastest).beginning.end;
        assert_eq!(
            (beginning(3.0), beginning(90.0), beginning(1e6)),
            (50, 200, 250)
        );
    }
}
