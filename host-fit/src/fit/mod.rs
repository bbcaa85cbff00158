//! Output-error fits: parameters that make the free run follow the records.

mod candidate;
mod drift;
mod lean;
mod levenberg;

pub use candidate::{CandidateError, fit_with_effect};
pub(crate) use drift::pieces;
pub use drift::restart_after;
pub use lean::{lean_base, settle_fixed_delay};
pub(crate) use levenberg::dot;
pub use levenberg::{Fit, FitOptions, fit};
