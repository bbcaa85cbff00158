//! Memories of the model: fixed ring buffers for outputs and jet strength, one bit per sample for an on/off
//! command.

use crate::real::Real;

/// Reads the past of a signal.
pub trait Past<T> {
    /// The value `lag` samples before the newest one; 0 before the first sample (the paper's y_j = 0 for j < 0) or
    /// beyond the buffer.
    fn back(&self, lag: usize) -> T;
}

/// A past to which samples are appended.
pub trait Memory<T>: Past<T> + Clone {
    /// Appends the newest sample.
    fn push(&mut self, value: T);
    /// The common value of all samples from lag `from` to lag `to`, if their equality can be checked cheaply.
    #[inline]
    fn steady(&self, _from: usize, _to: usize) -> Option<T> {
        None
    }
    /// Number of stored samples: `back` reaches lags below this.
    fn capacity(&self) -> usize;
    /// Mean of `window` samples, the newest of them `lag` back: eq. (13) for a delayed input. By default it costs
    /// `window` reads.
    fn mean_back(&self, lag: usize, window: u32) -> T
    where
        T: Real,
    {
        let mut sum = T::ZERO;
        for i in 0..window as usize {
            sum = sum + self.back(lag.saturating_add(i));
        }
        sum / T::from_count(window.max(1))
    }
}

/// A memory whose length is chosen at creation or fixed by its type.
pub trait Reaching<T>: Memory<T> {
    /// A memory at rest that reaches back `lag` samples, or as far as its type permits.
    fn reaching(lag: usize) -> Self;
}

/// Ring buffer of the last `LEN` samples.
///
/// Every sample is stored twice, `LEN` apart, so that the past is contiguous behind the newest sample and a
/// constant lag is a constant offset: the twenty lags of a step need no index wrapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelayLine<T, const LEN: usize> {
    samples: [[T; LEN]; 2],
    newest: usize,
}

impl<T: Real, const LEN: usize> DelayLine<T, LEN> {
    /// A line at rest: all samples 0.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(LEN > 0, "a delay line holds at least one sample") };
        Self {
            samples: [[T::ZERO; LEN]; 2],
            newest: 0,
        }
    }
}

impl<T: Real, const LEN: usize> Default for DelayLine<T, LEN> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const LEN: usize> Past<T> for DelayLine<T, LEN> {
    #[inline]
    fn back(&self, lag: usize) -> T {
        if lag >= LEN {
            return T::ZERO;
        }
        // `newest` is below LEN; the redundant limit lets the compiler drop the bounds check.
        let index = self.newest.min(LEN - 1) + LEN - lag;
        let samples = self.samples.as_flattened();
        samples.get(index).copied().unwrap_or(T::ZERO)
    }
}

impl<T: Real, const LEN: usize> Reaching<T> for DelayLine<T, LEN> {
    fn reaching(_lag: usize) -> Self {
        Self::new()
    }
}

impl<T: Real, const LEN: usize> Memory<T> for DelayLine<T, LEN> {
    #[inline]
    fn push(&mut self, value: T) {
        self.newest = if self.newest + 1 < LEN {
            self.newest + 1
        } else {
            0
        };
        for half in &mut self.samples {
            if let Some(slot) = half.get_mut(self.newest) {
                *slot = value;
            }
        }
    }
    #[inline]
    fn capacity(&self) -> usize {
        LEN
    }
}

/// On/off history, one bit per sample: 32·`WORDS` samples.
///
/// Up to 64 samples are a shift register, the newest the lowest bit; more are a
/// ring. The 6 411-sample input delay of the paper's Table IV needs 201 words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitHistory<const WORDS: usize> {
    words: [u32; WORDS],
    /// Position of the newest bit of a ring.
    newest: usize,
}

impl<const WORDS: usize> BitHistory<WORDS> {
    const BITS: usize = WORDS * 32;
    const SHIFTS: bool = WORDS <= 2;

