//! Moving averages without accumulating rounding errors.
//!
//! A running sum in floating point drifts without bound. Here a new sum is computed for every block of the
//! window's length, and replaces the running sum at the end of the block. Both are stored in two words. After any
//! number of samples the error is below that of summing the present window once, even after much larger values
//! have left it.

use crate::history::{DelayLine, Memory, Past};
use crate::real::Real;

/// Samples W of the averages in the paper, eqs. (1), (12) and (13).
pub const WINDOW: u32 = 250;

/// Running sum of the last `terms` samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowSum<T> {
    running: TwoWords<T>,
    fresh: TwoWords<T>,
    in_block: u32,
}

/// A sum and its rounding error.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TwoWords<T> {
    high: T,
    low: T,
}

impl<T: Real> TwoWords<T> {
    const ZERO: Self = Self {
        high: T::ZERO,
        low: T::ZERO,
    };

    #[inline(always)]
    fn add(&mut self, term: T) {
        let (sum, error) = self.high.two_sum(term);
        self.low = self.low + error;
        self.high = sum;
    }
}

impl<T: Real> WindowSum<T> {
    /// The sum over a window of zeros.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            running: TwoWords::ZERO,
            fresh: TwoWords::ZERO,
            in_block: 0,
        }
    }

    /// Advances a window of `terms` samples by one sample.
    #[inline(always)]
    pub fn slide(&mut self, entering: T, leaving: T, terms: u32) {
        self.fresh.add(entering);
        self.in_block += 1;
        if self.in_block >= terms {
            self.running = self.fresh;
            self.fresh = TwoWords::ZERO;
            self.in_block = 0;
        } else {
            self.running.add(entering);
            self.running.add(-leaving);
        }
    }

    /// Advances the window by one sample for a look-ahead: cheaper than [`slide`](Self::slide), and accurate
    /// for less than a window's length.
    #[inline(always)]
    pub(crate) fn lean(&mut self, entering: T, leaving: T) {
        self.running.low = self.running.low + (entering - leaving);
    }

    /// The sum over the window.
    #[inline(always)]
    #[must_use]
    pub fn value(&self) -> T {
        self.running.high + self.running.low
    }
}

impl<T: Real> Default for WindowSum<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// Moving average over the last `W` samples, eqs. (12) and (13):
/// (1/W) Σ_{i=0}^{W−1} x_{k−i}, with x = 0 before the first sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingAverage<T, const W: usize> {
    line: DelayLine<T, W>,
    sum: WindowSum<T>,
}

impl<T: Real, const W: usize> MovingAverage<T, W> {
    /// An average of zeros.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(W < u32::MAX as usize, "a window fits in 32 bits") };
        Self {
            line: DelayLine::new(),
            sum: WindowSum::new(),
        }
    }

    /// Adds the sample x_k and returns the average up to and including it.
    pub fn push(&mut self, sample: T) -> T {
        let leaving = self.line.back(W - 1);
        self.line.push(sample);
        self.sum.slide(sample, leaving, W as u32);
        self.sum.value() / T::from_count(W as u32)
    }
}

impl<T: Real, const W: usize> Default for MovingAverage<T, W> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The worst case of a plain running sum: values of very different size.
    fn sample(k: u64) -> f32 {
        let hashed = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
        let unit = hashed as f32 / (1_u64 << 24) as f32;
        if k % 5000 < 20 { 1e4 * unit } else { unit }
    }

    fn run(samples: u64) {
        const W: usize = 250;
        let mut average = MovingAverage::<f32, W>::new();
        let mut plain = 0.0_f32;
        let mut worst_plain = 0.0_f64;
        for k in 0..samples {
            let got = average.push(sample(k));
            plain += sample(k)
                - if k >= W as u64 {
                    sample(k - W as u64)
                } else {
                    0.0
                };
            if k % 99_991 == 0 || k + 3 > samples || (k > 300 && k % 5000 == 300 && k < 1_000_000) {
                let window = k.saturating_sub(W as u64 - 1)..=k;
                let exact: f64 = window.clone().map(|j| f64::from(sample(j))).sum();
                let size: f64 = window.map(|j| f64::from(sample(j)).abs()).sum();
                // Summing a window once in f32 errs by at most W·ε/2·Σ|x|.
                let bound = W as f64 * f64::from(f32::EPSILON) / 2.0 * size + 1e-12;
                let error = (f64::from(got) * W as f64 - exact).abs();
                assert!(error <= bound, "sample {k}: {error:e} > {bound:e}");
                worst_plain = worst_plain.max((f64::from(plain) - exact).abs() / bound);
            }
        }
        assert!(
            worst_plain > 1.0,
            "this sequence must break a plain running sum"
        );
    }

    /// More than a day at 1 kHz.
    #[test]
    fn the_average_does_not_drift_in_a_day() {
        run(100_000_000);
    }

    #[test]
    fn it_is_the_definition() {
        let mut average = MovingAverage::<f64, 3>::new();
        assert_eq!(average.push(3.0), 1.0);
        assert_eq!(average.push(6.0), 3.0);
        assert_eq!(average.push(9.0), 6.0);
        assert_eq!(average.push(0.0), 5.0);
    }
}
