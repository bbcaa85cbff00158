//! One search over lags, the sensor's zero and effects.

use super::RULES;
use super::grid::longest_lag;
use super::judge::{Judge, Judged};
use super::proposal::Proposal;
use super::screen::Screen;
use super::table::{Table, has_jet_effect};
use super::term::Term;
use crate::fit::{Fit, FitOptions, Known, fit, lean_base, settle_fixed_delay, starts};
use crate::model::{Model, Start};
use crate::simulate::SimulateError;
use model_core::effect::{Influence, Spec};
use model_core::effects::NUISANCES;
use model_core::recursion::Grading;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::sync::atomic::{AtomicBool, Ordering as Memory};

/// A model with the terms that were added to the leanest one.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// The terms.
    pub terms: Vec<Term>,
    /// Its fits and its held-out error.
    pub judged: Judged,
    /// Whether further terms were screened for it.
    pub(super) expanded: bool,
    /// Whether it descends from the given structure, and not from the leanest one.
    pub(super) from_given: bool,
}

impl Hypothesis {
    /// A model as it is, without further terms.
    #[must_use]
    pub fn new(judged: Judged) -> Self {
        Self {
            terms: Vec::new(),
            judged,
            expanded: false,
            from_given: false,
        }
    }

    /// Whether no effect is among its terms.
    #[must_use]
    pub fn is_bare(&self) -> bool {
        self.terms.iter().all(|term| term.effect().is_none())
    }

    /// What its terms cost.
    #[must_use]
    pub fn cost(&self) -> usize {
        self.terms.iter().map(Term::cost).sum()
    }

    /// ln of the held-out error, and the price of the terms: the lower the better.
    #[must_use]
    pub fn score(&self) -> f64 {
        score(self.judged.rmse(), self.cost())
    }

    /// Its terms in words.
    #[must_use]
    pub fn words(&self) -> String {
        let names: Vec<String> = self.terms.iter().map(Term::name).collect();
        if names.is_empty() {
            "no terms".to_owned()
        } else {
            names.join(" + ")
        }
    }
}

pub(super) fn score(rmse: f64, cost: usize) -> f64 {
    rmse.ln() + RULES.price * cost as f64
}

/// What a search found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The leanest model.
    pub root: Hypothesis,
    /// The best hypothesis, all its terms needed.
    pub best: Hypothesis,
    /// The best without effects, its lags searched as hard.
    pub bare: Hypothesis,
    /// Everything that was fitted to the end.
    pub all: Vec<Hypothesis>,
    /// Alternatives that were looked at in full refits.
    pub tried: usize,
}

impl Found {
    /// Other models that were fitted to the end, with the same effects as `last` and no worse than it
    /// by anything that counts.
    pub(crate) fn as_good_as(&self, last: &Hypothesis) -> Vec<&Model> {
        let names = |hypothesis: &Hypothesis| {
            let effects = hypothesis.terms.iter().filter_map(Term::effect);
            let mut names: Vec<&str> = effects.map(|spec| spec.name).collect();
            names.sort_unstable();
            names
        };
        let own = names(last);
        let near = (1.0 + RULES.price) * last.judged.rmse();
        let all = self.all.iter();
        let alike = all.filter(|other| other.judged.rmse() <= near && names(other) == own);
        alike.map(|other| other.judged.model()).collect()
    }

    /// Whether the given structure was a second place to set out from.
    #[must_use]
    pub fn set_out_twice(&self) -> bool {
        self.all.iter().any(|hypothesis| hypothesis.from_given)
    }
}

/// The search and what it works on.
pub struct Search<'a> {
    /// The bench.
    pub judge: &'a Judge,
    /// What the records say.
    pub known: Known,
    /// Whether effects may be added.
    pub effects: bool,
    /// Most effects.
    pub most_effects: usize,
    /// Set to end with the best so far.
    pub interrupt: &'a AtomicBool,
    /// Told what is being tried.
    pub progress: &'a (dyn Fn(&str) + Sync),
}

