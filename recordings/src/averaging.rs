//! Options of averaging, and its summary.

use crate::error::{DataError, FilePlace};

/// Alignment of the repeats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Align {
    /// On the command's rising edges ([`Align::Grid`] if the command never rises).
    #[default]
    Edges,
    /// On whole periods counted from the start, by the recording's own clock.
    Grid,
}

/// How recordings are averaged.
#[derive(Debug, Clone, PartialEq)]
pub struct Averaging {
    /// Length of one repeat of the command sequence, s; at least two samples.
    pub period_s: f64,
    /// Time after the first row at which the first period starts, s, ≥ 0: best at rest, because the command
    /// before a record counts as 0.
    pub start_s: f64,
    /// Alignment of the repeats.
    pub align: Align,
    /// Allowed shift of an edge between repeats, samples, relative to the anchor.
    pub edge_jitter: usize,
}

impl Averaging {
    /// Averaging over `period_s` seconds with the usual choices: from the first row, on edges, one sample of jitter.
    #[must_use]
    pub fn over(period_s: f64) -> Self {
        Self {
            period_s,
            start_s: 0.0,
            align: Align::Edges,
            edge_jitter: 1,
        }
    }
}

/// Why a period was dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Defect {
    /// Samples are missing by the time column.
    MissingSamples,
    /// A value is missing, not a number or not finite, or the row is too short or too long.
    UnreadableValue,
    /// The time step is not a multiple of the sampling period, or the time is unreadable.
    UnevenTime,
    /// The command is neither 0 nor 1.
    CommandNotOnOff,
    /// No rising edge of the command at the expected time.
    NoAnchorEdge,
    /// The command differs from that of most periods.
    OtherCommand,
    /// Time decreases: the recording was restarted within the period.
    Restart,
}

impl Defect {
    /// The defect in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::MissingSamples => "samples missing",
            Self::UnreadableValue => "a value is missing or not a finite number",
            Self::UnevenTime => "the time step is off the sampling grid",
            Self::CommandNotOnOff => "the command is neither 0 nor 1",
            Self::NoAnchorEdge => "no rising edge at the expected time",
            Self::OtherCommand => "command sequence differs from most periods",
            Self::Restart => "time goes back",
        }
    }
}

/// Periods dropped for one reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Dropped {
    /// The reason.
    pub defect: Defect,
    /// How many periods.
    pub periods: u64,
    /// Line of the file of its first occurrence (the line after the gap for missing samples).
    pub first_line: u64,
}

/// Summary of one recording.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct AverageSummary {
    /// Name of the record.
    pub name: String,
    /// Rows read.
    pub rows: u64,
    /// Bytes read.
    pub bytes: u64,
    /// Sampling period of the recording, s.
    pub sample_period_s: f64,
    /// Samples in one period.
    pub period_samples: usize,
    /// Periods in the average. With fewer than two there is no standard error.
    pub periods_used: u64,
    /// Periods dropped, by reason.
    pub dropped: Vec<Dropped>,
    /// Samples at the end that do not make a whole period.
    pub left_over_samples: usize,
    /// Whether the periods were aligned on edges.
    pub aligned_on_edges: bool,
    /// Root mean square over the period of the standard error of the mean; `None` with one period.
    pub mean_standard_error: Option<f64>,
}

/// Why recordings could not be averaged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AverageError {
    /// A recording cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The period does not fit the sampling.
    #[error(
        "the period of {period_s} s does not contain a usable number of samples of {sample_period_s} s each; \
             give the length of one repeat of the command sequence in seconds"
    )]
    Period {
        /// The stated period.
        period_s: f64,
        /// Sampling period of the recording.
        sample_period_s: f64,
    },
    /// No complete period.
    #[error(
        "{place}: there is no complete period to average ({found}); compare --period with the recording, and give with --start the time at which a repeat begins"
    )]
    NothingLeft {
        /// The recording.
        place: Box<FilePlace>,
        /// Number of dropped periods by reason, in words.
        found: String,
    },
    /// The command repeats with another period than stated.
    #[error(
        "{place}: the command repeats every {found} s, not every {stated} s, so most periods of {stated} s would be dropped, because their commands differ; give --period {found}"
    )]
    RepeatsEvery {
        /// The recording.
        place: Box<FilePlace>,
        /// The period as stated, s.
        stated: f64,
        /// Repetition period of the command, s.
        found: f64,
    },
    /// Two recordings would make records of one name.
    #[error(
        "two recordings are named `{0}`; every recording becomes a record named by its file, so rename one"
    )]
    DoubledName(String),
}
