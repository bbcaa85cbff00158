//! The dialogue between host and board: the host sends readings, the board
//! answers with predictions and decisions.
//!
//! Every request carries a number and is answered by exactly one reply with the same number. A request that comes again
//! (its reply was lost) gets the same reply and is not executed twice. A damaged request is reported, and the host
//! sends it again. A lost byte is therefore either recovered or reported; the two sides are always at the same step.
//!
//! | request | content after kind (1 byte) and number (2 bytes, low first) | reply's content after the same |
//! |---|---|---|
//! | `START` | case (1) | 1 if there is such a case, else 0 (1) |
//! | `STEPS` | the measured channel in counts (2), readings of the sensor in counts (2 each) | predictions (4 each, bits of f32), decisions (1 bit each, in 4 bytes) |
//! | `REPORT` | – | steps (4), clock ticks spent in steps (8), most in one step (4), stack used (4) |
//! | anything else or damaged | | `DAMAGED`, number 0 |

use heapless::Vec;
use wire::frame::{CONTENT, Frame, Receiver};

/// Starts a case from rest.
pub const START: u8 = 1;
/// Runs steps.
pub const STEPS: u8 = 2;
/// Requests the measurements.
pub const REPORT: u8 = 3;
/// A frame could not be understood.
pub const DAMAGED: u8 = 0x7F;
/// Largest number of steps in a request.
pub const BATCH: usize = 32;

/// Measurements of a case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Steps made.
    pub steps: u32,
    /// Clock ticks in these steps.
    pub ticks: u64,
    /// Largest number of ticks in one step.
    pub most: u32,
    /// Deepest stack so far, bytes.
    pub stack: u32,
}

impl Report {
    /// Bytes on the wire.
    pub const SIZE: usize = 20;

    /// In wire format.
    #[must_use]
    pub fn to_bytes(self) -> [u8; Self::SIZE] {
        let mut bytes = [0; Self::SIZE];
        let values = self
            .steps
            .to_le_bytes()
            .into_iter()
            .chain(self.ticks.to_le_bytes())
            .chain(self.most.to_le_bytes())
            .chain(self.stack.to_le_bytes());
        for (slot, value) in bytes.iter_mut().zip(values) {
            *slot = value;
        }
        bytes
    }

    /// From wire format.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (steps, rest) = bytes.split_first_chunk::<4>()?;
        let (ticks, rest) = rest.split_first_chunk::<8>()?;
        let (most, rest) = rest.split_first_chunk::<4>()?;
        let (stack, _) = rest.split_first_chunk::<4>()?;
        Some(Self {
            steps: u32::from_le_bytes(*steps),
            ticks: u64::from_le_bytes(*ticks),
            most: u32::from_le_bytes(*most),
            stack: u32::from_le_bytes(*stack),
        })
    }
}

/// The lockstep cases of a board.
pub trait Cases {
    /// Starts a case from rest; `false` if the number is invalid.
    fn start(&mut self, case: u8) -> bool;
    /// One step with the counts of sensor and measured channel: the prediction, and the valve position.
    fn step(&mut self, counts: u16, channel: u16) -> (f32, bool);
    /// Measurements since the start of the case.
    fn report(&mut self) -> Report;
}

/// The board's side.
pub struct Server<C> {
    cases: C,
    receiver: Receiver,
    /// Number and reply of the last request.
    answered: Option<(u8, u16)>,
    reply: Frame,
    damaged: Frame,
}

impl<C: Cases> Server<C> {
    /// Initial state.
    pub fn new(cases: C) -> Self {
        Self {
            cases,
            receiver: Receiver::new(),
            answered: None,
            reply: Frame::empty(),
            damaged: Frame::new(&[DAMAGED, 0, 0]),
        }
    }

    /// Takes a byte; returns the bytes to send, usually no bytes.
    pub fn receive(&mut self, byte: u8) -> &[u8] {
        let Some(result) = self.receiver.receive(byte) else {
            return &[];
        };
        let request = result.ok().and_then(|content| {
            let ([kind, low, high], rest) = content.split_first_chunk::<3>()?;
            Some((*kind, u16::from_le_bytes([*low, *high]), rest))
        });
        let Some((kind, number, rest)) = request else {
            // The last reply is kept, because the host may repeat its request.
            return self.damaged.bytes();
        };
        if self.answered == Some((kind, number)) {
            return self.reply.bytes();
        }
        let mut reply = Reply::new(kind, number);
        match kind {
            START => {
                let known = rest.first().is_some_and(|case| self.cases.start(*case));
                reply.put(&[known.into()]);
            }
            STEPS => {
                let mut decisions = 0_u32;
                let mut counts = rest.chunks_exact(2).map(|counts| match counts {
                    [low, high] => u16::from_le_bytes([*low, *high]),
                    _ => 0,
                });
                // The channel counts as constant over the batch, because channels are slow.
                let channel = counts.next().unwrap_or(0);
                for (i, counts) in counts.take(BATCH).enumerate() {
                    let (predicted, open) = self.cases.step(counts, channel);
                    reply.put(&predicted.to_bits().to_le_bytes());
                    decisions |= u32::from(open) << (i % BATCH);
                }
                reply.put(&decisions.to_le_bytes());
            }
            REPORT => reply.put(&self.cases.report().to_bytes()),
            _ => reply = Reply::new(DAMAGED, 0),
        }
        self.answered = Some((kind, number));
        self.reply = Frame::new(reply.content());
        self.reply.bytes()
    }
}

