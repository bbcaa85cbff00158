//! Full refit of a proposal: starts from the screening's prediction, moves the lags to the least error, and
//! leaves out effects at a bound of their range.

use super::RULES;
use super::grid::{hides, longest_lag};
use super::hypothesis::Hypothesis;
use super::proposal::Proposal;
use super::screen::Screen;
use super::search::Search;
use super::table::path_terms;
use super::term::Term;
use crate::fit::{Fit, FitOptions, fit, settle_fixed_delay, starts};
use crate::model::Model;
use crate::order;
use crate::parallel;

impl Search<'_> {
    /// The first fit of a proposal, from the screening's prediction; from several starts if the error has
    /// several minima.
    pub(crate) fn set_out(
        &self,
        model: &Model,
        proposal: &Proposal,
        iterations: usize,
    ) -> Option<Fit> {
        let others = self.valleys(model, &proposal.terms);
        let all: Vec<&[Term]> = match &others[..] {
            [] => vec![&proposal.terms],
            others => others.iter().map(Vec::as_slice).collect(),
        };
        // Only the best of many starts are fitted further.
        let many = all.len() > RULES.followed;
        let first = if many { iterations / 2 } else { iterations };
        let mut fits = parallel::some(all, |terms| {
            self.set_out_from(model, proposal, terms, first)
        });
        let better = |a: &Fit, b: &Fit| a.mean_square().total_cmp(&b.mean_square());
        order::ascending(&mut fits, Fit::mean_square);
        if many {
            fits.truncate(RULES.followed);
            let learning = self.judge.learning(0);
            fits = parallel::each(fits, |begun| {
                let options = FitOptions {
                    iterations: iterations - first,
                    ..self.judge.options_for(&begun.model)
                };
                fit(&begun.model, &learning, &options).unwrap_or(begun)
            });
        }
        fits.into_iter().min_by(better)
    }

    /// The terms at further starting points; none where one start is enough.
    fn valleys(&self, model: &Model, terms: &[Term]) -> Vec<Vec<Term>> {
        if terms.iter().any(|term| matches!(term, Term::Inertia(_))) {
            let second = RULES.second_lags.into_iter().map(|samples| {
                let other = |term: &Term| match term {
                    Term::Inertia(_) => Term::Inertia(samples),
                    term => term.clone(),
                };
                terms.iter().map(other).collect()
            });
            return second.collect();
        }
        let path = terms.iter().position(|t| matches!(t, Term::Path { .. }));
        if let Some((at, Term::Path { spec, .. })) = path.map(|at| (at, &terms[at])) {
            let others = path_terms(spec).into_iter().map(|other| {
                let mut terms = terms.to_vec();
                terms[at] = other;
                terms
            });
            return others.collect();
        }
        match terms {
            [term @ Term::Effect { spec, .. }] if hides(spec) => {
                let starts = starts(model, spec, &self.judge.learning(0)).into_iter();
                let others = starts.map(|start| vec![term.with_parameters(start)]);
                std::iter::once(terms.to_vec()).chain(others).collect()
            }
            _ => Vec::new(),
        }
    }

    fn set_out_from(
        &self,
        model: &Model,
        proposal: &Proposal,
        terms: &[Term],
        iterations: usize,
    ) -> Option<Fit> {
        let learning = self.judge.learning(0);
        let with = |bold: bool| {
            let pairs = terms.iter().zip(&proposal.coefficients);
            let all = pairs.fold(model.clone(), |model, (term, coefficients)| {
                term.added_to(&model, if bold { coefficients } else { &[] })
            });
            let options = FitOptions {
                iterations,
                ..self.judge.options_for(&all)
            };
            fit(&all, &learning, &options)
        };
        // First-order coefficients may make the free run diverge; the fit then starts from 0.
        with(true).or_else(|_| with(false)).ok()
    }

    /// Completes a fit: moves lags and fixed delays to the least error, fits and scores all folds. Effects at
    /// a bound of their range are left out, since the other terms may still be right. `None` if fewer than
    /// `least` terms remain.
    pub(crate) fn finish(&self, terms: Vec<Term>, brief: Fit, least: usize) -> Option<Hypothesis> {
        let (fitted, terms) = self.settled_fit(terms, &brief)?;
        let (bent, kept) = bent_and_kept(&fitted, terms);
        if kept.len() < least {
            return None;
        }
        if !bent.is_empty() {
            let rest = self.without_bent(&fitted, &bent)?;
            return self.finish(kept, rest, least);
        }
        let judged = self.judge.judged_from(fitted).ok()?;
        Some(Hypothesis {
            terms: kept,
            ..Hypothesis::new(judged)
        })
    }

    /// Like `finish`, and if an effect is at a bound, also the hypothesis with that effect: if the base model lacks
    /// terms, the right effect may go to a bound and leave it when a further term is added.
    pub(super) fn finish_with_bent(
        &self,
        terms: Vec<Term>,
        brief: Fit,
        least: usize,
    ) -> Vec<Hypothesis> {
        let Some((fitted, terms)) = self.settled_fit(terms, &brief) else {
            return Vec::new();
        };
        let (bent, kept) = bent_and_kept(&fitted, terms.clone());
        let rest = match bent.is_empty() || kept.len() < least {
            true => None,
            false => self.without_bent(&fitted, &bent),
        };
        let rest = rest.and_then(|rest| self.finish(kept, rest, least));
        let whole = self.judge.judged_from(fitted).ok();
        let whole = whole.map(|judged| Hypothesis {
            terms,
            bent: !bent.is_empty(),
            ..Hypothesis::new(judged)
        });
        whole.into_iter().chain(rest).collect()
    }

    /// The fit with its lags and delays at the least error, and the terms with these lags.
    fn settled_fit(&self, mut terms: Vec<Term>, brief: &Fit) -> Option<(Fit, Vec<Term>)> {
        let learning = self.judge.learning(0);
        let options = self.judge.options_for(&brief.model);
        let fitted = fit(&brief.model, &learning, &options).ok()?;
        let fitted = self.settle_lags(fitted, &mut terms);
        let fitted = settle_fixed_delay(fitted, &learning, &options).ok()?;
        Some((fitted, terms))
    }

    /// A fit without the terms at a bound.
    fn without_bent(&self, fitted: &Fit, bent: &[Term]) -> Option<Fit> {
        let end = &fitted.model;
        let rest = bent
            .iter()
            .fold(end.clone(), |m, term| term.taken_from(&m, end));
        let options = self.judge.options_for(&rest);
        fit(&rest, &self.judge.learning(0), &options).ok()
    }

    /// Moves all lags to the least error by Gauss–Newton steps in lags and parameters together; the
    /// parameters are refitted briefly after each. A step that does not lower the error is halved.
    fn settle_lags(&self, fitted: Fit, terms: &mut [Term]) -> Fit {
        let learning = self.judge.learning(0);
        let shortest = learning.iter().map(|r| r.len()).min().unwrap_or(0);
        let longest = longest_lag(fitted.model.sample_period_s, shortest);
        let (mut model, mut least) = (fitted.model.clone(), fitted.mean_square());
        let mut settled = terms.to_vec();
        for _ in 0..RULES.lag_rounds {
            let Some(screen) = Screen::new(self.judge, &model) else {
                break;
            };
            let moves = screen.moves_of(&settled);
            let mut steps = moves.steps.clone();
            let mut better = None;
            while better.is_none() && steps.iter().any(|step| *step != 0) && !self.interrupted() {
                let (moved, lags) = moved(&model, &settled, &steps, longest);
                let moved = moved.with_values(&screen.values_with(&moves, &steps));
                let options = FitOptions {
                    iterations: RULES.lag_iterations,
                    ..self.judge.options_for(&moved)
                };
                let end = fit(&moved, &learning, &options).ok();
                better = end
                    .filter(|end| end.mean_square() < least * (1.0 - RULES.lag_gain))
                    .map(|end| (end, lags));
                steps.iter_mut().for_each(|step| *step /= 2);
            }
            let Some((end, lags)) = better else {
                break;
            };
            (least, model, settled) = (end.mean_square(), end.model, lags);
        }
        if least >= fitted.mean_square() {
            return fitted;
        }
        match fit(&model, &learning, &self.judge.options_for(&model)) {
            Ok(end) if end.mean_square() < fitted.mean_square() => {
                terms.clone_from_slice(&settled);
                end
            }
            _ => fitted,
        }
    }
}