    /// A command that has always been off.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(WORDS > 0, "a history holds at least one word") };
        Self {
            words: [0; WORDS],
            newest: 0,
        }
    }

    /// Words needed to reach `lag` samples back.
    #[must_use]
    pub const fn words_for(lag: usize) -> usize {
        lag / 32 + 1
    }

    /// Whether the command was on `lag` samples ago; off beyond the buffer.
    #[inline]
    #[must_use]
    pub fn is_on(&self, lag: usize) -> bool {
        if lag >= Self::BITS {
            return false;
        }
        let position = self.position(lag);
        match self.words.get(position / 32) {
            Some(word) => word >> (position % 32) & 1 == 1,
            None => false,
        }
    }

    /// Number of samples with the command on among `window` samples, the newest of them `lag` back.
    #[must_use]
    pub fn count_on(&self, lag: usize, window: u32) -> u32 {
        if lag >= Self::BITS {
            return 0;
        }
        let mut left = (window as usize).min(Self::BITS - lag);
        if Self::SHIFTS {
            return (lag..lag + left).filter(|lag| self.is_on(*lag)).count() as u32;
        }
        // Words are read from the newest to the oldest; of each word, the bits at and below
        // `position`.
        let mut position = self.position(lag);
        let mut count = 0;
        while left > 0 {
            let available = position % 32 + 1;
            let taken = available.min(left);
            let word = self.words.get(position / 32).copied().unwrap_or(0);
            // The newest bit is shifted to the top; then all but `taken` bits are shifted out.
            let kept = (word << (32 - available)) >> (32 - taken);
            count += kept.count_ones();
            left -= taken;
            position = if position + 1 > taken {
                position - taken
            } else {
                Self::BITS - 1
            };
        }
        count
    }

    #[inline]
    fn position(&self, lag: usize) -> usize {
        if Self::SHIFTS {
            lag
        } else if lag <= self.newest {
            self.newest - lag
        } else {
            self.newest + Self::BITS - lag
        }
    }

    /// Makes `on` the newest sample.
    #[inline]
    pub fn record(&mut self, on: bool) {
        if Self::SHIFTS {
            let mut entering = u32::from(on);
            for word in &mut self.words {
                let leaving = *word >> 31;
                *word = *word << 1 | entering;
                entering = leaving;
            }
            return;
        }
        self.newest = if self.newest + 1 < Self::BITS {
            self.newest + 1
        } else {
            0
        };
        let bit = 1_u32 << (self.newest % 32);
        if let Some(word) = self.words.get_mut(self.newest / 32) {
            if on {
                *word |= bit;
            } else {
                *word &= !bit;
            }
        }
    }
}

impl<const WORDS: usize> Default for BitHistory<WORDS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const WORDS: usize> Past<T> for BitHistory<WORDS> {
    #[inline]
    fn back(&self, lag: usize) -> T {
        if self.is_on(lag) { T::ONE } else { T::ZERO }
    }
}

impl<T: Real, const WORDS: usize> Memory<T> for BitHistory<WORDS> {
    #[inline]
    fn push(&mut self, value: T) {
        self.record(value > T::from_f64(0.5));
    }
    #[inline]
    fn steady(&self, from: usize, to: usize) -> Option<T> {
        if !Self::SHIFTS || from > to || to >= Self::BITS {
            return None;
        }
        let words = self.words.iter().rev();
        let all = words.fold(0_u64, |all, word| all << 32 | u64::from(*word));
        let mask = u64::MAX >> (63 - (to - from));
        match all >> from & mask {
            0 => Some(T::ZERO),
            part if part == mask => Some(T::ONE),
            _ => None,
        }
    }
    #[inline]
    fn capacity(&self) -> usize {
        Self::BITS
    }
    fn mean_back(&self, lag: usize, window: u32) -> T {
        T::from_count(self.count_on(lag, window)) / T::from_count(window.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_remembers_its_length_and_no_more() {
        let mut line = DelayLine::<f32, 5>::new();
        assert_eq!(line.back(0), 0.0);
        for k in 1..=12 {
            line.push(k as f32);
        }
        for lag in 0..5 {
            assert_eq!(line.back(lag), (12 - lag) as f32);
        }
        assert_eq!(line.back(5), 0.0);
        assert_eq!(line.back(usize::MAX), 0.0);
    }

    #[test]
    fn bits_agree_with_a_line_of_numbers() {
        bits_agree::<3, 96>();
        bits_agree::<2, 64>();
    }

    fn bits_agree<const WORDS: usize, const BITS: usize>() {
        let mut bits = BitHistory::<WORDS>::new();
        let mut line = DelayLine::<f64, BITS>::new();
        let mut seed = 1_u32;
        for _ in 0..500 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let on = seed >> 31 == 1;
            bits.record(on);
            line.push(f64::from(u8::from(on)));
            for lag in [0, 1, 31, 32, 33, 63, 64, 95, 96, 200] {
                assert_eq!(Past::<f64>::back(&bits, lag), line.back(lag), "lag {lag}");
                for to in lag..(lag + 6).min(BITS) {
                    let equal = (lag..=to).all(|i| line.back(i) == line.back(lag));
                    let expected = (equal && BITS <= 64).then(|| line.back(lag));
                    assert_eq!(Memory::<f64>::steady(&bits, lag, to), expected);
                }
                for window in [1, 2, 31, 32, 33, 64, 90, 96] {
                    let direct: f64 = (0..window as usize).map(|i| line.back(lag + i)).sum();
                    assert_eq!(
                        f64::from(bits.count_on(lag, window)),
                        direct,
                        "{lag} {window}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_papers_longest_delay_fits_in_802_bytes() {
        const { assert!(BitHistory::<201>::BITS > 6411) };
        assert_eq!(BitHistory::<1>::words_for(6411), 201);
        assert!(size_of::<BitHistory<201>>() <= 804 + 2 * size_of::<usize>());
    }
}
