//! The serial line: interfaces of operator and host to the loop, and the protocol of the
//! processor-in-the-loop run.

pub mod desk;
pub mod lockstep;
pub mod service;
