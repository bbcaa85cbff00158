//! Discrete Fourier transform of signals whose length is a power of two: a library for all lengths is 4 % of the
//! crate's code.

use std::f64::consts::PI;

/// The squared magnitudes of the lines 0 to n/2 of the transform of `signal`, whose length n is a power of two from 2.
pub(crate) fn energies(signal: &[f64]) -> Vec<f64> {
    let n = signal.len();
    debug_assert!(n.is_power_of_two() && n > 1);
    let unused = usize::BITS - n.ilog2();
    let reversed = |i: usize| [signal[i.reverse_bits() >> unused], 0.0];
    let mut lines: Vec<[f64; 2]> = (0..n).map(reversed).collect();
    let mut half = 1;
    while half < n {
        let turn = |k: usize| (-PI * k as f64 / half as f64).sin_cos();
        let turns: Vec<(f64, f64)> = (0..half).map(turn).collect();
        for block in lines.chunks_exact_mut(2 * half) {
            let (even, odd) = block.split_at_mut(half);
            for ((even, odd), (sin, cos)) in even.iter_mut().zip(odd).zip(&turns) {
                let ([re, im], [odd_re, odd_im]) = (*even, *odd);
                let turned = [odd_re * cos - odd_im * sin, odd_re * sin + odd_im * cos];
                *even = [re + turned[0], im + turned[1]];
                *odd = [re - turned[0], im - turned[1]];
            }
        }
        half *= 2;
    }
    let lines = lines[..=n / 2].iter();
    lines.map(|[re, im]| re * re + im * im).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lines_are_those_of_the_defining_sum() {
        for n in [2, 64, 512] {
            let signal: Vec<f64> = (0..n).map(|i| ((i * i) as f64).sin()).collect();
            let found = energies(&signal);
            assert_eq!(found.len(), n / 2 + 1);
            for (k, found) in found.into_iter().enumerate() {
                let part = |wave: fn(f64) -> f64| -> f64 {
                    let at = |i: usize| wave(2.0 * PI * (i * k % n) as f64 / n as f64);
                    signal.iter().enumerate().map(|(i, x)| x * at(i)).sum()
                };
                let expected = part(f64::cos).powi(2) + part(f64::sin).powi(2);
                assert!((found - expected).abs() < 1e-11 * n as f64, "{n}, {k}");
            }
        }
    }
}
