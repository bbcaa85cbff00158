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
const SWITCHING_SLOPE: f64 = 50.0;

/// A lag below this, in samples, is of the order of the flow; from it on it is a memory.
pub const SHORTEST_MEMORY: usize = 20;

impl Grading {
    /// Every response.
    pub const ALL: [Self; 3] = [Self::Proportional, Self::Interpolated, Self::Switched];

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
/// where nothing shapes the command). With another [`Grading`] than proportional, one
/// input and jets of part strength, the flow goes at a rate between the separated flow's and the
/// attached one's to a level in proportion between theirs; what terms of
/// [`SHORTEST_MEMORY`] and more add is part of the level. For on/off jets it is the same.
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
    /// What [`pace`](Self::pace) makes of the rest, where that was asked before; `None` is right, and slower.
    pub pace: Option<&'a Pace<T>>,
}

/// How fast a flow goes to the level of the moment, which holds what the flow remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace<T> {
    /// Lags below this, in samples, are those of the flow's order.
    pub order: usize,
    /// The separated flow's rate, per sample: 1 − Σ a_i of those lags.
    pub off: T,
    /// The attached flow's under the first input's jet: that − Σ c_j1 of those lags.
    pub on: T,
}

impl<T: Real> Pace<T> {
    /// The rate, per sample, under a jet that has this `share` of the attached flow's.
    #[inline(always)]
    fn at(&self, share: T) -> T {
        self.off + (self.on - self.off) * share
    }
}

/// Sums over terms of [`Bilinear::next`] that are known before the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known<T> {
    /// Of the a_i y_{k−τ_i}.
    pub free: T,
    /// Of the c_j1 y_{k−τ̄_j}, the first input's.
    pub gain: T,
}

impl<T: Real> Known<T> {
    /// No term is known.
    pub const NOTHING: Self = Self {
        free: T::ZERO,
        gain: T::ZERO,
    };
}

impl<T: Real> Bilinear<'_, T> {
    /// The terms with lags of `horizon` samples and more, `ahead` samples from
    /// now (less than `horizon`, which is no less than [`SHORTEST_MEMORY`]): they read
    /// what has happened already.
    #[inline(always)]
    pub fn known(&self, y: &impl Past<T>, horizon: usize, ahead: usize) -> Known<T> {
        let mut known = Known::NOTHING;
        for (a, lag) in self.a.iter().zip(self.state_lags) {
            let lag = self.convention.behind_newest(*lag);
            if lag >= horizon {
                known.free = known.free + *a * y.back(lag - ahead);
            }
        }
        for (c, lag) in self.column(0).iter().zip(self.product_lags) {
            let lag = self.convention.behind_newest(*lag);
            if lag >= horizon {
                known.gain = known.gain + *c * y.back(lag - ahead);
            }
        }
        known
    }

    /// y_{k+1}; `y` reads y_k at lag 0 and `arriving(l)` is j_l.
    ///
    /// The terms are added in the order in which they are written in eq. (3).
    #[inline(always)]
    pub fn next(&self, y: &impl Past<T>, arriving: impl FnMut(usize) -> T) -> T {
        self.next_from(&Known::NOTHING, usize::MAX, y, arriving)
    }

    /// [`next`](Self::next) where the terms with lags of `horizon` samples and more
    /// are `known`; they are added first.
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
        let mut next = self.constant + known.free;
        for (a, lag) in self.a.iter().zip(self.state_lags) {
            let lag = self.convention.behind_newest(*lag);
            if lag < horizon {
                next = next + *a * y.back(lag);
            }
        }
        for l in 0..self.b.len() {
            let jet = arriving(l);
            // An exact zero, value and derivatives, adds nothing.
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
        // Only the first input's sums are known.
        let (mut gain, horizon) = if l == 0 {
            (start + known.gain, horizon)
        } else {
            (start, usize::MAX)
        };
        for (c, lag) in self.column(l).iter().zip(self.product_lags) {
            let lag = self.convention.behind_newest(*lag);
            if lag < horizon {
                gain = gain + *c * y.back(lag);
            }
        }
        gain
    }

    /// [`next`](Self::next) of a flow with one input and another grading than proportional.
    fn graded(&self, drive: T, known: &Known<T>, horizon: usize, y: &impl Past<T>, jet: T) -> T {
        let pace = self.pace();
        let limit = pace.order;
        let share = self.grading.share(jet);
        // What is known is of the past.
        let (mut free, mut past) = (self.constant, known.free);
        for (a, lag) in self.a.iter().zip(self.state_lags) {
            let lag = self.convention.behind_newest(*lag);
            let sum = if lag < limit { &mut free } else { &mut past };
            if lag < horizon {
                *sum = *sum + *a * y.back(lag);
            }
        }
        let (mut gain, mut past_gain) = (T::ZERO, known.gain);
        for (c, lag) in self.column(0).iter().zip(self.product_lags) {
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
            // All is of the flow's order, the past that is known too.
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

    /// How fast the flow goes to its level: with the lags below [`SHORTEST_MEMORY`], or with all of them where the
    /// short ones alone would not let it go to any.
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

    /// The pace with the lags below `order`.
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

    /// The rate, per sample, at which y goes to the level of the moment, which holds what the flow remembers, under
    /// the first input's jet.
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
        // On/off jets, and rates that cannot be shared out.
        if share == T::ZERO || share == T::ONE || rate == T::ZERO {
            return T::ONE - share;
        }
        (T::ONE - share) * self.pace().off / rate
    }

    /// Of a motion, s_{k+1} − s_k, what the separated flow makes, its share of the rate being `separated`:
    /// where jets act in proportion, the two flows move side by side, and `free` is how it moves without jets.
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

    /// A flow at 0.3 that separates at 0.02 a sample and attaches at 0.05 towards 0.8.
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
        // Side by side, each for its part of the jet.
        let [_, released] = self::motion(Grading::Proportional, 0.4);
        assert!((released + 0.6 * 0.02 * 0.3).abs() < 1e-12);
        // One flow of a rate between: 0.6 of 0.02 beside 0.4 of 0.05.
        let [motion, released] = self::motion(Grading::Interpolated, 0.4);
        assert!((released - motion * 0.012 / 0.032).abs() < 1e-12);
        // One flow or the other.
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
            // On/off jets meet eq. (3).
            assert!((next(0.0) - now - 0.02 * (level(0.0) - now)).abs() < 1e-12);
            assert!((next(1.0) - now - 0.05 * (level(1.0) - now)).abs() < 1e-12);
            // What is known before is added as if it were summed.
            let known = flow.known(&y, SHORTEST_MEMORY, 0);
            let again = flow.next_from(&known, SHORTEST_MEMORY, &y, |_| 0.4);
            assert!((again - next(0.4)).abs() < 1e-12);
        }
    }
}
