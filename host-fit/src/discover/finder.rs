//! The search from screened curves to a significant term and its equivalence set.

use super::outcome::{Alike, Found, Smallest};
use super::{Options, RULES};
use crate::curves::{
    Candidate, Context, Coordinate, Entry, RULES as CURVES, Screened, Term, best, diverse,
    reference, refitted,
};
use crate::diagnose::RULES as DIAGNOSE;
use crate::experiment::Separation;
use crate::model::Model;
use crate::order;
use crate::terms::{
    HeldOut, Hypothesis, Judge, Judged, MostLikely, Screen, Search, Table, Units, is_out, log_e,
    p_of, p_value, shares_won,
};
use std::collections::BTreeMap;
use std::sync::atomic::Ordering;

/// The result of a round: the term found, and the number of candidates.
pub(super) struct Round {
    pub(super) found: Option<Found>,
    pub(super) looked_at: usize,
    pub(super) smallest: BTreeMap<String, Smallest>,
}

/// The search for terms with its data.
pub(super) struct Finder<'a> {
    pub(super) search: &'a Search<'a>,
    pub(super) units: &'a Units,
    pub(super) options: &'a Options,
    /// Whether the sensor has a record-to-record offset.
    pub(super) moving_zero: bool,
}

impl Finder<'_> {
    /// The best term for any of the `contexts` (highest model order first), if it beats `base`.
    pub(super) fn next(&self, contexts: &[Hypothesis], base: &Hypothesis, number: usize) -> Round {
        let progress = self.search.progress;
        progress(&format!("term {number}: screening curves"));
        let mut pool: Vec<(&Hypothesis, Screened)> = Vec::new();
        let (mut looked_at, mut smallest) = (0, BTreeMap::new());
        for (index, beside) in contexts.iter().enumerate() {
            let context = Context::new(self.search, beside.judged.model(), number);
            let mut curves = context.map_or_else(Vec::new, |context| context.all(&Entry::ALL));
            curves.retain(|curve| self.may_be_told(&curve.term, base));
            looked_at += curves.len();
            let most = if index == 0 {
                smallest = self.smallest(&curves);
                // A first-order prediction underestimates the gain, so a candidate with half of the required gain
                // is refitted.
                let wanted = (1.0 - RULES.promised * CURVES.worthwhile) * base.judged.rmse();
                let left = |curve: &Screened| (1.0 - curve.held_out).max(0.0).sqrt();
                curves.retain(|curve| left(curve) * beside.judged.rmse() < wanted);
                CURVES.tried
            } else {
                CURVES.tried_leaner
            };
            let curves = diverse(curves, most);
            pool.extend(curves.into_iter().map(|curve| (beside, curve)));
        }
        // A model at the noise level cannot be improved.
        let open = self.search.judge.over_noise(base.judged.rmse()) > DIAGNOSE.floor_margin;
        let found = open
            .then(|| self.judged(self.followed(pool, number), base, looked_at, number))
            .flatten();
        Round {
            found,
            looked_at,
            smallest,
        }
    }

    /// Adds points where the curve of a candidate is steepest, as long as they lower the error enough: a step may lie
    /// between two points.
    fn finer(&self, candidate: Candidate) -> Candidate {
        let judge = self.search.judge;
        let mut last = candidate;
        for _ in 0..RULES.refinements {
            let term = last.term.in_model(last.with.judged.model());
            let bare = term.taken_from(last.with.judged.model());
            let reference = reference(&term.coordinate, &judge.learning(0));
            let finer = term.finer(&term.errors(&last.with.judged.fits[0]));
            let finer = finer.and_then(|finer| {
                let with = finer.added_to(&bare, reference)?;
                let mut hypothesis = Hypothesis::new(judge.refitted(&with).ok()?);
                hypothesis.terms.clone_from(&last.with.terms);
                let pays = hypothesis.judged.size() < last.with.judged.size();
                pays.then_some((finer, hypothesis))
            });
            match finer {
                Some((term, with)) => (last.term, last.with) = (term, with),
                None => break,
            }
        }
        last
    }

    /// Whether `base` is close to the noise level.
    fn is_near_the_floor(&self, base: &Hypothesis) -> bool {
        self.search.judge.over_noise(base.judged.rmse()) < RULES.near_the_floor
    }

    /// Whether a term added to `base` may be reported. Near the noise level, a sensitivity or a drift over time is
    /// not distinguishable from record-to-record scatter.
    fn may_be_told(&self, term: &Term, base: &Hypothesis) -> bool {
        let varies = term.entry == Entry::Sensitivity || term.coordinate == Coordinate::Time;
        !varies || !self.is_near_the_floor(base)
    }

    /// Whether a term explains too little: less than the required share of the unexplained variance. If
    /// record-to-record scatter may account for all of it, the share refers to the variance left by the best base.
    fn takes_too_little(&self, with: &Judged, without: &Judged, base: &Hypothesis) -> bool {
        let judge = self.search.judge;
        let may_scatter = self.moving_zero || self.is_near_the_floor(base);
        let too_little = |of: &Judged, least: f64| taken(judge, of, with) < least;
        judge.over_noise(1.0).is_finite()
            && (too_little(without, RULES.least_share)
                || may_scatter && too_little(&base.judged, RULES.most_of_it))
    }

    /// Detectable size of a term at each place, in the user's units.
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

    /// The best candidate with its equivalence set, if it beats the base.
    fn judged(
        &self,
        mut all: Vec<Candidate>,
        base: &Hypothesis,
        looked_at: usize,
        number: usize,
    ) -> Option<Found> {
        let judge = self.search.judge;
        (self.search.progress)(&format!("term {number}: testing equivalent candidates"));
        all.retain(|one| self.may_be_told(&one.term, base));
        let leader = best(&mut all)?;
        let without = self.without(&leader)?;
        let context = Context::new(self.search, without.judged.model(), number)?;
        let mut others = context.all(&Entry::ALL);
        others.retain(|other| {
            !other.term.is_like(&leader.term) && self.may_be_told(&other.term, base)
        });
        let near = context.near(&leader.term).into_iter();
        all.extend(refitted(
            self.search,
            &without,
            diverse(others, CURVES.tried),
        ));
        all.extend(refitted(
            self.search,
            &without,
            near.take(CURVES.of_a_kind).collect(),
        ));
        // With the final base model a different candidate may fit best.
        all.push(leader);
        let found = self.finer(best(&mut all)?);
        let last = found.judged();
        let gain = 1.0 - last.rmse() / base.judged.rmse();
        let little = self.takes_too_little(last, &without.judged, base);
        let drifts_more = judge.drifts_more(last, &base.judged);
        if gain < CURVES.worthwhile || little || drifts_more {
            return None;
        }
        let p = self.p_value(base, last, looked_at);
        if p >= RULES.level_of_search {
            return None;
        }
        let term = &found.term;
        let told = |term: &Term| Alike {
            place: term.entry.place(),
            coordinate: term.entry.depends_on(&term.coordinate.out(self.units)),
        };
        // If one coordinate enters one place in two forms, they are reported as one finding.
        let same = |other: &Term| other.is_like(term) || told(other) == told(term);
        order::ascending(&mut all, Candidate::size);
        let held_out: Vec<&HeldOut> = std::iter::once(&found)
            .chain(&all)
            .map(|one| &one.judged().held_out)
            .collect();
        let shares = shares_won(&held_out);
        let rivals = all.iter().enumerate();
        let of_the_same = rivals.filter(|(_, rival)| same(&rival.term));
        let stability = shares[0] + of_the_same.map(|(i, _)| shares[i + 1]).sum::<f64>();
        let (mut alike, mut rivals): (Vec<Alike>, Vec<Candidate>) = (Vec::new(), Vec::new());
        for (index, rival) in all.iter().enumerate() {
            // Of equal coordinates with different time constants, only the best is reported.
            let met = rivals.iter().any(|other| other.term.is_like(&rival.term));
            let new = !met && !same(&rival.term) && !alike.contains(&told(&rival.term));
            let as_good = is_as_good(held_out[index + 1], held_out[0]);
            if new && (as_good || !is_out(&shares, index + 1)) {
                alike.push(told(&rival.term));
                rivals.push(rival.clone());
            }
        }
        let Candidate { term, with, .. } = found;
        let term = term.in_model(with.judged.model());
        let errors = term.errors(&with.judged.fits[0]);
        let direction = context.direction(&term);
        let resembles = direction.map_or_else(Vec::new, |direction| {
            self.resembling(context.screen(), &direction)
        });
        let taken = taken(judge, &without.judged, &with.judged);
        Some(Found {
            curve: term.clone(),
            errors,
            term,
            with,
            without: without.judged,
            p,
            taken,
            formula_taken: taken,
            resembles,
            alike,
            rivals,
            beside: Vec::new(),
            stability,
        })
    }

    /// Family-wise p-value of `with` against `base` over the curves that were screened, as its e-value bounds it
    /// (theory 4.5).
    fn p_value(&self, base: &Hypothesis, with: &Judged, looked_at: usize) -> f64 {
        let judge = self.search.judge;
        let p = || {
            let evidence = |of: &Judged| MostLikely::of(judge, of.model())?.evidence(judge);
            Some(p_of(log_e(
                evidence(with)?,
                evidence(&base.judged)?,
                looked_at,
            )))
        };
        p().unwrap_or(1.0)
    }

    /// A model in the user's units, and its `terms` in the order they were added.
    pub(super) fn outer(&self, model: &Model, terms: &[&Term]) -> (Model, Vec<Term>) {
        let mut bare = model.clone();
        let mut written = Vec::new();
        for term in terms.iter().rev() {
            let term = term.in_model(&bare);
            bare = term.taken_from(&bare);
            written.push(term.out(self.units));
        }
        written.reverse();
        let mut outer = self.units.model_out(&bare);
        for term in &written {
            let reference = reference(&term.coordinate, &self.search.judge.learning(0));
            outer = term.added_to(&outer, reference).unwrap_or(outer);
        }
        (outer, written)
    }

    /// The command that would distinguish `model` (with all terms) from models with an equivalent term in place of the
    /// first ambiguous one.
    pub(super) fn separation(&self, found: &[Found], model: &Model) -> Option<Separation> {
        let judge = self.search.judge;
        let index = found.iter().position(|found| !found.rivals.is_empty())?;
        if !judge.on_off || self.search.interrupt.load(Ordering::Relaxed) {
            return None;
        }
        let (mut models, mut names) = (vec![model.clone()], vec![found[index].term.name()]);
        for rival in &found[index].rivals {
            let terms: Vec<&Term> = found[index].beside.iter().chain([&rival.term]).collect();
            models.push(self.outer(rival.with.judged.model(), &terms).0);
            names.push(rival.term.name());
        }
        let noise = judge.measured_noise_rmse() * self.units.y;
        Separation::of(models, names, noise, 0)
    }

    /// Effects of the catalogue whose change of the free run is similar to `direction`.
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
}

/// Share of the unexplained variance of one model that another one explains.
fn taken(judge: &Judge, without: &Judged, with: &Judged) -> f64 {
    let excess = |judged: &Judged| judge.excess(&judged.held_out);
    1.0 - excess(with) / excess(without).max(f64::MIN_POSITIVE)
}

/// Whether a worse model is not distinguishable from a better one on these records.
fn is_as_good(worse: &HeldOut, better: &HeldOut) -> bool {
    worse.rmse() <= (1.0 + RULES.alike) * better.rmse() || p_value(worse, better) >= RULES.level
}
