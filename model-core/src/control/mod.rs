//! On/off control with the identified model. A command arrives a transport delay later, so the laws decide on
//! the predicted flow.
//!
//! Parameters, state and step are separate, as in the rest of the crate. Every request passes through
//! [`hold`], which enforces the valve's on and off times.

pub mod ahead;
pub mod budget;
mod constants;
mod correction;
pub mod golden;
pub mod hold;
pub mod period;
pub mod pulses;
pub mod reference;
pub mod tracking;

pub use budget::{Air, Switches};
pub use constants::{Tracking, Unusable};
pub use hold::{Hold, HoldTimes};
pub use pulses::{PulseTrain, Pulses};
pub use reference::{Reachable, Unreachable};
pub use tracking::{Decision, Measurement, TrackingState};
