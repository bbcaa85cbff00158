//! The end of a search: terms that are not needed are dropped, and each remaining one is exchanged for
//! others.

use super::RULES;
use super::effort::Effort;
use super::evidence::{HeldOut, p_value};
use super::hypothesis::{Hypothesis, score};
use super::screen::Screen;
use super::search::{Search, count_effects};
use super::table::Table;
use super::term::Term;
use crate::fit::{Fit, FitOptions, fit};
use crate::model::Model;
use crate::order;
use crate::parallel;
use std::cmp::Ordering;

/// An effect added to a model and fitted for a few iterations.
struct InPlace {
    term: Term,
    held_out: HeldOut,
    fit: Fit,
}

impl Search<'_> {
    /// Single terms that could replace a removed one, on the model without it, best first: one of each kind
    /// among `wanted`, and the leading effects. Only those whose validation error is within reach of `own`,
    /// the error with the removed term.
    fn in_place_of(
        &self,
        taken: &Term,
        without: &Model,
        own: f64,
        wanted: impl Fn(&Term) -> bool,
    ) -> Vec<InPlace> {
        let Ok(judged) = self.judge.refitted(without) else {
            return Vec::new();
        };
        let model = judged.model();
        let Some(screen) = Screen::new(self.judge, model) else {
            return Vec::new();
        };
        let table = Table::of(&screen, &self.known, true);
        let (mut met, mut effects) = (vec![taken.kind()], 0);
        let leading: Vec<_> = table
            .candidates
            .iter()
            .filter(|candidate| {
                let kind = candidate.term.kind();
                if met.contains(&kind) || !wanted(&candidate.term) {
                    return false;
                }
                met.push(kind);
                let is_effect = candidate.term.effect().is_some();
                effects += usize::from(is_effect);
                let left = (1.0 - candidate.held_out).max(0.0).sqrt() * judged.rmse();
                left <= RULES.promising * own && (!is_effect || effects <= RULES.in_its_place)
            })
            .collect();
        let mut tried: Vec<InPlace> = parallel::some(leading, |candidate| {
            let proposal = screen.alone(&table, candidate)?;
            let fit = self.set_out(model, &proposal, RULES.brief)?;
            let held_out = self.judge.held_out(|_| &fit.model).ok()?;
            let term = proposal.terms.into_iter().next()?;
            (held_out.rmse() < RULES.in_reach * own).then_some(InPlace {
                term,
                held_out,
                fit,
            })
        });
        let score = |other: &InPlace| score(other.held_out.rmse(), other.term.cost());
        order::ascending(&mut tried, score);
        tried
    }

    /// Replaces the terms of a hypothesis one by one where that lowers the error. Base terms and effects
    /// imitate each other, and a forward search does not correct a wrong early choice.
    pub(super) fn exchanged(
        &self,
        mut hypothesis: Hypothesis,
        root: &Hypothesis,
        effort: &mut Effort,
    ) -> Hypothesis {
        if let [Term::Effect { .. }] = hypothesis.terms[..] {
            // The first round compared all possible replacements.
            return hypothesis;
        }
        let mut done: Vec<String> = Vec::new();
        while let Some(index) = hypothesis
            .terms
            .iter()
            .position(|term| !done.contains(&term.name()))
            && self.effects
            && !self.interrupted()
            && !effort.is_spent()
        {
            let term = &hypothesis.terms[index];
            let effects = count_effects(&hypothesis.terms);
            if effects == 1
                && term.effect().is_some()
                && self.over(&hypothesis) <= RULES.at_the_floor
            {
                // No replacement lowers the error or removes a named effect.
                done.push(term.name());
                continue;
            }
            // Near the noise level, a base term is replaced only by a term with fewer parameters, or by one with
            // equally many at the same place.
            let less_only =
                term.effect().is_none() && self.over(&hypothesis) <= RULES.near_the_floor;
            (self.progress)(&format!("candidates in place of {}", term.name()));
            done.push(term.name());
            let others = effects - count_effects(std::slice::from_ref(term));
            let room = others < self.most_effects;
            let affordable = |other: &Term| match other.cost().cmp(&term.cost()) {
                Ordering::Less => true,
                Ordering::Equal => !less_only || other.place() == term.place(),
                Ordering::Greater => !less_only,
            };
            let wanted = |other: &Term| (room || other.effect().is_none()) && affordable(other);
            let without = term.taken_from(hypothesis.judged.model(), root.judged.model());
            let own = hypothesis.judged.rmse();
            let near = self.in_place_of(term, &without, own, wanted);
            near.iter().for_each(|_| effort.spend_on(&without));
            let other = near.into_iter().next().and_then(|other| {
                done.push(other.term.name());
                let mut terms = hypothesis.terms.clone();
                terms[index] = other.term;
                self.finish(terms, other.fit, hypothesis.terms.len())
            });
            let Some(other) = other else { continue };
            // A second named effect is kept only if no base model fits equally well.
            let needless = effects > 1 && count_effects(&other.terms) < effects;
            let within = if needless { RULES.as_well } else { 0.0 };
            if other.score() < hypothesis.score() + within {
                let from_given = hypothesis.from_given;
                let other = Hypothesis {
                    from_given,
                    ..other
                };
                hypothesis = self.pruned(other, root);
            }
        }
        hypothesis
    }

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
