//! Refits of promising curves in a model.

use super::RULES;
use super::candidate::Candidate;
use super::place::{Entry, Place};
use super::screening::{Screened, reference};
use super::term::Term;
use crate::fit::{Fit, FitOptions, fit};
use crate::model::Model;
use crate::order;
use crate::parallel;
use crate::terms::{self, Hypothesis, Search};
use std::sync::atomic::Ordering;

/// A base model with a term, fitted for a few iterations.
pub(crate) struct Tried {
    pub(crate) term: Term,
    pub(crate) brief: Fit,
    /// The memory terms of the base.
    memory: Vec<terms::Term>,
}

/// Group of a candidate for comparison: its place, the number of terms of the base, and the catalogue's delay
/// law if the base has one.
type Kind = (Place, usize, Option<&'static str>);

pub(crate) fn kind(term: &Term, memory: &[terms::Term], model: &Model) -> Kind {
    (term.entry.place(), memory.len(), model.delay.effect_name())
}

/// Selection of candidates for further fitting: the leading ones, the best at each place, and the best for each
/// base. A brief fit does not rank base models fairly: a low-order base needs more iterations, and a high-order one
/// has adapted to a wrong term.
pub(crate) struct Heirs {
    free: usize,
    taken: Vec<Kind>,
}

impl Heirs {
    pub(crate) fn of(free: usize) -> Self {
        Self {
            free,
            taken: Vec::new(),
        }
    }

    pub(crate) fn takes(&mut self, (place, terms, law): Kind) -> bool {
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

/// Refits one model with each of these curves; returns the best.
pub(crate) fn refitted(
    search: &Search<'_>,
    beside: &Hypothesis,
    curves: Vec<Screened>,
) -> Vec<Candidate> {
    followed(search, briefly(search, beside, curves))
}

/// One model with each of these curves, fitted for a few iterations, the best first.
pub(crate) fn briefly(
    search: &Search<'_>,
    beside: &Hypothesis,
    curves: Vec<Screened>,
) -> Vec<Tried> {
    let each = parallel::some(curves, |curve| tried(search, beside, curve));
    rated(search, each)
}

/// A model with the term, fitted for a few iterations. The fit starts with the term at 0 if its predicted values
/// make the free run diverge.
fn fitted(search: &Search<'_>, model: &Model, term: &Term) -> Option<Fit> {
    if search.interrupt.load(Ordering::Relaxed) {
        return None;
    }
    let judge = search.judge;
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
pub(crate) fn tried(search: &Search<'_>, beside: &Hypothesis, curve: Screened) -> Option<Tried> {
    let model = beside.judged.model();
    // On/off commands do not identify the response to jets of part strength, which a term at the jet
    // needs.
    let term = curve.term.with_free_time(RULES.time_of_a_curve);
    let unknown = term.entry == Entry::Jet && search.judge.on_off;
    let mut responses = vec![model.grading];
    if unknown {
        responses.extend(search.judge.other_gradings(model.grading));
    }
    let fits = parallel::some(responses, |grading| {
        let model = Model {
            grading,
            ..model.clone()
        };
        fitted(search, &model, &term)
    });
    let by_error = |a: &Fit, b: &Fit| a.mean_square().total_cmp(&b.mean_square());
    Some(Tried {
        brief: fits.into_iter().min_by(by_error)?,
        term,
        memory: beside.terms.clone(),
    })
}

/// Brief fits by their validation error, the best first; without those that diverge.
fn rated(search: &Search<'_>, tried: Vec<Tried>) -> Vec<Tried> {
    let mut rated: Vec<(f64, Tried)> = parallel::some(tried, |tried| {
        let rmse = search.judge.held_out(|_| &tried.brief.model).ok()?.rmse();
        Some((terms::size(rmse, &tried.brief.model), tried))
    });
    order::ascending(&mut rated, |one| one.0);
    rated.into_iter().map(|(_, tried)| tried).collect()
}

/// The best of some brief fits, refitted in full. The refit also moves the lags of the base, which had imitated the
/// missing term.
pub(crate) fn finished(search: &Search<'_>, tried: Vec<Tried>) -> Vec<Candidate> {
    followed(search, rated(search, tried))
}

fn followed(search: &Search<'_>, mut rated: Vec<Tried>) -> Vec<Candidate> {
    let mut heirs = Heirs::of(RULES.finished);
    rated.retain(|tried| heirs.takes(kind(&tried.term, &tried.memory, &tried.brief.model)));
    parallel::some(rated, |tried| {
        let least = tried.memory.len();
        let with = search.finish(tried.memory, tried.brief, least)?;
        Some(Candidate::of(tried.term, with))
    })
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