impl Search<'_> {
    pub(super) fn interrupted(&self) -> bool {
        self.interrupt.load(Memory::Relaxed)
    }

    fn over(&self, hypothesis: &Hypothesis) -> f64 {
        self.judge.over_noise(hypothesis.judged.rmse())
    }

    /// The leanest model with the kind of delay law and the effects that `given` has;
    /// in `mid_run`, its free runs begin from the measurement.
    ///
    /// # Errors
    /// When no starting point gives a stable free run.
    pub fn root(&self, given: &Model, mid_run: bool) -> Result<Hypothesis, SimulateError> {
        let learning = self.judge.learning(0);
        let mut bare = given.clone();
        // What was added before stays: the question is what is missing still.
        // Nuisances have to earn their place again.
        let mut kept = std::mem::take(&mut bare.effects);
        kept.retain(|added| NUISANCES.iter().all(|spec| spec.name != added.name));
        let mut model = lean_base(&bare, &learning)?.model;
        model.delay_between_samples();
        model.effects = kept;
        if mid_run {
            model.start = Start::Measured;
        }
        let mut judged = self.judge.refitted(&model)?;
        if !self.judge.on_off {
            // Graded commands show how the flow takes jets of part strength.
            let others: Vec<Judged> = Grading::ALL
                .into_par_iter()
                .filter(|grading| *grading != judged.model().grading)
                .filter_map(|grading| {
                    let other = Model {
                        grading,
                        ..judged.model().clone()
                    };
                    self.judge.refitted(&other).ok()
                })
                .collect();
            let better = others
                .into_iter()
                .min_by(|a, b| a.rmse().total_cmp(&b.rmse()));
            if let Some(better) = better.filter(|better| better.rmse() < judged.rmse()) {
                judged = better;
            }
        }
        Ok(Hypothesis::new(judged))
    }

    /// The structure of `given`, refitted, as terms on top of `root`: a second place to
    /// set out from. `None` where it is not made of such terms, or of too many.
    #[must_use]
    pub fn second_root(&self, given: &Model, root: &Hypothesis) -> Option<Hypothesis> {
        let mut model = given.clone();
        model.delay_between_samples();
        model.start = root.judged.model().start;
        let terms = Term::all_of(&model, root.judged.model())?;
        let judged = (!terms.is_empty() && terms.len() <= RULES.most_given)
            .then(|| self.judge.refitted(&model).ok())??;
        Some(Hypothesis {
            terms,
            from_given: true,
            ..Hypothesis::new(judged)
        })
    }

    /// From `root`, and from the `second` one where the first step did not reach the
    /// floor, round by round, until nothing that is left is worth its price.
    #[must_use]
    pub fn run(&self, root: Hypothesis, second: impl FnOnce() -> Option<Hypothesis>) -> Found {
        let mut all = vec![root];
        let mut second = Some(second);
        let mut tried = Vec::new();
        let mut stalled = 0;
        for round in 1..=RULES.rounds {
            if round > 1
                && self.over(&all[best(&all, |_| true)]) > RULES.at_the_floor
                && let Some(second) = second.take()
            {
                all.extend(second());
            }
            let chosen = self.chosen(&all);
            if chosen.is_empty() || self.interrupted() {
                break;
            }
            let before = all[best(&all, |_| true)].score();
            let mut pool: Vec<(usize, Proposal)> = Vec::new();
            for (index, effects) in chosen {
                all[index].expanded = true;
                (self.progress)(&format!(
                    "round {round}: screening [{}]",
                    all[index].words()
                ));
                pool.extend(
                    self.proposals(&all[index], effects, &tried)
                        .into_iter()
                        .map(|proposal| (index, proposal)),
                );
            }
            if pool.is_empty() {
                break;
            }
            (self.progress)(&format!("round {round}: refitting {} models", pool.len()));
            for (index, proposal) in &pool {
                tried.push(signature(&all[*index].terms, &proposal.terms));
            }
            let mut finished = self.refitted(&all, &pool);
            finished.extend(self.regraded(&finished));
            for hypothesis in finished {
                keep(&mut all, hypothesis);
            }
            let after = all[best(&all, |_| true)].score();
            if after > before - RULES.price {
                stalled += 1;
                if stalled >= RULES.patience {
                    break;
                }
            } else {
                stalled = 0;
            }
        }
        (self.progress)("leaving out what is not needed");
        let root = all[0].clone();
        let end = best(&all, |_| true);
        let bare_end = best(&all, Hypothesis::is_bare);
        let found = self.pruned(all[end].clone(), &root);
        // The best without effects is asked for before effects are tried in the place of its terms.
        let bare = if bare_end == end {
            found.clone()
        } else {
            (self.progress)("the same for the best without effects");
            self.pruned(all[bare_end].clone(), &root)
        };
        let found = self.exchanged(found, &root);
        Found {
            root,
            best: found,
            bare,
            tried: tried.len(),
            all,
        }
    }

    /// Whom to screen further terms for, and whether effects may be among them.
    fn chosen(&self, all: &[Hypothesis]) -> Vec<(usize, bool)> {
        let (end, bare) = (best(all, |_| true), best(all, Hypothesis::is_bare));
        let settled = all[end].expanded;
        let open = |i: &usize| !all[*i].expanded;
        // Once the best has nothing to gain, only a base that was searched less hard
        // can still say something.
        let bare_is_done = bare == end
            || all[bare].expanded
            || all[bare].cost() >= all[end].cost() + RULES.head_start;
        if self.over(&all[end]) <= RULES.at_the_floor && bare_is_done {
            return Vec::new();
        }
        let mut chosen = Vec::new();
        if !settled {
            chosen.push((end, self.effects));
            let rival = leading(all, |i| open(i) && *i != end);
            if let Some(rival) = rival
                && self.over(&all[end]) > RULES.near_the_floor
                && all[rival].score() < all[end].score() + RULES.rival.ln()
            {
                chosen.push((rival, self.effects));
            }
        }
        // Two lines of descent, until the one that is behind has become the dearer.
        let line = all[end].from_given;
        let other = leading(all, |i| all[*i].from_given != line);
        if let Some(other) = other.filter(open)
            && self.over(&all[end]) > RULES.at_the_floor
            && all[other].score() < all[end].score() + RULES.rival.ln()
            && all[other].cost() < all[end].cost() + RULES.head_start
            && !chosen.iter().any(|(index, _)| *index == other)
        {
            chosen.push((other, self.effects));
        }
        if !bare_is_done && !chosen.iter().any(|(index, _)| *index == bare) {
            chosen.push((bare, false));
        }
        chosen
    }

    /// What to refit for a hypothesis: some with effects, some without.
    fn proposals(
        &self,
        hypothesis: &Hypothesis,
        effects: bool,
        tried: &[Vec<TermKey>],
    ) -> Vec<Proposal> {
        let Some(screen) = Screen::new(self.judge, hypothesis.judged.model()) else {
            return Vec::new();
        };
        let present = count_effects(&hypothesis.terms);
        let effects = effects && present < self.most_effects;
        let table = Table::of(&screen, &self.known, effects);
        let (mut with, mut without) = (0, 0);
        let mut met = Vec::new();
        let mut kept: Vec<Proposal> = Vec::new();
        for proposal in screen.proposals(&table) {
            let added = count_effects(&proposal.terms);
            let again = |other: &&Proposal| Term::are_of_one_kind(&other.terms, &proposal.terms);
            let enough = if added > 0 {
                with >= RULES.with_effects
            } else {
                // Lags move: neighbours are one proposal.
                without >= RULES.without_effects
                    || kept.iter().filter(again).count() >= RULES.of_one_kind
            };
            let key = signature(&hypothesis.terms, &proposal.terms);
            let too_many = present + added > self.most_effects;
            if enough || too_many || tried.contains(&key) || met.contains(&key) {
                continue;
            }
            met.push(key);
            *(if added > 0 { &mut with } else { &mut without }) += 1;
            kept.push(proposal);
        }
        if effects && hypothesis.is_bare() {
            let unseen = self.stepwise(&screen);
            kept.extend(unseen.filter(|proposal| {
                let key = signature(&hypothesis.terms, &proposal.terms);
                !tried.contains(&key) && !met.contains(&key)
            }));
        }
        kept
    }

    /// Effects that act in steps, whatever the screening says of them: where a threshold is never crossed,
    /// or always at the wrong time, it promises nothing.
    fn stepwise(&self, screen: &Screen<'_>) -> impl Iterator<Item = Proposal> {
        let model = screen.model();
        let specs = model
            .candidates()
            .filter(|spec| acts_in_steps(spec) && spec.channel.is_none());
        let possible = specs.filter(|spec| screen.pointless(spec).is_none());
        possible.map(|spec| {
            let term = Term::Effect {
                spec,
                parameters: spec.parameters.iter().map(|p| p.starts[0]).collect(),
                grading: model.grading,
                reference: None,
            };
            Proposal {
                terms: vec![term],
                coefficients: vec![Vec::new()],
                left: 1.0,
                score: 0.0,
            }
        })
    }

    /// Every proposal for a few steps, the best of them to the end.
    fn refitted(&self, all: &[Hypothesis], pool: &[(usize, Proposal)]) -> Vec<Hypothesis> {
        let brief: Vec<Option<(f64, usize, Fit)>> = pool
            .par_iter()
            .enumerate()
            .map(|(at, (index, proposal))| {
                if self.interrupted() {
                    return None;
                }
                let parent = &all[*index];
                let fit = self.set_out(parent.judged.model(), proposal, RULES.brief)?;
                let rmse = self.judge.held_out(|_| &fit.model).ok()?.rmse();
                let cost: usize = proposal.terms.iter().map(Term::cost).sum();
                Some((score(rmse, parent.cost() + cost), at, fit))
            })
            .collect();
        let mut brief: Vec<(f64, usize, Fit)> = brief.into_iter().flatten().collect();
        brief.sort_by(|a, b| a.0.total_cmp(&b.0));
        // One without effects is among those that are followed to the end; what ends as another does is not.
        let mut leading: Vec<(usize, Fit)> = Vec::new();
        let (mut has_bare, mut met): (bool, Vec<Vec<Term>>) = (false, Vec::new());
        for (_, at, fit) in brief {
            let (index, proposal) = &pool[at];
            let bare = all[*index].is_bare() && count_effects(&proposal.terms) == 0;
            let terms = [all[*index].terms.clone(), proposal.terms.clone()].concat();
            let again = met.iter().any(|other| Term::are_alike(other, &terms));
            if !again && (leading.len() < RULES.finished || (bare && !has_bare)) {
                has_bare |= bare;
                met.push(terms);
                leading.push((at, fit));
            }
        }
        let finished: Vec<Option<Hypothesis>> = leading
            .into_par_iter()
            .map(|(at, fit)| {
                let (index, proposal) = &pool[at];
                let terms = [all[*index].terms.clone(), proposal.terms.clone()].concat();
                let from_given = all[*index].from_given;
                let finished = self.finish(terms, fit, all[*index].terms.len() + 1)?;
                Some(Hypothesis {
                    from_given,
                    ..finished
                })
            })
            .collect();
        finished.into_iter().flatten().collect()
    }

    /// The best of `finished` with another response to jets of part strength, if that
    /// is better: it shows only once effects make such jets.
    fn regraded(&self, finished: &[Hypothesis]) -> Option<Hypothesis> {
        let leader = finished.get(best(finished, |_| true))?;
        let model = leader.judged.model();
        let part = !self.judge.on_off || has_jet_effect(model);
        if !part || self.over(leader) <= RULES.near_the_floor || self.interrupted() {
            return None;
        }
        let learning = self.judge.learning(0);
        let others = Grading::ALL.into_par_iter().filter(|g| *g != model.grading);
        let fits = others.filter_map(|grading| {
            let other = Model {
                grading,
                ..model.clone()
            };
            let options = FitOptions {
                iterations: RULES.brief,
                ..self.judge.options_for(&other)
            };
            fit(&other, &learning, &options).ok()
        });
        let fits: Vec<Fit> = fits.collect();
        let least = fits
            .into_iter()
            .min_by(|a, b| a.mean_square().total_cmp(&b.mean_square()))?;
        if least.mean_square() >= leader.judged.fits[0].mean_square() {
            return None;
        }
        let graded = |term: &Term| term.with_grading(least.model.grading);
        let terms: Vec<Term> = leader.terms.iter().map(graded).collect();
        let (from_given, count) = (leader.from_given, terms.len());
        let finished = self.finish(terms, least, count)?;
        Some(Hypothesis {
            from_given,
            ..finished
        })
    }

    /// The fit of a proposal from where the screening puts it; from several points where the error
    /// has more than one valley.
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
        let fits = all
            .into_par_iter()
            .filter_map(|terms| self.set_out_from(model, proposal, terms, iterations));
        let fits: Vec<Fit> = fits.collect();
        fits.into_iter()
            .min_by(|a, b| a.mean_square().total_cmp(&b.mean_square()))
    }

    /// The terms from other starting points, none where one does.
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
        match terms {
            [term @ Term::Effect { spec, .. }] if acts_in_steps(spec) => {
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
        // First-order coefficients may be too bold for a free run: then from 0.
        with(true).or_else(|_| with(false)).ok()
    }

    /// A fit followed to the end: lags and fixed delays where they leave least, all
    /// folds fitted and judged. Effects that are bent as far as they can be are left out,
    /// as what they were added with may be right all the same; `None` if fewer than
    /// `least` terms stay.
    pub(crate) fn finish(
        &self,
        mut terms: Vec<Term>,
        brief: Fit,
        least: usize,
    ) -> Option<Hypothesis> {
        let learning = self.judge.learning(0);
        let options = self.judge.options_for(&brief.model);
        let fitted = fit(&brief.model, &learning, &options).ok()?;
        let fitted = self.settle_lags(fitted, &mut terms);
        let fitted = settle_fixed_delay(fitted, &learning, &options).ok()?;
        let end = &fitted.model;
        let (bent, kept): (Vec<Term>, Vec<Term>) =
            terms.into_iter().partition(|term| at_a_bound(end, term));
        if kept.len() < least {
            return None;
        }
        if !bent.is_empty() {
            let rest = bent
                .iter()
                .fold(end.clone(), |m, term| term.taken_from(&m, end));
            let options = self.judge.options_for(&rest);
            return self.finish(kept, fit(&rest, &learning, &options).ok()?, least);
        }
        let judged = self.judge.judged_from(fitted).ok()?;
        Some(Hypothesis {
            terms: kept,
            ..Hypothesis::new(judged)
        })
    }

    /// Moves all lags to where they leave least, by steps of Gauss and Newton; a step
    /// that does not lower the error is halved.
    fn settle_lags(&self, mut current: Fit, terms: &mut [Term]) -> Fit {
        let learning = self.judge.learning(0);
        let shortest = learning.iter().map(|r| r.len()).min().unwrap_or(0);
        let longest = longest_lag(current.model.sample_period_s, shortest);
        for _ in 0..RULES.lag_rounds {
            let Some(screen) = Screen::new(self.judge, &current.model) else {
                return current;
            };
            let mut steps = screen.moves_of(terms);
            drop(screen);
            let mut better = None;
            while better.is_none() && steps.iter().any(|step| *step != 0) && !self.interrupted() {
                better = self.moved(&current, terms, &steps, longest);
                steps.iter_mut().for_each(|step| *step /= 2);
            }
            let Some((fitted, moved)) = better else {
                return current;
            };
            current = fitted;
            terms.clone_from_slice(&moved);
        }
        current
    }

    /// A fit with its lags moved, if that lowers the error.
    fn moved(
        &self,
        current: &Fit,
        terms: &[Term],
        steps: &[i32],
        longest: u16,
    ) -> Option<(Fit, Vec<Term>)> {
        let mut model = current.model.clone();
        let mut moved = terms.to_vec();
        for (term, step) in moved.iter_mut().zip(steps) {
            let Some(old) = term.lag() else { continue };
            let lag = (i32::from(old) + step).clamp(3, longest.into()) as u16;
            if let Some(other) = term.moved_in(&model, lag) {
                model = other;
                *term = term.with_lag(lag);
            }
        }
        let options = FitOptions {
            iterations: RULES.lag_iterations,
            ..self.judge.options_for(&model)
        };
        let fitted = fit(&model, &self.judge.learning(0), &options).ok()?;
        let least = current.mean_square() * (1.0 - RULES.lag_gain);
        (fitted.mean_square() < least).then_some((fitted, moved))
    }

    /// A hypothesis refitted without one of its terms.
    #[must_use]
    pub fn without(
        &self,
        hypothesis: &Hypothesis,
        index: usize,
        root: &Hypothesis,
    ) -> Option<Hypothesis> {
        let term = &hypothesis.terms[index];
        let model = term.taken_from(hypothesis.judged.model(), root.judged.model());
        self.less(hypothesis, index, &model)
    }

    /// A hypothesis refitted without those of its effects that are `unwanted`, the last first.
    #[must_use]
    pub fn without_effects(
        &self,
        hypothesis: &Hypothesis,
        root: &Hypothesis,
        unwanted: impl Fn(&Spec) -> bool,
    ) -> Hypothesis {
        let mut rest = hypothesis.clone();
        let is_unwanted = |term: &Term| term.effect().is_some_and(&unwanted);
        while let Some(index) = rest.terms.iter().rposition(is_unwanted) {
            match self.without(&rest, index, root) {
                Some(lesser) => rest = lesser,
                None => break,
            }
        }
        rest
    }

    /// The same from `model`, which is without the term.
    pub(super) fn less(
        &self,
        hypothesis: &Hypothesis,
        index: usize,
        model: &Model,
    ) -> Option<Hypothesis> {
        let mut terms = hypothesis.terms.clone();
        terms.remove(index);
        Some(Hypothesis {
            terms,
            judged: self.judge.refitted(model).ok()?,
            expanded: true,
            from_given: hypothesis.from_given,
        })
    }
}

