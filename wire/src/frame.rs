//! Frames: content and CRC-32, byte-stuffed (COBS) so that 0 occurs only between frames. After any loss the next 0
//! starts a new frame.

use heapless::Vec;
use model_core::self_test::Crc32;

/// Longest content of a frame, bytes.
pub const CONTENT: usize = 248;
/// Longest frame on the wire: a zero, content, checksum, two stuffing bytes, a zero.
pub const WIRE: usize = CONTENT + 4 + 4;

/// Why the bytes between two zeros are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Damage {
    /// Longer than any frame.
    TooLong,
    /// The byte-stuffing is inconsistent.
    Stuffing,
    /// Checksum differs.
    Checksum,
}

/// A frame for the wire, written byte by byte, so that the work is spread over several samples.
///
/// ```
/// use wire::frame::{Frame, Receiver};
/// let frame = Frame::new(b"valve");
/// let mut receiver = Receiver::new();
/// let mut bytes = frame.bytes().iter();
/// let content = loop {
///     if let Some(result) = receiver.receive(*bytes.next().unwrap()) {
///         break result;
///     }
/// };
/// assert_eq!(content, Ok(&b"valve"[..]));
/// ```
#[derive(Clone, Debug)]
pub struct Frame {
    wire: Vec<u8, WIRE>,
    crc: Crc32,
    /// Bytes of content so far.
    content: usize,
    /// Position of the byte that counts to the next zero.
    code_at: usize,
    code: u8,
}

impl Frame {
    /// Nothing to send.
    #[must_use]
    pub const fn empty() -> Self {
        Self {
            wire: Vec::new(),
            crc: Crc32::new(),
            content: 0,
            code_at: 0,
            code: 1,
        }
    }

    /// The frame of `content`, of which at most [`CONTENT`] bytes are taken.
    #[must_use]
    pub fn new(content: &[u8]) -> Self {
        let mut frame = Self::empty();
        frame.begin();
        frame.put(content);
        frame.finish();
        frame
    }

    /// Starts a new frame. A zero is sent first, which ends any truncated frame.
    #[inline(never)]
    pub fn begin(&mut self) {
        *self = Self::empty();
        self.push(0);
        self.code_at = self.wire.len();
        self.push(0);
    }

    /// Adds content; content beyond [`CONTENT`] bytes is left out.
    #[inline(never)]
    pub fn put(&mut self, content: &[u8]) {
        for byte in content {
            if self.content < CONTENT {
                self.content += 1;
                self.crc = self.crc.byte(*byte);
                self.stuff(*byte);
            }
        }
    }

    /// Adds the checksum and the end.
    #[inline(never)]
    pub fn finish(&mut self) {
        for byte in self.crc.value().to_le_bytes() {
            self.stuff(byte);
        }
        self.set(self.code_at, self.code);
        self.push(0);
    }

    fn stuff(&mut self, byte: u8) {
        if byte != 0 {
            self.push(byte);
            self.code = self.code.wrapping_add(1);
        }
        if byte == 0 || self.code == u8::MAX {
            self.set(self.code_at, self.code);
            self.code_at = self.wire.len();
            self.code = 1;
            self.push(0);
        }
    }

    fn push(&mut self, byte: u8) {
        let _ = self.wire.push(byte);
    }

    fn set(&mut self, at: usize, byte: u8) {
        if let Some(slot) = self.wire.get_mut(at) {
            *slot = byte;
        }
    }

    /// The bytes to send; none for an empty frame.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.wire
    }
}

/// Collects frames from the wire.
#[derive(Clone, Debug)]
pub struct Receiver {
    content: Vec<u8, { CONTENT + 4 }>,
    /// Whether `content` was returned and the next byte starts a new frame.
    done: bool,
    /// Bytes until the next stuffed zero; 0 before a frame's first byte.
    left: u8,
    /// Whether a zero byte must be inserted when `left` reaches 0.
    zero_due: bool,
    damage: Option<Damage>,
}

impl Receiver {
    /// Between two frames.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            content: Vec::new(),
            done: false,
            left: 0,
            zero_due: false,
            damage: None,
        }
    }

    /// Receives a byte. At the end of a frame returns its content, or the error.
    pub fn receive(&mut self, byte: u8) -> Option<Result<&[u8], Damage>> {
        if self.done {
            self.done = false;
            self.content.clear();
        }
        if byte == 0 {
            return self.finish();
        }
        if self.left == 0 {
            if self.zero_due {
                self.put(0);
            }
            self.left = byte - 1;
            self.zero_due = byte != u8::MAX;
        } else {
            self.left -= 1;
            self.put(byte);
        }
        None
    }

    fn put(&mut self, byte: u8) {
        if self.content.push(byte).is_err() {
            self.damage = Some(Damage::TooLong);
        }
    }

    fn finish(&mut self) -> Option<Result<&[u8], Damage>> {
        let (left, damage) = (self.left, self.damage);
        let begun = self.zero_due || left > 0 || !self.content.is_empty();
        self.done = true;
        self.left = 0;
        self.zero_due = false;
        self.damage = None;
        // Zeros between frames are not frames.
        if !begun {
            return None;
        }
        if let Some(damage) = damage {
            return Some(Err(damage));
        }
        if left > 0 {
            return Some(Err(Damage::Stuffing));
        }
        let Some((content, crc)) = self.content.split_last_chunk::<4>() else {
            return Some(Err(Damage::Checksum));
        };
        let found = content
            .iter()
            .fold(Crc32::new(), |crc, byte| crc.byte(*byte));
        if found.value() == u32::from_le_bytes(*crc) {
            Some(Ok(content))
        } else {
            Some(Err(Damage::Checksum))
        }
    }
}

