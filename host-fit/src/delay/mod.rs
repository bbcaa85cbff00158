//! Delays of the response, edge by edge, and the law (2) through them.
//!
//! [`study_delays`] measures when y starts to respond to every edge of the command ([`Onset`] says how), pairs the
//! delay with the averaged output (1) at that time, fits h̃(ỹ) = p0 + p1·exp(−p2·ỹ) to the edges of the identify
//! records, and tests whether the data bear such a law out.

mod dependence;
mod drawing;
mod edge;
mod front;
mod law;
mod onset;
mod rules;
mod spread;
mod study;

pub use dependence::DelayVerdict;
pub use drawing::draw_delays;
pub use edge::{Edge, edges};
pub use law::{DelayLawFit, DelayPoint, Estimate, fit_delay_law};
pub use onset::{Onset, Unmeasured};
pub use rules::{RULES, Rules};
pub use spread::Spread;
pub use study::{
    DelayOptions, DelayStatistics, DelayStudy, EdgeDelay, SequenceStatistics, study_delays,
};
