//! The loop of the rig at the model's sample period, without a board: read the sensor, check it, run
//! the model and the law, drive the valve; with faults that latch.
//!
//! [`controller::Controller::tick`] is the whole loop as a function of a
//! reading. Boards call it from [`rig::Rig`]; the processor-in-the-loop run and
//! the host call the same function, so all take the same decisions.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod cases;
pub mod console;
pub mod controller;
pub mod fault;
pub mod law;
pub mod link;
pub mod on_board;
pub mod player;
pub mod pulses;
pub mod relay;
pub mod rig;
pub mod sensor;
pub mod start;
pub mod tracking;
