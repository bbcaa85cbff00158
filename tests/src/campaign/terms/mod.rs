//! The hidden-terms campaign: what the search for unknown terms finds in rigs with physics that the catalogue
//! lacks, with effects that were taken out of it, and in rigs with nothing missing.

mod case;
mod region;
mod row;
mod run;
mod spot;
mod table;

pub use case::{Sizes, cases};
pub use row::{Row, Told};
pub use run::run;
pub use spot::{Spot, Truth};
pub use table::table;
