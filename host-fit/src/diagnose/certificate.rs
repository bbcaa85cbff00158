//! Certificates of effects: a test whose error rate does not depend on what else is missing (theory 4.5).

use super::RULES;
use super::alternatives::Set;
use super::flexible::Curve;
use super::ranking::Rival;
use super::session::Session;
use crate::model::Model;
use crate::parallel;
use crate::residual::NoiseSource;
use crate::terms::{Found, Hypothesis, MostLikely, Term, log_e, p_of};
use model_core::effect::Spec;
use model_core::effects::NUISANCES;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
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
    /// Share that the model with the effect explains of the variance that the best model without it leaves
    /// unexplained. At most 1; negative if the model with the effect leaves more variance unexplained. Models that
    /// imitate the effect with more parameters and less evidence do not count.
    #[serde(skip)]
    pub share: f64,
    /// The best curve in place of the effect. Computed if the model is above the noise level or that level is unknown, and
    /// the effect has enough evidence against all other models.
    pub curve: Option<Curve>,
}

impl Certificate {
    /// Whether the effect is certified.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.is_evident() && self.better_curve().is_none()
    }

    /// The curve that prevents the certificate.
    #[must_use]
    pub fn better_curve(&self) -> Option<&Curve> {
        let curve = self.curve.as_ref()?;
        (self.is_evident() && curve.evidence_nats < self.least()).then_some(curve)
    }

    /// Whether the evidence against other models is large enough: log e ≥ ln(1/α).
    #[must_use]
    pub fn is_evident(&self) -> bool {
        self.log_e >= self.least()
    }

    /// Evidence that a certificate needs, nats.
    fn least(&self) -> f64 {
        -self.alpha.ln()
    }

    /// Upper bound of the p-value: the inverse of the e-value (Markov's inequality).
    #[must_use]
    pub fn p_value(&self) -> f64 {
        p_of(self.log_e)
    }

    /// Whether the effect is certified although part of the error stays unexplained. It must then explain most of the
    /// error: an effect that imitates another cause explains less.
    #[must_use]
    pub fn holds_beside_others(&self) -> bool {
        self.holds() && self.share >= RULES.certified_share
    }

    /// Whether the effect may be named in a model that leaves an error above the noise level, or none.
    pub(super) fn permits_a_name(&self, error_remains: bool) -> bool {
        match error_remains {
            true => self.holds_beside_others(),
            false => self.holds(),
        }
    }
}

/// Parsimony: the final model has more evidence than the given one, with fewer parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parsimony {
    /// The effects of the final model.
    pub effects: Vec<String>,
    /// ln of the evidence of the final model minus that of the given model, nats.
    pub nats: f64,
    /// By how many coefficients and parameters the final model is smaller than the given one.
    pub terms_fewer: usize,
}

