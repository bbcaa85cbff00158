//! The transport delay between jets and sensor: it selects the past jet strength that acts on the flow now.

use crate::history::Past;
use crate::real::Real;

/// Position in the jet history: `whole` samples back, or between that sample and the next older one if
/// `fraction` (0–1) is not 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tap<T> {
    /// Whole samples of delay.
    pub whole: usize,
    /// Weight of the next older sample, 0–1.
    pub fraction: T,
}

impl<T: Real> Tap<T> {
    /// A tap on a whole sample.
    #[inline(always)]
    #[must_use]
    pub fn on(whole: usize) -> Self {
        Self {
            whole,
            fraction: T::ZERO,
        }
    }

    /// A tap at any delay ≥ 0 (negative or NaN counts as 0), in samples.
    #[inline(always)]
    #[must_use]
    pub fn between(delay: T) -> Self {
        let delay = delay.at_least(T::ZERO);
        let whole = delay.floor().max(0);
        Self {
            whole: whole as usize,
            fraction: delay - T::from_count(whole as u32),
        }
    }

    /// A tap at any delay (negative or NaN counts as 0), in samples: on the
    /// nearest sample if `rounded`, as in eq. (4), else between samples.
    #[inline(always)]
    #[must_use]
    pub fn at(delay: T, rounded: bool) -> Self {
        if rounded {
            Self::on(delay.round().max(0) as usize)
        } else {
            Self::between(delay)
        }
    }

    /// The signal at the tap, linearly interpolated.
    #[inline(always)]
    pub fn read(&self, past: &impl Past<T>) -> T {
        let newer = past.back(self.whole);
        let older = past.back(self.whole.saturating_add(1));
        newer + self.fraction * (older - newer)
    }
}

/// A law of the transport from the jets to the flow; each law is defined in a file of [`effects`](crate::effects).
///
/// It gives the delay of one input; the delays of a model's inputs are multiples of it, see [`ScaledDelay`].
pub trait Transport<T: Real> {
    /// State of the law: its memory of the command.
    type State: Clone;

    /// The state before the first sample.
    fn start(&self) -> Self::State;

    /// The command for the valve; a law may delay edges here.
    #[inline(always)]
    fn command(&self, _state: &mut Self::State, command: T) -> T {
        command
    }

    /// The delay at the averaged output ỹ_k ≥ 0 (or y_k for an averaged model),
    /// samples; below 0 counts as 0.
    fn delay(&self, output: T) -> T;

    /// The shortest and the longest of these delays over all outputs ≥ 0, if the law has such bounds.
    fn bounds(&self) -> Option<[T; 2]>;

    /// Number of samples by which [`command`](Self::command) delays rising and falling edges. A pulse or gap
    /// shorter than that never arrives.
    #[inline(always)]
    fn held_back(&self) -> [T; 2] {
        [T::ZERO; 2]
    }
}

/// The input delays h_l of eqs. (3) and (4), as a model reads them.
pub trait DelayLaw<T: Real> {
    /// State of the law: its memory of the command.
    type State: Clone;
    /// Whether taps can fall between samples.
    const INTERPOLATES: bool = false;

    /// The state before the first sample.
    fn start(&self) -> Self::State;

    /// The command for the valve; a law may delay edges here.
    #[inline(always)]
    fn command(&self, _state: &mut Self::State, command: T) -> T {
        command
    }

    /// The common part of the law for all inputs, evaluated once per sample at the averaged output ỹ_k, or
    /// y_k for an averaged model.
    #[inline(always)]
    fn evaluate(&self, _output: T) -> T {
        T::ZERO
    }

    /// The nearest and farthest sample that taps of input `l` can read for outputs ≥ 0, if known.
    #[inline(always)]
    fn range(&self, _l: usize) -> Option<(usize, usize)> {
        None
    }

    /// The tap of input `l`, from the result of [`evaluate`](Self::evaluate).
    fn tap(&self, l: usize, evaluated: T) -> Tap<T>;
}

/// Constant delays h_l in samples, eq. (3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FixedDelay<H> {
    /// h_l, samples.
    pub delays: H,
}

impl<T: Real, H: AsRef<[u16]>> DelayLaw<T> for FixedDelay<H> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn tap(&self, l: usize, _evaluated: T) -> Tap<T> {
        Tap::on(self.delays.as_ref().get(l).copied().unwrap_or(0).into())
    }
}

