//! Tables of lagged products: every sum that a regression on lagged outputs needs.
//!
//! The regressors of eqs. (3) and (4) are outputs y_{k−m}, alone or times the arriving command d_k. All inner
//! products between them are P_w(i, j) = Σ_k w_k y_{k+1−i} y_{k+1−j} with w = 1 or products of d. If w consists of
//! intervals, an entry follows from its neighbour on the diagonal by the samples that enter and leave at the ends
//! of the intervals. A table then costs O(lags² × edges + lags × samples). Other weights need a matrix product over
//! all samples. A regression needs only look-ups, whatever the length of the records.

use super::arrival::Weights;
use numerics::linalg::{self, dot, dots};

/// Regressor elements: 0 is the constant 1, 1 + i is y_{k+1−i} (1 is the target y_{k+1}).
pub(crate) type Element = usize;

/// The constant 1.
pub(crate) const ONE: Element = 0;
/// The target y_{k+1}.
pub(crate) const TARGET: Element = 1;

/// The element y_{k−m}.
pub(crate) fn behind_newest(m: usize) -> Element {
    m + 2
}

/// A symmetric table of weighted products between all elements.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Table {
    size: usize,
    values: Vec<f64>,
}

impl Table {
    /// The product of two elements.
    pub(crate) fn at(&self, a: Element, b: Element) -> f64 {
        self.values[a * self.size + b]
    }

    /// Products of one element with all.
    pub(crate) fn row(&self, a: Element) -> &[f64] {
        &self.values[a * self.size..(a + 1) * self.size]
    }
}

/// Rows processed at a time if a table needs a matrix product.
const BLOCK_ROWS: usize = 512;

/// The outputs of all records, from which tables are made.
#[derive(Debug, Clone)]
pub(crate) struct LaggedOutputs {
    /// Per record: `longest` zeros, then the outputs.
    padded: Vec<Vec<f64>>,
    /// Number of elements.
    size: usize,
}

impl LaggedOutputs {
    /// Elements up to y_{k−`longest`}; history before a record is 0.
    pub(crate) fn new(outputs: &[Vec<f64>], longest: usize) -> Self {
        let padded = outputs
            .iter()
            .map(|y| {
                let mut padded = vec![0.0; longest];
                padded.extend_from_slice(y);
                padded
            })
            .collect();
        Self {
            padded,
            size: longest + 3,
        }
    }

    fn padding(&self) -> usize {
        self.size - 3
    }

    /// Value of an element at row k of a record.
    pub(crate) fn value(&self, record: usize, k: usize, element: Element) -> f64 {
        match element {
            ONE => 1.0,
            // y_{k+1−i} with i = element − 1 is stored `padding` positions later.
            _ => self.padded[record][self.padding() + k + 2 - element],
        }
    }

    /// All values of an element, record after record.
    pub(crate) fn column(&self, element: Element) -> Vec<f64> {
        (0..self.padded.len())
            .flat_map(|r| (0..self.rows(r)).map(move |k| self.value(r, k, element)))
            .collect()
    }

    /// Rows of a record: one fewer than its samples.
    pub(crate) fn rows(&self, record: usize) -> usize {
        (self.padded[record].len() - self.padding()).saturating_sub(1)
    }

    /// The table for the given weights.
    pub(crate) fn table(&self, weights: &Weights) -> Table {
        match weights {
            Weights::Intervals(intervals) => self.table_from_intervals(intervals),
            Weights::Samples(samples) => self.table_from_samples(samples),
        }
    }

    /// Shifting both elements of an entry by a sample shifts the intervals of its sum. Along a diagonal the entries
    /// therefore differ only by the samples that enter and leave at the ends. Row 0 is summed directly; the changes
    /// are one matrix product with a row for each end.
    fn table_from_intervals(&self, intervals: &[Vec<(usize, usize)>]) -> Table {
        // Row i belongs to y_{k+1−i}, the element with index 1 + i.
        let shifts = self.size - 1;
        let (mut first_row, mut first_sum) = (vec![0.0; shifts], 0.0);
        // For each end of an interval: the outputs y_{n−i} from i = 0 on, newest last, and its
        // sign.
        let mut ends: Vec<(&[f64], f64)> = Vec::new();
        for (padded, intervals) in self.padded.iter().zip(intervals) {
            for &(start, end) in intervals {
                let from = self.padding() + start + 1;
                let newest = &padded[from..self.padding() + end + 1];
                first_sum += newest.iter().sum::<f64>();
                let earlier = (0..shifts).map(|p| &padded[from - p..][..newest.len()]);
                let products = dots(newest, earlier);
                for (entry, product) in first_row.iter_mut().zip(products) {
                    *entry += product;
                }
                ends.push((&padded[start..from], 1.0));
                ends.push((&padded[end..][..=self.padding()], -1.0));
            }
        }
        let mut table = Table {
            size: self.size,
            values: vec![0.0; self.size * self.size],
        };
        if ends.is_empty() {
            return table;
        }
        let past = |(i, (outputs, _)): (usize, &(&[f64], f64))| outputs[self.padding() - i];
        let columns = (0..shifts - 1).flat_map(|i| ends.iter().map(move |end| past((i, end))));
        let columns: Vec<f64> = columns.collect();
        let signs: Vec<f64> = ends.iter().map(|(_, sign)| *sign).collect();
        let change = linalg::signed_products(&columns, &signs);
        let count: usize = intervals.iter().flatten().map(|(s, e)| e - s).sum();
        table.set(ONE, ONE, count as f64);
        let mut sum = first_sum;
        for i in 0..shifts {
            table.set(ONE, 1 + i, sum);
            if i + 1 < shifts {
                sum += dot(&columns[i * signs.len()..(i + 1) * signs.len()], &signs);
            }
        }
        for (p, first) in first_row.iter().enumerate() {
            let mut entry = *first;
            for i in 0..shifts - p {
                table.set(1 + i, 1 + i + p, entry);
                if i + p + 1 < shifts {
                    // Only the lower half is filled.
                    entry += change[i * (shifts - 1) + i + p];
                }
            }
        }
        table
    }