impl Session<'_> {
    /// Compares `last`, which has these effects, with the given model. `None` unless it has more evidence and fewer
    /// parameters.
    pub(super) fn parsimony(&self, last: &Hypothesis, effects: &[String]) -> Option<Parsimony> {
        if effects.is_empty() {
            return None;
        }
        let terms_fewer = count(self.given).checked_sub(count(last.judged.model()))?;
        let nats = self.evidence_of(last.judged.model())? - self.evidence_of(self.given)?;
        (terms_fewer > 0 && nats > 0.0).then(|| Parsimony {
            effects: effects.to_vec(),
            nats,
            terms_fewer,
        })
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
        let nulls = self.null(without).into_iter();
        let nulls: Vec<Null> = nulls.chain(self.given_without(&names)).collect();
        let own = self.evidence_of(subject.judged.model())?;
        self.certificate(subject, own, &nulls, found)
    }

    /// Whether the given model imitates the effects of `model`: it has none of these effects, but more parameters, and
    /// less evidence. At an unknown noise level a model of first or second order imitates nothing: its second lag is the
    /// simplest explanation, whose evidence is smaller only because the prior of a coefficient is wider than that of a
    /// time constant.
    pub(super) fn given_imitates(&self, model: &Hypothesis) -> bool {
        if self.judge().noise_source == NoiseSource::Scatter && is_of_second_order(self.given) {
            return false;
        }
        let names = model.terms.iter().filter_map(Term::effect);
        let names: Vec<&str> = names.map(|effect| effect.name).collect();
        let null = self.given_without(&names);
        let own = self.evidence_of(model.judged.model());
        null.zip(own)
            .is_some_and(|(null, own)| null.imitates(model, own))
    }

    /// The certificate of `subject` against `without` alone.
    pub(super) fn certified_over(
        &self,
        subject: &Hypothesis,
        without: &Hypothesis,
        found: &Found,
    ) -> Option<Certificate> {
        let own = self.evidence_of(subject.judged.model())?;
        self.certificate(subject, own, &[self.null(without)?], found)
    }

    /// The given model as a null model, unless it has one of these effects or diverges.
    fn given_without(&self, effects: &[&str]) -> Option<Null> {
        if effects.iter().any(|name| self.given.has_effect(name)) {
            return None;
        }
        Some(Null {
            evidence: self.evidence_of(self.given)?,
            excess: self.judge().excess(self.as_structured),
            parameters: searched(self.given),
        })
    }

    /// `None` if the free run diverges: such a model explains nothing.
    fn null(&self, hypothesis: &Hypothesis) -> Option<Null> {
        Some(Null {
            evidence: self.evidence_of(hypothesis.judged.model())?,
            excess: self.judge().excess(&hypothesis.judged.held_out),
            parameters: searched(hypothesis.judged.model()),
        })
    }

    /// The certificate of `subject` against these null models; `None` without any. `own` is ln of the evidence for its
    /// effects, nats.
    fn certificate(
        &self,
        subject: &Hypothesis,
        own: f64,
        nulls: &[Null],
        found: &Found,
    ) -> Option<Certificate> {
        let most = nulls.iter().map(|null| null.evidence).reduce(f64::max)?;
        let all = self.judge().first_fold();
        let mut records: Vec<String> = all.iter().map(|record| record.name.clone()).collect();
        records.dedup();
        let excess = |of: &Hypothesis| self.judge().excess(&of.judged.held_out);
        let (left, root) = (excess(subject), excess(&found.root));
        let real = nulls.iter().filter(|null| !null.imitates(subject, own));
        let without = real.map(|null| null.excess).fold(root, f64::min);
        Some(Certificate {
            evidence_nats: own - most,
            log_e: log_e(own, most, found.tried),
            alpha: RULES.level_of_search,
            records,
            share: 1.0 - left / without.max(f64::MIN_POSITIVE),
            curve: None,
        })
    }

    /// The certificate of each effect of `subject`: the largest evidence of the models with the effect, divided by the
    /// largest evidence of the models that contain neither the effect, nor another member of its equivalence set, nor an
    /// effect that reads the same channel. A model without the effect may have more evidence than `subject` because of
    /// its other terms; the effect is therefore also added to such models. `against_curves`: whether effects are also
    /// compared with curves (if `subject` is above the noise level, or that level is unknown).
    pub(super) fn certificates(
        &self,
        subject: &Hypothesis,
        sets: &[Set],
        others: &[Rival],
        found: &Found,
        against_curves: bool,
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
        let mut effects: Vec<(&Term, Option<Hypothesis>, Vec<usize>)> = Vec::new();
        for (index, term) in subject.terms.iter().enumerate() {
            let Some(effect) = term.effect() else {
                continue;
            };
            let name = effect.name.to_owned();
            let set = sets.iter().find(|set| set.effect.name == name);
            let names = set.map_or_else(|| vec![name.clone()], Set::names);
            let rivals = || others.iter().filter_map(|rival| rival.refitted.as_ref());
            // What reads the same channel says the same: that y depends on it.
            let models = found.all.iter().chain(rivals());
            let terms = models.flat_map(|model| &model.terms);
            let reads_it =
                |other: &&Spec| effect.channel.is_some() && other.channel == effect.channel;
            let alike = terms.filter_map(Term::effect).filter(reads_it);
            let names = names.iter().map(String::as_str);
            let names: Vec<&str> = names.chain(alike.map(|other| other.name)).collect();
            let nulls = [
                Some(found.bare.clone()),
                lesser[index].clone(),
                Hypothesis::best_without(found.all.iter(), &names).cloned(),
                Hypothesis::best_without(rivals(), &names).cloned(),
            ];
            let places = nulls.into_iter().flatten().map(|null| {
                let is_same = |other: &Hypothesis| is_same(other, &null);
                distinct.iter().position(is_same).unwrap_or_else(|| {
                    distinct.push(null);
                    distinct.len() - 1
                })
            });
            let places = places.collect();
            effects.push((term, lesser[index].take(), places));
        }
        let nulls: Vec<Option<Null>> = parallel::each(&distinct, |null| self.null(null));
        let model = subject.judged.model();
        let own = self.evidence_of(model);
        let noise_is_known = self.judge().noise_source != NoiseSource::Scatter;
        let is_at_noise = noise_is_known && self.is_at_noise(&subject.judged.held_out);
        let against_curves = against_curves && !is_at_noise;
        let certificates = effects.into_iter().filter_map(|(term, lesser, places)| {
            let name = term.effect()?.name;
            let evident = |at: &usize| Some((*at, nulls[*at]?));
            let own_nulls: Vec<(usize, Null)> = places.iter().filter_map(evident).collect();
            let most = own_nulls
                .iter()
                .max_by(|a, b| a.1.evidence.total_cmp(&b.1.evidence));
            let with = most
                .filter(|(_, null)| Some(null.evidence) > own)
                .and_then(|(most, _)| self.search.with(&distinct[*most], term, model));
            let with = with.and_then(|with| self.evidence_of(with.judged.model()));
            let mut nulls: Vec<Null> = own_nulls.iter().map(|(_, null)| *null).collect();
            nulls.extend(self.given_without(&[name]));
            let evidence = own.into_iter().chain(with).reduce(f64::max)?;
            let mut certificate = self.certificate(subject, evidence, &nulls, found)?;
            if against_curves && certificate.is_evident() {
                let lesser = lesser.unwrap_or_else(|| found.bare.clone());
                certificate.curve = self.against_curves(term, &lesser, evidence);
            }
            Some((name.to_owned(), certificate))
        });
        certificates.collect()
    }
}

