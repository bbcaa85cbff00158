//! Measured data: records of command and response, read, checked, averaged and judged for what they can tell.
//!
//! A data set is a folder with `dataset.toml` and CSV files, or one CSV file. Everything is checked when it is loaded
//! ([`DataSet::load`]) or put together in memory ([`DataSet::from_records`]); every fault is one paragraph that names
//! file, line and column, or the TOML key, and the remedy ([`DataError`]).

mod average;
mod error;
mod excitation;
mod folder;
mod folding;
mod hash;
mod raw;
mod record;
mod rows;
mod sampling;
mod table;

pub use average::{Align, AverageError, AverageSummary, Averaging, Defect, Dropped, average_files};
pub use error::{DataError, Place, Problem};
pub use excitation::{Demand, Excitation, ExcitationError, RecordExcitation, check_excitation};
pub use record::{DataSet, Record, Use};
pub use table::InputFile;
