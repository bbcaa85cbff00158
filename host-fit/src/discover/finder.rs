//! From screened curves to a term, and from its curve to a formula.

use super::formula::FORMS;
use super::outcome::{Alike, Found, Smallest, coordinate_words};
use super::place::Entry;
use super::screening::{Context, Screened, reference};
use super::term::{Shape, Term};
use super::{Options, RULES};
use crate::fit::{Fit, FitOptions, fit};
use crate::model::Model;
use crate::terms::{self, HeldOut, Hypothesis, Judged, Screen, Search, Table, Units, p_value};
use model_core::recursion::Grading;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::Ordering;

/// What a round found, and what it looked at.
pub(super) struct Round {
    pub(super) found: Option<Found>,
    pub(super) looked_at: usize,
    pub(super) smallest: BTreeMap<String, Smallest>,
}

/// ln of the held-out error, and the price of the model's parameters.
pub(super) fn size(hypothesis: &Hypothesis) -> f64 {
    hypothesis.judged.size()
}

/// A term beside a base, followed for a few steps.
struct Tried {
    term: Term,
    brief: Fit,
    /// The terms of the base: what the flow remembers.
    memory: Vec<crate::terms::Term>,
}

/// What a base is known by: its number of terms, and its delay law where that is one of the catalogue.
type Base = (usize, Option<&'static str>);

fn base_of(terms: &[crate::terms::Term], model: &Model) -> Base {
    (terms.len(), model.delay.effect_name())
}

/// Who is followed further, of many that come the best first: so many, and the best beside each base.
/// Beside a lean base a few steps say less, as it is further to go.
struct Heirs {
    free: usize,
    bases: Vec<Base>,
}

impl Heirs {
    fn of(free: usize) -> Self {
        Self {
            free,
            bases: Vec::new(),
        }
    }

    fn takes(&mut self, base: Base) -> bool {
        let taken = self.free > 0 || !self.bases.contains(&base);
        self.free = self.free.saturating_sub(1);
        self.bases.push(base);
        taken
    }
}

/// The search for terms and what it works on.
pub(super) struct Finder<'a> {
    pub(super) search: &'a Search<'a>,
    pub(super) units: &'a Units,
    pub(super) options: &'a Options,
}

