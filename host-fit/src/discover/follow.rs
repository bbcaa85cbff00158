//! Refits of promising curves: the model is refitted with each curve, the flow's lags are searched again, and the
//! term's coordinate is chosen again with those lags.

use super::RULES;
use super::candidate::{Candidate, best, best_of_each_place};
use super::finder::Finder;
use super::place::{Entry, Place};
use super::screening::{Context, Screened, diverse, reference};
use super::term::Term;
use crate::fit::{Fit, FitOptions, fit};
use crate::model::Model;
use crate::order;
use crate::parallel;
use crate::terms::{self, Hypothesis};
use std::sync::atomic::Ordering;

/// A base model with a term, fitted for a few iterations.
struct Tried {
    term: Term,
    brief: Fit,
    /// The memory terms of the base.
    memory: Vec<terms::Term>,
}

/// Group of a candidate for comparison: its place, the number of terms of the base, and the catalogue's delay
/// law if the base has one.
type Kind = (Place, usize, Option<&'static str>);

fn kind(term: &Term, memory: &[terms::Term], model: &Model) -> Kind {
    (term.entry.place(), memory.len(), model.delay.effect_name())
}

/// Selection of candidates for further fitting: the leading ones, the best at each place, and the best for each
/// base. A brief fit does not rank base models fairly: a low-order base needs more iterations, and a high-order one
/// has adapted to a wrong term.
struct Heirs {
    free: usize,
    taken: Vec<Kind>,
}

impl Heirs {
    fn of(free: usize) -> Self {
        Self {
            free,
            taken: Vec::new(),
        }
    }

    fn takes(&mut self, (place, terms, law): Kind) -> bool {
        let new_place = self.taken.iter().all(|other| other.0 != place);
        let new_base = self
            .taken
            .iter()
            .all(|other| (other.1, other.2) != (terms, law));
        let taken = self.free > 0 || new_place || new_base;
        self.free = self.free.saturating_sub(1);
        if taken {
            self.taken.push((place, terms, law));
        }
        taken
    }
}

impl Finder<'_> {
    /// The fitted terms of some curves, each in its model. If a model is at the noise level, only its term is returned.
    pub(super) fn followed(
        &self,
        curves: Vec<(&Hypothesis, Screened)>,
        number: usize,
    ) -> Vec<Candidate> {
        let progress = self.search.progress;
        progress(&format!("term {number}: refitting {} curves", curves.len()));
        let tried = parallel::some(curves, |(beside, curve)| self.tried(beside, curve));
        let mut all = self.finished(tried);
        progress(&format!("term {number}: searching the flow's lags again"));
        for candidate in self.leading(&mut all) {
            let with = self.search.run(candidate.with, None).best;
            let followed = Candidate::of(candidate.term, with);
            // No candidate can be better than one at the noise level; equivalent alternatives are
            // searched later.
            if self.at_the_floor(&followed) {
                return vec![followed];
            }
            all.push(followed);
        }
        progress(&format!("term {number}: choosing its coordinate again"));
        for index in best_of_each_place(&mut all) {
            let least = all.iter().map(Candidate::size);
            let least = least.fold(f64::INFINITY, f64::min);
            if let Some(settled) = self.settled(all[index].clone(), least, number) {
                if self.at_the_floor(&settled) {
                    return vec![settled];
                }
                all.push(settled);
            }
        }
        let mut contenders = best_of_each_place(&mut all);
        let reach = all.first().map_or(0.0, Candidate::size) + RULES.contends.ln();
        contenders.retain(|index| all[*index].size() < reach);
        if contenders.len() > 1 {
            progress(&format!(
                "term {number}: formulas of {} places",
                contenders.len()
            ));
            for index in contenders {
                all[index].formula = self.formula(&all[index].term, &all[index].with.judged);
            }
        }
        all
    }

    /// Whether the model with this candidate is at the noise level.
    fn at_the_floor(&self, candidate: &Candidate) -> bool {
        let judge = self.search.judge;
        judge.over_noise(candidate.with.judged.rmse()) < RULES.at_the_floor
    }

    /// Candidates for which the flow's lags are searched again: first those at the noise level and those on the
    /// lowest-order base. On a high-order base the error is small with any term, because its lags imitate the right
    /// one.
    fn leading(&self, all: &mut [Candidate]) -> Vec<Candidate> {
        order::ascending(all, Candidate::size);
        let mut leading: Vec<Candidate> = Vec::new();
        let mut heirs = Heirs::of(RULES.settled);
        for one in all {
            let own = kind(&one.term, &one.with.terms, one.with.judged.model());
            if !leading.iter().any(|other| one.is_twin(other)) && heirs.takes(own) {
                leading.push(one.clone());
            }
        }
        leading.sort_by_key(|one| (!self.at_the_floor(one), one.with.terms.len()));
        leading
    }

    /// A term with its lags, fitted further: the coordinate is chosen again with these lags, then the lags with the
    /// coordinate. This continues while the error falls and remains within reach of the best. On a low-order base a
    /// wrong coordinate may imitate missing lags.
    fn settled(&self, from: Candidate, least: f64, number: usize) -> Option<Candidate> {
        let reach = least + RULES.in_reach.ln();
        let (mut last, mut settled) = (from, None);
        for _ in 0..RULES.rounds {
            let Some(other) = self.another_coordinate(&last, number) else {
                break;
            };
            if other.size() > last.size() - RULES.twins || other.size() > reach {
                break;
            }
            let with = self.search.run(other.with.clone(), None).best;
            let followed = Candidate::of(other.term.clone(), with);
            let better = followed.size() < other.size();
            last = if better { followed } else { other };
            settled = Some(last.clone());
        }
        settled
    }

    /// The best other coordinate at the same place, on the model without this term.
    fn another_coordinate(&self, candidate: &Candidate, number: usize) -> Option<Candidate> {
        let without = self.without(candidate)?;
        let context = Context::new(self.search, without.judged.model(), number)?;
        let place = candidate.place();
        let there = Entry::ALL
            .into_iter()
            .filter(|entry| entry.place() == place);
        let others = context.closer(&there.collect::<Vec<_>>());
        let others = diverse(others, RULES.tried_leaner);
        best(&mut self.refitted(&without, others))
    }

    /// The model without the term, refitted.
    pub(super) fn without(&self, candidate: &Candidate) -> Option<Hypothesis> {
        let bare = candidate.term.taken_from(candidate.with.judged.model());
        let mut without = Hypothesis::new(self.search.judge.refitted(&bare).ok()?);
        without.terms.clone_from(&candidate.with.terms);
        Some(without)
    }

    /// Refits one model with each of these curves; returns the best.
    pub(super) fn refitted(&self, beside: &Hypothesis, curves: Vec<Screened>) -> Vec<Candidate> {
        let tried = parallel::some(curves, |curve| self.tried(beside, curve));
        self.finished(tried)
    }

    /// A model with the term, fitted for a few iterations. The fit starts with the term at 0 if its predicted values
    /// make the free run diverge.
    fn fitted(&self, model: &Model, term: &Term) -> Option<Fit> {
        if self.search.interrupt.load(Ordering::Relaxed) {
            return None;
        }
        let judge = self.search.judge;
        let learning = judge.learning(0);
        let reference = reference(&term.coordinate, &learning);
        let from = |term: &Term| {
            let with = term.added_to(model, reference)?;
            let options = FitOptions {
                iterations: terms::RULES.brief,
                ..judge.options_for(&with)
            };
            fit(&with, &learning, &options).ok()
        };
        let nothing = vec![0.0; term.values().len()];
        from(term).or_else(|| from(&term.with_values(&nothing)))
    }

    /// A model with a curve, fitted for a few iterations.
    fn tried(&self, beside: &Hypothesis, curve: Screened) -> Option<Tried> {
        let model = beside.judged.model();
        // On/off commands do not identify the response to jets of part strength, which a term at the jet
        // needs.
        let term = curve.term.with_free_time(RULES.time_of_a_curve);
        let unknown = term.entry == Entry::Jet && self.search.judge.on_off;
        let mut responses = vec![model.grading];
        if unknown {
            responses.extend(self.search.judge.other_gradings(model.grading));
        }
        let fits = parallel::some(responses, |grading| {
            let model = Model {
                grading,
                ..model.clone()
            };
            self.fitted(&model, &term)
        });
        let by_error = |a: &Fit, b: &Fit| a.mean_square().total_cmp(&b.mean_square());
        Some(Tried {
            brief: fits.into_iter().min_by(by_error)?,
            term,
            memory: beside.terms.clone(),
        })
    }

    /// The best of some brief fits, refitted in full. The refit also moves the lags of the base, which had imitated the
    /// missing term.
    fn finished(&self, tried: Vec<Tried>) -> Vec<Candidate> {
        let judge = self.search.judge;
        let mut rated: Vec<(f64, Tried)> = parallel::some(tried, |tried| {
            let rmse = judge.held_out(|_| &tried.brief.model).ok()?.rmse();
            Some((terms::size(rmse, &tried.brief.model), tried))
        });
        order::ascending(&mut rated, |one| one.0);
        let mut heirs = Heirs::of(RULES.finished);
        rated
            .retain(|(_, tried)| heirs.takes(kind(&tried.term, &tried.memory, &tried.brief.model)));
        parallel::some(rated, |(_, tried)| {
            let least = tried.memory.len();
            let with = self.search.finish(tried.memory, tried.brief, least)?;
            Some(Candidate::of(tried.term, with))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_are_followed_and_the_best_of_each_place_and_base() {
        let mut heirs = Heirs::of(2);
        let taken = [6, 6, 6, 0, 0, 3].map(|terms| heirs.takes((Place::Jet, terms, None)));
        assert_eq!(taken, [true, true, false, true, false, true]);
        assert!(heirs.takes((Place::Jet, 0, Some("edge-dependent-delay"))));
        assert!(heirs.takes((Place::Sensor, 6, None)));
        assert!(!heirs.takes((Place::Sensor, 0, None)));
    }
}
