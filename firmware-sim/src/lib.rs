//! Plants, instruments and recordings to test the model on, and the loop that closes around it.
//!
//! The plants are continuous-time physics and share no code with `model-core`.

mod waveform;

pub mod plant;
