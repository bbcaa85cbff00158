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

/// How the flow responds to jets between off and full strength, which valves,
/// plenums and vortices produce. On/off jets make no difference between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Grading {
    /// Eq. (3) with j for u: drive and rate both grow with the jet.
    #[default]
    Proportional,
    /// The equilibrium grows with the jet, and the rate at which the flow
    /// approaches it goes over from the separated to the attached flow's.
    Interpolated,
    /// The equilibrium grows with the jet; the rate is the separated flow's
    /// below half strength and the attached flow's above.
    Switched,
}

/// The jet strengths between which [`Grading::Switched`] goes over, as a slope
/// around one half: steep, but not a jump, so that a fit has a derivative.
const SWITCHING_SLOPE: f64 = 10.0;

impl Grading {
    /// The share of the attached flow's rate, 0–1 for jets of 0–1.
    #[inline]
    fn share<T: Real>(self, jet: T) -> T {
        match self {
            Self::Proportional | Self::Interpolated => jet,
            Self::Switched => {
                let half = T::from_f64(0.5);
                let share = half + (jet - half) * T::from_f64(SWITCHING_SLOPE);
                share.at_least(T::ZERO).at_most(T::ONE)
            }
        }
    }
}

/// A borrowed view of a bilinear model's structure and coefficients:
///
/// y_{k+1} = d + Σ_i a_i y_{k−τ_i} + Σ_l ( b_l + Σ_j c_jl y_{k−τ̄_j} ) j_l
///
/// with j_l the jet strength that arrives through input delay l (u_{k−h_l}
/// where nothing shapes the command). With another [`Grading`] than
/// proportional, j_l multiplies b_l·ρ/ρ_l and the products take its share,
/// ρ being [`relaxation`](Self::relaxation) and ρ_l that of input l at full
/// strength: the same for on/off jets.
#[derive(Clone, Copy, Debug)]
pub struct Bilinear<'a, T> {
    /// What the lags mean.
    pub convention: LagConvention,
    /// The response to jets of part strength.
    pub grading: Grading,
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
        if self.grading != Grading::Proportional {
            return self.graded(next, y, arriving);
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

    /// The inputs' part of [`next`](Self::next) where it is not proportional.
    fn graded(&self, free: T, y: &impl Past<T>, mut arriving: impl FnMut(usize) -> T) -> T {
        let rate = self.relaxation(&mut arriving);
        let mut next = free;
        for (l, b) in self.b.iter().enumerate() {
            let jet = arriving(l);
            if jet == T::ZERO {
                continue;
            }
            let mut gain = T::ZERO;
            let mut full = self.state_relaxation();
            for (c, lag) in self.column(l).zip(self.product_lags) {
                gain = gain + *c * y.back(self.convention.behind_newest(*lag));
                full = full - *c;
            }
            next = next + gain * self.grading.share(jet) + *b * jet * rate / full;
        }
        next
    }

    /// The rate, per sample, at which y approaches its equilibrium under
    /// constant jets: 1 − Σ a_i − Σ_l j_l Σ_j c_jl.
    #[inline]
    pub fn relaxation(&self, mut arriving: impl FnMut(usize) -> T) -> T {
        let mut rate = self.state_relaxation();
        for l in 0..self.b.len() {
            let share = self.grading.share(arriving(l));
            for c in self.column(l) {
                rate = rate - *c * share;
            }
        }
        rate
    }

    /// 1 − Σ a_i.
    fn state_relaxation(&self) -> T {
        self.a.iter().fold(T::ONE, |rate, a| rate - *a)
    }

    /// c_jl for input l.
    fn column(&self, l: usize) -> impl Iterator<Item = &T> {
        let lags = self.product_lags.len();
        self.c.iter().skip(l * lags).take(lags)
    }
}
