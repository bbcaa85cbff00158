//! Forward-mode derivatives: numbers that carry partial derivatives.
//!
//! Running `model-core` in [`Dual`] gives exact sensitivities of a free run from the same code that runs on the
//! board.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices are compiled into vector instructions wherever they are called from"
)]

use model_core::Real;
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A value and its derivatives with respect to `N` − 1 parameters, in `N` lanes of which the first holds the value.
/// Every operation does the same in all lanes, so it compiles to vector instructions if `N` is a multiple of 4.
///
/// Ordering compares the values only. Equality compares values and derivatives, so a zero that depends on a
/// parameter is not removed as a zero.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub struct Dual<const N: usize> {
    lanes: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// A number whose derivatives are 0.
    #[inline(always)]
    #[must_use]
    pub const fn constant(value: f64) -> Self {
        let mut lanes = [0.0; N];
        lanes[0] = value;
        Self { lanes }
    }

    /// The number with this derivative with respect to parameter `index`; unchanged if `index` + 1 ≥ `N`.
    #[must_use]
    pub fn with_slope(mut self, index: usize, slope: f64) -> Self {
        if let Some(lane) = self.lanes.get_mut(index + 1) {
            *lane = slope;
        }
        self
    }

    /// The `N` − 1 derivatives ∂value/∂parameter.
    #[inline(always)]
    #[must_use]
    pub fn partials(&self) -> &[f64] {
        &self.lanes[1..]
    }

    /// f(self), given f and f′ at the value.
    #[inline(always)]
    fn chain(self, value: f64, slope: f64) -> Self {
        let mut lanes = self.lanes;
        for lane in &mut lanes {
            *lane *= slope;
        }
        lanes[0] = value;
        Self { lanes }
    }

    /// Applies `f` in every lane to both operands and to `number`, which is 0 in the lane of the value.
    #[inline(always)]
    fn with(self, other: Self, number: f64, f: impl Fn(f64, f64, f64) -> f64) -> Self {
        let mut numbers = [number; N];
        numbers[0] = 0.0;
        let mut lanes = [0.0; N];
        for i in 0..N {
            lanes[i] = f(self.lanes[i], other.lanes[i], numbers[i]);
        }
        Self { lanes }
    }
}

impl<const N: usize> PartialEq for Dual<N> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        let mut equal = true;
        for i in 0..N {
            equal &= self.lanes[i] == other.lanes[i];
        }
        equal
    }
}

impl<const N: usize> PartialOrd for Dual<N> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.lanes[0].partial_cmp(&other.lanes[0])
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for i in 0..N {
            self.lanes[i] += other.lanes[i];
        }
        self
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for i in 0..N {
            self.lanes[i] -= other.lanes[i];
        }
        self
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let by = other.lanes[0];
        self.with(other, self.lanes[0], |own, other, number| {
            own * by + other * number
        })
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let by = other.lanes[0];
        let (value, inverse) = (self.lanes[0] / by, 1.0 / by);
        let mut quotient = self.with(other, value, |own, other, number| {
            (own - other * number) * inverse
        });
        quotient.lanes[0] = value;
        quotient
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        for lane in &mut self.lanes {
            *lane = -*lane;
        }
        self
    }
}

impl<const N: usize> Real for Dual<N> {
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
        self.lanes[0]
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = Real::exp(self.lanes[0]);
        self.chain(value, value)
    }
    #[inline(always)]
    fn sin(self) -> Self {
        self.chain(Real::sin(self.lanes[0]), Real::cos(self.lanes[0]))
    }
    #[inline(always)]
    fn cos(self) -> Self {
        self.chain(Real::cos(self.lanes[0]), -Real::sin(self.lanes[0]))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let value = Real::sqrt(self.lanes[0]);
        // At 0 the slope is infinite; a slope of 0 keeps a search from diverging.
        self.chain(value, if value > 0.0 { 0.5 / value } else { 0.0 })
    }
    #[inline(always)]
    fn cbrt(self) -> Self {
        let value = Real::cbrt(self.lanes[0]);
        let slope = if value == 0.0 {
            0.0
        } else {
            1.0 / (3.0 * value * value)
        };
        self.chain(value, slope)
    }
    #[inline(always)]
    fn two_sum(self, term: Self) -> (Self, Self) {
        // Derivatives are not summed over long times, so the rounding errors of derivatives are not
        // compensated.
        let (_, error) = self.lanes[0].two_sum(term.lanes[0]);
        (self + term, Self::constant(error))
    }
    #[inline(always)]
    fn round(self) -> i32 {
        Real::round(self.lanes[0])
    }
    #[inline(always)]
    fn floor(self) -> i32 {
        Real::floor(self.lanes[0])
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
        let parameter = |value, index| Dual::<4>::constant(value).with_slope(index, 1.0);
        let dual = f(parameter(x, 0), parameter(y, 1));
        assert_eq!(dual.value(), f(x, y));
        let by_x = (f(x + h, y) - f(x - h, y)) / (2.0 * h);
        let by_y = (f(x, y + h) - f(x, y - h)) / (2.0 * h);
        assert_ne!(parameter(0.0, 1), Dual::ZERO);
        assert!((dual.partials()[0] - by_x).abs() < 1e-8);
        assert!((dual.partials()[1] - by_y).abs() < 1e-8);
    }
}
