//! Pictures (SVG) and the report page (HTML).
//!
//! Every function takes plain data and returns the text of one self-contained document, without external fonts or
//! network access. The caller writes the file. Nothing here fails: missing or non-finite numbers leave gaps in a
//! picture.
//!
//! The layout is our own, because chart libraries offer neither panels with a shared time axis nor legends that
//! never cover data. The rest is a few SVG elements ([`canvas`](self)). Pages draw records with a script of their
//! own ([`Living`]).

mod axis;
mod canvas;
mod closed_loop;
mod curve;
mod decimate;
mod delay_law;
mod format;
mod frequency;
mod ladder;
mod legend;
mod lines;
mod living;
mod overlay;
mod palette;
mod panel;
mod ranking;
mod region;
mod report;
mod strip;
mod where_it_fails;

pub use canvas::Picture;
pub use closed_loop::{ClosedLoop, LoopRun, closed_loop};
pub use curve::{BandPoint, CurvePlot, curve};
pub use delay_law::{DelayEdge, DelayLawPlot, LawPoint, MeasuredDelay, delay_law};
pub use format::{fixed, listed, readable_time, signed, significant, time};
pub use frequency::{
    DEPTH as MAGNITUDE_DEPTH_DB, FrequencyCurve, FrequencyPlot, MeasuredResponse,
    TURN as PHASE_DEPTH_DEG, frequency,
};
pub use ladder::{Ladder, LadderRecord, LadderStep, ladder};
pub use lines::{Line, LinePlot, lines};
pub use living::{Living, Stretches, packed};
pub use overlay::{LabelledRun, Overlay, overlay};
pub use palette::{SERIES_COLOURS, neutral_colour, series_colour};
pub use ranking::{Candidate, Ranking, ranking};
pub use region::{Region, Regions, regions};
pub use report::{Column, Report, Tone, workbench_page};
pub use where_it_fails::{FailureBin, FailureView, WhereItFails, where_it_fails};

#[cfg(test)]
mod testing;
