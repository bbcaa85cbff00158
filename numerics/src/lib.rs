//! Dense linear algebra and Fourier transforms of real signals.
//!
//! Compiled once, beside the other dependencies of `host-fit`; nothing else uses faer and `realfft`.

pub mod fourier;
pub mod linalg;