/// Delays h_l = f_l · h with the delay h of a law, rounded to whole samples as in eq. (4) if `ROUNDED`, otherwise
/// with the input interpolated between samples.
///
/// Rounding moves every edge by up to half a sample. In a flow with an oscillation at 20 Hz this causes an error of
/// several per cent of the oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaledDelay<L, F, const ROUNDED: bool> {
    /// h.
    pub law: L,
    /// f_l, one factor for each input.
    pub factors: F,
}

impl<T: Real, L: Transport<T>, F: AsRef<[T]>, const ROUNDED: bool> DelayLaw<T>
    for ScaledDelay<L, F, ROUNDED>
{
    type State = L::State;
    const INTERPOLATES: bool = !ROUNDED;

    fn start(&self) -> L::State {
        self.law.start()
    }
    #[inline(always)]
    fn command(&self, state: &mut L::State, command: T) -> T {
        self.law.command(state, command)
    }
    #[inline(always)]
    fn evaluate(&self, output: T) -> T {
        self.law.delay(output)
    }
    /// A law stays within its bounds, and all further operations are monotonic, including rounding. The taps of the
    /// bounds are therefore the extremes.
    #[inline(always)]
    fn range(&self, l: usize) -> Option<(usize, usize)> {
        if !ROUNDED {
            return None;
        }
        let [low, high] = self.law.bounds()?;
        let (low, high) = (self.tap(l, low).whole, self.tap(l, high).whole);
        Some((low.min(high), low.max(high)))
    }
    #[inline(always)]
    fn tap(&self, l: usize, evaluated: T) -> Tap<T> {
        let factor = self.factors.as_ref().get(l).copied().unwrap_or(T::ONE);
        Tap::at(factor * evaluated, ROUNDED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::StateDependentDelay;

    fn papers<T: Real>(rise: f64) -> StateDependentDelay<T> {
        StateDependentDelay {
            floor: T::from_f64(47.35),
            rise: T::from_f64(rise),
            rate: T::from_f64(20.18),
        }
    }

    #[test]
    fn without_rounding_it_taps_between_samples() {
        let law = ScaledDelay::<_, [f64; 2], false> {
            law: StateDependentDelay {
                floor: 30.25,
                rise: 0.0,
                rate: 1.0,
            },
            factors: [1.0, 2.0],
        };
        let evaluated = law.evaluate(0.3);
        let (first, second) = (law.tap(0, evaluated), law.tap(1, evaluated));
        assert_eq!((first.whole, first.fraction), (30, 0.25));
        assert_eq!((second.whole, second.fraction), (60, 0.5));
        assert_eq!(law.range(0), None);
    }

    #[test]
    fn the_range_of_a_rounded_law_holds_all_its_taps_and_no_more() {
        for (rise, factor) in [(12.69, 1.0), (-12.69, 1.0), (12.69, 0.37), (12.69, 3.1)] {
            let law = ScaledDelay::<_, [f32; 1], true> {
                law: papers::<f32>(rise),
                factors: [factor],
            };
            let (low, high) = law.range(0).unwrap();
            let mut met = (usize::MAX, 0);
            for bits in (0..0x4080_0000_u32).step_by(10_007) {
                let tap = law.tap(0, law.evaluate(f32::from_bits(bits))).whole;
                met = (met.0.min(tap), met.1.max(tap));
            }
            assert_eq!(met, (low, high));
        }
    }

    #[test]
    fn the_papers_laws_at_their_ends() {
        let law = ScaledDelay::<_, [f32; 1], true> {
            law: papers::<f32>(12.69),
            factors: [1.0],
        };
        assert_eq!(law.tap(0, law.evaluate(0.0)).whole, 60);
        assert_eq!(law.tap(0, law.evaluate(1.0)).whole, 47);
        let two = ScaledDelay::<_, [f32; 2], true> {
            law: papers::<f32>(12.69),
            factors: [1.5513, 106.756],
        };
        assert_eq!(two.tap(1, two.evaluate(0.0)).whole, 6410);
        assert_eq!(two.tap(1, two.evaluate(1.0)).whole, 5055);
    }
}
