//! Effect after effect: forward with pruning, from more than one first step.

use super::bench::{Bench, FLOOR_MARGIN, Judged, LEVEL, Round};
use super::evidence::{HeldOut, p_value};
use super::rank::{WORTHWHILE, alike, prefers};
use super::{NotTried, Ranked, Rung};
use crate::model::Model;
use crate::simulate::SimulateError;
use model_core::effect::Spec;

/// Other first steps that are followed where the first one did not end at once.
const OTHER_STARTS: usize = 2;
/// What another first step must gain, as a share of the best one's gain.
const CONTENDER: f64 = 0.5;

/// What may come after the first step of a path.
enum Next<'a> {
    /// All candidates.
    Any,
    /// Those that counted in some round.
    Seen,
    /// This one.
    Only(&'a str),
}

/// From a base model, effect by effect.
#[derive(Clone)]
pub(super) struct Climb {
    pub(super) base: Judged,
    pub(super) current: Judged,
    pub(super) added: Vec<&'static Spec>,
    pub(super) ladder: Vec<Rung>,
    pub(super) ranking: Vec<Ranked>,
    pub(super) not_tried: Vec<NotTried>,
    /// Candidates that matched an effect when it was added, by its name.
    pub(super) matched: Vec<(&'static Spec, Vec<String>)>,
}

impl Bench<'_> {
    /// Adds effects as long as one is significant and worth it. Where one is not
    /// enough, other first steps are tried as well: the best first one can be an
    /// imitation that only a second one completes.
    pub(super) fn climb(&self, base: Judged, step: &str, most: usize) -> Climb {
        let mut start = Climb {
            ladder: vec![self.rung(&base.held_out, &[], step)],
            current: base.clone(),
            base,
            added: Vec::new(),
            ranking: Vec::new(),
            not_tried: Vec::new(),
            matched: Vec::new(),
        };
        if most == 0 || self.at_the_floor(&start.current.held_out) {
            return start;
        }
        let round = self.round(&start.current, &|_| true);
        if self.interrupted() {
            return start;
        }
        start.ranking = self.rank(&start.base, &start.current, &round);
        start.not_tried.clone_from(&round.not_tried);
        let before = start.current.held_out.rmse().powi(2);
        let gain = |ranked: &Ranked| before - ranked.validate_rmse.powi(2);
        let contenders: Vec<&Ranked> = start.ranking.iter().filter(|r| r.significant).collect();
        let Some(leader) = contenders.first() else {
            return start;
        };
        let mut seen: Vec<String> = contenders.iter().map(|r| r.effect.clone()).collect();
        let mut best = self.follow(&start, &round, leader, most, &mut seen, &Next::Any);
        if best.added.len() > 1 || self.is_above_floor(&best.current) {
            let promising = contenders[1..]
                .iter()
                .filter(|other| gain(other) >= CONTENDER * gain(leader));
            for other in promising.take(OTHER_STARTS) {
                let path = self.follow(&start, &round, other, most, &mut seen, &Next::Seen);
                if self.ends_better(&path, &best) {
                    best = path;
                }
            }
        }
        if most > 1
            && self.is_above_floor(&best.current)
            && let Some(mut path) = self.unbent(&start, &round, &leader.effect, &best)
        {
            self.go_on(&mut path, most, &mut seen, &Next::Any);
            best = path;
        }
        self.leader_first(&mut best, &leader.effect);
        best
    }

    /// One path: `first`, then the leaders of the rounds after it.
    fn follow(
        &self,
        start: &Climb,
        round: &Round,
        first: &Ranked,
        most: usize,
        seen: &mut Vec<String>,
        next: &Next,
    ) -> Climb {
        let mut path = start.clone();
        self.add(&mut path, round, first);
        self.go_on(&mut path, most, seen, next);
        path
    }

