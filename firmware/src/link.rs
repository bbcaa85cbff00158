//! The serial link of the processor-in-the-loop run: frames that find their
//! beginning again, checksums, and a dialogue in which nothing slips silently.

pub mod frame;
pub mod lockstep;
