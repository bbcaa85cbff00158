//! Scenarios that cross the crates, and the campaign that asks the diagnosis
//! for effects hidden in simulated rigs.

pub mod campaign;
