//! Plants: the physics of a rig in time steps far below the sample period, with exact delays.
//!
//! Nothing here is shared with `model-core`, because these plants test the model and must not repeat its
//! discretisation. The signals run command → valve → plenum → jet → transport → flow → film → reading.

pub mod altered;
mod base;
pub mod beyond;
mod character;
mod describe;
pub mod effects;
mod fault;
mod flow;
mod free_stream;
mod jet;
mod part;
mod rig;
mod sensor;
mod transport;

pub use altered::Altered;
pub(crate) use base::log_uniform;
pub use base::{BasePlant, BasePlantError, FlowDelay, RateLaw};
pub use beyond::{Beyond, Port, Region, Truth};
pub use character::{Character, PastTerm};
pub use effects::{Effect, EffectError, Parameter, ShowsWith};
pub use fault::Fault;
pub use free_stream::{FreeStream, MEAN_FREE_STREAM};
pub use part::Place;
pub use rig::{PlantError, PlantSpec, Rig};

/// Sample period of commands and readings (s).
pub const SAMPLE_PERIOD_S: f64 = 0.001;

/// Sub-steps per sample: the physics runs at 20 kHz.
pub const SUBSTEPS: u32 = 20;

/// Length of a sub-step (s).
pub const SUBSTEP_S: f64 = SAMPLE_PERIOD_S / SUBSTEPS as f64;

/// Length of the jet's history (s), much longer than any delay.
const LONGEST_DELAY_S: f64 = 2.5;

/// Two times with a smaller difference are the same instant (s).
const SHORTEST_PIECE_S: f64 = 1e-9;

/// A plant for a controller: one command in, one reading out, every millisecond.
pub trait Plant {
    /// Holds the valve command for one sample period, then reads the sensor (y, with noise and converter if the
    /// plant has them).
    fn step(&mut self, command: bool) -> f64;
}
