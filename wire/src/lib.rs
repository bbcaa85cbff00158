//! The protocol of host and board on the serial line.
//!
//! Both ends use this crate, so their formats cannot differ. Frames ([`frame`]) are found again after any loss.
//! [`request`] contains the host's requests, [`reply`] the board's answers, and [`samples`] the stream with every
//! sample. Nothing here allocates, waits or panics.
//!
//! # The line is fast enough
//!
//! 115 200 baud, 8N1, are 11 520 bytes a second: 11.5 bytes in a sample of 1 ms.
//! A frame of [`samples::BATCH`] samples takes
//!
//! | | content, bytes | on the wire | a sample | of the line |
//! |---|---|---|---|---|
//! | readings (disarmed, playing) | 18 + 24 · 3 = 90 | 97 | 4.0 | 35 % |
//! | with the law (armed) | 22 + 24 · 7 = 190 | 197 | 8.2 | 71 % |
//!
//! The remaining capacity is enough for the answers, and for a loop that cannot send during an eighth of its time.
//! A board with less than 0.4 ms per sample (0.8 ms with the law) produces more than the line transmits. Frames
//! that do not fit are left out completely and counted, and the host detects them by their numbers.
#![no_std]

#[cfg(test)]
extern crate std;

mod bytes;
pub mod frame;
pub mod outbox;
pub mod reply;
pub mod request;
pub mod samples;

pub use outbox::Outbox;
