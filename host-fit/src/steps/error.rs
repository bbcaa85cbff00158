//! Errors of the steps.

use crate::codegen::CodegenError;
use crate::data::memory::TooMuch;
use crate::data::{AverageError, DataError, FilePlace};
use crate::design::DesignError;
use crate::diagnose::DiagnoseError;
use crate::excitation::ExcitationError;
use crate::extend::ExtendError;
use crate::identify::IdentifyError;
use crate::model::{DefineError, ModelError};
use crate::simulate::SimulateError;
use crate::user_effect::DefinitionError;
use thiserror::Error;

/// Why a step failed: one paragraph with the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StepError {
    /// An error in the recordings.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Raw recordings cannot be averaged.
    #[error(transparent)]
    Average(#[from] AverageError),
    /// The recordings are valid, but their excitation is insufficient.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// The records need more memory than allowed.
    #[error(transparent)]
    Memory(#[from] TooMuch),
    /// An error in the model file.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// An error in a user effect.
    #[error(transparent)]
    Definition(#[from] DefinitionError),
    /// A user effect has the name of another one.
    #[error(transparent)]
    Define(#[from] DefineError),
    /// No model could be identified.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// No model could be identified, because of one record.
    #[error("{place}: {cause}")]
    IdentifyRecord {
        /// The record's file.
        place: Box<FilePlace>,
        /// Why.
        cause: IdentifyError,
    },
    /// A free run could not be made.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The diagnosis failed.
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    /// The model was not extended.
    #[error(transparent)]
    Extend(#[from] ExtendError),
    /// No law was designed.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// A time of a law outside the range of the search.
    #[error(
        "a {what} of {time_s:?} s is outside the range for a law of this model: give 0 to {longest_s} s (100000 samples)"
    )]
    DesignTime {
        /// Name of the time.
        what: &'static str,
        /// The time, s.
        time_s: f64,
        /// The longest, s.
        longest_s: f64,
    },
    /// No constants were generated.
    #[error(transparent)]
    Codegen(#[from] CodegenError),
    /// A model and recordings of different sampling periods.
    #[error(
        "{place}: `sample_period_s` is {data}, but the model has {model} s, and its lags are counted in \
        samples. Identify a model on this data, or resample it"
    )]
    SamplePeriod {
        /// The recordings.
        place: Box<FilePlace>,
        /// Sampling period of the recordings, s.
        data: f64,
        /// The model's, s.
        model: f64,
    },
    /// Invalid factors.
    #[error("--factors takes finite numbers that are not below 0, as in --factors 1")]
    BadFactors,
    /// Factors without a law.
    #[error("--factors multiplies a delay law: add --delay state-dependent or --delay-law")]
    FactorsWithoutLaw,
    /// No delay law could be measured.
    #[error(
        "no delay law is identifiable on these records; prescribe one with --delay-law P0,P1,P2, or use --delay fixed"
    )]
    NoDelayLaw,
    /// The command's sampling period differs from the model's.
    #[error(
        "{place}: the samples are {input} s apart, but the model has a sample period of {model} s; resample the command"
    )]
    InputPeriod {
        /// The command file.
        place: Box<FilePlace>,
        /// Sampling period of the input file, s.
        input: f64,
        /// The model's, s.
        model: f64,
    },
    /// The free run of the identified model diverges on its own records.
    #[error(
        "no model was written: the free run of the best model diverges on these records ({0}). Use fewer lags \
         (`--n1 1 --n2 1`), or a longer record with more switchings"
    )]
    Unstable(crate::simulate::SimulateError),
    /// An effect does not lower the error.
    #[error(
        "nothing was written: with {effects} the error of the free run does not decrease ({before} → {after} \
        on the {on} records). Keep the given model, or try another effect (`host-fit diagnose` ranks them)"
    )]
    NoGain {
        /// The effects.
        effects: String,
        /// Root mean square error before, y.
        before: String,
        /// After.
        after: String,
        /// `validation` or `estimation`.
        on: &'static str,
    },
    /// Too few samples can be scored.
    #[error(
        "{scored} of {samples} samples can be scored, less than half. The others are lead-in (`lead_samples` \
        in dataset.toml) or belong to records that start in mid-run. Record longer, or state the command \
        before the first sample (`u_before` in dataset.toml)"
    )]
    TooFewScored {
        /// Samples that can be scored.
        scored: usize,
        /// Samples in all.
        samples: usize,
    },
    /// A channel that the model's effects need.
    #[error("{place}: the column `{channel}`, which the model's effects need, is missing; add it")]
    NoChannel {
        /// The command file.
        place: Box<FilePlace>,
        /// The channel.
        channel: String,
    },
    /// The model diverges under this command.
    #[error(
        "the model's free run diverges at t = {time_s} s of {place}: the model is unstable for this command; \
         identify it again, with fewer lags or `--objective free-run`"
    )]
    Diverges {
        /// The command file.
        place: Box<FilePlace>,
        /// Time of the divergence, s.
        time_s: f64,
    },
    /// A validation record that does not exist.
    #[error(
        "--validate {0}: no recording has this name; give a file name without its ending, or the name of a record of a \
         file that is split"
    )]
    NoSuchRecording(String),
}
