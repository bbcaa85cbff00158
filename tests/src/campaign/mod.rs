//! Campaigns: simulated rigs of every family with hidden effects, the diagnosis of them without further
//! information, and the count of its results.
//!
//! Each case is a data set in a folder, then `host-fit identify`, then `host-fit diagnose --json` (hidden effects)
//! or `host-fit discover --json` (hidden terms) with the identified model. These are the steps of a user. The
//! result of each case is one line of JSON in a file.

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
