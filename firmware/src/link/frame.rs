//! Frames: content and CRC-32, byte-stuffed (COBS) so that 0 occurs only
//! between frames. After any loss the next 0 begins afresh.

use heapless::Vec;
use model_core::self_test::Crc32;

/// Longest content of a frame, bytes.
pub const CONTENT: usize = 248;
/// Longest frame on the wire: content, checksum, two stuffing bytes, the 0.
pub const WIRE: usize = CONTENT + 4 + 3;

/// Why bytes between two zeros are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Damage {
    /// Longer than any frame.
    TooLong,
    /// Byte-stuffing does not add up.
    Stuffing,
    /// Checksum differs.
    Checksum,
}

fn checksum(content: &[u8]) -> u32 {
    content
        .iter()
        .fold(Crc32::new(), |crc, byte| crc.byte(*byte))
        .value()
}

/// A frame ready for the wire.
#[derive(Clone, Debug)]
pub struct Frame {
    wire: Vec<u8, WIRE>,
}

impl Frame {
    /// Nothing to send.
    #[must_use]
    pub const fn empty() -> Self {
        Self { wire: Vec::new() }
    }

    /// The frame of `content`, of which at most [`CONTENT`] bytes are taken.
    #[must_use]
    pub fn new(content: &[u8]) -> Self {
        let content = content.get(..CONTENT).unwrap_or(content);
        let crc = checksum(content).to_le_bytes();
        let mut frame = Self::empty();
        // Position of the byte that counts to the next zero.
        let mut code_at = 0;
        let mut code = 1_u8;
        frame.put(0);
        for byte in content.iter().chain(&crc) {
            if *byte != 0 {
                frame.put(*byte);
                code += 1;
            }
            if *byte == 0 || code == u8::MAX {
                frame.set(code_at, code);
                code_at = frame.wire.len();
                code = 1;
                frame.put(0);
            }
        }
        frame.set(code_at, code);
        frame.put(0);
        frame
    }

    fn put(&mut self, byte: u8) {
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
    /// Whether `content` was handed out and the next byte begins afresh.
    done: bool,
    /// Bytes until the next stuffed zero; 0 before a frame's first byte.
    left: u8,
    /// Whether a zero belongs where the count ends.
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

    /// Takes a byte. At the end of a frame gives its content, or what is wrong
    /// with it.
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
        // Zeros between frames are no frames.
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
        if checksum(content) == u32::from_le_bytes(*crc) {
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
                    // Many zeros and, in long frames, long runs without.
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
            let (end, body) = frame.bytes().split_last().expect("a frame");
            assert!(*end == 0 && !body.contains(&0));
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
        for at in 0..good.len() - 1 {
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
}
