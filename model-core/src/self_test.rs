//! The board's self-test of its constants: a checksum and a short reference run.

use crate::history::Memory;
use crate::model::{Input, Parts, StateOf, step};

/// CRC-32 (IEEE 802.3, reflected) over 32-bit words, least significant byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crc32(u32);

impl Crc32 {
    /// Checksum of no data.
    #[must_use]
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Takes one byte in.
    #[must_use]
    pub const fn byte(self, byte: u8) -> Self {
        let mut crc = self.0 ^ byte as u32;
        let mut bit = 0;
        while bit < 8 {
            let low = crc & 1;
            crc = (crc >> 1) ^ (0xEDB8_8320 & 0_u32.wrapping_sub(low));
            bit += 1;
        }
        Self(crc)
    }

    /// Takes a word in.
    #[must_use]
    pub const fn word(self, word: u32) -> Self {
        let [a, b, c, d] = word.to_le_bytes();
        self.byte(a).byte(b).byte(c).byte(d)
    }

    /// The checksum.
    #[must_use]
    pub const fn value(self) -> u32 {
        !self.0
    }
}

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

/// Checksum over a model's structure and coefficients, bit for bit. The reference run covers delay law and effects.
#[must_use]
pub fn checksum<M: Parts<f32>>(model: &M) -> u32 {
    let (recursion, averaging) = (model.recursion(), model.averaging());
    let mut crc = Crc32::new()
        .word(recursion.convention as u32)
        .word(recursion.grading as u32)
        .word(averaging.window)
        .word(averaging.averaged_model.into())
        .word(recursion.constant.to_bits());
    for lag in recursion.state_lags.iter().chain(recursion.product_lags) {
        crc = crc.word(u32::from(*lag));
    }
    for value in recursion.a.iter().chain(recursion.b).chain(recursion.c) {
        crc = crc.word(value.to_bits());
    }
    crc.value()
}

/// A reference run: the bit-exact outputs of a model for the test command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Golden<const N: usize> {
    /// Samples between two expected values, at least 1.
    pub every: u32,
    /// The bits of the sensor's reading after `every`, 2·`every`, … samples.
    pub expected: [u32; N],
}

/// Whether the command of the reference run is on at sample `k`: the command is on in 18 of 32 blocks of 64
/// samples, in single blocks and in runs of blocks.
#[inline]
#[must_use]
pub const fn command(k: u32) -> bool {
    const BLOCKS: u32 = 0x5A1D_B38F;
    BLOCKS >> (k / 64 % 32) & 1 == 1
}

/// Runs `model` from `state` at rest; calls `at` with the bits of the sensor's
/// reading after every `every` samples, `values` times. `channels` stay
/// constant, usually at their references.
pub fn run<M, Y, J>(
    model: &M,
    mut state: StateOf<f32, M, Y, J>,
    channels: &[f32],
    every: u32,
    values: usize,
    mut at: impl FnMut(usize, u32),
) where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
{
    let mut k = 0_u32;
    for value in 0..values {
        let mut reading = 0.0;
        for _ in 0..every.max(1) {
            let input = Input {
                command: if command(k) { 1.0 } else { 0.0 },
                channels,
            };
            reading = step(model, &mut state, &input).measured;
            k = k.wrapping_add(1);
        }
        at(value, reading.to_bits());
    }
}

impl<const N: usize> Golden<N> {
    /// Whether `model` gives the expected output, in every bit.
    #[must_use]
    pub fn holds<M, Y, J>(&self, model: &M, state: StateOf<f32, M, Y, J>, channels: &[f32]) -> bool
    where
        M: Parts<f32>,
        Y: Memory<f32>,
        J: Memory<f32>,
    {
        let mut equal = true;
        run(model, state, channels, self.every, N, |i, bits| {
            equal &= self.expected.get(i) == Some(&bits);
        });
        equal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delay::FixedDelay;
    use crate::model::{Averaging, Params, matrix, vector};
    use crate::recursion::{Grading, LagConvention};

    #[test]
    fn the_checksum_is_the_usual_one() {
        let crc = b"123456789"
            .iter()
            .fold(Crc32::new(), |crc, byte| crc.byte(*byte));
        assert_eq!(crc.value(), 0xCBF4_3926);
    }

    const MODEL: Params<f32, 1, 1, 1, FixedDelay<[u16; 1]>, ()> = Params {
        convention: LagConvention::OneStep,
        grading: Grading::Proportional,
        averaging: Averaging {
            window: 2,
            averaged_model: false,
        },
        constant: 0.0,
        state_lags: [1],
        a: vector([0.875]),
        product_lags: [1],
        b: vector([0.25]),
        c: matrix([[-0.125]]),
        delay: FixedDelay { delays: [40] },
        effects: (),
    };

    #[test]
    fn a_changed_bit_is_seen() {
        let mut golden = Golden {
            every: 100,
            expected: [0_u32; 8],
        };
        run(
            &MODEL,
            MODEL.on_off_state::<4, 2>(),
            &[],
            100,
            8,
            |i, bits| {
                golden.expected[i] = bits;
            },
        );
        assert_ne!(golden.expected[0], golden.expected[7]);
        assert!(golden.holds(&MODEL, MODEL.on_off_state::<4, 2>(), &[]));

        let mut damaged = MODEL;
        damaged.a = vector([f32::from_bits(0.875_f32.to_bits() ^ 1)]);
        assert_ne!(checksum(&damaged), checksum(&MODEL));
        assert!(!golden.holds(&damaged, damaged.on_off_state::<4, 2>(), &[]));
        let later = Params {
            delay: FixedDelay { delays: [41] },
            ..MODEL
        };
        assert_eq!(checksum(&later), checksum(&MODEL));
        assert!(!golden.holds(&later, later.on_off_state::<4, 2>(), &[]));
    }
}
