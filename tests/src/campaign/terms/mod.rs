//! The campaign of the search for unknown terms: rigs with physics outside the catalogue, with effects
//! removed from it, and without a missing effect.

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
