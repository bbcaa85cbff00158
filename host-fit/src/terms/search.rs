//! The search over lags, the sensor's offset and effects.

use super::RULES;
use super::effort::Effort;
use super::grid::hides;
use super::hypothesis::{Hypothesis, score};
use super::judge::Judge;
use super::proposal::Proposal;
use super::screen::Screen;
use super::table::{Table, has_jet_effect};
use super::term::Term;
use crate::fit::{Fit, FitOptions, Known, fit};
use crate::model::Model;
use crate::order;
use crate::parallel;
use crate::residual::NoiseSource;
use model_core::effect::Spec;
use std::cmp::Ordering;
use std::sync::atomic::{AtomicBool, Ordering as Memory};

impl Hypothesis {
    /// The result of a search that ends with this hypothesis alone.
    pub(crate) fn alone(self) -> Found {
        Found {
            root: self.clone(),
            best: self.clone(),
            bare: self.clone(),
            all: vec![self],
            tried: 0,
        }
    }
}

/// Makes further roots of a search. It is passed by reference so that the search is compiled once for all callers.
pub(crate) type Second<'a> = &'a dyn Fn() -> Vec<Hypothesis>;

/// The result of a search.
#[derive(Clone, Debug)]
pub struct Found {
    /// The base model of the lowest order.
    pub root: Hypothesis,
    /// The best hypothesis, pruned to the terms that are needed.
    pub best: Hypothesis,
    /// The best hypothesis without effects, with equally thorough lags.
    pub bare: Hypothesis,
    /// All hypotheses that were refitted in full.
    pub all: Vec<Hypothesis>,
    /// Number of candidates that were refitted in full.
    pub tried: usize,
}

impl Found {
    /// Other refitted models with the same effects as `last` whose error is not significantly larger.
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

    /// Whether the given structure was a second starting point.
    #[must_use]
    pub fn set_out_twice(&self) -> bool {
        self.all.iter().any(|hypothesis| hypothesis.from_given)
    }
}

/// The search with its data and options.
pub struct Search<'a> {
    /// The bench.
    pub judge: &'a Judge,
    /// Facts about the records that limit the candidates.
    pub known: Known,
    /// Whether effects may be added.
    pub effects: bool,
    /// Largest number of effects.
    pub most_effects: usize,
    /// Terms are added only to hypotheses whose terms have fewer parameters than this.
    pub most_parameters: usize,
    /// When set, the search ends with the best hypothesis so far.
    pub interrupt: &'a AtomicBool,
    /// Receives progress messages.
    pub progress: &'a (dyn Fn(&str) + Sync),
}

impl<'a> Search<'a> {
    /// A search for at most this many effects that reports no progress.
    pub(crate) fn silent(judge: &'a Judge, most_effects: usize, interrupt: &'a AtomicBool) -> Self {
        Self {
            judge,
            known: Known::of(&judge.learning(0)),
            effects: most_effects > 0,
            most_effects,
            most_parameters: usize::MAX,
            interrupt,
            progress: &|_| {},
        }
    }
}

