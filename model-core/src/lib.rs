//! Bilinear input–output model with state-dependent input delay, physical
//! effects around it, for hosts and microcontrollers alike.
//!
//! The model is that of M. Feingesicht, C. Raibaudo, A. Polyakov, F. Kerhervé and J.-P. Richard, *A bilinear
//! input-output model with state-dependent delay for separated flow control*, ECC 2016; equation numbers in this
//! crate are those of the paper. [`model::step`] is the complete model. Host, simulation and firmware call the same
//! function, so equal constants give equal bits.
//!
//! The crate is `no_std`, does not allocate, has no unsafe code and cannot panic. Time, noise and measurements are
//! arguments; they are never read inside.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod average;
pub mod checks;
pub mod clock;
pub mod control;
pub mod delay;
pub mod effect;
pub mod effects;
pub mod frozen;
pub mod history;
pub mod model;
pub mod pairs;
#[cfg(test)]
mod paper;
pub mod real;
pub mod recursion;
pub mod self_test;

pub use effect::Effect;
pub use model::{Input, Output, Parts, State, step};
pub use pairs::pairs;
pub use real::Real;
