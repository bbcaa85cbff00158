//! Certificates of effects: a test whose error rate does not depend on what else is missing (theory 4.5).

use super::RULES;
use super::alternatives::Set;
use super::ranking::Rival;
use super::session::Session;
use crate::model::Model;
use crate::parallel;
use crate::terms::{Found, Hypothesis, MostLikely, Term, log_e, p_of};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::PoisonError;

/// The certificate of an effect: a bound on its false-alarm rate, valid even if other effects are missing (theory
/// 4.5).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Certificate {
    /// ln of the Bayes factor of the model with the effect against the best model without it, nats.
    pub evidence_nats: f64,
    /// ln of the e-value against the hypothesis that a model without the effect is true, nats: `evidence_nats`
    /// minus ln of the number of models tried.
    pub log_e: f64,
    /// Level α, 0 to 1. The effect is certified if the log e-value is at least ln(1/α). At most a share α of
    /// certificates is false, provided that the noise model is right and the base class contains the true base.
    pub alpha: f64,
    /// Names of the records from which the certificate was computed.
    pub records: Vec<String>,
    /// Of the variance that the best model without the effect leaves unexplained: the share that the model with the
    /// effect explains. At most 1; negative if the model with the effect leaves more variance unexplained.
    #[serde(skip)]
    pub share: f64,
}

impl Certificate {
    /// Whether the effect is certified.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.log_e >= -self.alpha.ln()
    }

    /// The p-value that the e-value bounds: by Markov's inequality at most its inverse.
    #[must_use]
    pub(super) fn p_value(&self) -> f64 {
        p_of(self.log_e)
    }

    /// Whether the effect is certified although part of the error stays unexplained. It must then explain most of the
    /// error: an effect that imitates another cause explains less.
    #[must_use]
    pub fn holds_beside_others(&self) -> bool {
        self.holds() && self.share >= RULES.certified_share
    }
}

/// Parsimony: the final model has more evidence than the given one, with fewer parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parsimony {
    /// The effects of the final model.
    pub effects: Vec<String>,
    /// ln of the evidence of the final model minus that of the given model, nats.
    pub nats: f64,
    /// Number of coefficients and parameters that the final model has fewer than the given one.
    pub terms_fewer: usize,
}

