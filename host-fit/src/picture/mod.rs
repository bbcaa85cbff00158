//! Pictures (SVG) and the report page (HTML).
//!
//! Every function takes plain data and returns the text of one self-contained
//! document: no scripts, no fonts to fetch, no network. Writing the file is the
//! caller's business. Nothing here fails: missing, non-finite or absurd numbers
//! leave gaps in a picture, they never stop it.
//!
//! `plotters` writes the SVG elements; the layout is ours, because panels that
//! share a time axis, legends that never cover data and lines placed finer than a
//! pixel are what its charts do not offer.

mod axis;
mod bars;
mod canvas;
mod closed_loop;
mod decimate;
mod delay_law;
mod format;
mod ladder;
mod legend;
mod overlay;
mod palette;
mod panel;
mod ranking;
mod report;
mod search_progress;
mod strip;
mod where_it_fails;

pub use bars::{BarRow, Bars, bars};
pub use closed_loop::{ClosedLoop, LoopRun, closed_loop};
pub use delay_law::{DelayEdge, DelayLawPlot, LawPoint, MeasuredDelay, delay_law};
pub use format::significant;
pub use ladder::{Ladder, LadderRecord, LadderStep, ladder};
pub use overlay::{Overlay, Run, overlay};
pub use ranking::{Candidate, Ranking, ranking};
pub use report::{Column, KeyNumber, Report, Tone};
pub use search_progress::{ProgressRun, SearchProgress, search_progress};
pub use where_it_fails::{FailureBin, FailureView, WhereItFails, where_it_fails};

#[cfg(test)]
mod gallery;
#[cfg(test)]
mod testing;
