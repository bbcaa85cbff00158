//! Structure selection: lags of the flow, the sensor's offset, physical effects.
//!
//! A hypothesis is a model with a list of [`Term`]s added to the base model of the lowest order. [`Screen`]
//! predicts to first order how much of the free-run error hundreds of further terms would explain, at the cost of
//! one run each. [`Search`] refits the most promising terms, scores them on validation records and continues from
//! the best. Lags and effects are moves of the same search: both must lower the error by more than their penalty,
//! and an effect must beat the best base model without it.

mod again;
mod automatic;
mod bench;
mod certificate;
mod effort;
mod evidence;
mod folds;
mod follow;
mod grid;
mod hypothesis;
mod input;
mod instead;
mod judge;
mod laws;
mod likelihood;
mod likely_delay;
mod linear;
mod proposal;
mod pruning;
mod resampling;
mod roots;
mod rules;
mod screen;
mod search;
mod settled;
mod shown;
mod table;
mod term;
mod units;

pub use crate::fit::Known;
pub use automatic::{Automatic, Frame, base_model};
pub use bench::Bench;
pub(crate) use certificate::{MostLikely, log_e, p_of};
pub use effort::Effort;
pub(crate) use evidence::{HeldOut, p_value};
pub use folds::HeldOutBy;
pub use hypothesis::Hypothesis;
pub(crate) use input::{leading_inputs, measured_inputs};
pub(crate) use judge::size;
pub use judge::{Judge, Judged};
pub(crate) use laws::at_the_papers_average;
pub(crate) use likelihood::Likelihood;
pub(crate) use linear::{baselines, second_order};
pub use proposal::Proposal;
pub(crate) use resampling::{is_out, shares_won};
pub use rules::{RULES, Rules};
pub use screen::Screen;
pub(crate) use screen::Tangent;
pub use search::{Found, Search};
pub(crate) use shown::{Left, Shown, Unnamed};
pub use table::{Candidate, Table};
pub use term::Term;
pub(crate) use term::second_lag_s;
pub use units::Units;
pub(crate) use units::resting_at_zero;
