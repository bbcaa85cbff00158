//! What else could stand for a named effect, and the experiment that would tell.

use super::ranking::{Rival, alike, rivals};
use super::session::Session;
use crate::experiment::{Experiment, Limits, separating};
use crate::model::Model;
use crate::terms::{Hypothesis, Term};
use model_core::effect::Spec;
use std::sync::atomic::Ordering;

/// How to tell apart what the data cannot.
#[derive(Clone, Debug)]
pub struct Separation {
    /// The effects that one of the models has and another has not.
    pub effects: Vec<String>,
    /// The models: the final one first.
    pub models: Vec<Model>,
    /// The command that separates the models most.
    pub experiment: Experiment,
}

/// An effect with what the records cannot tell from it.
pub(super) struct Set {
    pub(super) names: Vec<String>,
    /// The models with the others in its place, inner units.
    pub(super) models: Vec<Model>,
}

impl Session<'_> {
    /// For each effect all that the records cannot tell from it.
    pub(super) fn sets(
        &self,
        last: &Hypothesis,
        order: &[&'static Spec],
        first: &[Rival],
        root: &Hypothesis,
    ) -> Vec<Set> {
        order
            .iter()
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
                for rival in others {
                    let Some(judged) = rival.judged() else {
                        continue;
                    };
                    let present = order.iter().any(|s| s.name == rival.name);
                    if !present && alike(&judged.held_out, &last.judged.held_out) {
                        set.names.push(rival.name.clone());
                        set.models.push(judged.model().clone());
                    }
                }
                set
            })
            .collect()
    }

    /// The command that would tell the final model from those in which something else
    /// stands for one of its effects.
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
        let noise = (self.judge().measured_noise_rmse() * self.units.y).max(f64::MIN_POSITIVE);
        let experiment = separating(&models, noise, &Limits::default(), self.options.seed).ok()?;
        Some(Separation {
            effects,
            models,
            experiment,
        })
    }
}
