//! Refits of promising curves: the model is refitted with each curve, the flow's lags are searched again, and the
//! term's coordinate is chosen again with those lags.

use super::RULES;
use super::finder::Finder;
use crate::curves::{
    Candidate, Context, Entry, Heirs, RULES as CURVES, Screened, best, best_of_each_place, diverse,
    finished, kind, refitted, tried,
};
use crate::order;
use crate::parallel;
use crate::terms::Hypothesis;

impl Finder<'_> {
    /// The fitted terms of some curves, each in its model. If a model is at the noise level, only its term is returned.
    pub(super) fn followed(
        &self,
        curves: Vec<(&Hypothesis, Screened)>,
        number: usize,
    ) -> Vec<Candidate> {
        let progress = self.search.progress;
        progress(&format!("term {number}: refitting {} curves", curves.len()));
        let tried = parallel::some(curves, |(beside, curve)| tried(self.search, beside, curve));
        let mut all = finished(self.search, tried);
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
            if other.size() > last.size() - CURVES.twins || other.size() > reach {
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
        let others = diverse(others, CURVES.tried_leaner);
        best(&mut refitted(self.search, &without, others))
    }

    /// The model without the term, refitted.
    pub(super) fn without(&self, candidate: &Candidate) -> Option<Hypothesis> {
        let bare = candidate.term.taken_from(candidate.with.judged.model());
        let mut without = Hypothesis::new(self.search.judge.refitted(&bare).ok()?);
        without.terms.clone_from(&candidate.with.terms);
        Some(without)
    }
}
