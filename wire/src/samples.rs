//! The stream: every sample of the loop, numbered, a batch per frame.
//!
//! Sensor and channel are sent as the converter's 12 bits, so nothing is rounded. The law's signals are also sent
//! as counts of the sensor, in eighths: half a count is far below any sensor's noise, and the scale is suitable for
//! any unit of y.

use crate::bytes::Reader;
use crate::frame::Frame;
use crate::reply::Phase;

/// Largest number of samples in a frame.
pub const BATCH: usize = 24;
/// Steps per count in which the law's signals are sent.
pub const STEPS: f32 = 8.0;
/// Largest count of a 12-bit converter; NaN is sent as this.
pub const FULL: u16 = 0xFFF;

const READINGS: u8 = 0x40;
const LAW: u8 = 0x41;
/// Length of a frame's header, bytes: kind, session, first number, phase, last, left out.
const HEAD: usize = 1 + 4 + 4 + 1 + 1 + 4;

/// A streamed sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Counts of the sensor.
    pub counts: u16,
    /// Counts of the channel.
    pub channel: u16,
    /// The valve from this sample to the next.
    pub open: bool,
    /// Predicted reading of the model and deviation of the reading from it, both in counts of the sensor. `None`
    /// if the law does not run.
    pub law: Option<Law>,
}

/// The law's signals in a sample, counts of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// The model's predicted reading.
    pub model: f32,
    /// Reading minus prediction, without the sensor's zero. For an averaged model, the averaged
    /// reading is used.
    pub residual: f32,
}

/// Samples of a frame on the board: filled one by one, then sent.
#[derive(Clone, Debug)]
pub struct Batch {
    frame: Frame,
    session: u32,
    kind: u8,
    phase: Phase,
    /// Number of the next sample.
    next: u32,
    count: usize,
    /// One bit per sample: whether the valve was open.
    open: u32,
    /// Samples that did not fit since the session began, wrapping.
    left_out: u32,
}

impl Batch {
    /// Nothing to send.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            frame: Frame::empty(),
            session: 0,
            kind: READINGS,
            phase: Phase::Disarmed,
            next: 0,
            count: 0,
            open: 0,
            left_out: 0,
        }
    }

    /// A stream begins, at sample 0.
    pub fn start(&mut self, session: u32) {
        *self = Self::new();
        self.session = session;
    }

    /// Number of the next sample.
    #[must_use]
    pub fn next(&self) -> u32 {
        self.next
    }

    /// Whether another sample fits: the batch is not full, and its samples have the same phase.
    #[must_use]
    pub fn takes(&self, sample: &Sample, phase: Phase) -> bool {
        self.count == 0 || (self.count < BATCH && self.phase == phase && self.kind == kind(sample))
    }

    /// Adds a sample. A batch that cannot take it ([`Self::takes`]) must have been ended before.
    #[inline(never)]
    pub fn push(&mut self, sample: &Sample, phase: Phase, reference: f32) {
        if self.count == 0 {
            self.kind = kind(sample);
            self.phase = phase;
            self.open = 0;
            self.frame.begin();
            self.frame.put(&[self.kind]);
            self.frame.put(&self.session.to_le_bytes());
            self.frame.put(&self.next.to_le_bytes());
            self.frame.put(&[phase.to_byte()]);
            if self.kind == LAW {
                self.frame.put(&reference.to_bits().to_le_bytes());
            }
        }
        // Two 12-bit numbers are stored in three bytes.
        let (counts, channel) = (sample.counts.min(FULL), sample.channel.min(FULL));
        let [c0, c1] = counts.to_le_bytes();
        let [d0, d1] = channel.to_le_bytes();
        self.frame.put(&[c0, c1 | (d0 << 4), (d0 >> 4) | (d1 << 4)]);
        if let Some(law) = sample.law {
            self.frame.put(&steps(law.model).to_le_bytes());
            self.frame.put(&steps(law.residual).to_le_bytes());
        }
        self.open |= u32::from(sample.open) << (self.count % 32);
        self.count += 1;
        self.next = self.next.wrapping_add(1);
    }

    /// Samples that wait to be sent.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether there is something to send and no further sample fits.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.count >= BATCH
    }

    /// Ends the batch and passes its frame to `send`, which returns whether it fits in the queue. If it does not,
    /// its samples count as left out. `last` marks the end of the stream and is sent even without a sample.
    pub fn end(&mut self, last: bool, send: impl FnOnce(&[u8]) -> bool) {
        if self.count == 0 {
            if !last {
                return;
            }
            self.frame.begin();
            self.frame.put(&[READINGS]);
            self.frame.put(&self.session.to_le_bytes());
            self.frame.put(&self.next.to_le_bytes());
            self.frame.put(&[self.phase.to_byte()]);
            self.open = 0;
        }
        let [a, b, c, _] = self.open.to_le_bytes();
        self.frame.put(&[a, b, c, u8::from(last)]);
        self.frame.put(&self.left_out.to_le_bytes());
        self.frame.finish();
        if !send(self.frame.bytes()) {
            self.left_out = self.left_out.wrapping_add(self.count as u32);
        }
        self.count = 0;
    }

    /// Sets the phase that a last frame without samples reports.
    pub fn note(&mut self, phase: Phase) {
        if self.count == 0 {
            self.phase = phase;
        }
    }
}