    /// Two effects that end better than `best`, if there are: each that helps at all,
    /// then the leader or the first of `best`. An effect that has bent to imitate
    /// another as well may not find back when that is added; the other way round it
    /// sets out unbent.
    fn unbent(&self, start: &Climb, round: &Round, leader: &str, best: &Climb) -> Option<Climb> {
        let mut bent = vec![leader];
        bent.extend(best.added.first().map(|spec| spec.name));
        bent.dedup();
        let helps = |ranked: &&Ranked| ranked.error_reduction_percent > 0.0;
        let mut found: Option<Climb> = None;
        for first in start.ranking.iter().filter(helps) {
            for second in bent.iter().filter(|bent| **bent != first.effect) {
                let next = Next::Only(second);
                let path = self.follow(start, round, first, 2, &mut Vec::new(), &next);
                if self.ends_better(&path, found.as_ref().unwrap_or(best)) {
                    found = Some(path);
                }
            }
        }
        found
    }

    fn ends_better(&self, path: &Climb, best: &Climb) -> bool {
        let end = |climb: &Climb| climb.added.len();
        prefers((&path.current, end(path)), (&best.current, end(best)))
            && !self.drifts_more(&path.current, &best.current)
    }

    /// Names the best single effect first if it is among those that were added: the
    /// ladder then falls the way the ranking does.
    fn leader_first(&self, climb: &mut Climb, leader: &str) {
        let place = climb.added.iter().position(|spec| spec.name == leader);
        let Some(place) = place.filter(|place| *place > 0) else {
            return;
        };
        let mut order = climb.added.clone();
        let leader = order.remove(place);
        order.insert(0, leader);
        // From the last effect back, each rung is the model without it.
        let base = climb.base.model().clone();
        let mut current = climb.current.clone();
        let mut rungs = Vec::new();
        for count in (1..=order.len()).rev() {
            let names: Vec<String> = order[..count].iter().map(|s| s.name.to_owned()).collect();
            let step = format!("with {}", order[count - 1].name);
            rungs.push(self.rung(&current.held_out, &names, &step));
            if count > 1 {
                let Some(without) = self.without(&current, order[count - 1], &base) else {
                    return;
                };
                current = without;
            }
        }
        climb.ladder.truncate(1);
        climb.ladder.extend(rungs.into_iter().rev());
        climb.added = order;
    }

    /// Adds the leader of one round after the other. `seen` are the effects that
    /// counted in any round so far.
    fn go_on(&self, climb: &mut Climb, most: usize, seen: &mut Vec<String>, next: &Next) {
        while climb.added.len() < most
            && !self.at_the_floor(&climb.current.held_out)
            && !self.interrupted()
        {
            let round = self.round(&climb.current, &|name| match next {
                Next::Any => true,
                Next::Seen => seen.iter().any(|seen| seen == name),
                Next::Only(only) => name == *only,
            });
            if self.interrupted() {
                break;
            }
            let ranked = self.rank(&climb.base, &climb.current, &round);
            for counted in ranked.iter().filter(|r| r.significant) {
                if !seen.contains(&counted.effect) {
                    seen.push(counted.effect.clone());
                }
            }
            let Some(leader) = ranked.iter().find(|candidate| candidate.significant) else {
                break;
            };
            self.add(climb, &round, leader);
        }
    }

    fn add(&self, climb: &mut Climb, round: &Round, winner: &Ranked) {
        let mut candidates = round.candidates.iter();
        let Some((spec, judged)) = candidates.find(|(spec, _)| spec.name == winner.effect) else {
            return;
        };
        climb.added.push(spec);
        climb.matched.push((spec, winner.confounded_with.clone()));
        climb.current = judged.clone();
        self.prune(climb);
        let names: Vec<String> = climb.added.iter().map(|s| s.name.to_owned()).collect();
        let step = format!("with {}", winner.effect);
        climb
            .ladder
            .push(self.rung(&climb.current.held_out, &names, &step));
    }

