//! Why a search ended.

use core::fmt;

/// Why a search ended. The best point so far is returned in every case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// The mesh was at one tick everywhere, every neighbour one tick away was tried and is not better, and no search
    /// step can find a better point.
    LocallyOptimal,
    /// The allowed number of evaluations was used up.
    EvaluationBudget,
    /// The caller raised the interrupt flag.
    Interrupted,
    /// No point tried had a finite value.
    NoFiniteValue,
    /// Every variable was fixed by its bounds: there was nothing to search.
    NothingToSearch,
}

impl StopReason {
    /// Whether the search ended because no neighbour is better.
    pub fn was_successful(self) -> bool {
        matches!(self, Self::LocallyOptimal | Self::NothingToSearch)
    }

    /// Whether the search ended because of the way in which it was called, not because of the data.
    pub fn was_usage_issue(self) -> bool {
        matches!(self, Self::NothingToSearch)
    }

    /// Short name for reports and machine-readable output.
    pub fn name(self) -> &'static str {
        match self {
            Self::LocallyOptimal => "locally-optimal",
            Self::EvaluationBudget => "evaluation-budget",
            Self::Interrupted => "interrupted",
            Self::NoFiniteValue => "no-finite-value",
            Self::NothingToSearch => "nothing-to-search",
        }
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::LocallyOptimal => {
                "finished: every neighbouring point was tried and none is better, and further restarts did not help"
            }
            Self::EvaluationBudget => {
                "stopped at the evaluation limit: the result may improve with more evaluations"
            }
            Self::Interrupted => "interrupted: this is the best result so far",
            Self::NoFiniteValue => {
                "no point tried gave a finite value: every candidate model diverged or could not be fitted"
            }
            Self::NothingToSearch => "nothing to search: the bounds leave a single point",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_finished_search_counts_as_success() {
        assert!(StopReason::LocallyOptimal.was_successful());
        for unfinished in [
            StopReason::EvaluationBudget,
            StopReason::Interrupted,
            StopReason::NoFiniteValue,
        ] {
            assert!(!unfinished.was_successful());
            assert!(!unfinished.was_usage_issue());
        }
        assert!(StopReason::NothingToSearch.was_usage_issue());
    }
}