impl Default for Batch {
    fn default() -> Self {
        Self::new()
    }
}

fn kind(sample: &Sample) -> u8 {
    if sample.law.is_some() { LAW } else { READINGS }
}

fn steps(counts: f32) -> i16 {
    // The conversion saturates; NaN becomes 0.
    (counts * STEPS) as i16
}

/// A frame of samples as the host reads it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Samples<'a> {
    /// Session of the host that requested the stream.
    pub session: u32,
    /// Number of the first sample, from the stream's beginning.
    pub first: u32,
    /// State of the board at this sample.
    pub phase: Phase,
    /// y* at its first sample; `None` without a law, or with one that has none.
    pub reference: Option<f32>,
    /// Whether the stream ends with this frame.
    pub last: bool,
    /// Number of samples before this frame that did not fit on the board, wrapping.
    pub left_out: u32,
    open: u32,
    law: bool,
    bytes: &'a [u8],
}

impl<'a> Samples<'a> {
    /// From a frame's content; `None` if it is not a stream.
    #[must_use]
    pub fn read(content: &'a [u8]) -> Option<Self> {
        let mut reader = Reader(content);
        let kind = reader.u8()?;
        let law = match kind {
            READINGS => false,
            LAW => true,
            _ => return None,
        };
        let (session, first) = (reader.u32()?, reader.u32()?);
        let phase = Phase::from_byte(reader.u8()?)?;
        let reference = if law { Some(reader.f32()?) } else { None };
        let bytes = reader.slice(reader.0.len().checked_sub(8)?)?;
        let each = if law { 7 } else { 3 };
        let count = bytes.len() / each;
        if !bytes.len().is_multiple_of(each) || count > BATCH {
            return None;
        }
        let [a, b, c, last] = reader.take()?;
        Some(Self {
            session,
            first,
            phase,
            reference: reference.filter(|y| y.is_finite()),
            last: last != 0,
            left_out: reader.u32()?,
            open: u32::from_le_bytes([a, b, c, 0]),
            law,
            bytes,
        })
    }

    /// Samples in it.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes.len() / self.each()
    }

    /// Whether the frame contains no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    fn each(&self) -> usize {
        if self.law { 7 } else { 3 }
    }

    /// The samples, with their numbers.
    pub fn iter(self) -> impl Iterator<Item = (u32, Sample)> + 'a {
        let bytes = self.bytes.chunks_exact(self.each());
        bytes.zip(0_u32..).filter_map(move |(bytes, i)| {
            let mut reader = Reader(bytes);
            let [c0, mixed, d1] = reader.take()?;
            let law = match (reader.u16(), reader.u16()) {
                (Some(model), Some(residual)) => Some(Law {
                    model: f32::from(model as i16) / STEPS,
                    residual: f32::from(residual as i16) / STEPS,
                }),
                _ => None,
            };
            let sample = Sample {
                counts: u16::from_le_bytes([c0, mixed & 0xF]),
                channel: u16::from(mixed >> 4) | (u16::from(d1) << 4),
                open: self.open >> (i % 32) & 1 == 1,
                law,
            };
            Some((self.first.wrapping_add(i), sample))
        })
    }
}

