//! Fourier transforms of real signals, without the processor's vector units: the same digits on every machine.

use realfft::{RealFftPlanner, RealToComplex};
use std::fmt;
use std::sync::Arc;

pub use realfft::num_complex::Complex;

/// The transform X(i) = Σ x(k)·exp(−2πj·ik/n) of n real values at the frequencies i = 0 … n/2.
#[derive(Clone)]
pub struct Fourier(Arc<dyn RealToComplex<f64>>);

impl Fourier {
    /// The transform of `length` values; at least 1.
    #[must_use]
    pub fn new(length: usize) -> Self {
        Self(RealFftPlanner::new().plan_fft_forward(length.max(1)))
    }

    /// The transform of `x`, cut or filled with zeros to the planned length.
    #[must_use]
    pub fn lines(&self, mut x: Vec<f64>) -> Vec<Complex<f64>> {
        x.resize(self.0.len(), 0.0);
        let mut lines = self.0.make_output_vec();
        // This cannot fail: both lengths are those of the plan.
        let _ = self.0.process(&mut x, &mut lines);
        lines
    }
}

impl fmt::Debug for Fourier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Fourier").field(&self.0.len()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tone_is_one_line() {
        let n = 48;
        let tone = |k: usize| (std::f64::consts::TAU * 5.0 * k as f64 / n as f64).cos();
        let lines = Fourier::new(n).lines((0..n).map(tone).collect());
        assert_eq!(lines.len(), n / 2 + 1);
        for (i, line) in lines.iter().enumerate() {
            let exact = if i == 5 { n as f64 / 2.0 } else { 0.0 };
            assert!((line - exact).norm() < 1e-12, "{i}: {line}");
        }
    }

    #[test]
    fn a_short_signal_is_filled_with_zeros() {
        let lines = Fourier::new(8).lines(vec![1.0]);
        assert_eq!(lines, [Complex::new(1.0, 0.0); 5]);
    }
}