impl Search<'_> {
    pub(super) fn interrupted(&self) -> bool {
        self.interrupt.load(Memory::Relaxed)
    }

    pub(super) fn over(&self, hypothesis: &Hypothesis) -> f64 {
        self.judge.over_noise(hypothesis.judged.rmse())
    }

    /// Whether the error is far above a known noise level.
    fn leaves_much(&self, hypothesis: &Hypothesis) -> bool {
        self.judge.noise_source != NoiseSource::Scatter && self.over(hypothesis) > RULES.much
    }

    /// Searches from `root`, and from `second` unless the first round reaches the noise level, until the gain of
    /// every remaining candidate is below its penalty. If the error is still far above the noise, one extension
    /// follows the less promising candidates of the root and of the best hypothesis. If the noise level is not
    /// reached, lags are searched again with the effects of the best hypothesis.
    #[must_use]
    pub fn run(&self, root: Hypothesis, second: Option<Second<'_>>) -> Found {
        self.run_within(root, second, &mut Effort::of_a_search())
    }

    /// [`run`](Self::run) with an effort that several searches share; when it is used up, no further models are
    /// tried.
    #[must_use]
    pub fn run_within(
        &self,
        root: Hypothesis,
        second: Option<Second<'_>>,
        effort: &mut Effort,
    ) -> Found {
        let (mut all, mut tried) = self.rounds(root, second, effort);
        (self.progress)("removing terms that are not needed");
        let root = all[0].clone();
        let end = best(&all, |_| true);
        let bare_end = best(&all, Hypothesis::is_bare);
        let mut found = self.pruned(all[end].clone(), &root);
        let is_rival = all[bare_end].score() < found.score() + RULES.rival.ln();
        let bare = if bare_end == end {
            found.clone()
        } else if is_rival {
            (self.progress)("removing terms from the best model without effects");
            self.pruned(all[bare_end].clone(), &root)
        } else {
            all[bare_end].clone()
        };
        if self.over(&found) > RULES.at_the_floor
            && !effort.is_spent()
            && let Some(start) = self.without_lags(&found, &root)
        {
            (self.progress)("searching the lags again with the effects");
            let (anew, further) = self.rounds(start, None, effort);
            tried += further;
            let other = &anew[best(&anew, |_| true)];
            if other.score() < found.score() - RULES.price {
                found = self.pruned(other.clone(), &root);
            }
            all.extend(anew);
        }
        Found {
            root,
            best: found,
            bare,
            tried,
            all,
        }
    }

    /// The rounds of a search from `root`: all results, `root` first, and how many proposals were refitted.
    fn rounds(
        &self,
        root: Hypothesis,
        mut second: Option<Second<'_>>,
        effort: &mut Effort,
    ) -> (Vec<Hypothesis>, usize) {
        let mut all = vec![root];
        let (mut tried, mut purged) = (Vec::new(), Vec::new());
        let (mut last, mut stalled, mut since) = (RULES.rounds, 0, None);
        let (mut from_bound, mut further) = (0, 0..0);
        for round in 1.. {
            if round > 1
                && self.over(&all[best(&all, |_| true)]) > RULES.at_the_floor
                && let Some(second) = second.take()
            {
                let first = all.len();
                all.extend(second());
                further = first..all.len();
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
                // A start may need two more effects, so that its own error does not recommend it.
                let unseen = further.clone().filter(|start| !all[*start].expanded);
                let starts = [0].into_iter().chain(unseen).filter(|start| *start != end);
                chosen = [end].into_iter().chain(starts).map(|i| (i, true)).collect();
            }
            // At the end of the search, fits with an effect at a bound get a few more rounds of screening, if
            // their error is below that of every result. With a further term the effect may leave the bound.
            if chosen.is_empty()
                && from_bound < RULES.rounds_after
                && let Some(bent) = least_of(&all, |i| all[*i].bent && !all[*i].expanded)
                && all[bent].score() < all[end].score() - RULES.price
            {
                (last, stalled) = (round + RULES.rounds_after, 0);
                from_bound += 1;
                chosen = vec![(bent, self.effects)];
            }
            if chosen.is_empty() || self.interrupted() || effort.is_spent() {
                break;
            }
            let before = all[end].score();
            let refitted = self.advance(round, &chosen, width, &mut all, &mut tried, effort);
            self.purge(&mut all, &mut purged, effort);
            let gained = all[best(&all, |_| true)].score() <= before - RULES.price;
            stalled = match (refitted, gained) {
                (false, _) => RULES.patience,
                (true, true) => 0,
                (true, false) => stalled + 1,
            };
        }
        all.retain(|hypothesis| !hypothesis.bent);
        (all, tried.len())
    }

    /// Adds the effects of the best hypothesis of each starting point without further lags. Lags that were chosen
    /// before an effect was in the model imitate it, and further terms would be chosen beside them.
    fn purge(
        &self,
        all: &mut Vec<Hypothesis>,
        purged: &mut Vec<Vec<TermKey>>,
        effort: &mut Effort,
    ) {
        if self.over(&all[best(all, |_| true)]) <= RULES.at_the_floor {
            return;
        }
        for from_given in [false, true] {
            let Some(leader) = leading(all, |i| all[*i].from_given == from_given) else {
                continue;
            };
            let effects = all[leader].terms.iter();
            let effects: Vec<Term> = effects
                .filter(|term| term.effect().is_some())
                .cloned()
                .collect();
            let key = signature(&all[0], &effects);
            if purged.contains(&key) || effort.is_spent() {
                continue;
            }
            purged.push(key);
            if let Some(lean) = self.without_lags(&all[leader], &all[0]) {
                effort.spend_on(lean.judged.model());
                keep(all, lean);
            }
        }
    }

    /// One round: screens on the `chosen` hypotheses, refits `width` times the usual number of proposals, and
    /// adds them to `all`. Returns whether there was anything to refit.
    fn advance(
        &self,
        round: usize,
        chosen: &[(usize, bool)],
        width: usize,
        all: &mut Vec<Hypothesis>,
        tried: &mut Vec<Vec<TermKey>>,
        effort: &mut Effort,
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
            tried.push(signature(&all[*index], &proposal.terms));
            effort.spend_on(all[*index].judged.model());
        }
        let mut finished = self.refitted(all, &pool, width);
        finished.extend(self.regraded(&finished));
        let (bent, finished): (Vec<_>, Vec<_>) = finished.into_iter().partition(|h| h.bent);
        for hypothesis in finished {
            keep(all, hypothesis);
        }
        // Only hypotheses with a lower error than every result are chosen.
        let least = all[best(all, |_| true)].score() - RULES.price;
        for hypothesis in bent.into_iter().filter(|bent| bent.score() < least) {
            keep(all, hypothesis);
        }
        true
    }

    /// The hypotheses to screen next, and whether effects are candidates for each. Those from `since` on come
    /// from a wider round.
    fn chosen(&self, all: &[Hypothesis], since: Option<usize>) -> Vec<(usize, bool)> {
        let (end, bare) = (best(all, |_| true), best(all, Hypothesis::is_bare));
        let open = |i: &usize| !all[*i].expanded && all[*i].cost() < self.most_parameters;
        let settled = !open(&end);
        // If the best hypothesis is at the noise level, only the base model can still improve.
        let bare_is_done =
            bare == end || !open(&bare) || all[bare].cost() >= all[end].cost() + RULES.head_start;
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
        // Results of a wider round are screened even if they are not the best.
        let new = leading(all, |i| {
            since.is_some_and(|since| *i >= since) && !chosen.iter().any(|(c, _)| c == i)
        });
        if let Some(new) = new.filter(|i| open(i) && near(*i)) {
            chosen.push((new, self.effects));
        }
        // The searches from both starting points continue until the worse one also has more
        // parameters. The given lags may imitate effects, so the error of the fewest lags may be much larger.
        let given_leads = all[end].from_given;
        let other = leading(all, |i| all[*i].from_given != given_leads);
        if let Some(other) = other.filter(open)
            && self.over(&all[end]) > RULES.at_the_floor
            && (given_leads || near(other))
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

    /// The proposals to refit for a hypothesis: some with effects, some without.
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
                // A fit moves lags, so neighbouring lags count as one proposal.
                without >= RULES.without_effects * width
                    || kept.iter().filter(again).count() >= RULES.of_one_kind
            };
            let key = signature(hypothesis, &proposal.terms);
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
                let key = signature(hypothesis, &proposal.terms);
                !tried.contains(&key) && !met.contains(&key)
            }));
        }
        kept
    }

    /// Effects that a first-order screening cannot rate.
    pub(super) fn unseen(&self, screen: &Screen<'_>) -> impl Iterator<Item = Proposal> {
        let model = screen.model();
        let specs = model
            .candidates()
            .filter(|spec| hides(spec) && spec.channel.is_none());
        let possible = specs.filter(|spec| screen.pointless(spec).is_none());
        possible.map(|spec| Proposal::unrated(spec, model))
    }

    /// Fits every proposal for a few iterations, and the best of them in full: `width` times the usual
    /// number.
    fn refitted(
        &self,
        all: &[Hypothesis],
        pool: &[(usize, Proposal)],
        width: usize,
    ) -> Vec<Hypothesis> {
        let mut brief: Vec<(f64, usize, Fit)> = parallel::some(0..pool.len(), |at| {
            if self.interrupted() {
                return None;
            }
            let (index, proposal) = &pool[at];
            let parent = &all[*index];
            let fit = self.set_out(parent.judged.model(), proposal, RULES.brief)?;
            let rmse = self.judge.held_out(|_| &fit.model).ok()?.rmse();
            let cost: usize = proposal.terms.iter().map(Term::cost).sum();
            Some((score(rmse, parent.cost() + cost), at, fit))
        });
        order::ascending(&mut brief, |one| one.0);
        // Two kinds of fits are refitted in full in any case: the best without effects, and the best on each
        // screened model, for which the error of a brief fit is less informative. Proposals that converge to the
        // same model are fitted once.
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
        let finished = parallel::each(leading, |(at, fit)| {
            let (index, proposal) = &pool[at];
            let terms = [all[*index].terms.clone(), proposal.terms.clone()].concat();
            let from_given = all[*index].from_given;
            let finished = self.finish_with_bent(terms, fit, all[*index].terms.len() + 1);
            let finished = finished.into_iter().map(|finished| Hypothesis {
                from_given,
                ..finished
            });
            finished.collect::<Vec<_>>()
        });
        finished.concat()
    }

    /// The best of `finished` with another response to jets of part strength, if that lowers the error. Only
    /// models with effects that cause part strengths are tried.
    fn regraded(&self, finished: &[Hypothesis]) -> Option<Hypothesis> {
        let leader = &finished[leading(finished, |_| true)?];
        let model = leader.judged.model();
        let part = !self.judge.on_off || has_jet_effect(model);
        if !part || self.over(leader) <= RULES.near_the_floor || self.interrupted() {
            return None;
        }
        let learning = self.judge.learning(0);
        let others = self.judge.other_gradings(model.grading);
        let fits = parallel::some(others, |grading| {
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

    /// A hypothesis refitted with one more term, from the term's parameters in `like`. `None` if the model diverges, or if
    /// the term goes to a bound of its range.
    pub(crate) fn with(
        &self,
        hypothesis: &Hypothesis,
        term: &Term,
        like: &Model,
    ) -> Option<Hypothesis> {
        let term = term.as_in(like);
        let model = term.added_to(hypothesis.judged.model(), &[]);
        let judged = self.judge.refitted(&model).ok()?;
        if term.is_at_a_bound(judged.model()) {
            return None;
        }
        let terms = [hypothesis.terms.clone(), vec![term]].concat();
        Some(Hypothesis {
            terms,
            expanded: true,
            ..Hypothesis::new(judged)
        })
    }

    /// A hypothesis refitted without its `unwanted` effects, removed from the last to the first.
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

    /// A hypothesis refitted without one of its terms, starting from `model`, which already lacks it.
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
            bent: false,
        })
    }
}

