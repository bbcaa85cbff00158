//! One search over lags, the sensor's zero and effects.

use super::RULES;
use super::grid::hides;
use super::judge::{Judge, Judged};
use super::proposal::Proposal;
use super::screen::Screen;
use super::table::{Table, has_jet_effect};
use super::term::Term;
use crate::fit::{Fit, FitOptions, Known, fit, lean_base};
use crate::model::{Model, Start};
use crate::residual::NoiseSource;
use crate::simulate::SimulateError;
use model_core::effect::Spec;
use model_core::effects::NUISANCES;
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

    /// What a search found that tried nothing else.
    pub(crate) fn alone(self) -> Found {
        Found {
            root: self.clone(),
            best: self.clone(),
            bare: self.clone(),
            all: vec![self],
            tried: 0,
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

    /// Whether `other` is built as it is: fitted anew that is no other place to set out from.
    pub(crate) fn is_built_as(&self, other: &Model) -> bool {
        Term::all_of(other, self.judged.model()).is_some_and(|terms| terms.is_empty())
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

    pub(super) fn over(&self, hypothesis: &Hypothesis) -> f64 {
        self.judge.over_noise(hypothesis.judged.rmse())
    }

    /// Whether much is left that something could explain, where that is known.
    fn leaves_much(&self, hypothesis: &Hypothesis) -> bool {
        self.judge.noise_source != NoiseSource::Scatter && self.over(hypothesis) > RULES.much
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
            let others = self.judge.other_gradings(judged.model().grading);
            let others: Vec<Judged> = others
                .into_par_iter()
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
    /// floor, round by round, until nothing that is left is worth its price. Where much is left
    /// then, what promised less is followed too, once: from the root and from the best.
    #[must_use]
    pub fn run(&self, root: Hypothesis, second: impl FnOnce() -> Option<Hypothesis>) -> Found {
        let mut all = vec![root];
        let mut second = Some(second);
        let mut tried = Vec::new();
        let (mut last, mut stalled, mut since) = (RULES.rounds, 0, None);
        for round in 1.. {
            if round > 1
                && self.over(&all[best(&all, |_| true)]) > RULES.at_the_floor
                && let Some(second) = second.take()
            {
                all.extend(second());
            }
            let ended = round > last || stalled >= RULES.patience;
            let mut chosen = if ended {
                Vec::new()
            } else {
                self.chosen(&all, since)
            };
            let mut width = 1;
            let end = best(&all, |_| true);
            if chosen.is_empty() && since.is_none() && self.effects && self.leaves_much(&all[end]) {
                (last, stalled, since) = (round + RULES.rounds_after, 0, Some(all.len()));
                width = RULES.wider;
                chosen = vec![(end, true)];
                if end > 0 {
                    chosen.push((0, true));
                }
            }
            if chosen.is_empty() || self.interrupted() {
                break;
            }
            let before = all[end].score();
            let refitted = self.advance(round, &chosen, width, &mut all, &mut tried);
            let gained = all[best(&all, |_| true)].score() <= before - RULES.price;
            stalled = match (refitted, gained) {
                (false, _) => RULES.patience,
                (true, true) => 0,
                (true, false) => stalled + 1,
            };
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

    /// One round: screens for those that are `chosen`, refits `width` times what is refitted as a rule,
    /// and keeps it in `all`. Whether there was anything to refit.
    fn advance(
        &self,
        round: usize,
        chosen: &[(usize, bool)],
        width: usize,
        all: &mut Vec<Hypothesis>,
        tried: &mut Vec<Vec<TermKey>>,
    ) -> bool {
        let mut pool: Vec<(usize, Proposal)> = Vec::new();
        for &(index, effects) in chosen {
            all[index].expanded = true;
            let words = all[index].words();
            (self.progress)(&format!("round {round}: screening [{words}]"));
            let proposals = self.proposals(&all[index], effects, width, tried);
            pool.extend(proposals.into_iter().map(|proposal| (index, proposal)));
        }
        if pool.is_empty() {
            return false;
        }
        (self.progress)(&format!("round {round}: refitting {} models", pool.len()));
        for (index, proposal) in &pool {
            tried.push(signature(&all[*index].terms, &proposal.terms));
        }
        let mut finished = self.refitted(all, &pool, width);
        finished.extend(self.regraded(&finished));
        for hypothesis in finished {
            keep(all, hypothesis);
        }
        true
    }

    /// Whom to screen further terms for, and whether effects may be among them; those from `since` on came
    /// of a wider round.
    fn chosen(&self, all: &[Hypothesis], since: Option<usize>) -> Vec<(usize, bool)> {
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
        }
        let near = |i: usize| all[i].score() < all[end].score() + RULES.rival.ln();
        let rival = leading(all, |i| open(i) && *i != end);
        if let Some(rival) = rival.filter(|rival| near(*rival))
            && !settled
            && self.over(&all[end]) > RULES.near_the_floor
        {
            chosen.push((rival, self.effects));
        }
        // What a wider round brought is followed whether or not it leads.
        let new = leading(all, |i| {
            since.is_some_and(|since| *i >= since) && !chosen.iter().any(|(c, _)| c == i)
        });
        if let Some(new) = new.filter(|i| open(i) && near(*i)) {
            chosen.push((new, self.effects));
        }
        // Two lines of descent, until the one that is behind has become the dearer.
        let line = all[end].from_given;
        let other = leading(all, |i| all[*i].from_given != line);
        if let Some(other) = other.filter(open)
            && self.over(&all[end]) > RULES.at_the_floor
            && near(other)
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
        width: usize,
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
                with >= RULES.with_effects * width
            } else {
                // Lags move: neighbours are one proposal.
                without >= RULES.without_effects * width
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
            let unseen = self.unseen(&screen);
            kept.extend(unseen.filter(|proposal| {
                let key = signature(&hypothesis.terms, &proposal.terms);
                !tried.contains(&key) && !met.contains(&key)
            }));
        }
        kept
    }

    /// Effects that hide, whatever the screening says of them.
    fn unseen(&self, screen: &Screen<'_>) -> impl Iterator<Item = Proposal> {
        let model = screen.model();
        let specs = model
            .candidates()
            .filter(|spec| hides(spec) && spec.channel.is_none());
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

    /// Every proposal for a few steps, the best of them, `width` times as many as a rule, to the end.
    fn refitted(
        &self,
        all: &[Hypothesis],
        pool: &[(usize, Proposal)],
        width: usize,
    ) -> Vec<Hypothesis> {
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
        // One without effects is among those that are followed to the end, and one of each model that was screened:
        // a few steps say less where it is further to go. What ends as another does is not.
        let mut leading: Vec<(usize, Fit)> = Vec::new();
        let (mut has_bare, mut met): (bool, Vec<Vec<Term>>) = (false, Vec::new());
        let mut heirless: Vec<usize> = pool.iter().map(|(index, _)| *index).collect();
        for (_, at, fit) in brief {
            let (index, proposal) = &pool[at];
            let bare = all[*index].is_bare() && count_effects(&proposal.terms) == 0;
            let terms = [all[*index].terms.clone(), proposal.terms.clone()].concat();
            let again = met.iter().any(|other| Term::are_alike(other, &terms));
            let first = heirless.contains(index) || (bare && !has_bare);
            if !again && (leading.len() < RULES.finished * width || first) {
                has_bare |= bare;
                heirless.retain(|other| other != index);
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
        let others = self.judge.other_gradings(model.grading).into_par_iter();
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
