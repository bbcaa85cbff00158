//! Candidates against the model they would be added to, and which of them the data
//! cannot tell apart.

use super::{NotTried, RULES, Ranked, estimates};
use crate::model::Model;
use crate::terms::{
    Candidate, HeldOut, Hypothesis, Judge, Judged, Screen, Search, Table, Term, Units, decoys,
    last_of_both, p_value,
};
use model_core::effect::Spec;
use rayon::prelude::*;

/// What a longer memory is called among the effects that data cannot tell apart.
pub const FLOW_MEMORY: &str = "flow-memory";
/// What a second lag of the flow is called there.
pub const FLOW_LAG: &str = "flow-lag";

/// Whether the data cannot tell two models apart: by chance or by size.
pub(super) fn alike(a: &HeldOut, b: &HeldOut) -> bool {
    let (better, worse) = if a.rmse() <= b.rmse() { (a, b) } else { (b, a) };
    worse.rmse() <= (1.0 + RULES.alike) * better.rmse() || p_value(worse, better) >= RULES.level
}

/// A candidate as the screening sees it, and refitted where it promised enough.
pub(super) struct Rival {
    /// Its name: an effect's, or what a memory or a lag of the flow is called.
    pub(super) name: String,
    pub(super) spec: Option<&'static Spec>,
    pub(super) judged: Option<Judged>,
    /// Held-out rms error as screened, inner units.
    pub(super) promised: f64,
}

impl Rival {
    pub(super) fn rmse(&self) -> f64 {
        self.judged.as_ref().map_or(self.promised, Judged::rmse)
    }
}

/// All candidates for `context`, best first: the most promising refitted, and `named`
/// in any case.
pub(super) fn rivals(search: &Search<'_>, context: &Hypothesis, named: &[&str]) -> Vec<Rival> {
    let model = context.judged.model();
    let Some(screen) = Screen::new(search.judge, model) else {
        return Vec::new();
    };
    let table = Table::of(&screen, &search.known, true);
    // The best of each kind, in the order of what they promise.
    let mut best: Vec<(String, &Candidate)> = Vec::new();
    for candidate in &table.candidates {
        let name = match &candidate.term {
            Term::Effect { spec, .. } => spec.name.to_owned(),
            Term::Memory(_) | Term::Wake(_) => FLOW_MEMORY.to_owned(),
            Term::Inertia(_) => FLOW_LAG.to_owned(),
            Term::State(_) | Term::Product(_) | Term::Offset | Term::LevelRate => {
                continue;
            }
        };
        if !best.iter().any(|(met, _)| *met == name) {
            best.push((name, candidate));
        }
    }
    // What the flow may be without a name promises little to first order, and often does as well.
    let wanted = |(place, (name, _)): (usize, &(String, &Candidate))| {
        place < RULES.ranked_in_full
            || [FLOW_MEMORY, FLOW_LAG].contains(&name.as_str())
            || named.contains(&name.as_str())
    };
    let before = context.judged.rmse();
    let rated: Vec<Rival> = best
        .par_iter()
        .enumerate()
        .map(|(place, (name, candidate))| {
            let judged = (wanted((place, &best[place])) && !named.is_empty())
                .then(|| refitted(search, &screen, &table, context, candidate))
                .flatten();
            Rival {
                name: name.clone(),
                spec: candidate.term.effect(),
                judged,
                promised: before * (1.0 - candidate.held_out).max(0.0).sqrt(),
            }
        })
        .collect();
    let mut rated = rated;
    // What the screening found no use for was tried all the same.
    let useless = model.candidates().filter(|spec| {
        screen.pointless(spec).is_none() && !best.iter().any(|(name, _)| name == spec.name)
    });
    rated.extend(useless.map(|spec| Rival {
        name: spec.name.to_owned(),
        spec: Some(spec),
        judged: None,
        promised: before,
    }));
    // What was fitted comes before what is only promised.
    rated.sort_by(|a, b| {
        let fitted = a.judged.is_none().cmp(&b.judged.is_none());
        fitted.then(a.rmse().total_cmp(&b.rmse()))
    });
    rated
}