/// Bytes of the largest frame's content.
const MOST: usize = HEAD + 4 + 3 + 7 * BATCH;
const _: () = assert!(MOST <= crate::frame::CONTENT, "a batch fits a frame");
const _: () = assert!(BATCH <= 24, "the valve's bits fit three bytes");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Receiver;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn sample() -> impl Strategy<Value = (Sample, bool)> {
        let law = prop::option::of((-4000.0_f32..4000.0, -4000.0_f32..4000.0));
        (0..=FULL, 0..=FULL, any::<bool>(), law, any::<bool>()).prop_map(
            |(counts, channel, open, law, lost)| {
                let law = law.map(|(model, residual)| Law { model, residual });
                let sample = Sample {
                    counts,
                    channel,
                    open,
                    law,
                };
                (sample, lost)
            },
        )
    }

    proptest! {
        /// Samples that are not left out arrive with their numbers; the others are counted.
        #[test]
        fn samples_arrive_or_are_counted(all in prop::collection::vec(sample(), 0..200)) {
            let mut batch = Batch::new();
            batch.start(9);
            let (mut wire, mut kept, mut left_out) = (Vec::new(), Vec::new(), 0);
            let mut waiting: Vec<(u32, Sample)> = Vec::new();
            let mut send = |batch: &mut Batch, waiting: &mut Vec<_>, lost: bool, last| {
                batch.end(last, |bytes| {
                    if !lost { wire.extend_from_slice(bytes); }
                    !lost
                });
                if lost { left_out += waiting.len() } else { kept.append(waiting) }
                waiting.clear();
            };
            for (sample, lost) in &all {
                if !batch.takes(sample, Phase::Armed) {
                    send(&mut batch, &mut waiting, *lost, false);
                }
                waiting.push((batch.next(), *sample));
                batch.push(sample, Phase::Armed, 0.5);
            }
            send(&mut batch, &mut waiting, false, true);
            batch.end(true, |bytes| { wire.extend_from_slice(bytes); true });
            let mut receiver = Receiver::new();
            let (mut found, mut told) = (Vec::new(), 0);
            for byte in &wire {
                if let Some(content) = receiver.receive(*byte) {
                    let samples = Samples::read(content.expect("undamaged")).expect("samples");
                    prop_assert_eq!(samples.session, 9);
                    prop_assert_eq!(samples.iter().count(), samples.len());
                    found.extend(samples.iter());
                    told = samples.left_out;
                }
            }
            prop_assert_eq!(told as usize, left_out);
            prop_assert_eq!(found.len(), kept.len());
            for ((n, a), (m, b)) in found.iter().zip(&kept) {
                prop_assert_eq!((n, a.counts, a.channel, a.open), (m, b.counts, b.channel, b.open));
                match (a.law, b.law) {
                    (Some(a), Some(b)) => {
                        prop_assert!((a.model - b.model).abs() <= 1.0 / STEPS);
                        prop_assert!((a.residual - b.residual).abs() <= 1.0 / STEPS);
                    }
                    (a, b) => prop_assert_eq!(a, b),
                }
            }
        }

        #[test]
        fn garbage_is_read_without_a_panic(
            kind in READINGS..=LAW,
            bytes in prop::collection::vec(any::<u8>(), 0..300),
        ) {
            let content: Vec<u8> = std::iter::once(kind).chain(bytes).collect();
            if let Some(samples) = Samples::read(&content) {
                prop_assert_eq!(samples.iter().count(), samples.len());
            }
        }
    }

    /// The numbers of the table in the crate's documentation.
    #[test]
    fn the_stream_fits_the_line_at_1_khz() {
        let sizes = [
            None,
            Some(Law {
                model: 1.0,
                residual: 1.0,
            }),
        ]
        .map(|law| {
            let sample = Sample {
                counts: 1,
                channel: 1,
                open: true,
                law,
            };
            let mut batch = Batch::new();
            batch.start(u32::MAX);
            while !batch.is_full() {
                batch.push(&sample, Phase::Armed, 0.5);
            }
            let mut size = 0;
            batch.end(false, |bytes| {
                size = bytes.len();
                true
            });
            size
        });
        assert_eq!(sizes, [97, 197]);
        let line = 115_200.0 / 10.0 * 1e-3 * BATCH as f64;
        let shares = sizes.map(|bytes| (100.0 * bytes as f64 / line).round());
        assert_eq!(shares, [35.0, 71.0]);
    }
}
