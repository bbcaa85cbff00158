//! Delays of the response, edge by edge, and the law (2) through them.
//!
//! [`study_delays`] fits one plant with a dead time to whole records and derives the delay of every edge from it.
//! If no plant describes the records, it measures when y starts to respond to each edge ([`Onset`]). It pairs the
//! delays with the averaged output (1) at that time and fits h̃(ỹ) = p0 + p1·exp(−p2·ỹ) to the edges of the
//! identify records. The law is kept if tests support it. Theory 1.6 describes the method.

mod begun;
mod dead_time;
mod dependence;
mod disturbance;
mod drawing;
mod edge;
#[cfg(test)]
mod family;
mod front;
mod law;
mod linear;
mod local;
mod onset;
mod plant;
mod pooled;
mod rules;
mod spread;
mod study;
mod verdict;

pub use dead_time::DeadTime;
pub use drawing::draw_delays;
pub use edge::Edge;
pub use law::{DelayLawFit, DelayPoint, Estimate, fit_delay_law};
pub use onset::{Onset, Unmeasured};
pub use rules::{RULES, Rules};
pub use spread::Spread;
pub use study::{
    DelayMethod, DelayOptions, DelayStatistics, DelayStudy, EdgeDelay, ResponsePlant,
    SequenceStatistics, study_delays,
};
pub use verdict::DelayVerdict;
