//! Control laws: design from a model, and trials in closed loop before use on a valve.

mod bench;
mod certificate;
mod error;
mod horizon;
mod margin;
mod maximise;
mod noise;
mod possible;
mod proof;
mod record_judge;
mod rules;
mod steady;
mod tracking;
mod train;

pub use certificate::{Bound, Certificate, certificate};
pub use error::{DesignError, check_period};
pub use margin::{ERRORS, ErrorInterval, Margin, MarginPlane, margin};
pub use maximise::{BestPulses, MaximiseRequest, Optimum, Outside, Planned, Weighed, maximise};
pub use possible::{PossibleFlow, possible_flows};
pub use proof::{Case, CaseGroup, Proof, Trial, Trials, judged, prove, prove_pulses, run_law};
pub use rules::{RULES, Rules};
pub use steady::{Steady, steady, time_constants};
pub(crate) use tracking::held;
pub use tracking::{TrackDesign, TrackRequest, track};
