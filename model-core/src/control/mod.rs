//! On/off control of the flow with the identified model: what is issued now
//! arrives a transport delay later, so the laws decide on the flow as it will
//! be then.
//!
//! Parameters, state and step are apart as in the rest of the crate. Whatever a
//! law asks for goes through [`hold`], which keeps the valve's on and off times.

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
