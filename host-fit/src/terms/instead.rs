//! Effects in place of several base terms at once.
//!
//! Lags and curves that were chosen before an effect was in the model imitate it, and no exchange of one term for
//! another undoes this. Each effect is therefore fitted without the base terms, which then return with
//! coefficients of 0. Those that are not needed beside the effect are dropped: first by a first-order prediction,
//! then, for the effects with the best scores, by refits.

use super::RULES;
use super::hypothesis::{Hypothesis, score};
use super::proposal::Proposal;
use super::screen::Screen;
use super::search::{Found, Search};
use super::table::Table;
use super::term::Term;
use crate::fit::{Fit, FitOptions, fit, settle_fixed_delay};
use crate::model::Model;
use crate::order;
use crate::parallel;
use model_core::effect::Place;
use numerics::linalg::{dot, solve_symmetric};

/// An effect together with the base terms that are predicted to be needed with it.
struct Begun {
    terms: Vec<Term>,
    fit: Fit,
    /// Predicted score.
    score: f64,
}

impl Found {
    /// The result of a search from the given structure, in terms on top of `lean`. `None` if it has others.
    fn on_top_of(&self, lean: &Hypothesis) -> Option<Self> {
        Some(Self {
            root: lean.clone(),
            best: self.best.on_top_of(lean)?,
            bare: self.bare.on_top_of(lean)?,
            all: (self.all.iter())
                .filter_map(|one| one.on_top_of(lean))
                .collect(),
            tried: self.tried,
        })
    }
}

