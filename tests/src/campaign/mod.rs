//! Campaigns: rigs of every family that hide something, the program that is told nothing, and the count of
//! what it found.
//!
//! Each case is a data set in a folder, `host-fit identify` and then `host-fit diagnose --json` (hidden
//! effects) or `host-fit discover --json` (hidden terms) with the model that it writes: what a user would do,
//! with what a user would get. One line of JSON a case is kept in a file.

mod calibration;
mod case;
mod counts;
mod ledger;
pub mod literature;
mod program;
mod row;
mod run;
mod table;
pub mod terms;

pub use calibration::calibration;
pub use case::{Case, Given, Group, Sizes, cases};
pub(crate) use counts::bounded;
pub use ledger::{Entry, Ledger};
pub use program::{Part, Program, Spent};
pub use row::{Found, PutIn, Row};
pub use run::run;
pub use table::table;
