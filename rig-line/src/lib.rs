//! The host's end of the serial line to a board: the connection ([`Host`]), playing and recording commands
//! ([`record`]), and an emulated board ([`emulator`]).
//!
//! This crate knows nothing about models. The protocol is in the crate `wire`, which the board uses too.

pub mod alarm;
pub mod calibrate;
pub mod command;
pub mod emulator;
mod error;
mod host;
pub mod log;
mod port;
pub mod record;
mod rig_file;
pub mod watch;

pub use command::Command;
pub use error::LineError;
pub use host::{Change, Event, Host, Streamed, word};
pub use port::{Bad, Port};
pub use rig_file::{ChannelEntry, RigFile, SensorEntry, ValveEntry};