/// The properties of a model without the effect that a certificate needs.
#[derive(Clone, Copy)]
struct Null {
    /// ln of the evidence, nats.
    evidence: f64,
    /// Variance above the noise on the validation samples, y².
    excess: f64,
    /// Number of coefficients, parameters and searched lags.
    parameters: usize,
}

impl Null {
    /// Whether the null model imitates the effects of `model`, with more parameters and less evidence. Its error is then
    /// no measure of what the effects explain. `evidence` is that of `model`, nats.
    fn imitates(&self, model: &Hypothesis, evidence: f64) -> bool {
        self.parameters > searched(model.judged.model()) && self.evidence < evidence
    }
}

/// Number of coefficients, parameters and searched lags of a model.
fn searched(model: &Model) -> usize {
    let lags = model.state_lags.iter().chain(&model.product_lags);
    let lags: BTreeSet<&u16> = lags.filter(|lag| **lag > 2).collect();
    count(model) + lags.len()
}

/// Whether a model is of first or second order without effects; base terms may be in it.
fn is_of_second_order(model: &Model) -> bool {
    let is_nuisance = |name: &str| NUISANCES.iter().any(|spec| spec.name == name);
    model.state_lags.iter().all(|lag| *lag <= 2)
        && model.effects.iter().all(|added| is_nuisance(&added.name))
}

