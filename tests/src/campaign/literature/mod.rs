//! The campaign on published flows: what the diagnosis says of flows that nobody here made up, with an effect
//! hidden in front of them or behind them, or with nothing hidden.

mod case;
mod row;
mod run;
mod table;

pub use case::{Case, cases};
pub use row::Row;
pub use run::run;
pub use table::table;
