//! Identification.
mod arrival;
mod cholesky;
mod exchange;
mod lagged_products;
mod layout;
mod regression;
mod structure;
pub use structure::*;
