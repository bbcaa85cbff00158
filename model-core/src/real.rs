//! The number type of the model: `f32` on the board, `f64` on the host, dual
//! numbers where the host needs derivatives.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A real number the model can be run in.
///
/// Elementary functions come from `libm` in every build (the exponential in `f32` from this file), so host and
/// board compute the same bits. Products and sums are separate operations, never fused.
pub trait Real:
    nalgebra::Scalar
    + Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number 0.
    const ZERO: Self;
    /// The number 1.
    const ONE: Self;
    /// The nearest representable number.
    fn from_f64(value: f64) -> Self;
    /// An integer, rounded to the nearest representable number.
    fn from_count(count: u32) -> Self;
    /// The value as `f64`, without derivatives.
    fn value(self) -> f64;
    /// e raised to this number.
    fn exp(self) -> Self;
    /// Sine, argument in rad.
    fn sin(self) -> Self;
    /// Cosine, argument in rad.
    fn cos(self) -> Self;
    /// Square root; 0 for a negative number, so that noise around zero gives no NaN.
    fn sqrt(self) -> Self;
    /// Cube root.
    fn cbrt(self) -> Self;
    /// The nearest integer, halves away from zero as in eq. (4); saturates at
    /// the bounds of `i32`, and NaN gives 0.
    fn round(self) -> i32;
    /// The largest integer not above this number, saturating; NaN gives 0.
    fn floor(self) -> i32;

    /// Knuth's two-sum: the sum and its rounding error, both exact.
    #[inline(always)]
    fn two_sum(self, term: Self) -> (Self, Self) {
        let sum = self + term;
        let part = sum - self;
        (sum, (self - (sum - part)) + (term - part))
    }
    /// The magnitude.
    #[inline(always)]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }
    /// This number, or `low` if it is smaller. NaN stays NaN.
    #[inline(always)]
    fn at_least(self, low: Self) -> Self {
        if self < low { low } else { self }
    }
    /// This number, or `high` if it is larger. NaN stays NaN.
    #[inline(always)]
    fn at_most(self, high: Self) -> Self {
        if self > high { high } else { self }
    }
}

macro_rules! real {
    ($float:ty, $exp:path, $sin:path, $cos:path, $sqrt:path, $cbrt:path) => {
        impl Real for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            #[inline]
            fn from_f64(value: f64) -> Self {
                value as $float
            }
            #[inline]
            fn from_count(count: u32) -> Self {
                count as $float
            }
            #[inline]
            fn value(self) -> f64 {
                self as f64
            }
            #[inline]
            fn exp(self) -> Self {
                $exp(self)
            }
            #[inline]
            fn sin(self) -> Self {
                $sin(self)
            }
            #[inline]
            fn cos(self) -> Self {
                $cos(self)
            }
            #[inline]
            fn sqrt(self) -> Self {
                if self > 0.0 { $sqrt(self) } else { 0.0 }
            }
            #[inline]
            fn cbrt(self) -> Self {
                $cbrt(self)
            }
            #[inline]
            fn round(self) -> i32 {
                // Truncation and the remainder are exact; adding 0.5 is not.
                let whole = self as i32;
                let rest = self - whole as $float;
                whole.saturating_add((rest + rest) as i32)
            }
            #[inline]
            fn floor(self) -> i32 {
                let whole = self as i32;
                if (whole as $float) > self {
                    whole.saturating_sub(1)
                } else {
                    whole
                }
            }
        }
    };
}

/// e raised to `x` within 2 units in the last place; 0 where the result would be
/// below the normal numbers. After S. Moshier's Cephes library.
///
/// `libm::expf` needs twice the instructions, and a tracking law calls the exponential for every predicted sample.
#[inline]
fn single_exp(x: f32) -> f32 {
    const HIGHEST: f32 = 88.722_84;
    const LOWEST: f32 = -87.336_54;
    // Added to a number below 2²², it leaves the nearest integer in the low bits.
    const SHIFT: f32 = 12_582_912.0;
    // ln 2 in two parts. The first part has few digits, so that n times it is exact.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    const SERIES: [f32; 6] = [
        1.987_569_1e-4,
        1.398_199_9e-3,
        8.333_452e-3,
        4.166_579_6e-2,
        1.666_666_5e-1,
        0.5,
    ];
    if x < LOWEST {
        return 0.0;
    }
    if x > HIGHEST || x.is_nan() {
        return x + f32::INFINITY;
    }
    let shifted = x * core::f32::consts::LOG2_E + SHIFT;
    let n = shifted - SHIFT;
    let rest = x - n * LN_2[0] - n * LN_2[1];
    let mut series = SERIES[0];
    for term in &SERIES[1..] {
        series = series * rest + *term;
    }
    let power = series * (rest * rest) + rest + 1.0;
    // Multiplies by 2ⁿ: n is added to the exponent.
    f32::from_bits(power.to_bits().wrapping_add(shifted.to_bits() << 23))
}

real!(
    f32,
    single_exp,
    libm::sinf,
    libm::cosf,
    libm::sqrtf,
    libm::cbrtf
);
real!(f64, libm::exp, libm::sin, libm::cos, libm::sqrt, libm::cbrt);

#[cfg(test)]
mod tests {
    use super::Real;

    #[test]
    fn halves_are_rounded_away_from_zero() {
        assert_eq!(Real::round(2.5_f32), 3);
        assert_eq!(Real::round(-2.5_f32), -3);
        assert_eq!(Real::round(47.35_f64 + 12.69), 60);
        // The largest f32 below one half must not become 1.
        assert_eq!(Real::round(0.499_999_97_f32), 0);
        assert_eq!(Real::round(f32::NAN), 0);
        assert_eq!(Real::round(1e30_f32), i32::MAX);
        assert_eq!(Real::round(-1e30_f64), i32::MIN);
    }

    #[test]
    fn the_exponential_is_right_to_two_units_in_the_last_place() {
        let mut worst = 0.0_f64;
        for bits in (0..0x42B1_7218_u32).step_by(997) {
            for x in [f32::from_bits(bits), -f32::from_bits(bits)] {
                let exact = f64::from(x).exp();
                let found = f64::from(Real::exp(x));
                if x < -87.336_54 {
                    assert_eq!(found, 0.0);
                } else if exact < f64::from(f32::MAX) {
                    let unit = 2.0_f64.powi(exact.log2().floor() as i32 - 23);
                    worst = worst.max((found - exact).abs() / unit);
                }
            }
        }
        assert!(worst < 2.0, "{worst}");
        assert_eq!(Real::exp(0.0_f32), 1.0);
        assert_eq!(Real::exp(f32::INFINITY), f32::INFINITY);
        assert_eq!(Real::exp(f32::NEG_INFINITY), 0.0);
        assert_eq!(Real::exp(100.0_f32), f32::INFINITY);
        assert!(Real::exp(f32::NAN).is_nan());
    }

    #[test]
    fn floor_goes_down_on_both_sides() {
        assert_eq!(Real::floor(1.75_f32), 1);
        assert_eq!(Real::floor(-1.25_f64), -2);
        assert_eq!(Real::floor(-3.0_f64), -3);
    }
}