/// A model with the lags of its terms moved, and the terms.
fn moved(model: &Model, terms: &[Term], steps: &[i32], longest: u16) -> (Model, Vec<Term>) {
    let (mut model, mut moved) = (model.clone(), terms.to_vec());
    for (term, step) in moved.iter_mut().zip(steps) {
        let Some(old) = term.lag() else { continue };
        let lag = (i32::from(old) + step).clamp(3, longest.into()) as u16;
        if let Some(other) = term.moved_in(&model, lag) {
            model = other;
            *term = term.with_lag(lag);
        }
    }
    (model, moved)
}

/// Terms at a bound of their range in a fit, and the others.
fn bent_and_kept(fitted: &Fit, terms: Vec<Term>) -> (Vec<Term>, Vec<Term>) {
    terms
        .into_iter()
        .partition(|term| term.is_at_a_bound(&fitted.model))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Record, Use};
    use crate::model::Delay;
    use crate::terms::judge::Judge;
    use std::sync::atomic::AtomicBool;

    /// A flow with a memory of 120 samples on its own and of 61 samples under the jet.
    fn remembering(records: u32) -> Vec<Record> {
        let mut random = 7_u32;
        let mut next = move || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            random >> 16
        };
        let mut one = |index| {
            let mut u: Vec<f64> = Vec::new();
            while u.len() < 4000 {
                let (rest, blow) = (40 + next() % 300, 40 + next() % 300);
                u.extend((0..rest).map(|_| 0.0));
                u.extend((0..blow).map(|_| 1.0));
            }
            u.truncate(4000);
            let mut y: Vec<f64> = vec![0.0];
            for k in 0..u.len() - 1 {
                let jet = if k >= 20 { u[k - 20] } else { 0.0 };
                let past = |lag: usize| if k >= lag { y[k - lag] } else { 0.0 };
                let drive = 0.03 - 0.02 * y[k] + 0.005 * past(60);
                let noise = f64::from(next() % 1000) / 1e6;
                y.push(0.98 * y[k] - 0.006 * past(119) + jet * drive + 1e-3 * noise);
            }
            let role = if index % 2 == 0 {
                Use::Identify
            } else {
                Use::Validate
            };
            Record::new(&format!("r{index}"), role, 0.001, u, y)
        };
        (0..records).map(&mut one).collect()
    }

    static NEVER: AtomicBool = AtomicBool::new(false);

    fn search(judge: &Judge) -> Search<'_> {
        Search::silent(judge, 0, &NEVER)
    }

    /// A fit of a first-order flow with these terms.
    fn begun(judge: &Judge, terms: &[Term]) -> Fit {
        let lean = Model {
            a: vec![0.98],
            b: vec![0.03],
            c: vec![-0.02],
            delay: Delay::Fixed { delays: vec![20] },
            ..Model::default()
        };
        let add = |model: Model, term: &Term| term.added_to(&model, &[]);
        let with = terms.iter().fold(lean, add);
        let options = judge.options_for(&with);
        fit(&with, &judge.learning(0), &options).expect("a fit")
    }

    #[test]
    fn terms_of_a_finished_fit_have_the_lags_of_its_model() {
        let records = remembering(4);
        let judge = Judge::new(&records, None, FitOptions::default()).expect("records");
        let terms = vec![Term::State(131), Term::Product(52)];
        let begun = begun(&judge, &terms);
        let found = search(&judge).finish_with_bent(terms, begun, 1);
        let [only] = &found[..] else {
            panic!("{found:?}");
        };
        let lags = [&only.terms[0], &only.terms[1]].map(Term::lag);
        assert_eq!((only.bent, lags), (false, [Some(120), Some(61)]));
        let model = only.judged.model();
        assert_eq!(model.state_lags, [1, 120]);
        assert_eq!(model.product_lags, [1, 61]);
    }

    #[test]
    fn lags_are_dropped_beside_an_effect_that_stays() {
        let records = remembering(4);
        let judge = Judge::new(&records, None, FitOptions::default()).expect("records");
        let spec = model_core::effects::spec("hot-film-lag").expect("in the catalogue");
        let film = Term::Effect {
            spec,
            parameters: vec![0.004],
            grading: Model::default().grading,
            reference: None,
        };
        let judged = |terms: &[Term]| judge.judged_from(begun(&judge, terms)).expect("stable");
        let terms = vec![Term::State(120), film.clone(), Term::Product(61)];
        let with = Hypothesis {
            judged: judged(&terms),
            terms,
            ..Hypothesis::new(judged(&[]))
        };
        let root = Hypothesis::new(judged(&[]));
        let search = search(&judge);
        let anew = search.without_lags(&with, &root).expect("stable");
        let model = anew.judged.model();
        assert_eq!(anew.words(), film.name());
        assert_eq!(
            (&model.state_lags[..], &model.product_lags[..]),
            (&[1][..], &[1][..])
        );
        assert_eq!(model.effects.len(), 1);
        // Models with only lags, or with only an effect, keep all terms.
        assert!(search.without_lags(&anew, &root).is_none());
        assert!(search.without_lags(&root, &root).is_none());
    }

    #[test]
    fn lags_that_are_off_by_a_dozen_samples_are_moved_to_where_they_belong() {
        let records = remembering(4);
        let judge = Judge::new(&records, None, FitOptions::default()).expect("records");
        let mut terms = vec![Term::State(131), Term::Product(52)];
        let begun = begun(&judge, &terms);
        let settled = search(&judge).settle_lags(begun.clone(), &mut terms);
        assert!(settled.mean_square() < 1e-3 * begun.mean_square());
        assert_eq!([terms[0].lag(), terms[1].lag()], [Some(120), Some(61)]);
        assert!(
            (settled.model.a[1] + 0.006).abs() < 1e-4,
            "{:?}",
            settled.model
        );
    }
}