    fn table_from_samples(&self, samples: &[Vec<f64>]) -> Table {
        let mut values = vec![0.0; self.size * self.size];
        for (record, weights) in samples.iter().enumerate() {
            let rows = self.rows(record).min(weights.len());
            for start in (0..rows).step_by(BLOCK_ROWS) {
                let block = start..(start + BLOCK_ROWS).min(rows);
                let (mut plain, mut weighted) = (Vec::new(), Vec::new());
                for element in 0..self.size {
                    for k in block.clone() {
                        let value = self.value(record, k, element);
                        plain.push(value);
                        weighted.push(value * weights[k]);
                    }
                }
                linalg::add_cross_products(&mut values, &plain, &weighted, block.len(), self.size);
            }
        }
        // The matrix product rounds the two halves differently.
        let mut table = Table {
            size: self.size,
            values,
        };
        for a in 0..self.size {
            for b in 0..a {
                table.set(a, b, table.at(a, b));
            }
        }
        table
    }
}

impl Table {
    fn set(&mut self, a: Element, b: Element, value: f64) {
        self.values[a * self.size + b] = value;
        self.values[b * self.size + a] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outputs() -> Vec<Vec<f64>> {
        vec![
            (0..90).map(|k| (k as f64 * 0.3).sin() + 0.2).collect(),
            (0..61).map(|k| (k as f64 * 0.17).cos()).collect(),
        ]
    }

    fn direct(y: &[Vec<f64>], w: impl Fn(usize, usize) -> f64, a: Element, b: Element) -> f64 {
        let value = |r: usize, k: usize, e: Element| match e {
            ONE => 1.0,
            _ => (k + 2).checked_sub(e).map_or(0.0, |n| y[r][n]),
        };
        (0..y.len())
            .map(|r| {
                (0..y[r].len() - 1)
                    .map(|k| w(r, k) * value(r, k, a) * value(r, k, b))
                    .sum::<f64>()
            })
            .sum()
    }

    #[test]
    fn interval_and_sample_tables_equal_direct_sums() {
        let y = outputs();
        let lagged = LaggedOutputs::new(&y, 20);
        let intervals = vec![vec![(0, 7), (30, 89)], vec![(12, 40)]];
        let inside = |r: usize, k: usize| intervals[r].iter().any(|&(s, e)| (s..e).contains(&k));
        let as_samples: Vec<Vec<f64>> = (0..2)
            .map(|r| {
                (0..lagged.rows(r))
                    .map(|k| f64::from(u8::from(inside(r, k))))
                    .collect()
            })
            .collect();
        let graded: Vec<Vec<f64>> = (0..2)
            .map(|r| {
                (0..lagged.rows(r))
                    .map(|k| (k as f64 * 0.05).sin())
                    .collect()
            })
            .collect();
        let tables = [
            (
                lagged.table(&Weights::Intervals(intervals.clone())),
                as_samples.clone(),
            ),
            (
                lagged.table(&Weights::Samples(as_samples.clone())),
                as_samples,
            ),
            (lagged.table(&Weights::Samples(graded.clone())), graded),
        ];
        for (table, w) in &tables {
            for a in 0..lagged.size {
                for b in 0..lagged.size {
                    let expected = direct(&y, |r, k| w[r][k], a, b);
                    assert!((table.at(a, b) - expected).abs() < 1e-11, "{a} {b}");
                }
            }
        }
    }

    #[test]
    fn what_is_never_on_has_no_products() {
        let lagged = LaggedOutputs::new(&outputs(), 20);
        let table = lagged.table(&Weights::Intervals(vec![vec![], vec![]]));
        assert!(table.values.iter().all(|v| *v == 0.0));
    }

    #[test]
    fn columns_hold_the_target_and_the_past() {
        let y = outputs();
        let lagged = LaggedOutputs::new(&y, 20);
        let target = lagged.column(TARGET);
        assert_eq!(target[0], y[0][1]);
        assert_eq!(target[89], y[1][1]);
        let past = lagged.column(behind_newest(3));
        assert_eq!((past[2], past[3], past[89]), (0.0, y[0][0], 0.0));
        assert_eq!(past[88], y[0][85]);
    }
}
