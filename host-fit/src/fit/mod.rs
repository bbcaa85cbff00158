//! Output-error fits: parameters that make the free run follow the records.

mod candidate;
mod lean;
mod levenberg;

pub use candidate::{CandidateError, fit_with_effect};
pub use lean::{lean_base, settle_fixed_delay};
pub(crate) use levenberg::dot;
pub use levenberg::{Fit, FitOptions, fit};
