//! The models from which a search starts.

use super::RULES;
use super::hypothesis::Hypothesis;
use super::search::Search;
use super::term::Term;
use crate::fit::{Fit, FitOptions, fit_with_effect, lean_base, needs_fresh_starts};
use crate::model::{Model, Start};
use crate::parallel;
use crate::simulate::SimulateError;
use model_core::effect::Spec;
use model_core::effects::NUISANCES;

impl Search<'_> {
    /// The lowest-order model with the kind of delay law and the effects of `given`. With `mid_run`, free
    /// runs start from the measurement.
    ///
    /// # Errors
    /// No starting point gives a stable free run.
    pub fn root(&self, given: &Model, mid_run: bool) -> Result<Hypothesis, SimulateError> {
        let learning = self.judge.learning(0);
        let mut bare = given.clone();
        // Effects that the user added stay; drift and other disturbance terms must lower the error again to be
        // kept.
        let mut kept = std::mem::take(&mut bare.effects);
        kept.retain(|added| NUISANCES.iter().all(|spec| spec.name != added.name));
        let mut model = lean_base(&bare, &learning)?.model;
        model.effects.clone_from(&kept);
        let mut own = Model {
            effects: kept,
            ..given.clone()
        };
        for model in [&mut model, &mut own] {
            model.delay_between_samples();
            if mid_run {
                model.start = Start::Measured;
            }
        }
        // A base that was fitted without the kept effects may diverge with them. The given model was fitted with
        // them and is then refitted instead.
        let refitted = self.judge.refitted(&model);
        let mut judged = refitted.or_else(|error| self.judge.refitted(&own).map_err(|_| error))?;
        if !self.judge.on_off {
            // Graded commands identify the response to jets of part strength.
            let others = self.judge.other_gradings(judged.model().grading);
            let others = parallel::some(others, |grading| {
                let other = Model {
                    grading,
                    ..judged.model().clone()
                };
                self.judge.refitted(&other).ok()
            });
            let better = others
                .into_iter()
                .min_by(|a, b| a.rmse().total_cmp(&b.rmse()));
            if let Some(better) = better.filter(|better| better.rmse() < judged.rmse()) {
                judged = better;
            }
        }
        Ok(Hypothesis::new(judged))
    }

    /// The structure of `given`, refitted and expressed as terms on top of `root`: a second starting point.
    /// `None` if it has other or too many terms.
    #[must_use]
    pub fn second_root(&self, given: &Model, root: &Hypothesis) -> Option<Hypothesis> {
        let mut model = given.clone();
        model.delay_between_samples();
        model.start = root.judged.model().start;
        let terms = Term::all_of(&model, root.judged.model())?;
        let judged = (!terms.is_empty() && terms.len() <= RULES.most_given)
            .then(|| self.judge.refitted(&model).ok())??;
        Some(Hypothesis {
            terms,
            from_given: true,
            ..Hypothesis::new(judged)
        })
    }

    /// Further roots: the structure of `given`, and `root` with each effect that is fitted from fresh starts.
    pub(crate) fn second_roots(&self, given: &Model, root: &Hypothesis) -> Vec<Hypothesis> {
        let base = root.judged.model();
        let anew = base.candidates().filter_map(|spec| {
            if !self.effects || self.interrupted() || !self.is_fitted_anew(base, spec) {
                return None;
            }
            (self.progress)(&format!("{} from fresh starts", spec.name));
            let fit = self.fitted_anew(base, spec, &FitOptions::default())?;
            let mut model = fit.model;
            model.delay_between_samples();
            model.start = base.start;
            let judged = self.judge.refitted(&model).ok()?;
            let term = Term::unfitted(spec, base).as_in(judged.model());
            Some(Hypothesis {
                terms: vec![term],
                ..Hypothesis::new(judged)
            })
        });
        self.second_root(given, root)
            .into_iter()
            .chain(anew)
            .collect()
    }

    /// Whether an effect that is not in `base` is fitted from fresh starts: if `base` was fitted without the effect, a
    /// few iterations from its parameters may not converge.
    pub(super) fn is_fitted_anew(&self, base: &Model, spec: &Spec) -> bool {
        !base.has_effect(spec.name) && needs_fresh_starts(base, spec)
    }

    /// `base` with an effect, fitted from fresh starts. `None` if records with the fitted dead time cannot identify the
    /// effect.
    pub(super) fn fitted_anew(
        &self,
        base: &Model,
        spec: &'static Spec,
        options: &FitOptions,
    ) -> Option<Fit> {
        let fit = fit_with_effect(base, spec, &self.judge.learning(0), options).ok()?;
        let dead_time = fit.model.delay.present(0.0, base.sample_period_s);
        let unmet = spec.needs.unmet(self.judge.on_off, dead_time);
        unmet.is_none().then_some(fit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Record, Use};
    use crate::model::Delay;
    use crate::residual::plants::{base, records};
    use crate::terms::Bench;
    use model_core::effects::{ConstantDelay, spec};
    use model_core::recursion::Grading;
    use std::sync::atomic::AtomicBool;

    /// A motor whose driver has a dead zone. The base without the curve of the input has six times its gain, and diverges
    /// with the curve.
    #[test]
    fn a_base_that_diverges_with_a_kept_effect_gives_way_to_the_given_one() {
        let (mut y, mut speed, mut random, mut level) = (Vec::new(), 0.0, 11_u32, 0.0);
        let u: Vec<f64> = (0..2800)
            .map(|k| {
                if k % 60 == 0 {
                    random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    level = [0.0, 0.24, 0.39, 0.55, 0.71, 1.0][(random >> 16) as usize % 6];
                }
                level
            })
            .collect();
        for u in &u {
            y.push(speed);
            speed += ((u - 0.15_f64).max(0.0) / 0.85 - speed) / 12.0;
        }
        let record = Record::new("motor", Use::Identify, 0.001, u, y);
        let mut given = Model {
            a: vec![0.9166],
            b: vec![0.01425],
            grading: Grading::Interpolated,
            delay: Delay::of::<ConstantDelay<f64>>(&[0.0], vec![1.0], true),
            ..Model::default()
        };
        let curve = spec("input-nonlinearity").expect("in the catalogue");
        given.add(curve, &[10.0, -5.19], None);
        let bench = Bench::of(&given, &[record]).expect("a record to learn from");
        let never = AtomicBool::new(false);
        let root = Search::silent(&bench.judge, 0, &never).root(&bench.given, false);
        assert!(root.expect("stable").judged.rmse() < 0.05);
    }

    /// The root with this effect, on the records of a plant that has it.
    fn root_with(name: &str, delay: Option<u16>) -> [Hypothesis; 2] {
        let records = records(&[name], &[], 3);
        let bench = Bench::of(&base(&records), &records).expect("records to learn from");
        let never = AtomicBool::new(false);
        let search = Search::silent(&bench.judge, 1, &never);
        let model = match delay {
            Some(samples) => Model {
                delay: Delay::Fixed {
                    delays: vec![samples],
                },
                ..bench.given.clone()
            },
            None => bench.given.clone(),
        };
        let without = Hypothesis::new(bench.judge.refitted(&model).expect("stable"));
        let roots = search.second_roots(without.judged.model(), &without);
        let has = |root: &&Hypothesis| root.judged.model().has_effect(name);
        let with = roots.iter().find(has).expect("the effect").clone();
        [without, with]
    }

    /// A pickup pulls the delay of the base to 0. At that delay the pickup is not identifiable, so it is fitted from
    /// fresh starts.
    #[test]
    fn a_pickup_is_found_although_the_base_has_no_dead_time() {
        let pickup = spec("electrical-pickup").expect("in the catalogue");
        let [without, with] = root_with(pickup.name, Some(0));
        let model = with.judged.model();
        assert!(model.delay.present(0.0, model.sample_period_s) > 10.0);
        assert!(with.judged.rmse() < without.judged.rmse());
        assert!(needs_fresh_starts(without.judged.model(), pickup));
        assert!(!needs_fresh_starts(model, pickup));
    }

    /// A base that was fitted to the size of the friction has another gain.
    #[test]
    fn a_rectifying_sensor_is_found_from_fresh_starts() {
        let [without, with] = root_with("rectifying-sensor", None);
        assert!(
            with.judged.rmse() < 0.5 * without.judged.rmse(),
            "{} {}",
            with.judged.rmse(),
            without.judged.rmse()
        );
    }
}
