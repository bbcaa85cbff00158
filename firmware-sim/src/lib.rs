//! Plants, instruments and recordings to test the model on, and the loop that closes around it.
//!
//! The plants are continuous-time physics and share no code with `model-core`.

mod waveform;

pub mod closed_loop;
pub mod command;
pub mod dataset;
pub mod dde;
pub mod hidden_set;
pub mod instrument;
pub mod paper_like;
pub mod plant;
