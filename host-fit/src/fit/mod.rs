//! Output-error fits: parameters that make the free run follow the records.

mod levenberg;

pub use levenberg::{Fit, FitOptions, fit};
