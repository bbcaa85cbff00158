//! A model as a list of terms, with its fits and its score.

use super::RULES;
use super::judge::Judged;
use super::term::Term;
use crate::model::Model;

/// A model with the terms that were added to the base model of the lowest order.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// The terms.
    pub terms: Vec<Term>,
    /// Fits and validation error of the model.
    pub judged: Judged,
    /// Whether further terms were already screened on the hypothesis.
    pub(super) expanded: bool,
    /// Whether the hypothesis descends from the given structure instead of from the lowest-order model.
    pub(super) from_given: bool,
    /// Whether an effect is at a bound of its range. Further terms are screened on such a hypothesis, but it cannot
    /// be a result.
    pub(super) bent: bool,
}

impl Hypothesis {
    /// A model without further terms.
    #[must_use]
    pub fn new(judged: Judged) -> Self {
        Self {
            terms: Vec::new(),
            judged,
            expanded: false,
            from_given: false,
            bent: false,
        }
    }

    /// The given model, refitted, as a starting point.
    pub(crate) fn of_given(judged: Judged) -> Self {
        Self {
            from_given: true,
            ..Self::new(judged)
        }
    }

    /// Whether this root of a search is the given model, refitted.
    pub(crate) fn is_given(&self) -> bool {
        self.from_given && self.terms.is_empty()
    }

    /// Whether the hypothesis has no effect among its terms.
    #[must_use]
    pub fn is_bare(&self) -> bool {
        self.terms.iter().all(|term| term.effect().is_none())
    }

    /// Whether a term is at a bound of its range. Such a term imitates another one and is not a result.
    pub(crate) fn reaches_a_bound(&self) -> bool {
        let model = self.judged.model();
        self.terms.iter().any(|term| term.is_at_a_bound(model))
    }

    /// Number of parameters of the terms, as the penalty counts them.
    #[must_use]
    pub fn cost(&self) -> usize {
        self.terms.iter().map(Term::cost).sum()
    }

    /// ln of the validation error plus the penalty of the terms; lower is better.
    #[must_use]
    pub fn score(&self) -> f64 {
        score(self.judged.rmse(), self.cost())
    }

    /// Whether `other` has the same structure, so that refitting it gives no second starting point.
    pub(crate) fn is_built_as(&self, other: &Model) -> bool {
        Term::all_of(other, self.judged.model()).is_some_and(|terms| terms.is_empty())
    }

    /// The hypothesis with all its terms on top of the model of `lean`, those of a given structure included. `None` if the
    /// two models differ in other things.
    pub(super) fn on_top_of(&self, lean: &Self) -> Option<Self> {
        let (own, lean) = (self.judged.model(), lean.judged.model());
        let effects = self.terms.iter().filter(|term| term.effect().is_some());
        let effects: Vec<&Term> = effects.collect();
        let without = |model: Model, term: &&Term| term.taken_from(&model, lean);
        let bare = effects.iter().rev().fold(own.clone(), without);
        let mut terms = Term::all_of(&bare, lean)?;
        terms.extend(effects.into_iter().cloned());
        Some(Self {
            terms,
            ..self.clone()
        })
    }

    /// The hypothesis with the lowest error among those of `all` that have none of these effects.
    pub(crate) fn best_without<'a>(
        all: impl Iterator<Item = &'a Self>,
        effects: &[&str],
    ) -> Option<&'a Self> {
        let lacks = |hypothesis: &&Self| {
            let mut own = hypothesis.terms.iter().filter_map(Term::effect);
            !own.any(|effect| effects.contains(&effect.name))
        };
        all.filter(lacks)
            .min_by(|a, b| a.judged.rmse().total_cmp(&b.judged.rmse()))
    }

    /// The terms in words.
    #[must_use]
    pub fn words(&self) -> String {
        let names: Vec<String> = self.terms.iter().map(Term::name).collect();
        if names.is_empty() {
            "no terms".to_owned()
        } else {
            names.join(" + ")
        }
    }
}

pub(super) fn score(rmse: f64, cost: usize) -> f64 {
    rmse.ln() + RULES.price * cost as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};
    use crate::terms::Bench;
    use model_core::effects::spec;

    /// The range of the gain of a starting vortex ends at 3; the range of the lower threshold of a
    /// hysteresis ends at the upper threshold.
    #[test]
    fn an_effect_at_the_end_of_its_range_reaches_a_bound() {
        let records = records(&[], &[], 3);
        let bench = Bench::of(&base(&records), &records).expect("records to learn from");
        let judged = bench.judge.refitted(&bench.given).expect("stable");
        let with = |name: &str, parameters: &[f64]| {
            let spec = spec(name).expect("in the catalogue");
            let parameters = parameters.to_vec();
            let mut judged = judged.clone();
            judged.fits[0].model.add(spec, &parameters, None);
            let grading = bench.given.grading;
            let term = Term::Effect {
                spec,
                parameters,
                grading,
                reference: None,
            };
            Hypothesis {
                terms: vec![term],
                ..Hypothesis::new(judged)
            }
        };
        let vortex = |gain: f64| with("starting-vortex", &[gain, 0.02]);
        assert!(vortex(3.0).reaches_a_bound());
        assert!(!vortex(1.5).reaches_a_bound());
        // A small amplitude is not at a bound.
        assert!(!vortex(0.001).reaches_a_bound());
        let relay = |upper: f64, lower: f64| with("attachment-hysteresis", &[upper, lower, 0.2]);
        assert!(!relay(0.6, 0.3).reaches_a_bound());
        assert!(relay(0.3, 0.3).reaches_a_bound());
        assert!(relay(0.3, 0.6).reaches_a_bound());
    }
}