impl Finder<'_> {
    fn interrupted(&self) -> bool {
        self.search.interrupt.load(Ordering::Relaxed)
    }

    /// The best term for any of the `contexts`, the richest first, if it does better than
    /// `base` does.
    pub(super) fn next(&self, contexts: &[Hypothesis], base: &Hypothesis, number: usize) -> Round {
        let progress = self.search.progress;
        progress(&format!("term {number}: screening curves"));
        let mut pool: Vec<(&Hypothesis, Screened)> = Vec::new();
        let (mut looked_at, mut smallest) = (0, BTreeMap::new());
        for (index, beside) in contexts.iter().enumerate() {
            let context = Context::new(self.search, beside.judged.model(), number);
            let mut curves = context.map_or_else(Vec::new, |context| context.all());
            looked_at += curves.len();
            let most = if index == 0 {
                smallest = self.smallest(&curves);
                // To first order a term promises less than it does: half of what is asked is enough to try it.
                let wanted = (1.0 - RULES.promised * RULES.worthwhile) * base.judged.rmse();
                let left = |curve: &Screened| (1.0 - curve.held_out).max(0.0).sqrt();
                curves.retain(|curve| left(curve) * beside.judged.rmse() < wanted);
                RULES.tried
            } else {
                RULES.tried_leaner
            };
            let curves = diverse(curves, most, |curve| &curve.term);
            pool.extend(curves.into_iter().map(|curve| (beside, curve)));
        }
        progress(&format!("term {number}: refitting {} curves", pool.len()));
        let tried: Vec<Tried> = pool
            .into_par_iter()
            .filter_map(|(beside, curve)| self.brief_of(beside, curve))
            .collect();
        let mut finished = self.finished(tried);
        let by_size =
            |a: &(Term, Hypothesis), b: &(Term, Hypothesis)| size(&a.1).total_cmp(&size(&b.1));
        finished.sort_by(by_size);
        progress(&format!("term {number}: the flow's lags beside it"));
        for (term, hypothesis) in self.leading(&finished) {
            let found = self.search.run(hypothesis, || None);
            finished.push((term, found.best));
            // At the floor there is nothing to gain from others; what is as good is asked below.
            if self.at_floor(&finished[finished.len() - 1].1) {
                break;
            }
        }
        let best = finished.into_iter().min_by(by_size);
        let found = best.and_then(|best| self.judged(best, base, looked_at, number));
        Round {
            found,
            looked_at,
            smallest,
        }
    }

    /// Whether nothing is left that another term could explain.
    fn at_floor(&self, hypothesis: &Hypothesis) -> bool {
        let judge = self.search.judge;
        judge.over_noise(hypothesis.judged.rmse()) < crate::diagnose::RULES.floor_margin
    }

    /// Of `finished`, the best first, those beside which the flow's lags are searched again: the best, and the best
    /// beside each base, the leanest first: a rich base leaves less with any term, and its lags stand in for the right one.
    fn leading(&self, finished: &[(Term, Hypothesis)]) -> Vec<(Term, Hypothesis)> {
        let mut leading: Vec<(Term, Hypothesis)> = Vec::new();
        let mut heirs = Heirs::of(RULES.settled);
        for one in finished {
            // While it blows, the length of this pulse is the time since its edge.
            let twin = |other: &(Term, Hypothesis)| {
                let ratio = one.1.judged.rmse() / other.1.judged.rmse();
                other.0.entry == one.0.entry && ratio - 1.0 < RULES.twins
            };
            if !leading.iter().any(twin) && heirs.takes(base_of(&one.1.terms, one.1.judged.model()))
            {
                leading.push(one.clone());
            }
        }
        leading.sort_by_key(|(_, hypothesis)| (!self.at_floor(hypothesis), hypothesis.terms.len()));
        leading
    }

    /// How large a term would have to be at each place, in the user's units.
    fn smallest(&self, curves: &[Screened]) -> BTreeMap<String, Smallest> {
        let mut all = BTreeMap::new();
        for entry in [Entry::Jet, Entry::Delay, Entry::Level, Entry::Reading] {
            let own = curves.iter().filter(|curve| curve.term.entry == entry);
            let mut sizes: Vec<f64> = own.map(|curve| curve.smallest).collect();
            sizes.sort_by(f64::total_cmp);
            let Some(least) = sizes.first() else { continue };
            let scale = entry.scale(self.units);
            let name = entry.place().word().to_owned();
            let smallest = Smallest {
                from: least * scale,
                to: sizes[sizes.len() / 2] * scale,
                unit: entry.unit().symbol(),
            };
            all.insert(name, smallest);
        }
        all
    }

    /// A model with the term, fitted so many steps; from 0 where the promised values
    /// are too bold for a free run.
    fn fitted(&self, model: &Model, term: &Term, iterations: usize) -> Option<Fit> {
        if self.interrupted() {
            return None;
        }
        let judge = self.search.judge;
        let learning = judge.learning(0);
        let reference = reference(&term.coordinate, &learning);
        let from = |term: &Term| {
            let with = term.added_to(model, reference)?;
            let options = FitOptions {
                iterations,
                ..judge.options_for(&with)
            };
            fit(&with, &learning, &options).ok()
        };
        let nothing = vec![0.0; term.values().len()];
        from(term).or_else(|| from(&term.with_values(&nothing)))
    }

    /// A curve beside a model, followed for a few steps.
    fn brief_of(&self, beside: &Hypothesis, curve: Screened) -> Option<Tried> {
        let model = beside.judged.model();
        // On/off commands do not show how the flow takes jets of part strength, which a term at the jet makes of them.
        let unknown = curve.term.entry == Entry::Jet && self.search.judge.on_off;
        let responses = Grading::ALL
            .into_par_iter()
            .filter(|grading| unknown || *grading == model.grading);
        let fits = responses.filter_map(|grading| {
            let model = Model {
                grading,
                ..model.clone()
            };
            self.fitted(&model, &curve.term, crate::terms::RULES.brief)
        });
        let by_error = |a: &Fit, b: &Fit| a.mean_square().total_cmp(&b.mean_square());
        Some(Tried {
            brief: fits.min_by(by_error)?,
            term: curve.term,
            memory: beside.terms.clone(),
        })
    }

    fn brief(&self, beside: &Hypothesis, curves: Vec<Screened>) -> Vec<Tried> {
        let curves = curves.into_par_iter();
        curves
            .filter_map(|curve| self.brief_of(beside, curve))
            .collect()
    }

    /// The best of some brief fits, followed to the end: the base bent to stand in for what
    /// was missing, and its lags move back.
    fn finished(&self, tried: Vec<Tried>) -> Vec<(Term, Hypothesis)> {
        let judge = self.search.judge;
        let rated = tried.into_par_iter().filter_map(|tried| {
            let rmse = judge.held_out(|_| &tried.brief.model).ok()?.rmse();
            Some((terms::size(rmse, &tried.brief.model), tried))
        });
        let mut rated: Vec<(f64, Tried)> = rated.collect();
        rated.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut heirs = Heirs::of(RULES.finished);
        rated.retain(|(_, tried)| heirs.takes(base_of(&tried.memory, &tried.brief.model)));
        let finished = rated.into_par_iter().filter_map(|(_, tried)| {
            let least = tried.memory.len();
            let finished = self.search.finish(tried.memory, tried.brief, least)?;
            Some((tried.term, finished))
        });
        finished.collect()
    }

    /// A term with what else it could be, if it does better than the base.
    fn judged(
        &self,
        (term, with): (Term, Hypothesis),
        base: &Hypothesis,
        looked_at: usize,
        number: usize,
    ) -> Option<Found> {
        let judge = self.search.judge;
        let progress = self.search.progress;
        progress(&format!("term {number}: what else it could be"));
        let bare = term.taken_from(with.judged.model());
        let mut without = Hypothesis::new(judge.refitted(&bare).ok()?);
        without.terms.clone_from(&with.terms);
        let context = Context::new(self.search, without.judged.model(), number)?;
        let kind = |other: &Term| (other.entry, other.coordinate.slug());
        let own = kind(&term);
        let others = context.all().into_iter().filter(|c| kind(&c.term) != own);
        let others = diverse(others.collect(), RULES.tried, |curve| &curve.term);
        let near = context.near(&term).into_iter().take(RULES.of_a_kind);
        let mut all = self.finished(self.brief(&without, others));
        all.extend(self.finished(self.brief(&without, near.collect())));
        // Beside the final base another one may do better.
        let (mut term, mut with) = (term, with);
        let better = (0..all.len()).min_by(|a, b| size(&all[*a].1).total_cmp(&size(&all[*b].1)));
        if let Some(index) = better.filter(|index| size(&all[*index].1) < size(&with)) {
            let other = all.swap_remove(index);
            all.push((term, with));
            (term, with) = other;
        }
        let gain = 1.0 - with.judged.rmse() / base.judged.rmse();
        let p = p_value(&base.judged.held_out, &with.judged.held_out) * looked_at as f64;
        if gain < RULES.worthwhile
            || p >= RULES.level
            || judge.drifts_more(&with.judged, &base.judged)
        {
            return None;
        }
        let own = kind(&term);
        let alike = all.iter().filter(|(rival, other)| {
            let (worse, better) = (&other.judged.held_out, &with.judged.held_out);
            kind(rival) != own && is_as_good(worse, better)
        });
        let mut alike: Vec<Alike> = alike
            .map(|(other, _)| Alike {
                place: other.entry.place(),
                coordinate: coordinate_words(other.entry, other),
            })
            .collect();
        alike.dedup();
        // One coordinate may enter a place in two ways: for who reads it, that is the same finding.
        let words = coordinate_words(term.entry, &term);
        alike.retain(|other| other.place != term.entry.place() || other.coordinate != words);
        let term = term.in_model(with.judged.model());
        let errors = errors(&term, &with.judged.fits[0]);
        let direction = context.direction(&term);
        let resembles = direction.map_or_else(Vec::new, |direction| {
            self.resembling(context.screen(), &direction)
        });
        let excess = |judged: &Judged| judge.excess(&judged.held_out);
        let taken = 1.0 - excess(&with.judged) / excess(&without.judged).max(f64::MIN_POSITIVE);
        Some(Found {
            curve: term.clone(),
            errors,
            term,
            with,
            without: without.judged,
            p: p.min(1.0),
            taken,
            formula_taken: taken,
            resembles,
            alike,
        })
    }

    /// Effects of the catalogue that change the free run along `direction`.
    fn resembling(&self, screen: &Screen<'_>, direction: &[f64]) -> Vec<String> {
        let table = Table::of(screen, &self.search.known, true);
        let mut names: Vec<String> = Vec::new();
        for candidate in &table.candidates {
            let Some(spec) = candidate.term.effect() else {
                continue;
            };
            let forgotten = self.options.without.iter().any(|name| name == spec.name);
            let alike = table.likeness(screen, candidate, direction) > RULES.resembles;
            if alike && !forgotten && !names.iter().any(|name| name == spec.name) {
                names.push(spec.name.to_owned());
            }
        }
        names
    }

    /// The terms with formulas where one does as well as the curve, and the model with
    /// them.
    pub(super) fn formulas(
        &self,
        found: Vec<Found>,
        mut current: Hypothesis,
    ) -> (Vec<Found>, Hypothesis) {
        let mut told = Vec::new();
        for mut found in found {
            if let Some((term, judged)) = self.formula(&found, &current) {
                let excess = |held_out: &HeldOut| self.search.judge.excess(held_out);
                let without = excess(&found.without.held_out).max(f64::MIN_POSITIVE);
                // Other terms may have come since: what the formula loses, it loses here.
                let lost = excess(&judged.held_out) - excess(&current.judged.held_out);
                found.formula_taken = found.taken - lost / without;
                found.term = term;
                current = Hypothesis::new(judged);
            }
            told.push(found);
        }
        (told, current)
    }

    fn formula(&self, found: &Found, current: &Hypothesis) -> Option<(Term, Judged)> {
        let judge = self.search.judge;
        let model = current.judged.model();
        let curve = found.curve.in_model(model);
        let Shape::Points { x, g, pinned } = &curve.shape else {
            return None;
        };
        let typical = {
            let mut sizes = found.errors.clone();
            sizes.sort_by(f64::total_cmp);
            sizes.get(sizes.len() / 2).copied().unwrap_or(1.0).max(1e-9)
        };
        let weights: Vec<f64> = found.errors.iter().map(|e| 1.0 / e.max(typical)).collect();
        let base = curve.taken_from(model);
        let reference = reference(&curve.coordinate, &judge.learning(0));
        let range = [*x.first()?, *x.last()?];
        let forms: Vec<_> = FORMS
            .iter()
            .filter(|form| !(pinned.is_some() && form.has_level()))
            .collect();
        let fits = forms.into_par_iter().filter_map(|form| {
            let (parameters, _) = form.nearest(x, g, &weights, pinned.is_some())?;
            let formula = |fading: Option<f64>| Term {
                shape: Shape::Formula {
                    form,
                    parameters: parameters.clone(),
                    range,
                    fading,
                },
                ..curve.clone()
            };
            let refitted = |term: Term| {
                let with = term.added_to(&base, reference)?;
                let judged = judge.refitted(&with).ok()?;
                Some((term.in_model(judged.model()), judged))
            };
            let plain = refitted(formula(None));
            let faded = curve
                .coordinate
                .fading()
                .and_then(|t| refitted(formula(Some(t))));
            let least = |judged: &Judged| terms::size(judged.rmse(), judged.model());
            match (plain, faded) {
                (Some(a), Some(b)) if least(&b.1) < least(&a.1) => Some(b),
                (Some(a), _) => Some(a),
                (None, b) => b,
            }
        });
        let mut fits: Vec<(Term, Judged)> = fits.collect();
        fits.retain(|(_, judged)| {
            let with_curve = &current.judged;
            judged.rmse() <= (1.0 + RULES.formula) * with_curve.rmse()
                || p_value(&judged.held_out, &with_curve.held_out) >= RULES.level
        });
        fits.into_iter().min_by(|a, b| {
            terms::size(a.1.rmse(), a.1.model()).total_cmp(&terms::size(b.1.rmse(), b.1.model()))
        })
    }
}

