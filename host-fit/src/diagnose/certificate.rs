//! Certificates of effects: a test whose error rate does not depend on what else is missing (theory 4.5).

use super::RULES;
use super::alternatives::Set;
use super::ranking::Rival;
use super::session::Session;
use crate::model::Model;
use crate::terms::{Found, Hypothesis, MostLikely, Term};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// The certificate of an effect: a bound on its false-alarm rate, whatever else is missing (theory 4.5).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Certificate {
    /// ln of the Bayes factor of the model with the effect against the best model without it, nats.
    pub evidence_nats: f64,
    /// ln of the e-value against "no model without the effect needs more", nats: ln of the evidence of the
    /// model with it, minus ln of the number of models tried, minus ln of the largest likelihood of any model
    /// without it.
    pub log_e: f64,
    /// Level α, 0 to 1. The effect is certified if the log e-value is at least ln(1/α). At most a share α of
    /// certificates is false, provided that the noise model holds and the base class contains the true base.
    pub alpha: f64,
    /// Names of the records from which it was computed.
    pub records: Vec<String>,
}

impl Certificate {
    /// Whether the effect is certified.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.log_e >= -self.alpha.ln()
    }
}

/// Parsimony: the final model explains the records better than the given one, with fewer parameters.
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
    /// Compares `last`, which has these effects, with `given`. `None` unless it has more evidence and fewer
    /// parameters.
    pub(super) fn parsimony(
        &self,
        given: &Model,
        last: &Hypothesis,
        effects: &[String],
    ) -> Option<Parsimony> {
        let count = |model: &Model| model.coordinates().len();
        let terms_fewer = count(given).checked_sub(count(last.judged.model()))?;
        if terms_fewer == 0 || effects.is_empty() {
            return None;
        }
        let before = MostLikely::of(self.judge(), given)?.evidence(self.judge())?;
        let nats = self.evidence(last)? - before;
        (nats > 0.0).then(|| Parsimony {
            effects: effects.to_vec(),
            nats,
            terms_fewer,
        })
    }

    /// ln of the evidence of a model at its maximum-likelihood parameters, nats.
    fn evidence(&self, hypothesis: &Hypothesis) -> Option<f64> {
        MostLikely::of(self.judge(), hypothesis.judged.model())?.evidence(self.judge())
    }

    /// Whether the records certify that `best` contains an effect that the best base model lacks.
    pub(super) fn is_certified(&self, best: &Hypothesis, found: &Found) -> bool {
        let certificate = || {
            let own = self.evidence(best)?;
            self.certificate(own, std::slice::from_ref(&found.bare), found)
        };
        certificate().is_some_and(|certificate| certificate.holds())
    }

    /// The certificate of a model with this evidence (nats) against these null models.
    fn certificate(&self, own: f64, nulls: &[Hypothesis], found: &Found) -> Option<Certificate> {
        let judge = self.judge();
        let each = nulls.par_iter().filter_map(|null| {
            let null = MostLikely::of(judge, null.judged.model())?;
            // Where the evidence of a null model cannot be computed, its likelihood is used.
            let evidence = null.evidence(judge).unwrap_or(f64::NEG_INFINITY);
            Some((null.log_likelihood, evidence))
        });
        let (likelihood, evidence) =
            each.reduce_with(|a, b| (f64::max(a.0, b.0), f64::max(a.1, b.1)))?;
        let all = judge.first_fold();
        let mut records: Vec<String> = all.iter().map(|record| record.name.clone()).collect();
        records.dedup();
        // The e-value is divided by the number of structures tried.
        let tried = (found.tried.max(1) as f64).ln();
        Some(Certificate {
            evidence_nats: own - evidence,
            log_e: own - likelihood - tried,
            alpha: RULES.level_of_search,
            records,
        })
    }

    /// The certificate of each effect of `subject`: the evidence of that model over the largest likelihood of
    /// all models that contain neither the effect nor another member of its equivalence set.
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
        let Some(own) = self.evidence(subject) else {
            return BTreeMap::new();
        };
        let certificate = |(index, term): (usize, &Term)| {
            let name = term.effect()?.name.to_owned();
            let set = sets.iter().find(|set| set.names.first() == Some(&name));
            let names = set.map_or(std::slice::from_ref(&name), |set| &set.names);
            let lacks = |model: &&Hypothesis| {
                let mut effects = model.terms.iter().filter_map(Term::effect);
                !effects.any(|effect| names.iter().any(|name| name == effect.name))
            };
            let least = |all: &mut dyn Iterator<Item = &Hypothesis>| {
                all.filter(lacks)
                    .min_by(|a, b| a.judged.rmse().total_cmp(&b.judged.rmse()))
                    .cloned()
            };
            let nulls = [
                Some(found.bare.clone()),
                self.search.without(subject, index, &found.root),
                least(&mut found.all.iter()),
                least(&mut others.iter().filter_map(|rival| rival.refitted.as_ref())),
            ];
            let nulls: Vec<Hypothesis> = nulls.into_iter().flatten().collect();
            let certificate = self.certificate(own, &nulls, found)?;
            Some((name, certificate))
        };
        let terms: Vec<_> = subject.terms.iter().enumerate().collect();
        terms.into_par_iter().filter_map(certificate).collect()
    }
}
