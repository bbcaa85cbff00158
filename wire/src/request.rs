//! The host's requests to the board.
//!
//! Every request carries a number and the session, a random number of the host's connection. The board serves one
//! session at a time: another host gets the answer [`Status::Busy`](crate::reply::Status::Busy) until the first has
//! been silent for the link's timeout. Every host may request the identity and close the valves.
//!
//! A request whose answer was lost is sent again with the same number; the board then gives the same answer and
//! does not execute it twice.

use crate::bytes::{Reader, Writer};
use crate::frame::{CONTENT, Frame};

/// Largest number of run lengths in one request.
pub const RUNS: usize = 56;

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ask<'a> {
    /// Requests identity and state. Answered with [`Info`](crate::reply::Info).
    Hello,
    /// Keep-alive message; no answer. A board without a message from its host for
    /// [`LOST_AFTER_MS`](crate::reply::LOST_AFTER_MS) closes the valves.
    Alive,
    /// Run lengths of a command, to be stored from index `at` on.
    Load {
        /// Index of the first run; 0 begins a new command.
        at: u16,
        /// The run lengths, samples.
        runs: Runs<'a>,
    },
    /// Play the command that was loaded.
    Play {
        /// Number of repeats.
        repeats: u32,
        /// Number of runs of the command.
        runs: u16,
        /// [`checksum`] of its runs, so that the played command is the intended one.
        checksum: u32,
    },
    /// Stream every sample from now on, whether or not the valve moves.
    Stream,
    /// Let the law drive the valve; also ends a pause.
    Arm,
    /// Close the valve, end the command being played, acknowledge a fault.
    Disarm,
    /// Ask for the settings of the law and their bounds. The answer is [`Settings`](crate::reply::Settings).
    Settings,
    /// Change the target of the running law, y of the flow.
    Target(f32),
    /// Change the air budget of the running law: the share of time with the valve open, in 1/1000.
    Air(u16),
    /// Shut the valve and keep the law ready until it is armed again.
    Pause,
}

/// A request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request<'a> {
    /// Distinguishes the requests of a session.
    pub number: u16,
    /// Whose it is.
    pub session: u32,
    /// What is asked.
    pub ask: Ask<'a>,
}

/// Run lengths as stored in a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Runs<'a>(&'a [u8]);

impl<'a> Runs<'a> {
    /// The run lengths, samples.
    pub fn iter(self) -> impl Iterator<Item = u32> + 'a {
        self.0.chunks_exact(4).map(|bytes| match bytes {
            [a, b, c, d] => u32::from_le_bytes([*a, *b, *c, *d]),
            _ => 0,
        })
    }
}

/// Checksum of a command's run lengths.
pub fn checksum(runs: impl IntoIterator<Item = u32>) -> u32 {
    runs.into_iter()
        .fold(model_core::self_test::Crc32::new(), |crc, run| {
            crc.word(run)
        })
        .value()
}

const HELLO: u8 = 0x20;
const ALIVE: u8 = 0x21;
const LOAD: u8 = 0x22;
const PLAY: u8 = 0x23;
const STREAM: u8 = 0x24;
const ARM: u8 = 0x25;
const DISARM: u8 = 0x26;
const SETTINGS: u8 = 0x27;
const TARGET: u8 = 0x28;
const AIR: u8 = 0x29;
const PAUSE: u8 = 0x2A;

impl<'a> Request<'a> {
    /// From a frame's content; `None` if it is not a request.
    #[must_use]
    pub fn read(content: &'a [u8]) -> Option<Self> {
        let mut reader = Reader(content);
        let kind = reader.u8()?;
        let number = reader.u16()?;
        let session = reader.u32()?;
        let ask = match kind {
            HELLO => Ask::Hello,
            ALIVE => Ask::Alive,
            LOAD => {
                let at = reader.u16()?;
                let rest = reader.slice(reader.0.len())?;
                let whole = !rest.is_empty() && rest.len().is_multiple_of(4);
                if !whole || rest.len() > 4 * RUNS {
                    return None;
                }
                Ask::Load {
                    at,
                    runs: Runs(rest),
                }
            }
            PLAY => Ask::Play {
                repeats: reader.u32()?,
                runs: reader.u16()?,
                checksum: reader.u32()?,
            },
            STREAM => Ask::Stream,
            ARM => Ask::Arm,
            DISARM => Ask::Disarm,
            SETTINGS => Ask::Settings,
            TARGET => Ask::Target(reader.f32()?),
            AIR => Ask::Air(reader.u16()?),
            PAUSE => Ask::Pause,
            _ => return None,
        };
        reader.0.is_empty().then_some(Self {
            number,
            session,
            ask,
        })
    }

