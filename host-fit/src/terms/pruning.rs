//! The end of a search: terms that are not needed are dropped.

use super::RULES;
use super::evidence::p_value;
use super::hypothesis::Hypothesis;
use super::search::Search;
use super::term::Term;
use crate::fit::{FitOptions, fit};
use crate::parallel;

impl Search<'_> {
    /// The effects of a hypothesis with the lags of `root`; `None` if it has no other terms. Lags that were chosen
    /// before an effect was in the model imitate it.
    pub(super) fn without_lags(
        &self,
        hypothesis: &Hypothesis,
        root: &Hypothesis,
    ) -> Option<Hypothesis> {
        let (terms, lags): (Vec<Term>, Vec<Term>) = hypothesis
            .terms
            .iter()
            .cloned()
            .partition(|term| term.effect().is_some());
        if terms.is_empty() || lags.is_empty() || self.interrupted() {
            return None;
        }
        let own = hypothesis.judged.model().clone();
        let bare = root.judged.model();
        let model = lags
            .iter()
            .rev()
            .fold(own, |m, term| term.taken_from(&m, bare));
        let judged = self.judge.refitted(&model).ok()?;
        Some(Hypothesis {
            terms,
            ..Hypothesis::new(judged)
        })
    }

    /// Drops the terms that are not needed. A term that is needed in a larger model is needed in a smaller
    /// one and is not tested again.
    pub(super) fn pruned(&self, mut hypothesis: Hypothesis, root: &Hypothesis) -> Hypothesis {
        let mut open: Vec<usize> = (0..hypothesis.terms.len()).collect();
        while !open.is_empty() && !self.interrupted() {
            let needless: Vec<(usize, Hypothesis)> = parallel::some(&open, |index| {
                Some((*index, self.as_well_without(&hypothesis, *index, root)?))
            });
            open = needless.iter().map(|(index, _)| *index).collect();
            let by_score = |a: &(usize, Hypothesis), b: &(usize, Hypothesis)| {
                a.1.score().total_cmp(&b.1.score())
            };
            let Some((dropped, lesser)) = needless.into_iter().min_by(by_score) else {
                break;
            };
            hypothesis = lesser;
            open.retain(|index| *index != dropped);
            let moved = open.iter_mut().filter(|index| **index > dropped);
            moved.for_each(|index| *index -= 1);
        }
        hypothesis
    }

    /// The hypothesis refitted without one of its terms, if that term is not needed.
    fn as_well_without(
        &self,
        hypothesis: &Hypothesis,
        index: usize,
        root: &Hypothesis,
    ) -> Option<Hypothesis> {
        let own = hypothesis.judged.rmse();
        let price = |cost: usize| RULES.price * cost.max(RULES.head_start) as f64;
        let cost = hypothesis.terms[index].cost();
        // A few iterations identify the terms that are clearly needed.
        let model =
            hypothesis.terms[index].taken_from(hypothesis.judged.model(), root.judged.model());
        let options = FitOptions {
            iterations: RULES.brief,
            ..self.judge.options_for(&model)
        };
        let brief = fit(&model, &self.judge.learning(0), &options).ok()?;
        let after = self.judge.held_out(|_| &brief.model).ok()?;
        if (after.rmse() / own).ln() > RULES.far_from_needless * price(cost)
            && p_value(&after, &hypothesis.judged.held_out) <= RULES.level
        {
            return None;
        }
        let lesser = self.less(hypothesis, index, &brief.model)?;
        let p = p_value(&lesser.judged.held_out, &hypothesis.judged.held_out);
        let loss = (lesser.judged.rmse() / own).ln();
        let needless = loss < price(cost) || p > RULES.level;
        (needless && !lesser.reaches_a_bound()).then_some(lesser)
    }
}
