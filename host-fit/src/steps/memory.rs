//! Memory of the steps that grows with the records.

use crate::data::DataSet;
use crate::data::memory::{self, TooMuch};
use crate::parallel::threads;

/// A step whose memory grows with the records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    Delay,
    Compare,
    Identify,
    /// Also `extend`, which makes the same search.
    Diagnose,
    Discover,
    Design,
}

impl Work {
    /// Its name as a command, bytes per sample, and further bytes per sample for each thread. Measured on records of
    /// 50 000 and 100 000 samples with 1 to 8 threads, rounded up; `cargo xtask memory` checks them.
    const fn need(self) -> (&'static str, u64, u64) {
        match self {
            Self::Delay => ("delay", 200, 0),
            Self::Compare => ("compare", 300, 0),
            Self::Identify => ("identify", 1000, 100),
            Self::Diagnose => ("a search for effects", 600, 150),
            Self::Discover => ("discover", 700, 800),
            Self::Design => ("design", 600, 150),
        }
    }

    /// Checks that the step fits in the memory limit with the records of `set`.
    ///
    /// # Errors
    /// [`TooMuch`] with the need.
    pub(super) fn fits(self, set: &DataSet) -> Result<(), TooMuch> {
        let samples: usize = set.records.iter().map(|record| record.len()).sum();
        self.fits_samples(samples as u64, threads() as u64)
    }

    fn fits_samples(self, samples: u64, threads: u64) -> Result<(), TooMuch> {
        let (name, fixed, each) = self.need();
        memory::allow(
            samples * (fixed + each * threads),
            &format!("{name} on {samples} samples"),
            "use fewer or shorter records",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_that_do_not_fit_are_refused_with_the_need() {
        assert_eq!(Work::Identify.fits_samples(80_000, 64), Ok(()));
        let error = Work::Compare.fits_samples(10_000_000, 2).unwrap_err();
        assert_eq!(
            error.to_string(),
            "compare on 10000000 samples needs 3.0 GB of memory, but 2.0 GB are allowed; use fewer or shorter \
             records, or allow more with --memory 3"
        );
        let (few, many) = (2, 64);
        assert_eq!(Work::Discover.fits_samples(500_000, few), Ok(()));
        assert!(Work::Discover.fits_samples(500_000, many).is_err());
    }
}