fn refitted(
    search: &Search<'_>,
    screen: &Screen<'_>,
    table: &Table,
    context: &Hypothesis,
    candidate: &Candidate,
) -> Option<Judged> {
    let proposal = screen.alone(table, candidate)?;
    let brief = search.set_out(context.judged.model(), &proposal, crate::terms::RULES.brief)?;
    let terms = [context.terms.clone(), proposal.terms].concat();
    Some(search.finish(terms, brief)?.judged)
}

/// The ranking as it is reported, in the user's units.
pub(super) fn ranked(
    judge: &Judge,
    units: &Units,
    context: &Hypothesis,
    rivals: &[Rival],
    shifts: &[f64],
) -> Vec<Ranked> {
    let before = context.judged.rmse();
    let effects = || rivals.iter().filter_map(|r| Some((r, r.spec?)));
    effects()
        .map(|(rival, spec)| {
            let after = rival.rmse();
            // Every effect was looked at: the best of so many is often good by chance.
            let p = rival.judged.as_ref().map(|judged| {
                (RULES.alternatives * p_value(&context.judged.held_out, &judged.held_out)).min(1.0)
            });
            let chance = rival
                .judged
                .as_ref()
                .and_then(|judged| best_decoy(judge, &context.judged, judged, shifts));
            let gain = 1.0 - after / before;
            let others = effects().filter(|(other, _)| {
                let both = (other.judged.as_ref(), rival.judged.as_ref());
                let (Some(a), Some(b)) = both else {
                    return false;
                };
                other.name != rival.name && alike(&a.held_out, &b.held_out)
            });
            Ranked {
                effect: rival.name.clone(),
                validate_rmse: after * units.y,
                error_reduction_percent: 100.0 * gain,
                p_value: p.unwrap_or(1.0),
                best_decoy_percent: chance.map(|chance| 100.0 * chance),
                parameters: rival
                    .judged
                    .as_ref()
                    .map(|judged| estimates(&judged.fits[0], spec, units))
                    .unwrap_or_default(),
                confounded_with: others.map(|(other, _)| other.name.clone()).collect(),
                significant: p.is_some_and(|p| p < RULES.level)
                    && gain > RULES.worthwhile
                    && chance.is_none_or(|chance| gain > chance),
                refitted: rival.judged.is_some(),
            }
        })
        .collect()
}

/// Effects that cannot be tried on these records, and why.
pub(super) fn not_tried(search: &Search<'_>, model: &Model) -> Vec<NotTried> {
    let Some(screen) = Screen::new(search.judge, model) else {
        return Vec::new();
    };
    let reasons = model.candidates().filter_map(|spec| {
        Some(NotTried {
            effect: spec.name.to_owned(),
            reason: screen.pointless(spec)?,
        })
    });
    reasons.collect()
}

/// The best reduction of the held-out rms error among copies of the change that are
/// shifted in time or taken from another record.
fn best_decoy(judge: &Judge, without: &Judged, with: &Judged, shifts: &[f64]) -> Option<f64> {
    let change = |with: &HeldOut, without: &HeldOut| -> Vec<Vec<f64>> {
        let pairs = with.errors.iter().zip(&without.errors);
        pairs
            .map(|(with, without)| {
                let (with, without) = last_of_both(with, without);
                without.iter().zip(with).map(|(b, w)| b - w).collect()
            })
            .collect()
    };
    let learned = judge.learned(without).ok()?;
    let learning = change(&judge.learned(with).ok()?, &learned);
    let judging = change(&with.held_out, &without.held_out);
    let chances = decoys((&learned, &learning), (&without.held_out, &judging), shifts);
    let shares = chances
        .into_iter()
        .map(|energy| 1.0 - (1.0 - energy).max(0.0).sqrt());
    Some(shares.fold(0.0, f64::max))
}
