//! The bilinear recursion, eqs. (3), (4), (14) and (15).

use crate::history::Past;
use crate::real::Real;

/// What a printed lag τ means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum LagConvention {
    /// As printed in eq. (3): τ is y_{k−τ}.
    Literal,
    /// As a regression of y_{k+1} on its own past: τ is y_{k+1−τ}, so τ = 1 is y_k.
    #[default]
    OneStep,
}

impl LagConvention {
    /// How far behind the newest sample y_k the lag `tau` reads.
    #[inline]
    #[must_use]
    pub const fn behind_newest(self, tau: u16) -> usize {
        match self {
            Self::Literal => tau as usize,
            Self::OneStep => (tau as usize).saturating_sub(1),
        }
    }
}

/// A borrowed view of a bilinear model's structure and coefficients:
///
/// y_{k+1} = d + Σ_i a_i y_{k−τ_i} + Σ_l ( b_l + Σ_j c_jl y_{k−τ̄_j} ) j_l
///
/// with j_l the jet strength that arrives through input delay l (u_{k−h_l}
/// where nothing shapes the command).
#[derive(Clone, Copy, Debug)]
pub struct Bilinear<'a, T> {
    /// What the lags mean.
    pub convention: LagConvention,
    /// d: what drives the flow without jets; 0 in the paper.
    pub constant: T,
    /// τ_i, samples, length N1.
    pub state_lags: &'a [u16],
    /// a_i, length N1.
    pub a: &'a [T],
    /// τ̄_j, samples, length N2.
    pub product_lags: &'a [u16],
    /// b_l, length N3.
    pub b: &'a [T],
    /// c_jl, N2 × N3, column-major: the N2 coefficients of input 1 first.
    pub c: &'a [T],
}

impl<T: Real> Bilinear<'_, T> {
    /// y_{k+1}; `y` reads y_k at lag 0 and `arriving(l)` is j_l.
    ///
    /// The terms are added in the order in which they are written in eq. (3).
    #[inline]
    pub fn next(&self, y: &impl Past<T>, mut arriving: impl FnMut(usize) -> T) -> T {
        let mut next = self.constant;
        for (a, lag) in self.a.iter().zip(self.state_lags) {
            next = next + *a * y.back(self.convention.behind_newest(*lag));
        }
        let mut c = self.c;
        for (l, b) in self.b.iter().enumerate() {
            let (column, rest) = c
                .split_at_checked(self.product_lags.len())
                .unwrap_or((c, &[]));
            c = rest;
            let jet = arriving(l);
            // An exact zero, value and derivatives, adds nothing.
            if jet == T::ZERO {
                continue;
            }
            let mut gain = *b;
            for (c, lag) in column.iter().zip(self.product_lags) {
                gain = gain + *c * y.back(self.convention.behind_newest(*lag));
            }
            next = next + gain * jet;
        }
        next
    }

    /// The rate, per sample, at which y approaches its equilibrium under
    /// constant jets: 1 − Σ a_i − Σ_l j_l Σ_j c_jl.
    #[inline]
    pub fn relaxation(&self, mut arriving: impl FnMut(usize) -> T) -> T {
        let mut rate = T::ONE;
        for a in self.a {
            rate = rate - *a;
        }
        let lags = self.product_lags.len();
        for l in 0..self.b.len() {
            let jet = arriving(l);
            for c in self.c.iter().skip(l * lags).take(lags) {
                rate = rate - *c * jet;
            }
        }
        rate
    }
}
