//! Forward-mode derivatives: numbers that carry `P` partial derivatives.
//!
//! Running `model-core` in [`Dual`] gives exact sensitivities of a free run
//! from the very code that runs on the board.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices are compiled into vector instructions wherever they are called from"
)]

use model_core::Real;
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A value and its derivatives with respect to `P` parameters.
///
/// Ordering looks at the value alone; equality at everything, so that a zero
/// that still depends on a parameter is not taken for nothing.
#[derive(Clone, Copy, Debug)]
pub struct Dual<const P: usize> {
    /// The value.
    pub value: f64,
    /// ∂value/∂parameter.
    pub partials: [f64; P],
}

impl<const P: usize> Dual<P> {
    /// A number that depends on nothing.
    #[inline(always)]
    #[must_use]
    pub const fn constant(value: f64) -> Self {
        Self {
            value,
            partials: [0.0; P],
        }
    }

    /// The parameter with index `index` itself; a constant if `index >= P`.
    #[must_use]
    pub fn parameter(value: f64, index: usize) -> Self {
        let mut dual = Self::constant(value);
        if let Some(partial) = dual.partials.get_mut(index) {
            *partial = 1.0;
        }
        dual
    }

    /// f(self), given f and f′ at the value.
    #[inline(always)]
    fn chain(self, value: f64, slope: f64) -> Self {
        let mut partials = self.partials;
        for partial in &mut partials {
            *partial *= slope;
        }
        Self { value, partials }
    }
}

impl<const P: usize> PartialEq for Dual<P> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        let mut equal = self.value == other.value;
        for i in 0..P {
            equal &= self.partials[i] == other.partials[i];
        }
        equal
    }
}

impl<const P: usize> PartialOrd for Dual<P> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<const P: usize> Add for Dual<P> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        self.value += other.value;
        for i in 0..P {
            self.partials[i] += other.partials[i];
        }
        self
    }
}

impl<const P: usize> Sub for Dual<P> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        self.value -= other.value;
        for i in 0..P {
            self.partials[i] -= other.partials[i];
        }
        self
    }
}

impl<const P: usize> Mul for Dual<P> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let mut partials = [0.0; P];
        for (i, partial) in partials.iter_mut().enumerate() {
            *partial = self.partials[i] * other.value + other.partials[i] * self.value;
        }
        Self {
            value: self.value * other.value,
            partials,
        }
    }
}

impl<const P: usize> Div for Dual<P> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let mut partials = [0.0; P];
        for (i, partial) in partials.iter_mut().enumerate() {
            *partial = (self.partials[i] - other.partials[i] * value) / other.value;
        }
        Self { value, partials }
    }
}

impl<const P: usize> Neg for Dual<P> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const P: usize> Real for Dual<P> {
    const ZERO: Self = Self::constant(0.0);
    const ONE: Self = Self::constant(1.0);
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::constant(value)
    }
    #[inline(always)]
    fn from_count(count: u32) -> Self {
        Self::constant(f64::from(count))
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.value
    }
    #[inline]
    fn exp(self) -> Self {
        let value = Real::exp(self.value);
        self.chain(value, value)
    }
    #[inline]
    fn sin(self) -> Self {
        self.chain(Real::sin(self.value), Real::cos(self.value))
    }
    #[inline]
    fn cos(self) -> Self {
        self.chain(Real::cos(self.value), -Real::sin(self.value))
    }
    #[inline]
    fn sqrt(self) -> Self {
        let value = Real::sqrt(self.value);
        // At 0 the slope is infinite; 0 keeps a search from running away.
        self.chain(value, if value > 0.0 { 0.5 / value } else { 0.0 })
    }
    #[inline]
    fn cbrt(self) -> Self {
        let value = Real::cbrt(self.value);
        let slope = if value == 0.0 {
            0.0
        } else {
            1.0 / (3.0 * value * value)
        };
        self.chain(value, slope)
    }
    #[inline(always)]
    fn two_sum(self, term: Self) -> (Self, Self) {
        // Derivatives are not summed for ever: their rounding is left as it is.
        let (_, error) = self.value.two_sum(term.value);
        (self + term, Self::constant(error))
    }
    #[inline(always)]
    fn round(self) -> i32 {
        Real::round(self.value)
    }
    #[inline(always)]
    fn floor(self) -> i32 {
        Real::floor(self.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        fn f<T: Real>(x: T, y: T) -> T {
            let e = (-x * y).exp() + (x / y).sqrt() - (x * x).cbrt();
            (e.sin() * y - (x + y).cos()) / (T::ONE + x)
        }
        let (x, y, h) = (0.7, 1.3, 1e-6);
        let dual = f(Dual::<2>::parameter(x, 0), Dual::<2>::parameter(y, 1));
        assert_eq!(dual.value, f(x, y));
        let by_x = (f(x + h, y) - f(x - h, y)) / (2.0 * h);
        let by_y = (f(x, y + h) - f(x, y - h)) / (2.0 * h);
        assert_ne!(Dual::<2>::parameter(0.0, 1), Dual::ZERO);
        assert!((dual.partials[0] - by_x).abs() < 1e-8);
        assert!((dual.partials[1] - by_y).abs() < 1e-8);
    }
}