/// Whether a model is as good as a better one, for all that the records say.
fn is_as_good(worse: &HeldOut, better: &HeldOut) -> bool {
    worse.rmse() <= (1.0 + RULES.alike) * better.rmse() || p_value(worse, better) >= RULES.level
}

/// The first so many, no more of a kind than rules allow.
fn diverse<T>(all: Vec<T>, most: usize, term: impl Fn(&T) -> &Term) -> Vec<T> {
    let mut kept: Vec<T> = Vec::new();
    for one in all {
        let own = term(&one);
        let of_a_kind = kept.iter().filter(|other| {
            let other = term(other);
            other.entry == own.entry && other.coordinate.is_like(&own.coordinate)
        });
        if kept.len() < most && of_a_kind.count() < RULES.of_a_kind {
            kept.push(one);
        }
    }
    kept
}

/// Standard errors of a curve's values, 0 where it is pinned.
fn errors(term: &Term, fitted: &Fit) -> Vec<f64> {
    let Shape::Points { g, pinned, .. } = &term.shape else {
        return Vec::new();
    };
    let coordinates = fitted.model.coordinates();
    let name = term.name();
    let error = |i: usize| {
        if Some(i) == *pinned {
            return 0.0;
        }
        let full = format!("{name}.g{i}");
        let index = coordinates.iter().position(|c| c.name == full);
        let known = index.and_then(|index| fitted.standard_error(index));
        known.unwrap_or(f64::INFINITY)
    };
    (0..g.len()).map(error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_are_followed_and_the_best_beside_each_base() {
        let mut heirs = Heirs::of(2);
        let taken = [6, 6, 6, 0, 0, 3].map(|terms| heirs.takes((terms, None)));
        assert_eq!(taken, [true, true, false, true, false, true]);
        assert!(heirs.takes((0, Some("edge-dependent-delay"))));
    }
}
