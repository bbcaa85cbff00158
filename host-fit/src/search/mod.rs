//! Mesh adaptive direct search (MADS) over integers and granular reals.
//!
//! The parts are separate: the [`Mesh`] is a type of its own, search steps are plug-ins ([`SearchStep`]), the
//! [`Evaluator`] owns cache, order and threads, and a [`StopReason`] is a value with a description. Repeatable bit for
//! bit by seed, whatever the number of threads.
//!
//! ```
//! use host_fit::search::{Evaluation, Point, Problem, Settings, Shake, Variable, minimise};
//! use std::sync::atomic::AtomicBool;
//!
//! struct Parabola([Variable; 2]);
//! impl Problem for Parabola {
//!     fn variables(&self) -> &[Variable] {
//!         &self.0
//!     }
//!     fn evaluate(&self, point: &Point, _give_up_at: f64) -> Evaluation {
//!         let (delay, factor) = (self.0[0].value(point[0]), self.0[1].value(point[1]));
//!         Evaluation::Value((delay - 48.0).powi(2) + (factor - 1.25).powi(2))
//!     }
//! }
//!
//! let mut problem = Parabola([Variable::integer("delay", 0, 500), Variable::granular("factor", 0.0, 3.0, 1e-4)]);
//! let report =
//!     minimise(&mut problem, &[], &mut [Box::new(Shake::new(5))], &Settings::default(), &(), &AtomicBool::new(false));
//! assert_eq!(report.best.map(|b| b.point), Some(vec![48, 12_500]));
//! assert!(report.stop.was_successful());
//! ```

mod evaluator;
mod mads;
mod mesh;
mod poll;
mod problem;
mod rules;
mod settings;
mod shake;
mod step;
mod stop;
mod variable;

pub use evaluator::{Evaluator, Progress, Snapshot, Success};
pub use mads::{SearchReport, minimise};
pub use mesh::Mesh;
pub use problem::{Evaluation, Problem};
pub use rules::{RULES, Rules};
pub use settings::{PollKind, Settings};
pub use shake::Shake;
pub use step::{Around, Improve, SearchStep, Settle, Speculative};
pub use stop::StopReason;
pub use variable::{Point, Variable};
