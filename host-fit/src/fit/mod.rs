//! Output-error fits: parameters that make the free run follow the records.

mod candidate;
mod covariance;
mod drift;
mod free_run;
mod lean;
mod level_scatter;
mod levenberg;
mod rules;
mod starts;

pub(crate) use candidate::channel_reference;
pub use candidate::{CandidateError, fit_with_effect, needs_fresh_starts};
pub use drift::restart_after;
pub(crate) use drift::{pieces, pieces_of};
pub use free_run::{Fit, FitOptions, fit, sensitivities};
pub use lean::{lean_base, settle_fixed_delay};
pub use level_scatter::LevelScatter;
pub use levenberg::FitStop;
pub use rules::{RULES, Rules};
pub use starts::Known;
pub(crate) use starts::{combinations, rows, starts};
