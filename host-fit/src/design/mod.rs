//! Control laws designed from a model and tried in the loop before they reach a valve.

mod bench;
mod error;
mod horizon;
mod maximise;
mod proof;
mod rules;
mod steady;
mod tracking;
mod train;

pub use error::DesignError;
pub use maximise::{MaximiseRequest, Optimum, Outside, Planned, maximise};
pub use proof::{Case, CaseGroup, Proof, Trial, prove, prove_pulses, run_law};
pub use rules::{RULES, Rules};
pub use steady::{Steady, steady, time_constants};
pub use tracking::{TrackDesign, TrackRequest, track};
