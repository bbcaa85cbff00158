//! The bilinear recursion, eqs. (3), (4), (14) and (15).

use crate::history::Past;
use crate::pairs::pairs;
use crate::real::Real;

/// Meaning of a printed lag τ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum LagConvention {
    /// As printed in eq. (3): τ is y_{k−τ}.
    Literal,
    /// As a regression of y_{k+1} on its own past: τ is y_{k+1−τ}, so τ = 1 is y_k.
    #[default]
    OneStep,
}

impl LagConvention {
    /// Number of samples between the newest sample y_k and the sample that the lag `tau` reads.
    #[inline]
    #[must_use]
    pub const fn behind_newest(self, tau: u16) -> usize {
        match self {
            Self::Literal => tau as usize,
            Self::OneStep => (tau as usize).saturating_sub(1),
        }
    }
}

/// Response of the flow to jets between off and full strength, as produced by valves, plenums and vortices.
/// For on/off jets all gradings are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Grading {
    /// Eq. (3) with j instead of u: drive and rate are both proportional to the jet.
    #[default]
    Proportional,
    /// The equilibrium is proportional to the jet; the rate is interpolated between the separated and the
    /// attached flow's.
    Interpolated,
    /// The equilibrium is proportional to the jet; the rate is the separated flow's below half strength and
    /// the attached flow's above.
    Switched,
}

/// Slope of the transition of [`Grading::Switched`] around one half: steep but finite, so that a fit has a
/// derivative.
const SWITCHING_SLOPE: f64 = 50.0;

/// Lags below this, in samples, belong to the model order; longer ones are memories.
pub const SHORTEST_MEMORY: usize = 20;

impl Grading {
    /// Every response.
    pub const ALL: [Self; 3] = [Self::Proportional, Self::Interpolated, Self::Switched];

    /// The weight of the attached flow's rate, 0–1 for jets of 0–1.
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
/// with j_l the jet strength that arrives through input delay l (u_{k−h_l} if no effect shapes the command).
/// For one input, jets of part strength and a [`Grading`] other than proportional, the flow relaxes with a
/// rate between the separated and the attached flow's towards a level that lies between their levels in
/// proportion to the jet; terms with lags of [`SHORTEST_MEMORY`] and more are part of the level. On/off jets
/// give the same result.
#[derive(Clone, Copy, Debug)]
pub struct Bilinear<'a, T> {
    /// Meaning of the lags.
    pub convention: LagConvention,
    /// The response to jets of part strength.
    pub grading: Grading,
    /// d: constant drive of the flow without jets; 0 in the paper.
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
    /// Cached result of [`pace`](Self::pace); `None` is valid, and slower.
    pub pace: Option<&'a Pace<T>>,
}

/// Relaxation rates of the flow towards its present level, which includes its memories.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace<T> {
    /// Lags below this, in samples, belong to the model order.
    pub order: usize,
    /// The separated flow's rate, per sample: 1 − Σ a_i of those lags.
    pub off: T,
    /// The attached flow's rate under the first input's jet: the separated flow's minus Σ c_j1 of those lags.
    pub on: T,
}

impl<T: Real> Pace<T> {
    /// The rate, per sample, for this weight `share` of the attached flow's rate.
    #[inline(always)]
    fn at(&self, share: T) -> T {
        self.off + (self.on - self.off) * share
    }
}

/// Precomputed partial sums of [`Bilinear::next`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known<T> {
    /// Sum of the terms a_i y_{k−τ_i}.
    pub free: T,
    /// Sum of the terms c_j1 y_{k−τ̄_j} of the first input.
    pub gain: T,
}

impl<T: Real> Known<T> {
    /// No precomputed terms.
    pub const NOTHING: Self = Self {
        free: T::ZERO,
        gain: T::ZERO,
    };
}