impl Search<'_> {
    /// [`with_effects_instead`](Self::with_effects_instead), also for the base terms of a given structure from which the
    /// search started. `lean` is the model of the lowest order.
    pub(crate) fn with_effects_instead_of_given(&self, found: &mut Found, lean: &Hypothesis) {
        let anew = found.root.is_given().then(|| found.on_top_of(lean));
        let Some(mut anew) = anew.flatten() else {
            return self.with_effects_instead(found);
        };
        let before = anew.best.score();
        self.with_effects_instead(&mut anew);
        if anew.best.score() < before {
            *found = anew;
        }
    }

    /// Replaces base terms of the best hypothesis by effects, one after the other, as long as that lowers the score and
    /// the hypothesis has no effect or an error clearly above the noise.
    fn with_effects_instead(&self, found: &mut Found) {
        while (found.best.is_bare() || self.over(&found.best) > RULES.near_the_floor)
            && let Some(better) = self.with_an_effect_instead(found)
        {
            found.all.push(better.clone());
            found.best = better;
        }
    }

    /// The best hypothesis with one more effect and fewer base terms; `None` if none has a lower score.
    fn with_an_effect_instead(&self, found: &mut Found) -> Option<Hypothesis> {
        let (hypothesis, root) = (&found.best, &found.root);
        let is_effect = |term: &Term| term.effect().is_some();
        let (effects, bases): (Vec<Term>, Vec<Term>) =
            hypothesis.terms.iter().cloned().partition(is_effect);
        let full = effects.len() >= self.most_effects;
        if !self.effects || full || bases.is_empty() || self.interrupted() {
            return None;
        }
        (self.progress)("effects in place of base terms");
        let own = hypothesis.judged.model();
        let lean = match effects.is_empty() {
            true => root.judged.clone(),
            false => {
                let add = |model: Model, term: &Term| term.as_in(own).added_to(&model, &[]);
                let lean = effects.iter().fold(root.judged.model().clone(), add);
                self.judge.refitted(&lean).ok()?
            }
        };
        let proposals = self.each_effect(lean.model());
        let alone = parallel::some(&proposals, |proposal| self.alone(lean.model(), proposal));
        // A delay by whole samples has no derivative, so a fit that starts with a term in the jet path keeps this term.
        // Effects are therefore fitted without such terms, too.
        let in_the_jet = |term: &Term| term.place() == Some(Place::Jet);
        let mut bases = vec![bases];
        if bases[0].iter().any(in_the_jet) {
            let others = bases[0].iter().filter(|term| !in_the_jet(term));
            bases.push(others.cloned().collect());
        }
        let pairs = alone
            .iter()
            .flat_map(|alone| bases.iter().map(move |bases| (alone, bases)));
        let pairs: Vec<_> = pairs.collect();
        let mut begun = parallel::some(&pairs, |((with, added), bases)| {
            let effects = [effects.as_slice(), added].concat();
            self.begun(hypothesis, &effects, bases, lean.model(), with)
        });
        order::ascending(&mut begun, |one| one.score);
        begun.truncate(RULES.finished);
        found.tried += begun.len();
        let finished = parallel::some(begun, |begun| {
            self.finish(begun.terms, begun.fit, effects.len() + 1)
        });
        let pruned = finished
            .into_iter()
            .map(|finished| self.pruned(finished, root))
            .filter(|pruned| !pruned.reaches_a_bound());
        let best = pruned.min_by(|a, b| a.score().total_cmp(&b.score()))?;
        (best.score() < hypothesis.score()).then_some(Hypothesis {
            from_given: hypothesis.from_given,
            ..best
        })
    }

    /// Each effect of the catalogue at the grid point with the largest predicted gain on `model`.
    fn each_effect(&self, model: &Model) -> Vec<Proposal> {
        let Some(screen) = Screen::new(self.judge, model) else {
            return Vec::new();
        };
        let table = Table::of(&screen, &self.known, true);
        let mut met: Vec<&str> = Vec::new();
        let mut all: Vec<Proposal> = Vec::new();
        for candidate in &table.candidates {
            let Some(spec) = candidate.term.effect() else {
                continue;
            };
            if !met.contains(&spec.name) {
                met.push(spec.name);
                all.extend(screen.alone(&table, candidate));
            }
        }
        let anew = model
            .candidates()
            .filter(|spec| self.is_fitted_anew(model, spec));
        let others = self
            .unseen(&screen)
            .chain(anew.map(|spec| Proposal::unrated(spec, model)));
        for proposal in others {
            let Some(spec) = proposal.terms.iter().find_map(Term::effect) else {
                continue;
            };
            if !met.contains(&spec.name) {
                met.push(spec.name);
                all.push(proposal);
            }
        }
        all
    }

    /// `lean` with the effect of a proposal, fitted briefly, and the effect as fitted.
    fn alone(&self, lean: &Model, proposal: &Proposal) -> Option<(Model, Vec<Term>)> {
        if self.interrupted() {
            return None;
        }
        let fit = match &proposal.terms[..] {
            [Term::Effect { spec, .. }] if self.is_fitted_anew(lean, spec) => {
                self.fitted_anew(lean, spec, &self.brief_for(lean))?
            }
            _ => self.set_out(lean, proposal, RULES.brief)?,
        };
        let added = proposal.terms.iter().map(|term| term.as_in(&fit.model));
        let added = added.collect();
        Some((fit.model, added))
    }

    fn brief_for(&self, model: &Model) -> FitOptions {
        FitOptions {
            iterations: RULES.brief,
            ..self.judge.options_for(model)
        }
    }

    /// The fit of `with`, which has these `effects`, with the base terms of `hypothesis` that are predicted to be needed.
    fn begun(
        &self,
        hypothesis: &Hypothesis,
        effects: &[Term],
        bases: &[Term],
        lean: &Model,
        with: &Model,
    ) -> Option<Begun> {
        if self.interrupted() {
            return None;
        }
        let learning = self.judge.learning(0);
        let briefly = |model: &Model| fit(model, &learning, &self.brief_for(model)).ok();
        let own = hypothesis.judged.model();
        let bases: Vec<Term> = bases.iter().map(|term| term.as_in(own)).collect();
        let returned = bases
            .iter()
            .fold(with.clone(), |model, term| term.added_to(&model, &[]));
        let joint = briefly(&returned)?;
        let before = hypothesis.judged.fits[0].mean_square().sqrt();
        let is_within = |fit: &Fit, factor: f64| fit.mean_square().sqrt() <= factor * before;
        if !is_within(&joint, RULES.promising) {
            return None;
        }
        let joint = briefly(&joint.model)?;
        if !is_within(&joint, RULES.in_reach) {
            return None;
        }
        let joint = settle_fixed_delay(joint, &learning, &self.brief_for(&returned)).ok()?;
        let screen = Screen::new(self.judge, &joint.model)?;
        let (needless, loss) = screen.needless(&bases, lean, joint.sum_of_squares);
        let mut model = joint.model.clone();
        for term in needless.iter().rev().map(|index| &bases[*index]) {
            model = term.taken_from(&model, lean);
        }
        let needed = (0..bases.len()).filter(|index| !needless.contains(index));
        let needed = needed.map(|index| bases[index].clone());
        let terms: Vec<Term> = effects.iter().cloned().chain(needed).collect();
        let rmse = self.judge.held_out(|_| &joint.model).ok()?.rmse();
        let cost: usize = terms.iter().map(Term::cost).sum();
        Some(Begun {
            score: score(rmse, cost) + loss,
            fit: briefly(&model)?,
            terms,
        })
    }
}