impl Default for Receiver {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn contents() -> impl Iterator<Item = Vec<u8>> {
        let mut seed = 3_u32;
        (0..=CONTENT).map(move |length| {
            (0..length)
                .map(|_| {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    // The content has many zeros and, in long frames, long sequences without a
                    // zero.
                    let byte = (seed >> 24) as u8;
                    if length % 3 == 0 {
                        byte | 1
                    } else {
                        byte & 0x8F & (seed >> 16) as u8
                    }
                })
                .collect()
        })
    }

    #[test]
    fn content_survives_the_wire() {
        let mut receiver = Receiver::new();
        for content in contents() {
            let frame = Frame::new(&content);
            assert!(frame.bytes().len() <= WIRE);
            let Some((0, [body @ .., 0])) = frame.bytes().split_first() else {
                panic!("a frame is between zeros");
            };
            assert!(!body.contains(&0));
            for byte in body {
                assert!(receiver.receive(*byte).is_none());
            }
            assert_eq!(receiver.receive(0), Some(Ok(&content[..])));
            assert_eq!(receiver.receive(0), None);
        }
    }

    #[test]
    fn a_lost_or_changed_byte_is_seen_and_the_next_frame_is_not_harmed() {
        let content: Vec<u8> = (0..40).map(|i| i % 7).collect();
        let frame = Frame::new(&content);
        let good = frame.bytes();
        for at in 1..good.len() - 1 {
            for change in [None, Some(0x01_u8), Some(0x80)] {
                let mut receiver = Receiver::new();
                let mut damaged = 0;
                for (i, byte) in good.iter().enumerate() {
                    let byte = match (i == at, change) {
                        (true, None) => continue,
                        (true, Some(mask)) => byte ^ mask,
                        _ => *byte,
                    };
                    if let Some(result) = receiver.receive(byte) {
                        assert!(result.is_err(), "byte {at} {change:?}");
                        damaged += 1;
                    }
                }
                assert!(damaged >= 1, "byte {at} {change:?}");
                let mut after = None;
                for byte in good {
                    after = receiver.receive(*byte).map(|r| r.map(<[u8]>::to_vec));
                }
                assert_eq!(after, Some(Ok(content.clone())));
            }
        }
    }

    use proptest::prelude::*;

    fn received(bytes: &[u8]) -> Vec<Result<Vec<u8>, Damage>> {
        let mut receiver = Receiver::new();
        let mut all = Vec::new();
        for byte in bytes {
            all.extend(receiver.receive(*byte).map(|r| r.map(<[u8]>::to_vec)));
        }
        all
    }

    proptest! {
        /// After any noise or partial frame, the following frames arrive complete.
        #[test]
        fn garbage_and_half_frames_harm_nothing_that_follows(
            garbage in prop::collection::vec(any::<u8>(), 0..600),
            cut in prop::collection::vec(any::<u8>(), 0..CONTENT),
            keep in 0.0_f64..1.0,
            content in prop::collection::vec(any::<u8>(), 0..=CONTENT),
        ) {
            let half = Frame::new(&cut);
            let half = &half.bytes()[..(keep * half.bytes().len() as f64) as usize];
            let frame = Frame::new(&content);
            let all = received(&[&garbage, half, frame.bytes()].concat());
            prop_assert_eq!(all.last(), Some(&Ok(content)));
        }

        /// Noise is not a valid frame; the checksum accepts one of 2³² by coincidence.
        #[test]
        fn garbage_is_no_frame(garbage in prop::collection::vec(any::<u8>(), 0..2000)) {
            prop_assert!(received(&garbage).iter().all(Result::is_err));
        }

        /// A burst of wrong bytes within a frame is detected.
        #[test]
        fn a_burst_is_seen(
            content in prop::collection::vec(any::<u8>(), 1..=CONTENT),
            at in 0.0_f64..1.0,
            burst in prop::collection::vec(any::<u8>(), 1..5),
        ) {
            let frame = Frame::new(&content);
            let mut bytes = frame.bytes().to_vec();
            let at = 1 + (at * (bytes.len() - 2) as f64) as usize;
            for (slot, byte) in bytes[at..].iter_mut().zip(&burst) {
                *slot = *byte;
            }
            let changed = bytes != frame.bytes();
            let intact = received(&bytes).contains(&Ok(content));
            prop_assert_eq!(changed, !intact);
        }
    }
}
