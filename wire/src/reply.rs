//! The board's answers.

use crate::bytes::{Reader, Writer};
use crate::frame::{CONTENT, Frame};

/// The version of this protocol; host and board must have the same.
pub const PROTOCOL: u8 = 2;
/// Time without a message after which a host counts as lost, ms. The board then ends the command
/// that it plays for this host.
pub const LOST_AFTER_MS: u32 = 500;

/// [`LOST_AFTER_MS`] in samples of `period_us`, at least ten, because the board receives at most one message per
/// sample.
///
/// ```
/// use wire::reply::lost_after_samples;
/// assert_eq!([200, 1000, 10_000, 100_000].map(lost_after_samples), [2500, 500, 50, 10]);
/// ```
#[must_use]
pub const fn lost_after_samples(period_us: u32) -> u32 {
    let period_us = if period_us == 0 { 1 } else { period_us };
    let samples = LOST_AFTER_MS * 1000 / period_us;
    if samples < 10 { 10 } else { samples }
}

/// How a request ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
#[non_exhaustive]
pub enum Status {
    /// Done.
    Done = 0,
    /// Another host controls the board.
    Busy = 1,
    /// More runs (intervals of constant command) than the board can store; the detail is the number that it can store.
    TooLong = 2,
    /// Earlier runs of the command are missing; the detail is the number of stored runs.
    Missing = 3,
    /// A run is shorter than the valve's hold time; the detail is its index.
    TooShort = 4,
    /// The loaded command is not the one to be played.
    OtherCommand = 5,
    /// Nothing to play: no runs, no repeats, or more samples than can be counted.
    Nothing = 6,
    /// A fault is latched, or the law or a command controls the valve: disarm first.
    NotDisarmed = 7,
    /// A setting outside its bounds: the valve is shut and the fault latched.
    Outside = 8,
    /// The preceding change is not complete: a ramp to a target, or the shortest time shut after a pause.
    Pending = 9,
    /// The law has no such setting.
    NoSetting = 10,
    /// No law is running; its settings change only while it is.
    NotRunning = 11,
}

impl Status {
    const ALL: [Self; 12] = [
        Self::Done,
        Self::Busy,
        Self::TooLong,
        Self::Missing,
        Self::TooShort,
        Self::OtherCommand,
        Self::Nothing,
        Self::NotDisarmed,
        Self::Outside,
        Self::Pending,
        Self::NoSetting,
        Self::NotRunning,
    ];
}

/// State of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Valves shut.
    Disarmed,
    /// The law drives the valve.
    Armed,
    /// A command is played.
    Playing,
    /// The law is armed and waits with the valves shut.
    Paused,
    /// Valves shut by the fault of that number, see the board's `Fault::ALL`.
    Faulted(u8),
}

impl Phase {
    const FAULT: u8 = 0x80;

    /// For the wire.
    #[must_use]
    pub const fn to_byte(self) -> u8 {
        match self {
            Self::Disarmed => 0,
            Self::Armed => 1,
            Self::Playing => 2,
            Self::Paused => 3,
            Self::Faulted(number) => Self::FAULT | number,
        }
    }

    /// From the wire.
    #[must_use]
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0 => Some(Self::Disarmed),
            1 => Some(Self::Armed),
            2 => Some(Self::Playing),
            3 => Some(Self::Paused),
            byte if byte & Self::FAULT != 0 => Some(Self::Faulted(byte & !Self::FAULT)),
            _ => None,
        }
    }
}

/// The scale of a sensor or channel: value = (counts − zero) · per_count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scale {
    /// Counts of 0.
    pub zero: f32,
    /// Units per count.
    pub per_count: f32,
}