/// Adds a hypothesis to the list, or replaces one with the same terms if the error is smaller.
fn keep(all: &mut Vec<Hypothesis>, mut hypothesis: Hypothesis) {
    let alike = |other: &&mut Hypothesis| Term::are_alike(&other.terms, &hypothesis.terms);
    let Some(other) = all.iter_mut().find(alike) else {
        all.push(hypothesis);
        return;
    };
    let better = match (hypothesis.bent, other.bent) {
        (true, false) => false,
        (false, true) => true,
        _ => hypothesis.score() < other.score(),
    };
    if better {
        // Candidates were already screened on this hypothesis. They are screened again if its score
        // has fallen by at least the penalty of one parameter.
        hypothesis.expanded = other.expanded && hypothesis.score() > other.score() - RULES.price;
        *other = hypothesis;
    }
}

/// Key by which terms are compared.
type TermKey = (String, Option<model_core::recursion::Grading>);

/// The key of a hypothesis with further terms. Terms tried on a hypothesis at a bound may be tried again on others.
fn signature(before: &Hypothesis, added: &[Term]) -> Vec<TermKey> {
    let mut keys: Vec<TermKey> = before.terms.iter().chain(added).map(Term::key).collect();
    keys.extend(before.bent.then(|| ("at a bound".to_owned(), None)));
    keys.sort_by(|a, b| match a.0.cmp(&b.0) {
        Ordering::Equal => format!("{:?}", a.1).cmp(&format!("{:?}", b.1)),
        other => other,
    });
    keys
}

