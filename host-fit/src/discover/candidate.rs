//! A term that was fitted to the end, and the best of many.

use super::RULES;
use super::place::Place;
use super::term::Term;
use crate::terms::{self, Hypothesis, Judged};

/// A term and the model with it, fitted to the end.
#[derive(Clone)]
pub(super) struct Candidate {
    /// Its curve.
    pub(super) term: Term,
    pub(super) with: Hypothesis,
    /// The same as a formula, where one was looked for and does as well.
    pub(super) formula: Option<(Term, Judged)>,
}

impl Candidate {
    pub(super) fn of(term: Term, with: Hypothesis) -> Self {
        Self {
            term: term.in_model(with.judged.model()),
            with,
            formula: None,
        }
    }

    /// As a curve or as a formula, whichever is better: what is smooth, straight lines leave some of.
    fn told(&self) -> (&Term, &Judged) {
        let curve = (&self.term, &self.with.judged);
        match &self.formula {
            Some((term, judged)) if judged.size() < curve.1.size() => (term, judged),
            _ => curve,
        }
    }

    /// The model as it is told.
    pub(super) fn judged(&self) -> &Judged {
        self.told().1
    }

    /// ln of the held-out error, and the price of the model's parameters and of a time that was chosen and not fitted.
    pub(super) fn size(&self) -> f64 {
        let (term, judged) = self.told();
        let chosen = if term.has_chosen_time() {
            terms::RULES.price
        } else {
            0.0
        };
        judged.size() + chosen
    }

    pub(super) fn place(&self) -> Place {
        self.term.entry.place()
    }

    /// While it blows, the length of this pulse is the time since its edge.
    pub(super) fn is_twin(&self, other: &Self) -> bool {
        let ratio = self.with.judged.rmse() / other.with.judged.rmse();
        self.term.entry == other.term.entry && ratio - 1.0 < RULES.twins
    }
}

/// The best of some, taken from them.
pub(super) fn best(all: &mut Vec<Candidate>) -> Option<Candidate> {
    let smaller = |a: &usize, b: &usize| all[*a].size().total_cmp(&all[*b].size());
    let index = (0..all.len()).min_by(smaller)?;
    Some(all.swap_remove(index))
}

/// Where the best of each place are once all are sorted, the best first.
pub(super) fn best_of_each_place(all: &mut [Candidate]) -> Vec<usize> {
    all.sort_by(|a, b| a.size().total_cmp(&b.size()));
    let new = |i: &usize| {
        all[..*i]
            .iter()
            .all(|better| better.place() != all[*i].place())
    };
    (0..all.len()).filter(new).collect()
}
