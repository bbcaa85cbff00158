//! A search from every start that a model and its records offer.

use super::RULES;
use crate::model::{Model, Start};
use crate::terms::{Effort, Found, Hypothesis, Search, at_the_papers_average};

/// The given model, and how further starts are made of it.
pub(crate) struct Given<'a, E> {
    /// The model, in inner units.
    pub(crate) model: &'a Model,
    /// Root mean square error of the model on the validation records.
    pub(crate) rmse: f64,
    /// Whether the lags of the model are kept, so that the search starts from its structure.
    pub(crate) keeps_lags: bool,
    /// The model of the lowest order with the delay law of another model.
    pub(crate) root: &'a dyn Fn(&Model) -> Result<Hypothesis, E>,
}

impl Search<'_> {
    /// Whether the search keeps the lags that the user chose: with graded commands and records that start in
    /// mid-run, because these are not records of a flow with jets.
    pub(crate) fn keeps_lags(&self, given: &Model, mid_run: bool) -> bool {
        mid_run && given.start == Start::Measured && !self.judge.on_off
    }

    /// The best model from `root`, from the structure of the given model, and with another delay law; and the root
    /// from which it was found. If the given model misses the noise level, its averaging time was chosen without the
    /// effects, and that of eq. (1) is tried first.
    pub(crate) fn thorough<E>(
        &self,
        root: Hypothesis,
        given: &Given<'_, E>,
    ) -> (Found, Hypothesis) {
        let misses = |rmse: f64| self.judge.over_noise(rmse) > RULES.floor_margin;
        let papers = at_the_papers_average(given.model).filter(|_| misses(given.rmse));
        let other = papers.and_then(|model| Some(((given.root)(&model).ok()?, model)));
        let mut effort = Effort::of_a_search();
        let Some((other, model)) = other else {
            return self.at_one_average(root, given, &mut effort);
        };
        let with_papers = Given {
            model: &model,
            ..*given
        };
        let first = self.at_one_average(other, &with_papers, &mut effort);
        if !misses(first.0.best.judged.rmse()) || effort.is_spent() {
            return first;
        }
        let second = self.at_one_average(root, given, &mut effort);
        match second.0.best.score() < first.0.best.score() {
            true => second,
            false => first,
        }
    }

    /// [`thorough`](Self::thorough) with the averaging time of the given model.
    fn at_one_average<E>(
        &self,
        root: Hypothesis,
        given: &Given<'_, E>,
        effort: &mut Effort,
    ) -> (Found, Hypothesis) {
        let judge = self.judge;
        let (model, below) = (given.model, 1.0 - RULES.worthwhile);
        let mut origin = root.clone();
        let mut found = self.run_within(root, Some(&|| self.second_roots(model, &origin)), effort);
        let reached = found.best.judged.rmse();
        let misses = |rmse: f64| judge.over_noise(rmse) > RULES.floor_margin;
        // The given structure may contain terms that the search cannot reach by single steps.
        if (misses(reached) || reached > below * given.rmse)
            && !effort.is_spent()
            && !found.set_out_twice()
            && (given.keeps_lags || !origin.is_built_as(model))
            && let Ok(judged) = judge.refitted(model)
            && judged.rmse() < origin.judged.rmse()
        {
            let from_given = self.run_within(Hypothesis::of_given(judged), None, effort);
            if from_given.best.judged.rmse() < below * reached {
                found = from_given;
            }
        }
        // The form of the delay law in the given model was chosen without the effects. With them another form may
        // have a lower error.
        let reached = found.best.judged.rmse();
        if misses(reached)
            && model.delay.follows_y()
            && !effort.is_spent()
            && let Some(other) = self.after_another_law(&found.best, &[])
            && other.judged.rmse() < below * reached
        {
            (self.progress)("fitting again with another delay law");
            let with_law = Model {
                delay: other.judged.model().delay.clone(),
                ..model.clone()
            };
            if let Ok(root) = (given.root)(&with_law) {
                let set_out = root.clone();
                let anew = self.run_within(
                    root,
                    Some(&|| self.second_roots(&with_law, &set_out)),
                    effort,
                );
                if anew.best.score() < found.best.score() {
                    (found, origin) = (anew, set_out);
                }
            }
        }
        self.with_effects_instead_of_given(&mut found, &origin);
        (found, origin)
    }
}

#[cfg(test)]
mod tests {
    use crate::diagnose::{Options, diagnose};
    use crate::residual::plants::{base, drift, records};
    use model_core::average::WINDOW;
    use std::sync::atomic::AtomicBool;

    /// The plant's delay follows the mean of eq. (1). Its base was identified with another one, beside a drift.
    #[test]
    fn an_averaging_time_that_was_chosen_without_the_effect_is_not_kept() {
        let mut records = records(&[], &[], 3);
        drift(&mut records, &[(0.15, 1.5)]);
        let mut given = base(&records);
        given.averaging.window = 50;
        let never = AtomicBool::new(false);
        let found = diagnose(&given, &records, &Options::default(), &never, &|_| ());
        let found = found.expect("records to learn from");
        assert_eq!(found.missing, ["thermal-drift"]);
        assert_eq!(found.model.averaging.window, WINDOW);
    }
}
