//! The number type of the model: `f32` on the board, `f64` on the host, dual
//! numbers where the host needs derivatives.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A real number the model can be run in.
///
/// Elementary functions come from `libm` in every build, so that a host and a
/// board compute the same bits. Products and sums are written out, never fused.
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
    /// Square root; 0 for a negative number, so that noise around zero is safe.
    fn sqrt(self) -> Self;
    /// Cube root.
    fn cbrt(self) -> Self;
    /// The nearest integer, halves away from zero as in eq. (4); saturates at
    /// the bounds of `i32`, and NaN gives 0.
    fn round(self) -> i32;
    /// The largest integer not above this number, saturating; NaN gives 0.
    fn floor(self) -> i32;

    /// The magnitude.
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }
    /// This number, or `low` where it is below. NaN is kept.
    fn at_least(self, low: Self) -> Self {
        if self < low { low } else { self }
    }
    /// This number, or `high` where it is above. NaN is kept.
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
                // Truncation and the remainder are exact, which adding 0.5 is not.
                let whole = self as i32;
                let rest = self - whole as $float;
                if rest >= 0.5 {
                    whole.saturating_add(1)
                } else if rest <= -0.5 {
                    whole.saturating_sub(1)
                } else {
                    whole
                }
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

real!(
    f32,
    libm::expf,
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
    fn floor_goes_down_on_both_sides() {
        assert_eq!(Real::floor(1.75_f32), 1);
        assert_eq!(Real::floor(-1.25_f64), -2);
        assert_eq!(Real::floor(-3.0_f64), -3);
    }
}