impl<T: Real> Bilinear<'_, T> {
    /// The terms with lags of at least `horizon` samples, `ahead` samples from now (less than `horizon`,
    /// which is at least [`SHORTEST_MEMORY`]): they read only the past.
    #[inline(always)]
    pub fn known(&self, y: &impl Past<T>, horizon: usize, ahead: usize) -> Known<T> {
        let mut known = Known::NOTHING;
        for (a, lag) in pairs(self.a, self.state_lags) {
            let lag = self.convention.behind_newest(*lag);
            if lag >= horizon {
                known.free = known.free + *a * y.back(lag - ahead);
            }
        }
        for (c, lag) in pairs(self.column(0), self.product_lags) {
            let lag = self.convention.behind_newest(*lag);
            if lag >= horizon {
                known.gain = known.gain + *c * y.back(lag - ahead);
            }
        }
        known
    }

    /// y_{k+1}; `y` reads y_k at lag 0 and `arriving(l)` is j_l.
    ///
    /// The terms are added in the order of eq. (3).
    #[inline(always)]
    pub fn next(&self, y: &impl Past<T>, arriving: impl FnMut(usize) -> T) -> T {
        self.next_from(&Known::NOTHING, usize::MAX, y, arriving)
    }

    /// [`next`](Self::next) with the terms of lags ≥ `horizon` precomputed in `known`; they are added first.
    #[inline(always)]
    pub fn next_from(
        &self,
        known: &Known<T>,
        horizon: usize,
        y: &impl Past<T>,
        mut arriving: impl FnMut(usize) -> T,
    ) -> T {
        if self.grading != Grading::Proportional
            && let [drive] = self.b
        {
            return self.graded(*drive, known, horizon, y, arriving(0));
        }
        let start = self.constant + known.free;
        let mut next = self.added(start, self.a, self.state_lags, horizon, y);
        for l in 0..self.b.len() {
            let jet = arriving(l);
            // Skipped only if value and derivatives are exactly zero.
            if jet == T::ZERO {
                continue;
            }
            let drive = self.b.get(l).copied().unwrap_or(T::ZERO);
            let gain = self.products(l, drive, known, horizon, y);
            next = next + gain * jet;
        }
        next
    }

    /// `start` + Σ_j c_jl y_{k−τ̄_j}.
    #[inline(always)]
    fn products(
        &self,
        l: usize,
        start: T,
        known: &Known<T>,
        horizon: usize,
        y: &impl Past<T>,
    ) -> T {
        // Only the first input has precomputed sums.
        let (start, horizon) = if l == 0 {
            (start + known.gain, horizon)
        } else {
            (start, usize::MAX)
        };
        self.added(start, self.column(l), self.product_lags, horizon, y)
    }

    /// `start` + Σ_i x_i y_{k−τ_i} over the lags below `horizon`, in order.
    #[inline(always)]
    fn added(
        &self,
        start: T,
        mut x: &[T],
        mut lags: &[u16],
        horizon: usize,
        y: &impl Past<T>,
    ) -> T {
        let mut sum = start;
        // Slices without their first items cost less than two iterators, whose ends would be compared in every
        // iteration.
        while let ([first, x_after @ ..], [lag, lags_after @ ..]) = (x, lags) {
            let lag = self.convention.behind_newest(*lag);
            if lag < horizon {
                sum = sum + *first * y.back(lag);
            }
            (x, lags) = (x_after, lags_after);
        }
        sum
    }

    /// [`next`](Self::next) for one input and a grading other than proportional.
    fn graded(&self, drive: T, known: &Known<T>, horizon: usize, y: &impl Past<T>, jet: T) -> T {
        let pace = self.pace();
        let limit = pace.order;
        let share = self.grading.share(jet);
        // Precomputed terms belong to the past.
        let (mut free, mut past) = (self.constant, known.free);
        for (a, lag) in pairs(self.a, self.state_lags) {
            let lag = self.convention.behind_newest(*lag);
            let sum = if lag < limit { &mut free } else { &mut past };
            if lag < horizon {
                *sum = *sum + *a * y.back(lag);
            }
        }
        let (mut gain, mut past_gain) = (T::ZERO, known.gain);
        for (c, lag) in pairs(self.column(0), self.product_lags) {
            let lag = self.convention.behind_newest(*lag);
            let sum = if lag < limit {
                &mut gain
            } else {
                &mut past_gain
            };
            if lag < horizon {
                *sum = *sum + *c * y.back(lag);
            }
        }
        if jet == T::ZERO {
            return free + past;
        }
        if limit == usize::MAX {
            // All lags belong to the model order, the precomputed ones too.
            (free, gain) = (free + past, gain + past_gain);
            (past, past_gain) = (T::ZERO, T::ZERO);
        }
        let separated = if past == T::ZERO {
            T::ZERO
        } else {
            (T::ONE - jet) * past / pace.off
        };
        let attached = jet * (drive + past + past_gain) / pace.on;
        free + gain * share + pace.at(share) * (separated + attached)
    }

    /// Relaxation rates from the lags below [`SHORTEST_MEMORY`], or from all lags if the short ones alone
    /// give no positive rate.
    #[inline(always)]
    #[must_use]
    pub fn pace(&self) -> Pace<T> {
        if let Some(pace) = self.pace {
            return *pace;
        }
        let short = self.rates(SHORTEST_MEMORY);
        if short.off > T::ZERO && short.on > T::ZERO {
            short
        } else {
            self.rates(usize::MAX)
        }
    }

    /// The rates from lags below `order`.
    #[inline(always)]
    fn rates(&self, order: usize) -> Pace<T> {
        let sum = |start: T, coefficients: &[T], lags: &[u16]| {
            let mut all = coefficients.iter().zip(lags);
            all.by_ref().fold(start, |rate, (x, lag)| {
                let counts = self.convention.behind_newest(*lag) < order;
                if counts { rate - *x } else { rate }
            })
        };
        let off = sum(T::ONE, self.a, self.state_lags);
        let on = sum(off, self.column(0), self.product_lags);
        Pace { order, off, on }
    }

    /// The relaxation rate per sample towards the present level (memories included) under the first input's
    /// jet.
    #[inline(always)]
    pub(crate) fn rate(&self, jet: T) -> T {
        self.pace().at(self.grading.share(jet))
    }

    /// The rate, per sample, at which y approaches its equilibrium under
    /// constant jets: 1 − Σ a_i − Σ_l j_l Σ_j c_jl.
    #[inline(always)]
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

    /// The separated flow's share of [`rate`](Self::rate) under the first input's jet.
    #[inline(always)]
    pub(crate) fn separated(&self, jet: T, rate: T) -> T {
        let share = self.grading.share(jet);
        // For on/off jets, and for a rate of 0, by which nothing can be divided.
        if share == T::ZERO || share == T::ONE || rate == T::ZERO {
            return T::ONE - share;
        }
        (T::ONE - share) * self.pace().off / rate
    }

    /// The separated flow's part of the motion s_{k+1} − s_k, with its share `separated` of the rate. With
    /// proportional grading both flows contribute in parallel, and `free` is the motion without jets.
    #[inline(always)]
    pub(crate) fn released(&self, motion: T, separated: T, jet: T, free: &impl Fn() -> T) -> T {
        let part = jet != T::ZERO && jet != T::ONE;
        if part && self.grading == Grading::Proportional {
            (T::ONE - jet) * free()
        } else {
            separated * motion
        }
    }

    /// 1 − Σ a_i.
    fn state_relaxation(&self) -> T {
        self.a.iter().fold(T::ONE, |rate, a| rate - *a)
    }

    /// c_jl for input l.
    #[inline]
    fn column(&self, l: usize) -> &[T] {
        let lags = self.product_lags.len();
        self.c.get(l * lags..(l + 1) * lags).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::{DelayLine, Memory};

    /// A flow at 0.3 with rate 0.02 per sample when separated, and 0.05 towards 0.8 when attached.
    fn motion(grading: Grading, jet: f64) -> [f64; 2] {
        let flow = Bilinear {
            convention: LagConvention::OneStep,
            grading,
            constant: 0.0,
            state_lags: &[1],
            a: &[0.98],
            product_lags: &[1],
            b: &[0.04],
            c: &[-0.03],
            pace: None,
        };
        let mut y = DelayLine::<f64, 2>::new();
        y.push(0.3);
        let motion = flow.next(&y, |_| jet) - 0.3;
        let separated = flow.separated(jet, flow.rate(jet));
        let free = || flow.next(&y, |_| 0.0) - 0.3;
        [motion, flow.released(motion, separated, jet, &free)]
    }

    #[test]
    fn a_motion_is_shared_out_between_the_separated_and_the_attached_flow() {
        for grading in Grading::ALL {
            let [motion, released] = self::motion(grading, 0.0);
            assert!((motion + 0.02 * 0.3).abs() < 1e-12 && released == motion);
            let [motion, released] = self::motion(grading, 1.0);
            assert!((motion - 0.05 * (0.8 - 0.3)).abs() < 1e-12 && released == 0.0);
        }
        // The model is two parallel flows, each with its part of the jet.
        let [_, released] = self::motion(Grading::Proportional, 0.4);
        assert!((released + 0.6 * 0.02 * 0.3).abs() < 1e-12);
        // The model is one flow with an intermediate rate, 0.6 × 0.02 + 0.4 × 0.05.
        let [motion, released] = self::motion(Grading::Interpolated, 0.4);
        assert!((released - motion * 0.012 / 0.032).abs() < 1e-12);
        // Either flow.
        let [motion, released] = self::motion(Grading::Switched, 0.4);
        assert!(motion > 0.0 && released == motion);
    }

    #[test]
    fn under_part_of_a_jet_the_level_with_its_memory_is_in_proportion() {
        let (now, past) = (0.3, 0.7);
        for (grading, rate) in [(Grading::Switched, 0.02), (Grading::Interpolated, 0.032)] {
            let flow = Bilinear {
                convention: LagConvention::OneStep,
                grading,
                constant: 0.0,
                state_lags: &[1, 30],
                a: &[0.98, 0.004],
                product_lags: &[30, 1],
                b: &[0.04],
                c: &[-0.01, -0.03],
                pace: None,
            };
            let mut y = DelayLine::<f64, 40>::new();
            y.push(past);
            (0..29).for_each(|_| y.push(now));
            let off = 0.004 * past / 0.02;
            let on = (0.04 + (0.004 - 0.01) * past) / 0.05;
            let level = |jet: f64| off + (on - off) * jet;
            let next = |jet: f64| flow.next(&y, |_| jet);
            assert!((flow.rate(0.4) - rate).abs() < 1e-12);
            assert!((next(0.4) - now - rate * (level(0.4) - now)).abs() < 1e-12);
            // On/off jets give eq. (3).
            assert!((next(0.0) - now - 0.02 * (level(0.0) - now)).abs() < 1e-12);
            assert!((next(1.0) - now - 0.05 * (level(1.0) - now)).abs() < 1e-12);
            // Precomputed terms give the same sum.
            let known = flow.known(&y, SHORTEST_MEMORY, 0);
            let again = flow.next_from(&known, SHORTEST_MEMORY, &y, |_| 0.4);
            assert!((again - next(0.4)).abs() < 1e-12);
        }
    }
}
