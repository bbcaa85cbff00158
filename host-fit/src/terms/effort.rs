//! The end of a search. It is measured by the number of refitted parameters, because a limit in seconds would
//! depend on the machine.

use super::RULES;
use crate::model::Model;

/// The remaining effort of a search: parameters of the models that it may refit.
#[derive(Debug)]
pub struct Effort {
    left: f64,
}

impl Effort {
    /// The effort of one search, or of several that share it.
    #[must_use]
    pub fn of_a_search() -> Self {
        Self { left: RULES.effort }
    }

    /// Counts a refit of this model.
    pub(super) fn spend_on(&mut self, model: &Model) {
        self.left -= model.coordinates().len() as f64;
    }

    /// Whether no further models are tried.
    #[must_use]
    pub fn is_spent(&self) -> bool {
        self.left <= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};

    #[test]
    fn a_large_model_spends_more_than_a_small_one() {
        let refits = |model: &Model| {
            let mut effort = Effort::of_a_search();
            let spent = (1..).find(|_| {
                effort.spend_on(model);
                effort.is_spent()
            });
            spent.expect("an end")
        };
        let small = base(&records(&[], &[], 1));
        let mut large = small.clone();
        for _ in 0..small.coordinates().len() {
            large.state_lags.push(40);
            large.a.push(0.0);
        }
        let (few, many) = (refits(&large), refits(&small));
        assert!(
            few > 20 && (2 * few - 1..=2 * few).contains(&many),
            "{few} {many}"
        );
    }
}
