//! Fitted terms and the choice of the best.

use super::RULES;
use super::place::Place;
use super::term::Term;
use crate::order;
use crate::terms::{self, Hypothesis, Judged};

/// A fully fitted term with its model.
#[derive(Clone)]
pub(crate) struct Candidate {
    /// The term as a piecewise-linear curve.
    pub(crate) term: Term,
    pub(crate) with: Hypothesis,
    /// The term as a formula, if one was tried and fits equally well.
    pub(crate) formula: Option<(Term, Judged)>,
}

impl Candidate {
    pub(crate) fn of(term: Term, with: Hypothesis) -> Self {
        Self {
            term: term.in_model(with.judged.model()),
            with,
            formula: None,
        }
    }

    /// The curve or the formula, whichever has the smaller penalised error. A formula may have the smaller error
    /// because straight lines approximate a smooth function poorly.
    fn told(&self) -> (&Term, &Judged) {
        let curve = (&self.term, &self.with.judged);
        match &self.formula {
            Some((term, judged)) if judged.size() < curve.1.size() => (term, judged),
            _ => curve,
        }
    }

    /// The model with the curve or formula that is reported.
    pub(crate) fn judged(&self) -> &Judged {
        self.told().1
    }

    /// ln of the validation error plus the penalty of the model's parameters and of a chosen (not fitted)
    /// time constant.
    pub(crate) fn size(&self) -> f64 {
        let (term, judged) = self.told();
        let chosen = if term.has_chosen_time() {
            terms::RULES.price
        } else {
            0.0
        };
        judged.size() + chosen
    }

    pub(crate) fn place(&self) -> Place {
        self.term.entry.place()
    }

    /// Whether one term depends on the pulse length and the other on the time since the edge: these are equal during a
    /// pulse.
    pub(crate) fn is_twin(&self, other: &Self) -> bool {
        let ratio = self.with.judged.rmse() / other.with.judged.rmse();
        self.term.entry == other.term.entry && ratio - 1.0 < RULES.twins
    }
}

/// Removes and returns the best of some candidates.
pub(crate) fn best(all: &mut Vec<Candidate>) -> Option<Candidate> {
    let smaller = |a: &usize, b: &usize| all[*a].size().total_cmp(&all[*b].size());
    let index = (0..all.len()).min_by(smaller)?;
    Some(all.swap_remove(index))
}

/// Indices of the best candidate of each place, after sorting all from best to worst.
pub(crate) fn best_of_each_place(all: &mut [Candidate]) -> Vec<usize> {
    order::ascending(all, Candidate::size);
    let new = |i: &usize| {
        all[..*i]
            .iter()
            .all(|better| better.place() != all[*i].place())
    };
    (0..all.len()).filter(new).collect()
}
