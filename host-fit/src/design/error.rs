//! Requirements of a law on its model, and why no law was designed.

use crate::model::Model;
use crate::picture::time;
use crate::terms::Units;
use model_core::control::Unusable;
use model_core::control::period::SHORTEST_US;
use model_core::control::{Reachable, Unreachable};
use thiserror::Error;

/// Longest sample period of a law, s. The timers of the boards have a lower limit.
const LONGEST_S: f64 = 3600.0;

/// Why no law was designed.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum DesignError {
    /// The reference is not reachable.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The model's poles could not be found.
    #[error(transparent)]
    NotConverged(#[from] numerics::linalg::NotConverged),
    /// The law's constants do not fit the model.
    #[error(transparent)]
    Unusable(#[from] Unusable),
    /// The model's sample period is outside the range of a law.
    #[error(
        "key `sample_period_s`: a law runs with a sample period of 0.2 ms to 1 h, and the model has {}; \
        identify on records with a sample period within that range",
        time(*.0, 3)
    )]
    SamplePeriod(f64),
    /// The model does not settle under a constant command.
    #[error(
        "with the valve {} the model does not settle within {seconds} s (largest pole modulus {modulus:.5}); \
         no reachable interval can be given; identify again with fewer lags or `--objective free-run`",
        if *.on { "open" } else { "closed" }
    )]
    Unsettled {
        /// The constant command.
        on: bool,
        /// Time allowed for settling, s.
        seconds: f64,
        /// Largest pole modulus under this command.
        modulus: f64,
    },
    /// Steady blowing does not raise the friction.
    #[error(
        "steady blowing does not raise the model's friction ({low} → {high}), so no law is possible"
    )]
    NoEffect {
        /// Without blowing.
        low: f64,
        /// With.
        high: f64,
    },
    /// Holding the reference needs more air than allowed.
    #[error(
        "holding {reference} takes {needed:.3} of the air of steady blowing, but {allowed:.3} is allowed; \
         allow more, or lower the reference"
    )]
    Air {
        /// The reference.
        reference: f64,
        /// Duty that holds the reference.
        needed: f64,
        /// Largest allowed duty.
        allowed: f64,
    },
    /// No pulse train stays bounded in the long run.
    #[error(
        "the model diverges under every pulse train with a higher mean than steady blowing (largest pole modulus {off:.5} with the valve closed, {on:.5} with it open); these trains excite instabilities of the model, not of the flow; identify again with fewer lags or `--objective free-run`"
    )]
    OnlyInstabilities {
        /// Largest pole modulus with the valve closed.
        off: f64,
        /// Largest pole modulus with the valve open.
        on: f64,
    },
}

impl DesignError {
    /// The error with levels in the user's units, the sensor's offset included.
    pub(crate) fn outward(self, units: &Units) -> Self {
        let level = |y: f64| y * units.y + units.zero;
        match self {
            Self::Unreachable(error) => Self::Unreachable(Unreachable {
                reference: level(error.reference),
                reachable: Reachable {
                    low: level(error.reachable.low),
                    high: level(error.reachable.high),
                },
            }),
            Self::NoEffect { low, high } => Self::NoEffect {
                low: level(low),
                high: level(high),
            },
            Self::Air {
                reference,
                needed,
                allowed,
            } => Self::Air {
                reference: level(reference),
                needed,
                allowed,
            },
            other => other,
        }
    }
}

/// Rejects a sample period outside the range of a law; checked before any work.
///
/// # Errors
/// [`DesignError::SamplePeriod`].
pub fn check_period(model: &Model) -> Result<(), DesignError> {
    let shortest_s = 1e-6 * f64::from(SHORTEST_US);
    match (shortest_s * (1.0 - 1e-3)..=LONGEST_S).contains(&model.sample_period_s) {
        true => Ok(()),
        false => Err(DesignError::SamplePeriod(model.sample_period_s)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_is_refused_with_its_key_and_the_range() {
        let at = |sample_period_s| Model {
            sample_period_s,
            ..Model::default()
        };
        for period in [2e-4, 1e-3, 0.0123, 0.1, 2.0, 3600.0] {
            assert_eq!(check_period(&at(period)), Ok(()), "{period}");
        }
        for (period, said) in [(1e-4, "has 100 µs"), (7200.0, "has 7200 s")] {
            let error = check_period(&at(period)).unwrap_err().to_string();
            for word in ["`sample_period_s`", "0.2 ms to 1 h", said, "identify"] {
                assert!(error.contains(word), "{error}");
            }
        }
    }
}
