//! Replacement of a term's curve by a formula.

use super::RULES;
use super::finder::Finder;
use super::outcome::Found;
use crate::curves::{FORMS, Shape, Term, reference};
use crate::parallel;
use crate::terms::{HeldOut, Hypothesis, Judged, p_value};

impl Finder<'_> {
    /// The terms, each as a formula if one fits equally well, and the model with them.
    pub(super) fn formulas(
        &self,
        found: Vec<Found>,
        mut current: Hypothesis,
    ) -> (Vec<Found>, Hypothesis) {
        let mut told = Vec::new();
        for mut found in found {
            if let Some((term, judged)) = self.formula_of(&found, &current) {
                self.tell(&mut found, term, &judged, &mut current);
            }
            told.push(found);
        }
        (told, current)
    }

    /// A term as a formula if that has a smaller error than its curve. Otherwise the residual of straight lines on
    /// a smooth function could be reported as a second term.
    pub(super) fn better_as_formula(&self, found: &mut Found, current: &mut Hypothesis) {
        if let Some((term, judged)) = self.formula_of(found, current)
            && judged.size() < current.judged.size()
        {
            self.tell(found, term, &judged, current);
        }
    }

    /// The formula of a term that is still a curve.
    fn formula_of(&self, found: &Found, current: &Hypothesis) -> Option<(Term, Judged)> {
        let is_curve = matches!(found.term.shape, Shape::Points { .. });
        let formula = is_curve.then(|| self.formula(&found.curve, &current.judged));
        formula.flatten()
    }

    fn tell(&self, found: &mut Found, term: Term, judged: &Judged, current: &mut Hypothesis) {
        let excess = |held_out: &HeldOut| self.search.judge.excess(held_out);
        let without = excess(&found.without.held_out).max(f64::MIN_POSITIVE);
        // Other terms may have been added since the curve was fitted. The loss caused by the formula is
        // therefore measured on the present model.
        let lost = excess(&judged.held_out) - excess(&current.judged.held_out);
        found.formula_taken = found.taken - lost / without;
        found.term = term;
        let terms = std::mem::take(&mut current.terms);
        *current = Hypothesis::new(judged.clone());
        current.terms = terms;
    }

    /// The shortest formula that fits the records as well as the curve in a model.
    pub(super) fn formula(&self, curve: &Term, with_curve: &Judged) -> Option<(Term, Judged)> {
        let judge = self.search.judge;
        let model = with_curve.model();
        let curve = curve.in_model(model);
        let errors = curve.errors(&with_curve.fits[0]);
        let Shape::Points { x, g, pinned } = &curve.shape else {
            return None;
        };
        let typical = {
            let mut sizes = errors.clone();
            sizes.sort_by(f64::total_cmp);
            sizes.get(sizes.len() / 2).copied().unwrap_or(1.0).max(1e-9)
        };
        let weights: Vec<f64> = errors.iter().map(|e| 1.0 / e.max(typical)).collect();
        let base = curve.taken_from(model);
        let reference = reference(&curve.coordinate, &judge.learning(0));
        let range = [*x.first()?, *x.last()?];
        let forms: Vec<_> = FORMS
            .iter()
            .filter(|form| !(pinned.is_some() && form.has_level()))
            .collect();
        let mut fits: Vec<(Term, Judged)> = parallel::some(forms, |form| {
            let (parameters, _) = form.nearest(x, g, &weights, pinned.is_some())?;
            let term = Term {
                shape: Shape::Formula {
                    form,
                    parameters,
                    range,
                },
                ..curve.clone().with_free_time(RULES.time_of_a_formula)
            };
            let with = term.added_to(&base, reference)?;
            let judged = judge.refitted(&with).ok()?;
            Some((term.in_model(judged.model()), judged))
        });
        fits.retain(|(_, judged)| {
            judged.rmse() <= (1.0 + RULES.formula) * with_curve.rmse()
                || p_value(&judged.held_out, &with_curve.held_out) >= RULES.level
        });
        fits.into_iter()
            .min_by(|a, b| a.1.size().total_cmp(&b.1.size()))
    }
}
