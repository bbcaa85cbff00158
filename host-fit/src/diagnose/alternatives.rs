//! Which effects are not distinguishable from a named one, and the experiment that would distinguish them.

use super::ranking::{Rival, alike, rivals};
use super::session::Session;
use crate::experiment::Separation;
use crate::model::Model;
use crate::terms::{Hypothesis, Judged, Likelihood, Term, is_out, shares_won};
use model_core::effect::Spec;
use std::sync::atomic::Ordering;

/// An effect with its equivalence set: all candidates that are not distinguishable from it on these records.
pub(super) struct Set {
    pub(super) names: Vec<String>,
    /// For each other member of the set, the model with that member in the effect's place, inner units.
    pub(super) models: Vec<Model>,
}

impl Set {
    /// Posterior probability of each member, the effect of `last` first. Empty where every free run diverges.
    pub(super) fn posterior(&self, likelihood: &Likelihood<'_>, last: &Judged) -> Vec<f64> {
        let models = std::iter::once(last.model()).chain(&self.models);
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
    /// The equivalence sets of the first `told` effects.
    pub(super) fn sets(
        &self,
        last: &Hypothesis,
        order: &[&'static Spec],
        told: usize,
        first: &[Rival],
        root: &Hypothesis,
    ) -> Vec<Set> {
        order
            .iter()
            .take(told)
            .map(|spec| {
                let mut set = Set {
                    names: vec![spec.name.to_owned()],
                    models: Vec::new(),
                };
                let owned: Vec<Rival>;
                let others = if order.len() == 1 {
                    first
                } else {
                    let of = |t: &Term| t.effect().is_some_and(|s| s.name == spec.name);
                    let index = last.terms.iter().position(of);
                    let without = index.and_then(|i| self.search.without(last, i, root));
                    let Some(without) = without else { return set };
                    owned = rivals(self.search, &without, &[spec.name]);
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
                for (index, (rival, judged)) in fitted.iter().enumerate() {
                    if alike(&judged.held_out, own) || !is_out(&shares, index + 1) {
                        set.names.push(rival.name.clone());
                        set.models.push(judged.model().clone());
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
