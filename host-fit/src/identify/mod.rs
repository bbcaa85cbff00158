//! Identification: recordings to delays and coefficients.
//!
//! MADS proposes delays, and least squares gives the coefficients. The objective is the one-step residual or the
//! free-run error ε. The sums for the least squares are tabulated once ([`lagged_products`](self)), so an
//! evaluation needs only look-ups and a small solve.

mod arrival;
mod coefficients;
mod delay_search;
mod error;
mod exchange;
mod free_run;
mod free_run_steps;
mod free_runner;
mod lagged_products;
mod layout;
mod linearised;
mod one_step;
mod options;
mod refinement;
mod regression;
mod rules;
mod run;
mod structure;

pub use error::IdentifyError;
pub use options::{IdentifyOptions, Objective};
pub use refinement::Refinement;
pub use rules::{RULES, Rules};
pub use run::{Identified, Watcher, identify};
pub use structure::{ExponentialDelay, InputDelay, Structure};