/// Whether a card has a parameter that acts in steps.
fn acts_in_steps(spec: &Spec) -> bool {
    let mut parameters = spec.parameters.iter();
    parameters.any(|parameter| parameter.influence == Influence::Stepwise)
}

/// Whether an effect was bent as far as its card lets it: it stands in for something
/// else then. Delay laws are exempt: levels that y hardly visits leave them open.
fn at_a_bound(model: &Model, term: &Term) -> bool {
    let Some(spec) = term.effect() else {
        return false;
    };
    let added = model.effects.iter().find(|added| added.name == spec.name);
    let values = added.map_or(&[][..], |added| &added.parameters);
    values.iter().zip(spec.parameters).any(|(value, card)| {
        let place = |x: f64| if card.is_logarithmic() { x.ln() } else { x };
        let (low, high) = (place(card.low), place(card.high));
        let near = RULES.bound * (high - low);
        // An amplitude may be small.
        let low_end = card.is_logarithmic() || card.low != 0.0;
        let at_low = low_end && place(*value) < low + near;
        card.low < card.high && (place(*value) > high - near || at_low)
    })
}

/// Adds a hypothesis, or puts it in the place of one that it is alike but for its error.
fn keep(all: &mut Vec<Hypothesis>, mut hypothesis: Hypothesis) {
    let alike = |other: &&mut Hypothesis| Term::are_alike(&other.terms, &hypothesis.terms);
    let Some(other) = all.iter_mut().find(alike) else {
        all.push(hypothesis);
        return;
    };
    if hypothesis.score() < other.score() {
        // What follows from it was looked at, unless it has become another model.
        hypothesis.expanded = other.expanded && hypothesis.score() > other.score() - RULES.price;
        *other = hypothesis;
    }
}

/// What the key of a term looks like.
type TermKey = (String, Option<model_core::recursion::Grading>);

fn signature(before: &[Term], added: &[Term]) -> Vec<TermKey> {
    let mut keys: Vec<TermKey> = before.iter().chain(added).map(Term::key).collect();
    keys.sort_by(|a, b| match a.0.cmp(&b.0) {
        Ordering::Equal => format!("{:?}", a.1).cmp(&format!("{:?}", b.1)),
        other => other,
    });
    keys
}

pub(super) fn count_effects(terms: &[Term]) -> usize {
    terms.iter().filter(|term| term.effect().is_some()).count()
}

/// The index of the best hypothesis that is `wanted`; the root is always wanted.
fn best(all: &[Hypothesis], wanted: impl Fn(&Hypothesis) -> bool) -> usize {
    leading(all, |i| wanted(&all[*i])).unwrap_or(0)
}

/// The index of the best hypothesis among those that are `wanted` by their index.
fn leading(all: &[Hypothesis], wanted: impl Fn(&usize) -> bool) -> Option<usize> {
    (0..all.len())
        .filter(wanted)
        .min_by(|a, b| all[*a].score().total_cmp(&all[*b].score()))
}
