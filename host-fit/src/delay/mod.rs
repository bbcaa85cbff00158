//! Delays of the response, edge by edge, and the law (2) through them.
//!
//! [`study_delays`] fits one plant with a dead time to whole records and takes the delay of every edge from it; where no
//! plant describes the records it measures when y starts to respond to each edge ([`Onset`] says how). It pairs the
//! delays with the averaged output (1) at that time, fits h̃(ỹ) = p0 + p1·exp(−p2·ỹ) to the edges of the identify
//! records, and keeps the law where the data bear it out. Theory 1.5 has the method.

mod begun;
mod dead_time;
mod dependence;
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
