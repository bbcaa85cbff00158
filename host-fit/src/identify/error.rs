//! Errors of an identification, detected before or after the search.

use thiserror::Error;

use super::structure::{InputDelay, Structure};
use crate::data::Record;
use crate::data::memory::TooMuch;
use crate::search::StopReason;
use numerics::linalg;

/// Why an identification could not be made.
#[derive(Debug, Clone, Error, PartialEq)]
#[non_exhaustive]
pub enum IdentifyError {
    /// The tables of lagged products do not fit into memory.
    #[error(transparent)]
    Memory(#[from] TooMuch),
    /// Nothing to fit.
    #[error(
        "the data set has no record with use \"identify\". Mark at least one record so in dataset.toml."
    )]
    NoRecords,
    /// An invalid structure.
    #[error("{what}. {remedy}")]
    Structure {
        /// The problem.
        what: String,
        /// The remedy.
        remedy: String,
    },
    /// A record shorter than the lags.
    #[error(
        "record `{record}` has {samples} samples, too few for lags up to {longest}. \
         Give a smaller --max-lag or a longer record."
    )]
    TooShort {
        /// The record.
        record: String,
        /// Number of samples in the record.
        samples: usize,
        /// Longest lag asked for.
        longest: usize,
    },
    /// Fewer rows than coefficients.
    #[error(
        "the records give {rows} equations for {coefficients} coefficients. \
         Give longer records, or fewer lags with --n1 and --n2."
    )]
    TooFewSamples {
        /// Equations.
        rows: usize,
        /// Coefficients.
        coefficients: usize,
    },
    /// A signal of another length, or with a value that is not a number.
    #[error(
        "record `{record}`: signal `{signal}` has the wrong length or a value that is not finite. Clean the CSV file."
    )]
    BadSignal {
        /// The record.
        record: String,
        /// `u` or `y`.
        signal: &'static str,
    },
    /// The command u never changes.
    #[error(
        "the command u never changes in the identify records, so no input delay is identifiable. \
         Add a record with switching, or use --n3 0."
    )]
    ConstantInput,
    /// No candidate had a bounded free run.
    #[error(
        "every candidate model diverges in free run ({stop}). \
         Use fewer lags, or --objective one-step and a refinement."
    )]
    NoStableModel {
        /// How the search ended.
        stop: StopReason,
    },
    /// The user stopped the search before its first result.
    #[error("{stop}, before there was any result. Run again with more evaluations.")]
    NoResult {
        /// How the search ended.
        stop: StopReason,
    },
    /// The final least squares failed.
    #[error(transparent)]
    NotConverged(#[from] linalg::NotConverged),
}

impl IdentifyError {
    /// The one record at fault, if the error is about a single record.
    #[must_use]
    pub fn record(&self) -> Option<&str> {
        match self {
            Self::TooShort { record, .. } | Self::BadSignal { record, .. } => Some(record),
            _ => None,
        }
    }
}

/// Rejects data and structures from which no model can be identified.
pub(crate) fn check(records: &[&Record], structure: &Structure) -> Result<(), IdentifyError> {
    let refuse = |what: String, remedy: &str| {
        Err(IdentifyError::Structure {
            what,
            remedy: remedy.to_owned(),
        })
    };
    if records.is_empty() {
        return Err(IdentifyError::NoRecords);
    }
    let longest = usize::from(structure.longest_lag);
    if structure.state_lags == 0 || longest == 0 {
        return refuse(
            "a model needs at least one state lag".to_owned(),
            "Give --n1 and --max-lag of 1 or more.",
        );
    }
    if structure.state_lags.max(structure.product_lags) > longest {
        return refuse(
            format!(
                "{} different lags do not fit into 1 … {longest}",
                structure.state_lags.max(structure.product_lags)
            ),
            "Give a larger --max-lag, or fewer lags with --n1 and --n2.",
        );
    }
    if let Some(given) = structure.given_ticks()
        && given.len() != structure.inputs
    {
        return refuse(
            format!(
                "{} input delays are given for {} inputs",
                given.len(),
                structure.inputs
            ),
            "Give one delay or factor per input, or --n3 with their number.",
        );
    }
    if let InputDelay::StateDependent { law, .. } = &structure.delay
        && !(law.floor.is_finite()
            && law.rise.is_finite()
            && law.rate.is_finite()
            && law.floor >= 0.0)
    {
        return refuse(
            "the delay law has a negative or non-finite parameter".to_owned(),
            "Give --delay-law P0,P1,P2 with P0 ≥ 0.",
        );
    }
    for record in records {
        for (signal, values) in [("u", &record.u), ("y", &record.y)] {
            if values.len() != record.y.len() || values.iter().any(|v| !v.is_finite()) {
                return Err(IdentifyError::BadSignal {
                    record: record.name.clone(),
                    signal,
                });
            }
        }
        if record.y.len() <= longest + 1 + structure.skipped() {
            return Err(IdentifyError::TooShort {
                record: record.name.clone(),
                samples: record.y.len(),
                longest,
            });
        }
    }
    let rows: usize = records
        .iter()
        .map(|r| r.y.len() - 1 - structure.skipped())
        .sum();
    let coefficients = structure.coefficients();
    if rows <= coefficients {
        return Err(IdentifyError::TooFewSamples { rows, coefficients });
    }
    let constant = |r: &&Record| r.u.iter().all(|u| Some(u) == r.u.first());
    let same = records.iter().all(|r| r.u.first() == records[0].u.first());
    // If the record is preceded by rest, a command that is on from the start is a step.
    let rises = structure.skipped() == 0
        && records
            .iter()
            .any(|r| r.u.first().is_some_and(|u| *u != 0.0));
    if structure.inputs > 0 && same && !rises && records.iter().all(constant) {
        return Err(IdentifyError::ConstantInput);
    }
    Ok(())
}
