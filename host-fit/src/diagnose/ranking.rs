//! Ranking of the candidates on one model, and which of them are not distinguishable.

use super::certificate::Certificate;
use super::estimate::estimates;
use super::session::Session;
use super::{NotTried, RULES, Ranked};
use crate::model::Model;
use crate::parallel;
use crate::terms::{
    Candidate, Found, HeldOut, Hypothesis, Judged, RULES as TERMS, Screen, Search, Table, Term,
    p_value,
};
use model_core::effect::Spec;
use std::sync::atomic::Ordering;

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

/// A candidate with a first estimate, and refitted if that was good enough.
pub(super) struct Rival {
    /// The effect's name, or that of a base term: a memory, a lag, a path of the drive.
    pub(super) name: String,
    pub(super) spec: Option<&'static Spec>,
    pub(super) refitted: Option<Hypothesis>,
    /// Validation error after a brief fit, or as the screening predicts it, inner units rms.
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

/// All candidates for `context`, best first. Those in reach of the least error and `named` are refitted.
pub(super) fn rivals(search: &Search<'_>, context: &Hypothesis, named: &[&str]) -> Vec<Rival> {
    match Screen::new(search.judge, context.judged.model()) {
        Some(screen) => {
            let table = Table::of(&screen, &search.known, true);
            refitted(search, context, named, &screen, &table)
        }
        None => Vec::new(),
    }
}

/// All candidates of `table`, fitted briefly on `context`; `named` and those whose error is then in reach of the least are
/// fitted in full. A first-order prediction excludes none: it says little of a threshold. None is fitted if no effect is
/// named.
fn refitted(
    search: &Search<'_>,
    context: &Hypothesis,
    named: &[&str],
    screen: &Screen<'_>,
    table: &Table,
) -> Vec<Rival> {
    let (model, before) = (context.judged.model(), context.judged.rmse());
    let all = best_of_each_kind(table);
    let begun = parallel::each(&all, |(_, candidate)| {
        let wanted = !named.is_empty() && !search.interrupt.load(Ordering::Relaxed);
        let proposal = wanted.then(|| screen.alone(table, candidate)).flatten()?;
        let brief = search.set_out(model, &proposal, TERMS.brief)?;
        let rmse = search.judge.held_out(|_| &brief.model).ok()?.rmse();
        Some((rmse, proposal, brief))
    });
    let least = begun.iter().flatten().map(|(rmse, ..)| *rmse);
    let least = least.fold(before, f64::min);
    // At least half of the largest gain, which says more than the error where all are near the noise.
    let reach = (TERMS.in_reach * least).min(0.5 * (least + before));
    let pairs: Vec<_> = all.iter().zip(begun).collect();
    let mut rated: Vec<Rival> = parallel::each(pairs, |((name, candidate), begun)| {
        let spec = candidate.term.effect();
        // A full fit also moves the lags of a base term.
        let reach = match spec {
            Some(spec) if named.contains(&spec.name) => f64::INFINITY,
            Some(_) => reach,
            None => TERMS.promising * least,
        };
        let predicted = || before * (1.0 - candidate.held_out).max(0.0).sqrt();
        let promised = (begun.as_ref()).map_or_else(predicted, |(rmse, ..)| *rmse);
        let begun = begun.filter(|(rmse, ..)| *rmse <= reach);
        let refitted = begun.and_then(|(_, proposal, brief)| {
            let terms = [context.terms.clone(), proposal.terms].concat();
            let count = terms.len();
            search.finish(terms, brief, count)
        });
        Rival {
            name: name.clone(),
            spec,
            refitted,
            promised,
        }
    });
    // Candidates that the screening rejected are listed as tried.
    let useless = model.candidates().filter(|spec| {
        screen.pointless(spec).is_none() && !all.iter().any(|(name, _)| name == spec.name)
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

/// The best candidate of each effect and kind of base term, with its name, in the order of the predictions.
fn best_of_each_kind(table: &Table) -> Vec<(String, &Candidate)> {
    let mut best: Vec<(String, &Candidate)> = Vec::new();
    for candidate in &table.candidates {
        let name = match &candidate.term {
            Term::Effect { spec, .. } | Term::Path { spec, .. } => spec.name,
            Term::Memory(_) | Term::Wake(_) => FLOW_MEMORY,
            Term::Inertia(_) => FLOW_LAG,
            Term::State(_) | Term::Product(_) | Term::Offset | Term::LevelRate => continue,
        };
        if !best.iter().any(|(met, _)| met == name) {
            best.push((name.to_owned(), candidate));
        }
    }
    best
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, long_records};
    use crate::terms::Bench;
    use std::sync::atomic::AtomicBool;

    /// A hysteresis whose lower threshold is 0 imitates friction. What the screening says of either depends on its starting
    /// point, so both are fitted, whichever was found.
    #[test]
    fn an_effect_that_does_as_well_as_the_found_one_is_fitted() {
        let records = long_records(&["dry-friction"], &[], 3);
        let bench = Bench::of(&base(&records), &records).expect("records to learn from");
        let never = AtomicBool::new(false);
        let search = Search::silent(&bench.judge, 1, &never);
        let context = Hypothesis::new(bench.judge.refitted(&bench.given).expect("stable"));
        let all = |named: &[&str]| rivals(&search, &context, named);
        let fitted = |all: &[Rival]| {
            let fitted = all.iter().filter(|rival| rival.refitted.is_some());
            fitted.map(|rival| rival.name.clone()).collect::<Vec<_>>()
        };
        assert!(fitted(&all(&[])).is_empty());
        for name in ["attachment-hysteresis", "dry-friction"] {
            let all = all(&[name]);
            let fitted = fitted(&all);
            assert!(fitted.contains(&"dry-friction".to_owned()), "{fitted:?}");
            assert!(
                !fitted.contains(&"vortex-shedding".to_owned()),
                "{fitted:?}"
            );
            // A prediction of the screening may lie below every fit; the error of a brief fit does not.
            let least = all[0].rmse();
            let promised = all.iter().map(|rival| rival.promised);
            assert!(promised.fold(f64::INFINITY, f64::min) >= least);
        }
    }
}