/// Identity and state of the board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Info {
    /// [`PROTOCOL`] of the board.
    pub protocol: u8,
    /// Version of the firmware: major, minor, patch.
    pub version: [u8; 3],
    /// Sample period, µs.
    pub period_us: u32,
    /// Checksum of the model's constants.
    pub model: u32,
    /// Checksum of the rig's constants.
    pub rig: u32,
    /// From counts to y.
    pub sensor: Scale,
    /// Lower and upper limit of the readings, counts. A reading at or beyond a limit counts as
    /// saturated.
    pub rails: [f32; 2],
    /// Number of equal readings in a row after which the sensor counts as stuck.
    pub stuck_after: u32,
    /// Residual's envelope, y.
    pub envelope: f32,
    /// Shortest times open and shut, samples.
    pub hold: [u32; 2],
    /// From counts to the channel's unit; all zero if the model needs none.
    pub channel: Scale,
    /// State of the board.
    pub phase: Phase,
    /// Samples since the start.
    pub samples: u64,
    /// Largest number of runs of a command.
    pub most_runs: u16,
    /// Damaged frames received since the start, wrapping.
    pub damaged: u32,
    /// The host that controls the board; 0 if none does. A restarted board has no host.
    pub session: u32,
}

/// The settings of a law that a host may change, with their bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The target, y of the flow; not finite for a law without one.
    pub target: f32,
    /// The open interval of targets.
    pub reachable: [f32; 2],
    /// Largest change of the target per sample; 0 for a step.
    pub slope: f32,
    /// Share of time with the valve open that the budget allows, in 1/1000; [`NO_LIMIT`] without a budget.
    pub air: u16,
}

/// An air budget that does not limit, in 1/1000. A budget is at least 1.
pub const NO_LIMIT: u16 = 1000;

impl Settings {
    /// The settings of a law that has none.
    pub const NONE: Self = Self {
        target: f32::NAN,
        reachable: [f32::NAN; 2],
        slope: 0.0,
        air: NO_LIMIT,
    };

    /// Whether the law has a target.
    #[must_use]
    pub fn has_target(&self) -> bool {
        self.target.is_finite()
    }

    /// Whether `target` is within its bounds.
    #[must_use]
    pub fn takes_target(&self, target: f32) -> bool {
        let [low, high] = self.reachable;
        low < target && target < high
    }

    /// Whether an air budget is within its bounds.
    #[must_use]
    pub fn takes_air(per_mille: u16) -> bool {
        (1..=NO_LIMIT).contains(&per_mille)
    }
}

/// An answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// To [`Ask::Hello`](crate::request::Ask::Hello).
    Info(Info),
    /// To [`Ask::Settings`](crate::request::Ask::Settings).
    Settings(Settings),
    /// To any other request.
    Done {
        /// How the request ended.
        status: Status,
        /// Detail of the status; its meaning depends on the status.
        detail: u32,
        /// Samples from the board's start to the execution.
        samples: u64,
    },
}

/// An answer with the number and session of its request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reply {
    /// Copied from the request.
    pub number: u16,
    /// Copied from the request.
    pub session: u32,
    /// The answer.
    pub answer: Answer,
}

pub(crate) const INFO: u8 = 0x30;
pub(crate) const DONE: u8 = 0x31;
pub(crate) const SETTINGS: u8 = 0x32;

impl Reply {
    /// The frame for the wire.
    #[must_use]
    pub fn frame(&self) -> Frame {
        let mut content = Writer::<CONTENT>::new();
        content.put(&[match self.answer {
            Answer::Info(_) => INFO,
            Answer::Settings(_) => SETTINGS,
            Answer::Done { .. } => DONE,
        }]);
        content.put(&self.number.to_le_bytes());
        content.put(&self.session.to_le_bytes());
        match &self.answer {
            Answer::Info(info) => {
                content.put(&[info.protocol]);
                content.put(&info.version);
                for word in [
                    info.period_us,
                    info.model,
                    info.rig,
                    info.sensor.zero.to_bits(),
                    info.sensor.per_count.to_bits(),
                    info.rails[0].to_bits(),
                    info.rails[1].to_bits(),
                    info.stuck_after,
                    info.envelope.to_bits(),
                    info.hold[0],
                    info.hold[1],
                    info.channel.zero.to_bits(),
                    info.channel.per_count.to_bits(),
                ] {
                    content.put(&word.to_le_bytes());
                }
                content.put(&[info.phase.to_byte()]);
                content.put(&info.samples.to_le_bytes());
                content.put(&info.most_runs.to_le_bytes());
                content.put(&info.damaged.to_le_bytes());
                content.put(&info.session.to_le_bytes());
            }
            Answer::Settings(settings) => {
                let [low, high] = settings.reachable;
                for number in [settings.target, low, high, settings.slope] {
                    content.put(&number.to_bits().to_le_bytes());
                }
                content.put(&settings.air.to_le_bytes());
            }
            Answer::Done {
                status,
                detail,
                samples,
            } => {
                content.put(&[*status as u8]);
                content.put(&detail.to_le_bytes());
                content.put(&samples.to_le_bytes());
            }
        }
        Frame::new(&content.0)
    }