impl Screen<'_> {
    /// The `terms` of this model that are not needed by a first-order prediction, and by how much ln of the error then
    /// rises. A term is not needed if its penalty is larger than the rise. `sum` is the sum of squares of the error.
    ///
    /// Removing terms changes the free run by Σd. The other parameters compensate part of Σd, and the remaining part
    /// raises the sum of squares.
    fn needless(&self, terms: &[Term], lean: &Model, sum: f64) -> (Vec<usize>, f64) {
        /// The change of the free run when a term is taken away.
        struct Taken {
            index: usize,
            /// Coordinates of the term; these cannot compensate its removal.
            coordinates: Vec<usize>,
            /// Components along the basis.
            along: Vec<f64>,
            /// The remainder, outside the basis.
            rest: Vec<f64>,
        }
        let taken = parallel::some(0..terms.len(), |index| {
            let term = &terms[index];
            let mut rest = self.change(&term.taken_from(self.model(), lean))?;
            let along = self.residualise(&mut rest);
            rest.truncate(self.learned);
            let coordinates = term.coordinates_in(self.model());
            Some(Taken {
                index,
                coordinates,
                along,
                rest,
            })
        });
        let products: Vec<Vec<f64>> = taken
            .iter()
            .map(|a| taken.iter().map(|b| dot(&a.rest, &b.rest)).collect())
            .collect();
        let loss = |set: &[usize]| {
            let mut outside = 0.0;
            set.iter()
                .for_each(|i| set.iter().for_each(|j| outside += products[*i][*j]));
            let own: Vec<usize> = set
                .iter()
                .flat_map(|i| &taken[*i].coordinates)
                .copied()
                .collect();
            let mut along = vec![0.0; self.basis.len()];
            for i in set {
                let pairs = along.iter_mut().zip(&taken[*i].along);
                pairs.for_each(|(sum, x)| *sum += x);
            }
            let raised = outside + self.left_by_others(&along, &own);
            0.5 * (raised * self.stride as f64 / sum.max(f64::MIN_POSITIVE)).ln_1p()
        };
        let price = |set: &[usize]| {
            let cost: usize = set.iter().map(|i| terms[taken[*i].index].cost()).sum();
            RULES.price * cost as f64
        };
        let mut set: Vec<usize> = Vec::new();
        loop {
            let others = (0..taken.len()).filter(|i| !set.contains(i));
            let with = others.map(|i| {
                let with = [set.as_slice(), &[i]].concat();
                (loss(&with) - price(&with), with)
            });
            let Some((gain, with)) = with.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                break;
            };
            if gain >= loss(&set) - price(&set) {
                break;
            }
            set = with;
        }
        let mut dropped: Vec<usize> = set.iter().map(|i| taken[*i].index).collect();
        dropped.sort_unstable();
        (dropped, loss(&set))
    }

    /// Squared length of the part of a change along the basis that remains after all parameters except those
    /// with these coordinates have compensated it.
    fn left_by_others(&self, along: &[f64], without: &[usize]) -> f64 {
        let free = self.made_by.iter().enumerate();
        let columns: Vec<Vec<f64>> = free
            .filter(|(_, (index, _))| !without.contains(index))
            .map(|(_, (_, made))| {
                let mut column = made.clone();
                column.resize(self.made_by.len(), 0.0);
                column
            })
            .collect();
        // Fixed delays, which are the last directions, can compensate it too.
        let along = &along[..self.made_by.len()];
        let n = columns.len();
        let products: Vec<f64> = (0..n * n)
            .map(|at| {
                let ridge = if at / n == at % n { 1.0 + 1e-12 } else { 1.0 };
                ridge * dot(&columns[at / n], &columns[at % n])
            })
            .collect();
        let right: Vec<f64> = columns.iter().map(|column| dot(column, along)).collect();
        let whole = dot(along, along);
        let Some(scale) = solve_symmetric(&products, &right) else {
            return whole;
        };
        (whole - dot(&scale, &right)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};
    use crate::terms::Bench;
    use std::sync::atomic::AtomicBool;

    /// Two lags imitate a valve that opens and closes with different lags. No exchange of one lag for the valve has a
    /// lower score, because the other lag still imitates it. It makes no difference whether the search found the lags or
    /// they were given.
    #[test]
    fn an_effect_takes_the_place_of_the_lags_that_imitate_it() {
        let records = records(&["valve-lag"], &[], 3);
        let bench = Bench::of(&base(&records), &records).expect("records to learn from");
        let never = AtomicBool::new(false);
        let search = Search::silent(&bench.judge, 1, &never);
        let root = Hypothesis::new(bench.judge.refitted(&bench.given).expect("stable"));
        let bases = Search {
            effects: false,
            known: search.known.clone(),
            ..search
        };
        let imitation = bases.run(root.clone(), None).best;
        assert!(imitation.terms.len() > 1, "{}", imitation.words());
        let searched = Found {
            root: root.clone(),
            best: imitation.clone(),
            ..imitation.clone().alone()
        };
        let given = Hypothesis::of_given(imitation.judged.clone()).alone();
        for mut found in [searched, given] {
            search.with_effects_instead_of_given(&mut found, &root);
            let found = found.best;
            let names: Vec<&str> = found
                .terms
                .iter()
                .filter_map(Term::effect)
                .map(|effect| effect.name)
                .collect();
            assert_eq!(names, ["valve-lag"], "{}", found.words());
            // One of the terms is the effect.
            assert!(
                found.terms.len() <= imitation.terms.len(),
                "{}",
                found.words()
            );
            assert!(found.score() < imitation.score());
        }
    }
}