    /// The frame for the wire.
    #[must_use]
    pub fn frame(&self) -> Frame {
        let mut content = Writer::<CONTENT>::new();
        let kind = match self.ask {
            Ask::Hello => HELLO,
            Ask::Alive => ALIVE,
            Ask::Load { .. } => LOAD,
            Ask::Play { .. } => PLAY,
            Ask::Stream => STREAM,
            Ask::Arm => ARM,
            Ask::Disarm => DISARM,
            Ask::Settings => SETTINGS,
            Ask::Target(_) => TARGET,
            Ask::Air(_) => AIR,
            Ask::Pause => PAUSE,
        };
        content.put(&[kind]);
        content.put(&self.number.to_le_bytes());
        content.put(&self.session.to_le_bytes());
        match self.ask {
            Ask::Load { at, runs } => {
                content.put(&at.to_le_bytes());
                content.put(runs.0);
            }
            Ask::Play {
                repeats,
                runs,
                checksum,
            } => {
                content.put(&repeats.to_le_bytes());
                content.put(&runs.to_le_bytes());
                content.put(&checksum.to_le_bytes());
            }
            Ask::Target(target) => content.put(&target.to_bits().to_le_bytes()),
            Ask::Air(per_mille) => content.put(&per_mille.to_le_bytes()),
            _ => {}
        }
        Frame::new(&content.0)
    }

    /// The frame that loads `runs`, at most [`RUNS`] of them, from index `at` on.
    #[must_use]
    pub fn load(number: u16, session: u32, at: u16, runs: &[u32]) -> Frame {
        let mut bytes = Writer::<{ 4 * RUNS }>::new();
        for run in runs.iter().take(RUNS) {
            bytes.put(&run.to_le_bytes());
        }
        let runs = Runs(&bytes.0);
        Request {
            number,
            session,
            ask: Ask::Load { at, runs },
        }
        .frame()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Receiver;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn content(frame: &Frame) -> Vec<u8> {
        let mut receiver = Receiver::new();
        let mut content = None;
        for byte in frame.bytes() {
            let received = receiver.receive(*byte);
            content = content.or(received.map(|r| r.expect("undamaged").to_vec()));
        }
        content.expect("a frame")
    }

    #[test]
    fn every_request_arrives_as_it_was_meant() {
        let asks = [
            Ask::Hello,
            Ask::Alive,
            Ask::Play {
                repeats: 200,
                runs: 7,
                checksum: 0xDEAD_BEEF,
            },
            Ask::Stream,
            Ask::Arm,
            Ask::Disarm,
            Ask::Settings,
            Ask::Target(0.625),
            Ask::Air(400),
            Ask::Pause,
        ];
        for ask in asks {
            let request = Request {
                number: 513,
                session: 7,
                ask,
            };
            let bytes = content(&request.frame());
            assert_eq!(Request::read(&bytes), Some(request));
            // Content after the end of a request makes it invalid.
            assert_eq!(Request::read(&[&bytes[..], &[0]].concat()), None);
        }
    }

    proptest! {
        #[test]
        fn runs_arrive(at: u16, runs in prop::collection::vec(any::<u32>(), 1..=RUNS)) {
            let bytes = content(&Request::load(3, 4, at, &runs));
            match Request::read(&bytes).map(|request| request.ask) {
                Some(Ask::Load { at: found, runs: loaded }) => {
                    prop_assert_eq!(found, at);
                    prop_assert_eq!(loaded.iter().collect::<Vec<_>>(), runs);
                }
                other => prop_assert!(false, "{other:?}"),
            }
        }

        #[test]
        fn garbage_is_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = Request::read(&bytes);
        }
    }
}