    /// From a frame's content; `None` if it is not an answer.
    #[must_use]
    pub fn read(content: &[u8]) -> Option<Self> {
        let mut reader = Reader(content);
        let kind = reader.u8()?;
        let (number, session) = (reader.u16()?, reader.u32()?);
        let answer = match kind {
            INFO => Answer::Info(Info {
                protocol: reader.u8()?,
                version: reader.take()?,
                period_us: reader.u32()?,
                model: reader.u32()?,
                rig: reader.u32()?,
                sensor: scale(&mut reader)?,
                rails: [reader.f32()?, reader.f32()?],
                stuck_after: reader.u32()?,
                envelope: reader.f32()?,
                hold: [reader.u32()?, reader.u32()?],
                channel: scale(&mut reader)?,
                phase: Phase::from_byte(reader.u8()?)?,
                samples: reader.u64()?,
                most_runs: reader.u16()?,
                damaged: reader.u32()?,
                session: reader.u32()?,
            }),
            SETTINGS => Answer::Settings(Settings {
                target: reader.f32()?,
                reachable: [reader.f32()?, reader.f32()?],
                slope: reader.f32()?,
                air: reader.u16()?,
            }),
            DONE => Answer::Done {
                status: {
                    let byte = reader.u8()?;
                    Status::ALL.into_iter().find(|s| *s as u8 == byte)?
                },
                detail: reader.u32()?,
                samples: reader.u64()?,
            },
            _ => return None,
        };
        reader.0.is_empty().then_some(Self {
            number,
            session,
            answer,
        })
    }
}

fn scale(reader: &mut Reader<'_>) -> Option<Scale> {
    Some(Scale {
        zero: reader.f32()?,
        per_count: reader.f32()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Receiver;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn through(reply: &Reply) -> Option<Reply> {
        let mut receiver = Receiver::new();
        let mut found = None;
        for byte in reply.frame().bytes() {
            if let Some(content) = receiver.receive(*byte) {
                found = Reply::read(content.expect("undamaged"));
            }
        }
        found
    }

    #[test]
    fn every_answer_arrives_as_it_was_given() {
        let info = Info {
            protocol: PROTOCOL,
            version: [1, 2, 3],
            period_us: 1000,
            model: 1,
            rig: 2,
            sensor: Scale {
                zero: 812.5,
                per_count: 0.0005,
            },
            rails: [8.0, 4087.0],
            stuck_after: 500,
            envelope: 0.5,
            hold: [20, 21],
            channel: Scale::default(),
            phase: Phase::Faulted(5),
            samples: 1 << 40,
            most_runs: 1024,
            damaged: 3,
            session: 12,
        };
        let reply = |answer| Reply {
            number: 9,
            session: 77,
            answer,
        };
        let told = reply(Answer::Info(info));
        assert_eq!(through(&told), Some(told));
        let settings = reply(Answer::Settings(Settings {
            target: 0.5,
            reachable: [0.0, 1.0625],
            slope: 0.001,
            air: 400,
        }));
        assert_eq!(through(&settings), Some(settings));
        for status in Status::ALL {
            let done = reply(Answer::Done {
                status,
                detail: 4,
                samples: 5,
            });
            assert_eq!(through(&done), Some(done));
        }
    }

    proptest! {
        #[test]
        fn garbage_is_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let bytes: Vec<u8> = bytes;
            let _ = Reply::read(&bytes);
            let _ = bytes.first().map(|byte| Phase::from_byte(*byte).map(Phase::to_byte));
        }
    }
}
