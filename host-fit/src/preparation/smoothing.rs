//! Smoothing by a parabola over neighbouring samples (Savitzky and Golay, Anal. Chem. 36, 1964): value and slope of a
//! slow signal without the noise of single samples.

use std::ops::Range;

/// Half-widths that are tried, samples.
const HALVES: [usize; 6] = [2, 4, 8, 16, 32, 64];

/// A parabola over this many samples on both sides, fitted by least squares.
struct Parabola {
    value: f64,
    /// Weight of the sample's own value in the smoothed value.
    leverage: f64,
}

impl Parabola {
    /// The parabola at sample `at` of `y`, over the `2·half + 1` samples around it (near the ends of `y`, the first or
    /// last ones); `None` if there are fewer samples.
    fn of(y: &[f64], at: usize, half: usize) -> Option<Self> {
        let width = 2 * half + 1;
        let from = at.saturating_sub(half).min(y.len().checked_sub(width)?);
        let window = y.get(from..from + width)?;
        let (n, center) = (width as f64, half as f64);
        // Σx², Σx⁴ over −half … half: the parabola's second basis function is x² minus its mean.
        let squares = n * (n * n - 1.0) / 12.0;
        let mean = squares / n;
        let (mut sum, mut along, mut bend, mut bends) = (0.0, 0.0, 0.0, 0.0);
        for (k, y) in window.iter().enumerate() {
            let x = k as f64 - center;
            let curved = x * x - mean;
            sum += y;
            along += x * y;
            bend += curved * y;
            bends += curved * curved;
        }
        let x = at as f64 - from as f64 - center;
        let curved = x * x - mean;
        Some(Self {
            value: sum / n + along * x / squares + bend * curved / bends,
            leverage: 1.0 / n + x * x / squares + curved * curved / bends,
        })
    }
}

/// y at sample `at`, smoothed over `half` samples on both sides; unchanged for 0 or if there are too few samples.
pub(super) fn smoothed(y: &[f64], at: usize, half: usize) -> f64 {
    let own = y.get(at).copied().unwrap_or(0.0);
    let parabola = (half > 0).then(|| Parabola::of(y, at, half)).flatten();
    parabola.map_or(own, |parabola| parabola.value)
}

/// The best description of the slow part of a residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slow {
    /// The residual is noise, and its slow part is 0.
    Nothing,
    /// A parabola over this many samples on both sides; 0 is the residual itself.
    Parabola(usize),
}

/// The slow part of `y`, by leave-one-out cross-validation over the samples `range`: nothing, or the widest parabola whose
/// error is within one standard error of the smallest. Half-widths are at most the length of the range.
pub(super) fn slow_part(y: &[f64], range: Range<usize>) -> Slow {
    let errors = |half: usize| -> Option<Vec<f64>> {
        let each = range.clone().map(|at| {
            let parabola = Parabola::of(y, at, half)?;
            Some(((y.get(at)? - parabola.value) / (1.0 - parabola.leverage)).powi(2))
        });
        each.collect()
    };
    let tried = HALVES.into_iter().filter(|half| *half <= range.len());
    let parabolas = tried.filter_map(|half| Some((Slow::Parabola(half), errors(half)?)));
    let mut tried: Vec<(Slow, Vec<f64>)> = parabolas.collect();
    if tried.is_empty() {
        return Slow::Parabola(0);
    }
    let alone = y.iter().take(range.end).skip(range.start);
    tried.push((Slow::Nothing, alone.map(|y| y * y).collect()));
    let sum = |errors: &[f64]| errors.iter().sum::<f64>();
    let Some((_, least)) = tried.iter().min_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1))) else {
        return Slow::Parabola(0);
    };
    let as_good = |errors: &[f64]| {
        let more = errors.iter().zip(least).map(|(own, least)| own - least);
        let square: f64 = more.clone().map(|more| more * more).sum();
        more.sum::<f64>() <= square.sqrt()
    };
    let simplest = tried.iter().rev().find(|(_, errors)| as_good(errors));
    simplest.map_or(Slow::Parabola(0), |(slow, _)| *slow)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(k: usize) -> f64 {
        let state = (k as u32).wrapping_mul(2_654_435_761).wrapping_add(12_345);
        f64::from((state ^ (state >> 15)).wrapping_mul(2_246_822_519) >> 8) / f64::from(1 << 24)
            - 0.5
    }

    #[test]
    fn a_parabola_stays_as_it_is() {
        let y: Vec<f64> = (0..40)
            .map(f64::from)
            .map(|k| 2.0 - 0.3 * k + 0.01 * k * k)
            .collect();
        for at in [0, 1, 7, 20, 38, 39] {
            for half in HALVES.into_iter().filter(|half| 2 * half < y.len()) {
                assert!((smoothed(&y, at, half) - y[at]).abs() < 1e-9, "{at} {half}");
            }
        }
        assert_eq!(smoothed(&y, 3, 0), y[3]);
        assert_eq!(smoothed(&y[..4], 3, 2), y[3]);
    }

    #[test]
    fn the_slope_of_a_slow_signal_is_known_better_than_from_two_samples() {
        let y: Vec<f64> = (0..200).map(|k| 0.01 * k as f64 + noise(k)).collect();
        let found = slow_part(&y, 0..60);
        let Slow::Parabola(half @ 16..) = found else {
            panic!("{found:?}");
        };
        let slope = |half: usize| smoothed(&y, 60, half) - smoothed(&y, 59, half);
        assert!((slope(half) - 0.01).abs() < 0.02, "{}", slope(half));
        assert!((slope(0) - 0.01).abs() > 0.1);
    }

    #[test]
    fn a_fast_signal_is_hardly_smoothed() {
        let y: Vec<f64> = (0..200)
            .map(|k| (0.4 * k as f64).sin() + 0.01 * noise(k))
            .collect();
        let found = slow_part(&y, 0..60);
        assert!(matches!(found, Slow::Parabola(..=4)), "{found:?}");
        assert_eq!(slow_part(&y[..4], 0..4), Slow::Parabola(0));
        assert_eq!(slow_part(&y, 0..1), Slow::Parabola(0));
    }

    #[test]
    fn noise_has_no_slow_part() {
        let y: Vec<f64> = (0..200).map(noise).collect();
        assert_eq!(slow_part(&y, 0..60), Slow::Nothing);
    }
}