struct Reply {
    content: Vec<u8, CONTENT>,
}

impl Reply {
    fn new(kind: u8, number: u16) -> Self {
        let mut reply = Self {
            content: Vec::new(),
        };
        let [low, high] = number.to_le_bytes();
        reply.put(&[kind, low, high]);
        reply
    }

    fn put(&mut self, bytes: &[u8]) {
        let _ = self.content.extend_from_slice(bytes);
    }

    fn content(&self) -> &[u8] {
        &self.content
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Counts the samples that it is given, so that a missing or repeated step is detected.
    struct Counter {
        sum: f32,
        steps: u32,
    }

    impl Cases for Counter {
        fn start(&mut self, case: u8) -> bool {
            (self.sum, self.steps) = (0.0, 0);
            case == 0
        }
        fn step(&mut self, counts: u16, channel: u16) -> (f32, bool) {
            self.sum += f32::from(counts) + 1000.0 * f32::from(channel);
            self.steps += 1;
            (self.sum, self.steps.is_multiple_of(3))
        }
        fn report(&mut self) -> Report {
            Report {
                steps: self.steps,
                ticks: 1 << 40,
                most: 7,
                stack: 9,
            }
        }
    }

    fn ask(server: &mut Server<Counter>, content: &[u8], lost: Option<usize>) -> Vec<u8> {
        let mut receiver = Receiver::new();
        let mut reply = Vec::new();
        for (i, byte) in Frame::new(content).bytes().iter().enumerate() {
            if Some(i) == lost {
                continue;
            }
            for byte in server.receive(*byte).to_vec() {
                if let Some(Ok(content)) = receiver.receive(byte) {
                    reply = content.to_vec();
                }
            }
        }
        reply
    }

    #[test]
    fn a_batch_is_answered_once_however_often_it_is_asked() {
        let mut server = Server::new(Counter { sum: 0.0, steps: 0 });
        assert_eq!(ask(&mut server, &[START, 0, 0, 0], None), [START, 0, 0, 1]);
        assert_eq!(ask(&mut server, &[START, 1, 0, 9], None), [START, 1, 0, 0]);
        assert_eq!(ask(&mut server, &[START, 2, 0, 0], None)[3], 1);
        let batch = [STEPS, 3, 0, 1, 0, 10, 0, 20, 0, 0, 1];
        let first = ask(&mut server, &batch, None);
        assert_eq!(&first[..3], [STEPS, 3, 0]);
        assert_eq!(first[3..7], 1010.0_f32.to_le_bytes());
        assert_eq!(first[11..15], 3286.0_f32.to_le_bytes());
        assert_eq!(first[15..], 0b100_u32.to_le_bytes());
        assert_eq!(ask(&mut server, &batch, None), first);
        let report = ask(&mut server, &[REPORT, 4, 0], None);
        let report = Report::from_bytes(&report[3..]).expect("a report");
        assert_eq!((report.steps, report.ticks), (3, 1 << 40));
    }

    #[test]
    fn a_lost_byte_is_reported_and_the_request_can_be_repeated() {
        let batch = [STEPS, 3, 0, 1, 0, 10, 0, 20, 0, 0, 1];
        // The zero before a frame may be lost, but not the one after it.
        for lost in 1..Frame::new(&batch).bytes().len() - 1 {
            let mut server = Server::new(Counter { sum: 0.0, steps: 0 });
            let reply = ask(&mut server, &batch, Some(lost));
            assert_eq!(reply, [DAMAGED, 0, 0], "byte {lost}");
            let reply = ask(&mut server, &batch, None);
            assert_eq!(reply[..3], [STEPS, 3, 0]);
            // The reply was lost, and the repeated request was damaged.
            assert_eq!(ask(&mut server, &batch, Some(lost)), [DAMAGED, 0, 0]);
            assert_eq!(ask(&mut server, &batch, None), reply);
            let report = ask(&mut server, &[REPORT, 4, 0], None);
            assert_eq!(Report::from_bytes(&report[3..]).map(|r| r.steps), Some(3));
        }
    }
}
