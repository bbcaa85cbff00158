//! The processor in the loop: a board in lockstep with a continuous-time plant
//! and with the model as the host runs it, over the serial line.
//!
//! The board runs generated constants, the host the model file they are of, with
//! sizes known at run time; both in f32, and every prediction and every decision
//! is compared bit for bit. Decisions travel to the plant in batches: air that
//! leaves the valve takes longer than a batch to arrive, so nothing that is
//! sensed in a batch depends on what is decided in it.

pub mod cases;
pub mod host;
pub mod link;
pub mod run;

pub use cases::Case;
pub use link::Link;
pub use run::{Measured, run_case};
