//! What host and board say to each other over the serial line.
//!
//! Both ends use this crate, so that neither can misread the other. Frames
//! ([`frame`]) find their beginning again after any loss; [`request`] is what
//! the host asks, [`reply`] what the board answers, and [`samples`] the stream
//! that shows every sample. Nothing here allocates, waits or panics.
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
//! so that answers and a loop that sends nothing for an eighth of its time still
//! find room. A board at less than 0.4 ms a sample (0.8 ms with the law) has
//! more to say than the line takes: what does not fit is left out whole, counted,
//! and known to the host by its numbers.
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