pub(super) fn count_effects(terms: &[Term]) -> usize {
    terms.iter().filter(|term| term.effect().is_some()).count()
}

/// The index of the best result for which `wanted` is true; the root (index 0) if there is none.
fn best(all: &[Hypothesis], wanted: impl Fn(&Hypothesis) -> bool) -> usize {
    leading(all, |i| wanted(&all[*i])).unwrap_or(0)
}

/// The index of the hypothesis with the least score among those that are not at a bound and for whose index `wanted` is
/// true.
fn leading(all: &[Hypothesis], wanted: impl Fn(&usize) -> bool) -> Option<usize> {
    least_of(all, |i| !all[*i].bent && wanted(i))
}

/// The index of the hypothesis with the least score among those for whose index `wanted` is true.
fn least_of(all: &[Hypothesis], wanted: impl Fn(&usize) -> bool) -> Option<usize> {
    (0..all.len())
        .filter(wanted)
        .min_by(|a, b| all[*a].score().total_cmp(&all[*b].score()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};
    use crate::terms::Bench;
    use model_core::effects::spec;

    /// Lags that were chosen first imitate the echo. Beside them the echo lowers the error less than alone.
    #[test]
    fn an_effect_is_also_tried_without_the_lags_that_were_chosen_before_it() {
        let records = records(&["echo-path"], &[], 1);
        let bench = Bench::of(&base(&records), &records).expect("records to learn from");
        let never = AtomicBool::new(false);
        let search = Search::silent(&bench.judge, 1, &never);
        let root = Hypothesis::new(bench.judge.refitted(&bench.given).expect("stable"));
        let echo = Term::unfitted(spec("echo-path").expect("in the catalogue"), &bench.given);
        let mut all = vec![root];
        let (mut purged, mut effort) = (Vec::new(), Effort::of_a_search());
        // A model without effects stays.
        search.purge(&mut all, &mut purged, &mut effort);
        assert_eq!(all.len(), 1);
        let lags = [Term::State(90), Term::Product(90)];
        let lagged = lags
            .iter()
            .fold(all[0].judged.model().clone(), |model, term| {
                term.added_to(&model, &[])
            });
        let judged = bench.judge.refitted(&lagged).expect("stable");
        let lagged = Hypothesis {
            terms: lags.to_vec(),
            ..Hypothesis::new(judged)
        };
        let with = search.with(&lagged, &echo, &echo.added_to(&bench.given, &[]));
        all.push(with.expect("stable"));
        search.purge(&mut all, &mut purged, &mut effort);
        assert_eq!(all.len(), 3);
        assert_eq!(all[2].words(), echo.name());
        assert!(all[2].score() < all[1].score());
        // The same effects are not fitted again.
        search.purge(&mut all, &mut purged, &mut effort);
        assert_eq!(all.len(), 3);

        // A given model with less than half of the error does not end the search for effects from the fewest lags; the
        // other way round it does.
        let from = |from_given: bool, of: &Hypothesis| Hypothesis {
            from_given,
            expanded: false,
            ..of.clone()
        };
        let (root, better) = (&all[0], &all[2]);
        assert!(better.judged.rmse() < root.judged.rmse() / RULES.rival);
        let is_followed = |given_leads: bool| {
            let both = [from(!given_leads, root), from(given_leads, better)];
            search.chosen(&both, None).contains(&(0, true))
        };
        assert!(is_followed(true) && !is_followed(false));
    }
}
