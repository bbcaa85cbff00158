//! What laws can be designed from, and why none was.

use crate::model::{Model, Start};
use closed_loop::SAMPLE_PERIOD_S;
use model_core::control::Unreachable;
use model_core::control::Unusable;
use thiserror::Error;

/// Why no law was designed.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum DesignError {
    /// The reference cannot be held.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The model's poles could not be found.
    #[error(transparent)]
    NotConverged(#[from] crate::linalg::NotConverged),
    /// The law's constants do not fit the model.
    #[error(transparent)]
    Unusable(#[from] Unusable),
    /// The model starts in mid-run.
    #[error(
        "the model begins from measurements, not from rest, so there is no natural flow to blow on; \
         identify it on records that start at rest"
    )]
    NotFromRest,
    /// The loop is not at 1 kHz.
    #[error(
        "the loop runs at 1 kHz, but the model's sample period is {0} s; identify on data sampled at 1 ms"
    )]
    SamplePeriod(f64),
    /// The model does not settle under a constant command.
    #[error(
        "with the valve {} the model does not settle within {seconds} s (largest pole modulus {modulus:.5}); \
         no reference can be promised on it; identify again with fewer lags or `--objective free-run`",
        if *.on { "open" } else { "closed" }
    )]
    Unsettled {
        /// The constant command.
        on: bool,
        /// How long it was waited, s.
        seconds: f64,
        /// Largest pole modulus under it.
        modulus: f64,
    },
    /// Steady blowing does not raise the friction.
    #[error(
        "steady blowing takes the model's friction from {low} to {high}: there is nothing to control"
    )]
    NoEffect {
        /// Without blowing.
        low: f64,
        /// With.
        high: f64,
    },
    /// Holding the reference takes more air than allowed.
    #[error(
        "holding {reference} takes {needed:.3} of the air of steady blowing, but {allowed:.3} is allowed; \
         allow more, or lower the reference"
    )]
    Air {
        /// The reference.
        reference: f64,
        /// The duty it takes.
        needed: f64,
        /// The duty allowed.
        allowed: f64,
    },
    /// No pulse train survives the long run.
    #[error(
        "every pulse train that looks better than steady blowing makes the model grow without bound \
         (largest pole modulus {off:.5} closed, {on:.5} open): these are instabilities of the model, not of the flow; \
         identify again with fewer lags or `--objective free-run`"
    )]
    OnlyInstabilities {
        /// Largest pole modulus with the valve closed.
        off: f64,
        /// Largest pole modulus with the valve open.
        on: f64,
    },
}

/// Refuses models that no law can be designed from.
pub(super) fn check(model: &Model) -> Result<(), DesignError> {
    if !model.is_sampled_at(SAMPLE_PERIOD_S) {
        return Err(DesignError::SamplePeriod(model.sample_period_s));
    }
    if model.start == Start::Measured {
        return Err(DesignError::NotFromRest);
    }
    Ok(())
}
