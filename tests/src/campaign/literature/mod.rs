//! The campaign on flows from the literature: the diagnosis of published flows with one hidden effect or
//! none.

mod case;
mod row;
mod run;
mod table;

pub use case::{Case, cases};
pub use row::Row;
pub use run::run;
pub use table::table;
