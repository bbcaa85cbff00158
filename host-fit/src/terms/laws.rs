//! Delay laws of the catalogue as parts of the base model.

use super::hypothesis::Hypothesis;
use super::search::Search;
use crate::fit::rows;
use crate::parallel;
use model_core::effect::Place;

impl Search<'_> {
    /// The structure with the best-fitting delay law of the catalogue, those in `forgotten` excluded. `None` if the
    /// present law fits equally well.
    #[must_use]
    pub fn after_another_law(
        &self,
        hypothesis: &Hypothesis,
        forgotten: &[String],
    ) -> Option<Hypothesis> {
        let model = hypothesis.judged.model();
        let facts = self.known.facts(model, 1.0, 1.0);
        let mut starts = Vec::new();
        for spec in model.candidates().filter(|spec| spec.place == Place::Delay) {
            if !forgotten.iter().any(|name| name == spec.name) {
                let rows = rows(spec, &facts).unwrap_or_default();
                starts.extend(rows.into_iter().map(|row| (spec, row)));
            }
        }
        let tried = parallel::some(starts, |(spec, parameters)| {
            let mut with = model.clone();
            with.add(spec, &parameters, None);
            self.judge.refitted(&with).ok()
        });
        let best = (tried.into_iter()).min_by(|a, b| a.rmse().total_cmp(&b.rmse()))?;
        let pays = best.size() < hypothesis.judged.size();
        pays.then(|| Hypothesis {
            terms: hypothesis.terms.clone(),
            ..Hypothesis::new(best)
        })
    }
}
