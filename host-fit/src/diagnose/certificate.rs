//! How sure an effect is, whatever else may be missing (theory 4.5).

use super::RULES;
use super::alternatives::Set;
use super::ranking::Rival;
use super::session::Session;
use crate::model::Model;
use crate::terms::{Found, Hypothesis, MostLikely, Term};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// How sure an effect is, whatever else may be missing (theory 4.5).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Certificate {
    /// ln of the evidence for the model with the effect, less that of the best without it, nats.
    pub evidence_nats: f64,
    /// ln of the e-value of "a model without the effect is enough", nats: ln of the evidence for the model with it, over the number
    /// of models tried, less ln of the largest likelihood of models without it.
    pub log_e: f64,
    /// Level α from 0 to 1. The effect is certified from ln(1/α) on: at most this share of certificates is false, as far as the
    /// noise model holds and the base class has the truth.
    pub alpha: f64,
    /// The records that it rests on.
    pub records: Vec<String>,
}

impl Certificate {
    /// Whether the effect is certified.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.log_e >= -self.alpha.ln()
    }
}

/// Effects with which fewer terms explain the records better than the given model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parsimony {
    /// The effects.
    pub effects: Vec<String>,
    /// ln of the evidence for the final model, less that of the given one, nats.
    pub nats: f64,
    /// By how many coefficients and parameters it is smaller.
    pub terms_fewer: usize,
}

impl Session<'_> {
    /// What `last` with these effects explains better than `given` with fewer parameters; none where it does not.
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

    /// ln of the evidence of a model at its most likely parameters, nats.
    fn evidence(&self, hypothesis: &Hypothesis) -> Option<f64> {
        MostLikely::of(self.judge(), hypothesis.judged.model())?.evidence(self.judge())
    }

    /// Whether the records certify that `best` has something that the best base has not.
    pub(super) fn is_certified(&self, best: &Hypothesis, found: &Found) -> bool {
        let certificate = || {
            let own = self.evidence(best)?;
            self.certificate(own, std::slice::from_ref(&found.bare), found)
        };
        certificate().is_some_and(|certificate| certificate.holds())
    }

    /// The certificate of a model with this evidence, nats, against others.
    fn certificate(&self, own: f64, nulls: &[Hypothesis], found: &Found) -> Option<Certificate> {
        let judge = self.judge();
        let each = nulls.par_iter().filter_map(|null| {
            let null = MostLikely::of(judge, null.judged.model())?;
            // A model counts by its likelihood also where its evidence is not to be had.
            let evidence = null.evidence(judge).unwrap_or(f64::NEG_INFINITY);
            Some((null.log_likelihood, evidence))
        });
        let (likelihood, evidence) =
            each.reduce_with(|a, b| (f64::max(a.0, b.0), f64::max(a.1, b.1)))?;
        let all = judge.first_fold();
        let mut records: Vec<String> = all.iter().map(|record| record.name.clone()).collect();
        records.dedup();
        // One structure of all that were tried.
        let tried = (found.tried.max(1) as f64).ln();
        Some(Certificate {
            evidence_nats: own - evidence,
            log_e: own - likelihood - tried,
            alpha: RULES.level_of_search,
            records,
        })
    }

    /// How sure each effect of `subject` is: the evidence for that model over the largest likelihood of any without the effect, and
    /// without those of its set.
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
