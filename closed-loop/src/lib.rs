//! Closed-loop simulation at any sample period: controllers, plants and figures.
//!
//! The law of `model-core` and standard controllers run here on anything that is [`Controlled`]: a model, a
//! simulated plant, or the caller's own plant.

mod figures;
mod model_flow;
mod open_loop;
mod proportional_integral;
mod relay;
mod run;
mod tracking;

pub use figures::Figures;
pub use model_flow::ModelFlow;
pub use open_loop::OpenLoop;
pub use proportional_integral::{FirstOrder, Gains, PulseWidth};
pub use relay::Relay;
pub use run::{Controlled, Controller, Sample, Trace, run, span};
pub use tracking::{AHEAD, TrackingController};
