//! Curves of a coordinate at a place of the model, in free form: screened to first order, refitted with the model.

mod candidate;
mod coordinate;
mod fits;
mod formula;
mod place;
mod rules;
mod screening;
mod term;

pub(crate) use candidate::{Candidate, best, best_of_each_place};
pub use coordinate::Coordinate;
pub(crate) use fits::{Heirs, briefly, finished, kind, refitted, tried};
pub(crate) use formula::FORMS;
pub use place::{Entry, Place};
pub use rules::{RULES, Rules};
pub(crate) use screening::{Context, ON, Screened, diverse, reference, room};
pub(crate) use term::{Shape, Term};
