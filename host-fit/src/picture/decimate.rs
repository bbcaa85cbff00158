//! Decimation of long records: the smallest and largest sample of every pixel column are kept, so that a
//! picture of any record is small and no spike is lost.

use std::ops::Range;

/// Indices of `values[range]` to draw, as unbroken pieces: non-finite samples end a piece unless decimation
/// hides them. At most `2·columns` indices, or all if the range is that short.
pub(super) fn min_max(values: &[f64], range: Range<usize>, columns: usize) -> Vec<Vec<usize>> {
    let range = range.start.min(values.len())..range.end.min(values.len());
    let columns = columns.max(1);
    let mut pieces = Vec::new();
    let mut piece = Vec::new();
    let mut end_piece = |piece: &mut Vec<usize>| {
        if !piece.is_empty() {
            pieces.push(std::mem::take(piece));
        }
    };
    if range.len() <= 2 * columns {
        for (index, value) in indexed(values, range) {
            if value.is_finite() {
                piece.push(index);
            } else {
                end_piece(&mut piece);
            }
        }
    } else {
        for column in split(range, columns) {
            match extremes(values, column) {
                Some((lowest, highest)) => {
                    piece.push(lowest.min(highest));
                    if lowest != highest {
                        piece.push(lowest.max(highest));
                    }
                }
                None => end_piece(&mut piece),
            }
        }
    }
    end_piece(&mut piece);
    pieces
}

/// `range`, divided into `columns` parts whose lengths differ by at most one sample.
pub(super) fn split(range: Range<usize>, columns: usize) -> impl Iterator<Item = Range<usize>> {
    let (start, length) = (range.start, range.len());
    // The arithmetic is 128 bits wide, because length × column may overflow.
    let edge =
        move |column: usize| start + (length as u128 * column as u128 / columns as u128) as usize;
    (0..columns).map(move |column| edge(column)..edge(column + 1))
}

/// Indices of the smallest and the largest finite value of `values[range]`.
pub(super) fn extremes(values: &[f64], range: Range<usize>) -> Option<(usize, usize)> {
    indexed(values, range)
        .filter(|(_, value)| value.is_finite())
        .fold(None, |found, (index, value)| {
            let Some(((low, low_value), (high, high_value))) = found else {
                return Some(((index, value), (index, value)));
            };
            Some((
                if value < low_value {
                    (index, value)
                } else {
                    (low, low_value)
                },
                if value > high_value {
                    (index, value)
                } else {
                    (high, high_value)
                },
            ))
        })
        .map(|((low, _), (high, _))| (low, high))
}

fn indexed(values: &[f64], range: Range<usize>) -> impl Iterator<Item = (usize, f64)> {
    let start = range.start;
    values
        .get(range)
        .unwrap_or_default()
        .iter()
        .enumerate()
        .map(move |(offset, value)| (start + offset, *value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn one_sample_spike_in_a_million_survives() {
        let mut values = vec![0.0; 1_000_000];
        values[765_432] = 3.0;
        values[10] = -2.0;
        let kept = min_max(&values, 0..values.len(), 800).concat();
        assert!(kept.len() <= 1600);
        assert!(kept.contains(&765_432) && kept.contains(&10));
    }

    #[test]
    fn a_gap_ends_a_piece() {
        let nan = f64::NAN;
        assert_eq!(
            min_max(&[1.0, 2.0, nan, 3.0, nan], 0..5, 10),
            [vec![0, 1], vec![3]]
        );
        assert!(min_max(&[nan; 100], 0..100, 10).is_empty());
        assert!(min_max(&[], 0..100, 10).is_empty());
        assert!(min_max(&[1.0], 5..9, 0).is_empty());
    }

    proptest! {
        #[test]
        fn keeps_the_extremes_in_order(
            values in prop::collection::vec(-1e3..1e3f64, 1..3000),
            columns in 1usize..200,
        ) {
            let kept = min_max(&values, 0..values.len(), columns).concat();
            prop_assert!(kept.len() <= (2 * columns).max(1));
            prop_assert!(kept.windows(2).all(|w| w[0] < w[1]));
            let drawn = kept.iter().map(|i| values[*i]);
            let (lo, hi) = super::super::axis::extent(values.iter().copied()).unwrap();
            prop_assert_eq!(super::super::axis::extent(drawn), Some((lo, hi)));
        }
    }
}
