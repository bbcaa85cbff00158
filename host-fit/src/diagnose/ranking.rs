//! Ranking of the candidates on one model, and which of them are not distinguishable.

use super::certificate::Certificate;
use super::estimate::estimates;
use super::session::Session;
use super::{NotTried, RULES, Ranked};
use crate::model::Model;
use crate::parallel;
use crate::terms::{
    Candidate, Found, HeldOut, Hypothesis, Judged, Screen, Search, Table, Term, p_value,
};
use model_core::effect::Spec;

/// Name of a longer memory in equivalence sets.
pub const FLOW_MEMORY: &str = "flow-memory";
/// Name of a second lag of the flow in equivalence sets.
pub const FLOW_LAG: &str = "flow-lag";

/// Whether two models are not distinguishable: the difference of their errors is not significant, or below
/// the practical margin.
pub(super) fn alike(a: &HeldOut, b: &HeldOut) -> bool {
    let (better, worse) = if a.rmse() <= b.rmse() { (a, b) } else { (b, a) };
    worse.rmse() <= (1.0 + RULES.alike) * better.rmse() || p_value(worse, better) >= RULES.level
}

/// A candidate with its first-order prediction, and refitted if the prediction was good enough.
pub(super) struct Rival {
    /// The effect's name, or that of a base term: a memory, a lag, a path of the drive.
    pub(super) name: String,
    pub(super) spec: Option<&'static Spec>,
    pub(super) refitted: Option<Hypothesis>,
    /// First-order prediction of the validation error, inner units rms.
    pub(super) promised: f64,
}

impl Rival {
    pub(super) fn rmse(&self) -> f64 {
        self.judged().map_or(self.promised, Judged::rmse)
    }

    /// Validation error as measured, scatter of the level included.
    fn measured_rmse(&self) -> f64 {
        let measured = |judged: &Judged| judged.held_out.measured_rmse();
        self.judged().map_or(self.promised, measured)
    }

    /// Fits of the candidate, if it was refitted.
    pub(super) fn judged(&self) -> Option<&Judged> {
        Some(&self.refitted.as_ref()?.judged)
    }
}

/// All candidates for `context`, best first. The most promising ones and `named` are refitted.
pub(super) fn rivals(search: &Search<'_>, context: &Hypothesis, named: &[&str]) -> Vec<Rival> {
    match Screen::new(search.judge, context.judged.model()) {
        Some(screen) => {
            let table = Table::of(&screen, &search.known, true);
            refitted(search, context, named, &screen, &table)
        }
        None => Vec::new(),
    }
}

/// The most promising candidates and `named`, refitted on `context`. None if no effect is named.
fn refitted(
    search: &Search<'_>,
    context: &Hypothesis,
    named: &[&str],
    screen: &Screen<'_>,
    table: &Table,
) -> Vec<Rival> {
    let of = |name: &str| {
        let is = |candidate: &&Candidate| candidate.term.effect().is_some_and(|s| s.name == name);
        table.candidates.iter().find(is)
    };
    let found: Vec<&Candidate> = named.iter().filter_map(|name| of(name)).collect();
    rated(
        screen,
        table,
        context.judged.rmse(),
        |place, name, candidate| {
            // Base terms often have a small first-order prediction and fit equally well after a refit. The same
            // holds for named effects at another grid point. Both are refitted too.
            let wanted = place < RULES.ranked_in_full
                || candidate.term.effect().is_none()
                || named.contains(&name)
                || (found.iter()).any(|own| table.are_alike(screen, own, candidate));
            if !wanted || named.is_empty() {
                return None;
            }
            let proposal = screen.alone(table, candidate)?;
            let brief =
                search.set_out(context.judged.model(), &proposal, crate::terms::RULES.brief)?;
            let terms = [context.terms.clone(), proposal.terms].concat();
            let count = terms.len();
            search.finish(terms, brief, count)
        },
    )
}

fn rated(
    screen: &Screen<'_>,
    table: &Table,
    before: f64,
    refit: impl Fn(usize, &str, &Candidate) -> Option<Hypothesis> + Sync,
) -> Vec<Rival> {
    // The best candidate of each kind, in the order of the predictions.
    let mut best: Vec<(String, &Candidate)> = Vec::new();
    for candidate in &table.candidates {
        let name = match &candidate.term {
            Term::Effect { spec, .. } => spec.name.to_owned(),
            Term::Memory(_) | Term::Wake(_) => FLOW_MEMORY.to_owned(),
            Term::Inertia(_) => FLOW_LAG.to_owned(),
            Term::Path { spec, .. } => spec.name.to_owned(),
            Term::State(_) | Term::Product(_) | Term::Offset | Term::LevelRate => continue,
        };
        if !best.iter().any(|(met, _)| *met == name) {
            best.push((name, candidate));
        }
    }
    let mut rated: Vec<Rival> = parallel::each(0..best.len(), |place| {
        let (name, candidate) = &best[place];
        Rival {
            name: name.clone(),
            spec: candidate.term.effect(),
            refitted: refit(place, name, candidate),
            promised: before * (1.0 - candidate.held_out).max(0.0).sqrt(),
        }
    });
    // Candidates that the screening rejected are listed as tried.
    let useless = screen.model().candidates().filter(|spec| {
        screen.pointless(spec).is_none() && !best.iter().any(|(name, _)| name == spec.name)
    });
    rated.extend(useless.map(|spec| Rival {
        name: spec.name.to_owned(),
        spec: Some(spec),
        refitted: None,
        promised: before,
    }));
    // Refitted candidates come before screened ones.
    rated.sort_by(|a, b| {
        let fitted = a.refitted.is_none().cmp(&b.refitted.is_none());
        fitted.then(a.rmse().total_cmp(&b.rmse()))
    });
    rated
}

impl Session<'_> {
    /// The ranking of the candidates added to `context`, in the user's units.
    pub(super) fn ranked(
        &self,
        context: &Hypothesis,
        rivals: &[Rival],
        found: &Found,
    ) -> Vec<Ranked> {
        let units = &self.units;
        let effects: Vec<(&Rival, &'static Spec)> = rivals
            .iter()
            .filter_map(|rival| Some((rival, rival.spec?)))
            .collect();
        parallel::each(&effects, |(rival, spec)| {
            let gain = 1.0 - rival.rmse() / context.judged.rmse();
            let others = effects.iter().filter(|(other, _)| {
                let both = (other.judged(), rival.judged());
                let (Some(a), Some(b)) = both else {
                    return false;
                };
                other.name != rival.name && alike(&a.held_out, &b.held_out)
            });
            let refitted = rival.refitted.as_ref();
            let certificate = refitted.and_then(|with| self.certified_over(with, context, found));
            let p_value = certificate.as_ref().map_or(1.0, Certificate::p_value);
            Ranked {
                effect: rival.name.clone(),
                validate_rmse: rival.measured_rmse() * units.y,
                error_reduction_percent: 100.0 * gain,
                p_value,
                gain_nats: certificate.map(|certificate| certificate.evidence_nats),
                parameters: rival
                    .judged()
                    .map(|judged| estimates(&judged.fits[0], spec, units))
                    .unwrap_or_default(),
                confounded_with: others.map(|(other, _)| other.name.clone()).collect(),
                significant: p_value <= RULES.level && gain > RULES.worthwhile,
                refitted: refitted.is_some(),
                evidence_nats: rival
                    .judged()
                    .and_then(|judged| self.evidence_of(judged.model())),
            }
        })
    }
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
