//! The hidden-effects campaign: rigs of every family that hide something, the program that is told nothing,
//! and the count of what it found.
//!
//! Each case is a data set in a folder, `host-fit identify`, `host-fit diagnose --json` and the model that it
//! writes: what a user would do, with what a user would get. One line of JSON a case is kept in a file, so
//! that a campaign can be stopped, taken up again and run in pieces.

mod case;
mod row;
mod run;
mod table;

pub use case::{Case, Given, Group, Sizes, cases};
pub use row::{Found, Row, Spent};
pub use run::{Program, run};
pub use table::table;
