//! The serial line: what operator and host say to the loop and see of it, and
//! the dialogue of the processor-in-the-loop run.

pub mod desk;
pub mod lockstep;
pub mod service;
