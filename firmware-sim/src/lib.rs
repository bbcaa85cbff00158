//! Plants, instruments and recordings to test the model on.
//!
//! The plants are continuous-time physics and share no code with `model-core`.

mod named;
mod nuisance;
mod stream;
mod waveform;

pub mod bench;
pub mod command;
pub mod family;
pub mod hidden_set;
pub mod instrument;
pub mod literature;
pub mod paper_like;
pub mod plant;
pub mod recording;
