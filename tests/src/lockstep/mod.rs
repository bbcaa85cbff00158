//! The processor in the loop: a board in lockstep with a continuous-time plant
//! and with the model as the host runs it, over the serial line.
//!
//! The board runs generated constants; the host runs the model file from which they were generated, with sizes
//! known at run time. Both compute in f32, and every prediction and every decision is compared bit for bit.
//! Decisions travel to the plant in batches: a jet needs longer than a batch to arrive, so no reading within a
//! batch depends on a decision in it.

pub mod cases;
pub mod host;
pub mod link;
pub mod run;

pub use cases::Case;
pub use link::Link;
pub use run::{Measured, run_case};
