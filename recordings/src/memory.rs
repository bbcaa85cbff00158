//! Memory limit of a command.
//!
//! Sizes from a user's file or option (an array in a `.mat`, a table of lags) are checked before allocation,
//! so that a small file cannot exhaust the memory.

use std::sync::atomic::{AtomicU64, Ordering};

/// Default limit, bytes.
pub const USUAL: u64 = 2_000_000_000;

static LIMIT: AtomicU64 = AtomicU64::new(USUAL);

/// The memory limit would be exceeded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what} needs {} of memory, but {} are allowed; {remedy}, or allow more with --memory {}", gigabytes(*.needed), gigabytes(*.limit), needed.div_ceil(1_000_000_000))]
pub struct TooMuch {
    /// The purpose.
    pub what: String,
    /// Bytes needed.
    pub needed: u64,
    /// Bytes allowed.
    pub limit: u64,
    /// Alternatives.
    pub remedy: &'static str,
}

fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}

/// Sets the limit of this process, bytes.
pub fn set_limit(bytes: u64) {
    LIMIT.store(bytes, Ordering::Relaxed);
}

/// The limit of this process, bytes.
#[must_use]
pub fn limit() -> u64 {
    LIMIT.load(Ordering::Relaxed)
}

/// Checks that `what` may use this many bytes.
///
/// # Errors
/// [`TooMuch`] with the need, the limit and the `remedy`.
pub fn allow(needed: u64, what: &str, remedy: &'static str) -> Result<(), TooMuch> {
    let limit = limit();
    match needed <= limit {
        true => Ok(()),
        false => Err(TooMuch {
            what: what.to_owned(),
            needed,
            limit,
            remedy,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_much_says_how_much_and_what_to_do() {
        assert_eq!(allow(USUAL, "it", "shorten it"), Ok(()));
        let error = allow(6_300_000_000, "--max-lag 12000", "lower it").unwrap_err();
        assert_eq!(
            error.to_string(),
            "--max-lag 12000 needs 6.3 GB of memory, but 2.0 GB are allowed; lower it, or allow more with --memory 7"
        );
    }
}
