//! Delay laws of the catalogue as parts of the base model.

use super::hypothesis::Hypothesis;
use super::judge::{Judge, Judged};
use super::search::Search;
use super::term::take_delay_law;
use crate::fit::rows;
use crate::model::{Delay, Model};
use crate::parallel;
use model_core::effect::Place;

/// Averaging times of y that are tried with a delay law in addition to that of eq. (1), samples. A flow that
/// carries the jets with its present velocity averages over the dead time.
const AVERAGES: [u32; 3] = [2, 50, 125];

impl Search<'_> {
    /// The structure with the best-fitting delay law of the catalogue, those in `forgotten` excluded. `None` if the
    /// present law fits equally well.
    #[must_use]
    pub fn after_another_law(
        &self,
        hypothesis: &Hypothesis,
        forgotten: &[String],
    ) -> Option<Hypothesis> {
        let own = hypothesis.judged.model();
        let is_known = |with: &Model| {
            let law = with.delay.effect_name();
            !forgotten.iter().any(|name| Some(name.as_str()) == law)
        };
        let best = self.with_best_law(own, is_known)?;
        let pays = best.size() < hypothesis.judged.size();
        pays.then(|| Hypothesis {
            terms: hypothesis.terms.clone(),
            ..Hypothesis::new(best)
        })
    }

    /// `model`, whose delay does not follow y, with the averaging time of the delay law that fits best. It takes effect
    /// if the law is added.
    pub(super) fn averaged(&self, mut judged: Judged) -> Judged {
        if judged.model().delay.follows_y() || judged.model().averaging.averaged_model {
            return judged;
        }
        let depends = |with: &Model| {
            let at = |y: f64| with.delay.present(y, with.sample_period_s);
            at(0.0) != at(1.0)
        };
        if let Some(best) = self.with_best_law(judged.model(), depends) {
            let own = best.model();
            let others = at_other_averages(self.judge, own, std::slice::from_ref(&own.delay));
            let all = others.into_iter().chain([best]);
            let best = all.min_by(|a, b| a.rmse().total_cmp(&b.rmse()));
            let averaging = best.map_or(judged.model().averaging, |best| best.model().averaging);
            judged
                .fits
                .iter_mut()
                .for_each(|fit| fit.model.averaging = averaging);
        }
        judged
    }

    /// `model` with the best-fitting delay law of the catalogue among those that are `wanted`.
    fn with_best_law(&self, model: &Model, wanted: impl Fn(&Model) -> bool) -> Option<Judged> {
        let facts = self.known.facts(model, 1.0, 1.0);
        let mut starts = Vec::new();
        for spec in model.candidates().filter(|spec| spec.place == Place::Delay) {
            for row in rows(spec, &facts).unwrap_or_default() {
                let mut with = model.clone();
                with.add(spec, &row, None);
                starts.extend(wanted(&with).then_some(with));
            }
        }
        let tried = parallel::some(&starts, |with| self.judge.refitted(with).ok());
        (tried.into_iter()).min_by(|a, b| a.rmse().total_cmp(&b.rmse()))
    }
}

/// `model` with these delay laws at the further averaging times, refitted.
pub(super) fn at_other_averages(judge: &Judge, model: &Model, laws: &[Delay]) -> Vec<Judged> {
    let all: Vec<Model> = laws
        .iter()
        .flat_map(|law| AVERAGES.map(|window| with_average(model, law, window)))
        .collect();
    parallel::some(&all, |model| judge.refitted(model).ok())
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
    use crate::data::{Record, Use};
    use crate::terms::Bench;
    use model_core::effects::SaturatingDelay;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::sync::atomic::AtomicBool;

    /// A flow of first order behind a dead time of `delay` samples, which is given the run of y so far.
    fn carried(seed: u64, delay: impl Fn(&[f64]) -> usize) -> Record {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut u = Vec::new();
        while u.len() < 4000 {
            let (rest, blow) = (rng.random_range(40..300), rng.random_range(40..300));
            u.extend(std::iter::repeat_n(0.0, rest));
            u.extend(std::iter::repeat_n(1.0, blow));
        }
        u.truncate(4000);
        let mut y = vec![0.0];
        for k in 0..u.len() - 1 {
            let jet = k.checked_sub(delay(&y)).map_or(0.0, |from| u[from]);
            y.push(y[k] + (jet - y[k]) / 40.0);
        }
        y.iter_mut()
            .for_each(|y| *y += 0.01 * rng.random_range(-1.0..1.0));
        let role = match seed % 2 {
            0 => Use::Identify,
            _ => Use::Validate,
        };
        Record::new(&format!("r{seed}"), role, 0.001, u, y)
    }

    /// Jets that the flow carries arrive when their way is covered. The delay of eq. (2) follows the mean of eq. (1).
    #[test]
    fn a_law_averages_y_over_the_time_in_which_the_flow_carries_the_jets() {
        let way = |y: &[f64]| {
            let steps = y.iter().rev().scan(0.0, |way, y| {
                *way += (1.0 + y) / 60.0;
                Some(*way)
            });
            steps.take_while(|way| *way < 1.0).count()
        };
        let mean = |y: &[f64]| {
            let last = &y[y.len().saturating_sub(249)..];
            let mean = last.iter().sum::<f64>() / 250.0;
            (30.0 + 30.0 * (-2.0 * mean).exp()).round() as usize
        };
        let window = |delay: &dyn Fn(&[f64]) -> usize| {
            let records: Vec<Record> = (0..4).map(|seed| carried(seed, delay)).collect();
            let bench = Bench::of(&Model::default(), &records).expect("records to learn from");
            let never = AtomicBool::new(false);
            let search = Search {
                effects: true,
                ..Search::silent(&bench.judge, 0, &never)
            };
            let given = Model {
                delay: Delay::Fixed { delays: vec![50] },
                ..bench.given.clone()
            };
            let root = search.root(&given, false).expect("stable");
            root.judged.model().averaging.window
        };
        assert_eq!(window(&way), 50);
        assert_eq!(window(&mean), 250);
    }

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
