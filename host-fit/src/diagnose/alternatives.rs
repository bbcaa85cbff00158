//! Which effects are not distinguishable from a named one, and the experiment that would distinguish them.

use super::ranking::{FLOW_LAG, Rival, alike, rivals};
use super::session::{Compared, Session};
use crate::experiment::Separation;
use crate::model::Model;
use crate::terms::{Hypothesis, Judged, Likelihood, Term, is_out, shares_won};
use model_core::effect::Spec;
use std::sync::atomic::Ordering;

/// An effect with its equivalence set: all candidates that are not distinguishable from it on these records.
pub(super) struct Set {
    pub(super) effect: &'static Spec,
    /// For each other member of the set, the model with that member in the effect's place, inner units.
    pub(super) others: Vec<(String, Model)>,
}

impl Set {
    /// The members, the effect first. A lag in series is not distinguishable from a second lag of the flow, because
    /// their outputs are equal by construction.
    pub(super) fn names(&self) -> Vec<String> {
        let own = std::iter::once(self.effect.name.to_owned());
        let same = self.adds_flow_lag().then(|| FLOW_LAG.to_owned());
        let others = self.others.iter().map(|(name, _)| name.clone());
        own.chain(same).chain(others).collect()
    }

    fn adds_flow_lag(&self) -> bool {
        self.effect.lag_in_series && self.others.iter().all(|(name, _)| name != FLOW_LAG)
    }

    /// Posterior probability of each of [`names`](Self::names). Empty if every free run diverges.
    pub(super) fn posterior(&self, likelihood: &Likelihood<'_>, last: &Judged) -> Vec<f64> {
        let own = std::iter::once(last.model());
        let same = self.adds_flow_lag().then_some(last.model());
        let models = own
            .chain(same)
            .chain(self.others.iter().map(|(_, model)| model));
        let evidence: Vec<f64> = models
            .map(|model| likelihood.evidence(model).unwrap_or(f64::NEG_INFINITY))
            .collect();
        let most = evidence.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if most == f64::NEG_INFINITY {
            return Vec::new();
        }
        let weights: Vec<f64> = evidence.iter().map(|own| (own - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter().map(|weight| weight / sum).collect()
    }
}

impl Session<'_> {
    /// The equivalence sets of the first `told` effects. A member fits the validation records as well as the effect, and has
    /// more evidence than the model without either: what the records do not support is no alternative.
    pub(super) fn sets(
        &self,
        last: &Hypothesis,
        order: &[&'static Spec],
        told: usize,
        alone: &Compared,
        root: &Hypothesis,
    ) -> Vec<Set> {
        order
            .iter()
            .take(told)
            .map(|spec| {
                let mut set = Set {
                    effect: spec,
                    others: Vec::new(),
                };
                let owned: Compared;
                let Compared { context, others } = if order.len() == 1 {
                    alone
                } else {
                    let of = |t: &Term| t.effect().is_some_and(|s| s.name == spec.name);
                    let index = last.terms.iter().position(of);
                    let without = index.and_then(|i| self.search.without(last, i, root));
                    let Some(context) = without else { return set };
                    let others = rivals(self.search, &context, &[spec.name]);
                    owned = Compared { context, others };
                    &owned
                };
                let absent = |name: &str| !order.iter().any(|s| s.name == name);
                let fitted = others.iter().filter(|rival| absent(&rival.name));
                let fitted: Vec<(&Rival, &Judged)> = fitted
                    .filter_map(|rival| Some((rival, rival.judged()?)))
                    .collect();
                let own = &last.judged.held_out;
                let theirs = fitted.iter().map(|(_, judged)| &judged.held_out);
                let shares = shares_won(&std::iter::once(own).chain(theirs).collect::<Vec<_>>());
                let without = self.evidence_of(context.judged.model());
                let is_supported = |judged: &Judged| {
                    let with = self.evidence_of(judged.model());
                    with.zip(without)
                        .is_none_or(|(with, without)| with > without)
                };
                for (index, (rival, judged)) in fitted.iter().enumerate() {
                    let fits = alike(&judged.held_out, own) || !is_out(&shares, index + 1);
                    if fits && is_supported(judged) {
                        let model = judged.model().clone();
                        set.others.push((rival.name.clone(), model));
                    }
                }
                set
            })
            .collect()
    }

    /// The command that would distinguish the final model from models with another member of an effect's set.
    pub(super) fn separation(
        &self,
        model: &Model,
        alternatives: Vec<Model>,
        effects: Vec<String>,
    ) -> Option<Separation> {
        let interrupted = self.search.interrupt.load(Ordering::Relaxed);
        if alternatives.is_empty() || !self.judge().on_off || interrupted {
            return None;
        }
        let models: Vec<Model> = std::iter::once(model.clone()).chain(alternatives).collect();
        let noise = self.judge().measured_noise_rmse() * self.units.y;
        Separation::of(models, effects, noise, self.options.seed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};
    use model_core::effects::spec;

    #[test]
    fn a_films_lag_and_a_lag_of_the_flow_are_one_thing() {
        let model = base(&records(&[], &[], 1));
        let names = |effect: &str, others: &[&str]| {
            let others = others
                .iter()
                .map(|name| ((*name).to_owned(), model.clone()));
            let effect = spec(effect).expect("in the catalogue");
            let others = others.collect();
            Set { effect, others }.names()
        };
        assert_eq!(
            names("hot-film-lag", &["valve-lag"]),
            ["hot-film-lag", FLOW_LAG, "valve-lag"]
        );
        assert_eq!(
            names("hot-film-lag", &[FLOW_LAG]),
            ["hot-film-lag", FLOW_LAG]
        );
        assert_eq!(names("valve-lag", &[]), ["valve-lag"]);
    }
}