impl Session<'_> {
    /// Compares `last`, which has these effects, with the given model. `None` unless it has more evidence and fewer
    /// parameters.
    pub(super) fn parsimony(&self, last: &Hypothesis, effects: &[String]) -> Option<Parsimony> {
        if effects.is_empty() {
            return None;
        }
        let (terms_fewer, nats) = self.leaner_than_given(last)?;
        Some(Parsimony {
            effects: effects.to_vec(),
            nats,
            terms_fewer,
        })
    }

    /// Number of parameters that `model` has fewer than the given model, and nats of evidence that it has more. `None`
    /// if one of the two numbers is not positive.
    fn leaner_than_given(&self, model: &Hypothesis) -> Option<(usize, f64)> {
        let count = |model: &Model| model.coordinates().len();
        let fewer = count(self.given).checked_sub(count(model.judged.model()))?;
        if fewer == 0 {
            return None;
        }
        let nats = self.evidence_of(model.judged.model())? - self.evidence_of(self.given)?;
        (nats > 0.0).then_some((fewer, nats))
    }

    /// Whether the given model imitates the effects of `model` with more parameters and less evidence. Its error is then
    /// no measure of what the effects explain.
    pub(super) fn given_imitates(&self, model: &Hypothesis) -> bool {
        self.leaner_than_given(model).is_some()
    }

    /// ln of the evidence of a model at its most likely parameters, nats; `None` if its free run diverges. Several
    /// certificates need the same models, so each model is fitted once.
    pub(super) fn evidence_of(&self, model: &Model) -> Option<f64> {
        let all = || {
            self.evidences
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
        };
        if let Some((_, met)) = all().iter().find(|(met, _)| met == model) {
            return *met;
        }
        let judge = self.judge();
        let evidence = MostLikely::of(judge, model).and_then(|likely| likely.evidence(judge));
        all().push((model.clone(), evidence));
        evidence
    }

    /// The certificate of all effects of `subject` together, against one model without them and the given model.
    pub(super) fn certified(
        &self,
        subject: &Hypothesis,
        without: &Hypothesis,
        found: &Found,
    ) -> Option<Certificate> {
        let effects = subject.terms.iter().filter_map(Term::effect);
        let names: Vec<&str> = effects.map(|effect| effect.name).collect();
        let nulls: Vec<Null> = std::iter::once(self.null(without)?)
            .chain(self.given_without(subject, &names))
            .collect();
        self.certificate(subject, &nulls, found)
    }

    /// The certificate of `subject` against `without` alone.
    pub(super) fn certified_over(
        &self,
        subject: &Hypothesis,
        without: &Hypothesis,
        found: &Found,
    ) -> Option<Certificate> {
        self.certificate(subject, &[self.null(without)?], found)
    }

    /// The given model as a null model for `subject`, unless it has one of these effects or diverges.
    fn given_without(&self, subject: &Hypothesis, effects: &[&str]) -> Option<Null> {
        if effects.iter().any(|name| self.given.has_effect(name)) {
            return None;
        }
        let excess = match self.given_imitates(subject) {
            true => f64::INFINITY,
            false => self.judge().excess(self.as_given),
        };
        Some(Null {
            evidence: self.evidence_of(self.given)?,
            excess,
        })
    }

    fn null(&self, hypothesis: &Hypothesis) -> Option<Null> {
        Some(Null {
            evidence: self.evidence_of(hypothesis.judged.model())?,
            excess: self.judge().excess(&hypothesis.judged.held_out),
        })
    }

    /// The certificate of `subject` against these null models; `None` without any.
    fn certificate(
        &self,
        subject: &Hypothesis,
        nulls: &[Null],
        found: &Found,
    ) -> Option<Certificate> {
        let own = self.evidence_of(subject.judged.model())?;
        let most = nulls.iter().map(|null| null.evidence).reduce(f64::max)?;
        let all = self.judge().first_fold();
        let mut records: Vec<String> = all.iter().map(|record| record.name.clone()).collect();
        records.dedup();
        let left = self.judge().excess(&subject.judged.held_out);
        let without = nulls.iter().map(|null| null.excess);
        let without = without.fold(f64::INFINITY, f64::min);
        Some(Certificate {
            evidence_nats: own - most,
            log_e: log_e(own, most, found.tried),
            alpha: RULES.level_of_search,
            records,
            share: 1.0 - left / without.max(f64::MIN_POSITIVE),
        })
    }

    /// The certificate of each effect of `subject`: the evidence of `subject` over the largest evidence of a model
    /// with neither the effect nor another member of its equivalence set.
    pub(super) fn certificates(
        &self,
        subject: &Hypothesis,
        sets: &[Set],
        others: &[Rival],
        found: &Found,
    ) -> BTreeMap<String, Certificate> {
        if subject.is_bare() {
            return BTreeMap::new();
        }
        let without = |index: usize| {
            subject.terms[index].effect()?;
            self.search.without(subject, index, &found.root)
        };
        let mut lesser: Vec<Option<Hypothesis>> = parallel::each(0..subject.terms.len(), without);
        // Null models are often common to several effects, so each is fitted once.
        let mut distinct: Vec<Hypothesis> = Vec::new();
        let mut effects: Vec<(String, Vec<usize>)> = Vec::new();
        for (index, effect) in subject.terms.iter().enumerate() {
            let Some(effect) = effect.effect() else {
                continue;
            };
            let name = effect.name.to_owned();
            let set = sets.iter().find(|set| set.effect.name == name);
            let names = set.map_or_else(|| vec![name.clone()], Set::names);
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let rivals = others.iter().filter_map(|rival| rival.refitted.as_ref());
            let nulls = [
                Some(found.bare.clone()),
                lesser[index].take(),
                Hypothesis::best_without(found.all.iter(), &names).cloned(),
                Hypothesis::best_without(rivals, &names).cloned(),
            ];
            let places = nulls.into_iter().flatten().map(|null| {
                let is_same = |other: &Hypothesis| is_same(other, &null);
                distinct.iter().position(is_same).unwrap_or_else(|| {
                    distinct.push(null);
                    distinct.len() - 1
                })
            });
            let places = places.collect();
            effects.push((name, places));
        }
        let nulls: Vec<Option<Null>> = parallel::each(&distinct, |null| self.null(null));
        let certificates = effects.into_iter().filter_map(|(name, places)| {
            // Without the evidence of a null model nothing is certified.
            let nulls: Option<Vec<Null>> = places.into_iter().map(|at| nulls[at]).collect();
            let mut nulls = nulls?;
            nulls.extend(self.given_without(subject, &[&name]));
            Some((name, self.certificate(subject, &nulls, found)?))
        });
        certificates.collect()
    }
}

