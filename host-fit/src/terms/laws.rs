//! Delay laws of the catalogue as parts of the base model.

use super::hypothesis::Hypothesis;
use super::judge::{Judge, Judged};
use super::search::Search;
use super::term::take_delay_law;
use crate::fit::rows;
use crate::model::{Delay, Model};
use crate::parallel;
use model_core::average::WINDOW;
use model_core::effect::Place;

/// Averaging times of y that are tried with a delay law, samples. The last is that of eq. (1). A flow that carries the jets
/// with its present velocity averages over the dead time.
const AVERAGES: [u32; 4] = [2, 50, 125, WINDOW];

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

/// These models and delay laws with the other averaging time that fits best. `None` if no law follows y.
pub(super) fn at_another_average<'a>(
    judge: &Judge,
    lawful: impl Iterator<Item = (&'a Model, &'a Delay)>,
) -> Option<Judged> {
    let all: Vec<Model> = lawful
        .filter(|(_, law)| law.follows_y())
        .flat_map(|(model, law)| {
            let others = AVERAGES
                .into_iter()
                .filter(|window| *window != model.averaging.window);
            others.map(|window| with_average(model, law, window))
        })
        .collect();
    let fitted = parallel::some(&all, |model| judge.refitted(model).ok());
    let by_size = |a: &Judged, b: &Judged| a.size().total_cmp(&b.size());
    fitted.into_iter().min_by(by_size)
}

/// `model` with the averaging time of eq. (1); `None` if it has that one, or if its delay does not follow y.
pub(crate) fn at_the_papers_average(model: &Model) -> Option<Model> {
    let other = model.delay.follows_y() && model.averaging.window != WINDOW;
    other.then(|| with_average(model, &model.delay, WINDOW))
}

/// The model with a delay law that depends on the mean of y over `window` samples. The levels of the law follow ỹ, which
/// is (W − 1)/W of a constant y by eq. (1).
fn with_average(model: &Model, law: &Delay, window: u32) -> Model {
    let mut other = model.clone();
    if !model.delay.is_alike(law) {
        take_delay_law(&mut other, law);
    }
    let share = |window: u32| 1.0 - 1.0 / f64::from(window.max(2));
    let ratio = share(window) / share(model.averaging.window);
    if let Delay::Law(law) = &mut other.delay {
        let parameters = law.parameters.iter_mut().zip(law.spec.parameters);
        parameters.for_each(|(value, card)| *value *= card.unit.scale(ratio, 1.0, 1.0));
    }
    other.averaging.window = window;
    other
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::effects::SaturatingDelay;

    /// The law's level is 0.6 of a constant y at any averaging time.
    #[test]
    fn another_averaging_time_keeps_the_delay_at_a_constant_y() {
        let model = Model {
            delay: Delay::of::<SaturatingDelay<f64>>(&[20.0, 10.0, 0.6, 0.0], vec![1.0], true),
            ..Model::default()
        };
        let delay = |window: u32, y: f64| {
            let other = with_average(&model, &model.delay, window);
            assert_eq!(other.averaging.window, window);
            let mean = y * (1.0 - 1.0 / f64::from(window));
            other.delay.present(mean, model.sample_period_s)
        };
        for y in [0.1, 0.3, 0.5] {
            let [short, long] = [2, model.averaging.window].map(|window| delay(window, y));
            assert!((short - long).abs() < 1e-9, "{y}: {short} {long}");
        }
    }
}
