//! Recordings: records of command and response, read, checked and averaged.
//!
//! A data set is a folder with `dataset.toml` and CSV files, or one CSV file. Everything is checked when it is
//! loaded ([`DataSet::load`]) or assembled in memory ([`DataSet::from_records`]). Every error is one paragraph that
//! names file, line and column, or the TOML key, and the remedy ([`DataError`]). Files are written completely or
//! not at all ([`output`]). Other formats are converted to data sets by [`mod@import`].

mod average;
mod averaging;
mod error;
mod folder;
mod folding;
mod hash;
pub mod import;
pub mod memory;
pub mod output;
mod printed;
mod raw;
mod record;
mod repetition;
mod rows;
pub mod rules;
mod sampling;
mod set;
mod table;
mod thresholds;
mod visible;

pub use average::average_files;
pub use averaging::{Align, AverageError, AverageSummary, Averaging, Defect, Dropped};
pub use error::{DataError, DataProblem, FilePlace};
pub use record::{PERIODS_S, Record, Use, rounding_variance};
pub use set::{DataSet, Plant};
pub use table::InputFile;
pub use thresholds::{RULES, Rules};
pub use visible::{visible, visible_json};