/// Number of coefficients and parameters of a model.
fn count(model: &Model) -> usize {
    model.coordinates().len()
}

/// Whether two hypotheses are the same model, found by two searches.
fn is_same(a: &Hypothesis, b: &Hypothesis) -> bool {
    let [least, most] = [f64::min, f64::max].map(|of| of(a.judged.rmse(), b.judged.rmse()));
    a.is_built_as(b.judged.model()) && most <= (1.0 + f64::EPSILON.sqrt()) * least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curves::Place;
    use crate::diagnose::Options;
    use crate::residual::plants::{base, records};
    use crate::terms::{Bench, Search};
    use model_core::effects::spec;
    use std::sync::Mutex;
    use std::sync::atomic::AtomicBool;

    /// Eight lags imitate a vortex behind every rising edge, with more parameters and less evidence. A given model with
    /// fewer parameters, or with more evidence, is not an imitation.
    #[test]
    fn a_given_model_imitates_and_a_model_that_diverges_does_not_count() {
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
        let options = Options::default();
        let session = |given: &Hypothesis, check: &dyn Fn(&Session<'_>) -> bool| {
            check(&Session {
                search: &search,
                units: bench.units,
                options: &options,
                given: given.judged.model(),
                as_given: &given.judged.held_out,
                as_structured: &given.judged.held_out,
                evidences: Mutex::default(),
            })
        };
        let imitates = |given, model| session(given, &|session| session.given_imitates(model));
        assert!(imitates(&lagged, &named));
        assert!(!imitates(&bare, &named));
        assert!(!imitates(&lagged, &bare));
        // A model without the effect that diverges is no reason to doubt the effect; the given model is compared.
        let mut unstable = bare.clone();
        unstable.judged.fits[0].model.a = vec![1.5];
        let mut subject = named.clone();
        subject.terms = vec![effect];
        let found = bare.clone().alone();
        let holds = |session: &Session<'_>| {
            let certificate = session.certified(&subject, &unstable, &found);
            certificate.is_some_and(|certificate| certificate.holds())
        };
        assert!(session(&bare, &holds));
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
                curve: None,
            };
            certificate.p_value()
        };
        assert!((p_value(50.0_f64.ln()) - 0.02).abs() < 1e-12);
        assert_eq!(p_value(-3.0), 1.0);
        assert!(p_value(1e4) > 0.0);
    }

    /// Evidence against other models does not suffice if a curve explains the records as well.
    #[test]
    fn a_better_curve_prevents_a_certificate() {
        let against = |evidence_nats: f64| Certificate {
            evidence_nats: 223.0,
            log_e: 220.0,
            alpha: 0.02,
            records: Vec::new(),
            share: 0.9,
            curve: Some(Curve {
                place: Place::Flow,
                coordinate: "wind".to_owned(),
                evidence_nats,
            }),
        };
        assert!(against(34.0).holds() && against(34.0).better_curve().is_none());
        for nats in [3.0, -170.0] {
            let certificate = against(nats);
            assert!(!certificate.holds() && !certificate.holds_beside_others());
            assert_eq!(certificate.better_curve(), certificate.curve.as_ref());
        }
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
                curve: None,
            };
            let named = [false, true].map(|remains| certificate.permits_a_name(remains));
            let holds = [certificate.holds(), certificate.holds_beside_others()];
            assert_eq!(named, holds);
            (holds[0], holds[1])
        };
        assert_eq!(holds(223.0, 0.86), (true, true));
        // Most of what the effect explains may have another cause.
        assert_eq!(holds(223.0, 0.56), (true, false));
        assert_eq!(holds(-184.0, 0.9), (false, false));
        assert_eq!(holds(3.0, 0.9), (false, false));
    }
}