    /// Drops effects that the last one has made needless.
    fn prune(&self, climb: &mut Climb) {
        let base = climb.base.model().clone();
        let mut index = 0;
        while climb.added.len() > 1 && index + 1 < climb.added.len() {
            let without = self.without(&climb.current, climb.added[index], &base);
            let needless = without.filter(|judged| {
                let loss = judged.held_out.rmse() / climb.current.held_out.rmse() - 1.0;
                let p = p_value(&judged.held_out, &climb.current.held_out);
                loss < WORTHWHILE || p > LEVEL
            });
            match needless {
                Some(judged) => {
                    climb.current = judged;
                    let dropped = climb.added.remove(index);
                    climb.matched.retain(|(spec, _)| spec.name != dropped.name);
                }
                None => index += 1,
            }
        }
    }

    /// The models in which another effect stands for one that was added and the
    /// held-out records still cannot tell: by the name of the one, the name of
    /// the other and its model.
    pub(super) fn stand_ins(&self, climb: &Climb) -> Vec<(String, String, Model)> {
        let base = climb.base.model().clone();
        let mut found = Vec::new();
        for (spec, others) in &climb.matched {
            let others = others.iter().filter(|name| {
                let added = climb.added.iter().any(|spec| spec.name == name.as_str());
                !added && !self.interrupted()
            });
            let others: Vec<&String> = others.collect();
            if others.is_empty() {
                continue;
            }
            let without = if climb.added.len() == 1 {
                Some(climb.base.clone())
            } else {
                self.without(&climb.current, spec, &base)
            };
            let Some(without) = without else { continue };
            for name in others {
                let Some(other) = climb.current.model().spec(name) else {
                    continue;
                };
                let Ok(judged) = self.with(&without, other) else {
                    continue;
                };
                if alike(&judged.held_out, &climb.current.held_out) {
                    found.push((spec.name.to_owned(), name.clone(), judged.model().clone()));
                }
            }
        }
        found
    }

    /// A given model refitted; with the product u·y where it has none and gains by
    /// it: that term is in the base class and never counts as missing. Where the
    /// refit alone has lost what the model could do `as_given`, gaining some of it
    /// back is no gain.
    pub(super) fn with_the_product(
        &self,
        given: &Model,
        as_given: &HeldOut,
    ) -> Result<(Judged, &'static str), SimulateError> {
        let plain = self.refitted(given)?;
        if given.product_lags.is_empty() {
            let bilinear = Model {
                product_lags: vec![1],
                c: vec![0.0; given.b.len()],
                ..plain.model().clone()
            };
            if let Ok(bilinear) = self.refitted(&bilinear) {
                let before = plain.held_out.rmse().min(as_given.rmse());
                let gain = 1.0 - bilinear.held_out.rmse() / before;
                let p = p_value(&plain.held_out, &bilinear.held_out);
                if gain > WORTHWHILE && p < LEVEL {
                    return Ok((bilinear, "refitted with the product of input and output"));
                }
            }
        }
        Ok((plain, "refitted in free run"))
    }

    /// Climbs again from the given structure where its free lags hold more than
    /// the lean model and all its effects: then its dynamics is not lean.
    pub(super) fn or_from_given(
        &self,
        climb: Climb,
        given: &Model,
        most: usize,
    ) -> Result<Climb, SimulateError> {
        let lean = climb.base.model();
        let richer = given.a.len() + given.c.len() > lean.a.len() + lean.c.len();
        let floor = FLOOR_MARGIN * self.noise_rmse();
        let reached = climb.current.held_out.rmse() <= floor;
        if !richer || reached || self.interrupted() {
            return Ok(climb);
        }
        let Ok(base) = self.refitted(given) else {
            return Ok(climb);
        };
        if base.held_out.rmse() > (1.0 - WORTHWHILE) * climb.current.held_out.rmse() {
            return Ok(climb);
        }
        Ok(self.climb(base, "refitted in free run", most))
    }
}