/// The properties of a model without the effect that a certificate needs.
#[derive(Clone, Copy)]
struct Null {
    /// ln of the evidence, nats.
    evidence: f64,
    /// Variance above the noise on the validation samples, y²; infinite for a model that imitates the effects.
    excess: f64,
}

/// Whether two hypotheses are the same model, found by two searches.
fn is_same(a: &Hypothesis, b: &Hypothesis) -> bool {
    let [least, most] = [f64::min, f64::max].map(|of| of(a.judged.rmse(), b.judged.rmse()));
    a.is_built_as(b.judged.model()) && most <= (1.0 + f64::EPSILON.sqrt()) * least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Options;
    use crate::residual::plants::{base, records};
    use crate::terms::{Bench, Search};
    use model_core::effects::spec;
    use std::sync::Mutex;
    use std::sync::atomic::AtomicBool;

    /// Eight lags imitate a vortex behind every rising edge, with more parameters and less evidence. Neither a leaner
    /// given model nor one with more evidence is an imitation.
    #[test]
    fn a_given_model_with_more_parameters_and_less_evidence_imitates() {
        let records = records(&["starting-vortex"], &[], 3);
        let bench = Bench::of(&base(&records), &records).expect("records to learn from");
        let (judge, lean) = (&bench.judge, &bench.given);
        let effect = Term::Effect {
            spec: spec("starting-vortex").expect("in the catalogue"),
            parameters: vec![0.5, 0.05],
            grading: lean.grading,
            reference: None,
        };
        let with_lags = Model {
            state_lags: vec![1, 2, 4, 8, 16, 32, 64, 128],
            a: [&lean.a[..1], &[0.0; 7]].concat(),
            ..lean.clone()
        };
        let fitted = |model: &Model| Hypothesis::new(judge.refitted(model).expect("stable"));
        let lagged = fitted(&with_lags);
        let named = fitted(&effect.added_to(lean, &[]));
        let bare = fitted(lean);
        let interrupt = AtomicBool::new(false);
        let search = Search::silent(judge, 1, &interrupt);
        let imitates = |given: &Hypothesis, model: &Hypothesis| {
            let session = Session {
                search: &search,
                units: bench.units,
                options: &Options::default(),
                given: given.judged.model(),
                as_given: &given.judged.held_out,
                evidences: Mutex::default(),
            };
            session.given_imitates(model)
        };
        assert!(imitates(&lagged, &named));
        assert!(!imitates(&bare, &named));
        assert!(!imitates(&lagged, &bare));
    }

    /// ln(50) nats correspond to a p-value of 0.02; an e-value below 1 gives no information.
    #[test]
    fn an_e_value_bounds_the_p_value_by_its_inverse() {
        let p_value = |log_e: f64| {
            let certificate = Certificate {
                evidence_nats: log_e,
                log_e,
                alpha: 0.02,
                records: Vec::new(),
                share: 1.0,
            };
            certificate.p_value()
        };
        assert!((p_value(50.0_f64.ln()) - 0.02).abs() < 1e-12);
        assert_eq!(p_value(-3.0), 1.0);
        assert!(p_value(1e4) > 0.0);
    }

    #[test]
    fn an_effect_is_certified_beside_others_by_its_evidence_and_its_share() {
        let holds = |log_e: f64, share: f64| {
            let certificate = Certificate {
                evidence_nats: log_e,
                log_e,
                alpha: 0.02,
                records: Vec::new(),
                share,
            };
            (certificate.holds(), certificate.holds_beside_others())
        };
        assert_eq!(holds(223.0, 0.86), (true, true));
        // Most of what the effect explains may have another cause.
        assert_eq!(holds(223.0, 0.56), (true, false));
        assert_eq!(holds(-184.0, 0.9), (false, false));
        assert_eq!(holds(3.0, 0.9), (false, false));
    }
}
