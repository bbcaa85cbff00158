//! The bench on which models are judged: fitted in free run to some records, judged
//! in free run on others.

use super::RULES;
use super::evidence::{HeldOut, p_above_noise};
use super::folds::{Fold, HeldOutBy, Judging, folds};
use crate::data::{Record, Use};
use crate::fit::{Fit, FitOptions, LevelScatter, fit, pieces};
use crate::linalg::dot;
use crate::model::Model;
use crate::residual::{NoiseSource, noise_floor};
use crate::simulate::SimulateError;
use model_core::recursion::Grading;
use rayon::prelude::*;

/// A model with its fits, one per fold, and its held-out error.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The fits.
    pub fits: Vec<Fit>,
    /// y − y_sim on what was held out.
    pub(crate) held_out: HeldOut,
    /// Root mean square error of free runs that are not started anew, y: the same
    /// for rigs that do not drift.
    pub(crate) drifted: f64,
}

impl Judged {
    /// The model of the first fold.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.fits[0].model
    }

    /// Root mean square error on what was held out, y.
    #[must_use]
    pub fn rmse(&self) -> f64 {
        self.held_out.rmse()
    }

    /// ln of that, and the price of all parameters: models of different laws are compared so.
    pub(crate) fn size(&self) -> f64 {
        size(self.rmse(), self.model())
    }
}

/// ln of an error, and the price of all parameters of the model that leaves it.
pub(crate) fn size(rmse: f64, model: &Model) -> f64 {
    rmse.ln() + RULES.price * model.coordinates().len() as f64
}

/// What is learned from, what is judged on, and the noise there.
pub struct Judge {
    pub(crate) folds: Vec<Fold>,
    /// The folds with free runs over whole records, where `folds` start them anew.
    whole: Option<Vec<Fold>>,
    /// How the errors are held out.
    pub held_out_by: HeldOutBy,
    /// Everything that may be learned from, for the model that is handed over.
    identify: Vec<Record>,
    /// Whether the command is on/off.
    pub on_off: bool,
    /// Whether a full jet is a command of 1 in the user's units: the share of full strength means nothing in others.
    pub(crate) full_is_one: bool,
    /// σ² of the noise per judged sample, what the level scatters by not counted …
    floor: Vec<Vec<f64>>,
    /// … and the root mean square of all of it, y.
    measured_noise: f64,
    /// Where the noise floor comes from.
    pub noise_source: NoiseSource,
    /// How models are fitted.
    pub options: FitOptions,
}

fn root_mean(variances: &[Vec<f64>]) -> f64 {
    let all = variances.iter().flatten();
    let (sum, count) = all.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    f64::sqrt(sum / f64::max(count, 1.0))
}

impl Judge {
    /// A bench over `records`; with `restarted`, free runs start anew after so many
    /// samples. `None` if there is nothing to learn from.
    #[must_use]
    pub fn new(records: &[Record], restarted: Option<usize>, options: FitOptions) -> Option<Self> {
        let (mut folds, held_out_by) = folds(records);
        let mut identify: Vec<Record> = records
            .iter()
            .filter(|r| r.role == Use::Identify)
            .cloned()
            .collect();
        let mut whole_runs = None;
        if let Some(samples) = restarted {
            whole_runs = Some(folds.clone());
            folds = folds.iter().map(|fold| fold.restarted(samples)).collect();
            identify = identify
                .iter()
                .flat_map(|record| pieces(record, samples))
                .collect();
        }
        if folds.is_empty() {
            return None;
        }
        let judging = || folds.iter().flat_map(|fold| &fold.judging);
        let whole: Vec<&Record> = judging().map(|judging| &judging.record).collect();
        let measured: Vec<Vec<f64>> = whole.iter().map(|record| record.y.clone()).collect();
        let (mut floor, noise_source) = noise_floor(&whole, &measured);
        for (variance, judging) in floor.iter_mut().zip(judging()) {
            variance.drain(..judging.scored_from().min(variance.len()));
        }
        let measured_noise = root_mean(&floor);
        let level_scatter = match restarted {
            None => LevelScatter::of(records),
            Some(_) => None,
        };
        if let Some(scatter) = &level_scatter {
            for (variance, judging) in floor.iter_mut().zip(judging()) {
                let y = judging.last(variance.len());
                scatter.take_from(variance, y);
            }
        }
        Some(Self {
            measured_noise,
            identify,
            on_off: records.iter().all(Record::is_on_off),
            full_is_one: true,
            folds,
            whole: whole_runs,
            held_out_by,
            floor,
            noise_source,
            options: FitOptions {
                level_scatter,
                ..options
            },
        })
    }

    /// Root mean square of the noise on what is judged, y: measured or estimated, without what the level scatters by.
    #[must_use]
    pub fn noise_rmse(&self) -> f64 {
        root_mean(&self.floor)
    }

    /// The same with it: what stands beside an error as it is measured.
    #[must_use]
    pub fn measured_noise_rmse(&self) -> f64 {
        self.measured_noise
    }

    /// By how much of itself the level of a record scatters between repeats; none where nothing says so.
    #[must_use]
    pub fn level_scatter(&self) -> Option<f64> {
        Some(self.options.level_scatter?.deviation)
    }

    /// The error over the noise floor; 1 is all that can be reached. Where slow noise
    /// is not known, the floor is not either, and nothing is near it.
    #[must_use]
    pub fn over_noise(&self, rmse: f64) -> f64 {
        match self.noise_source {
            NoiseSource::Scatter => f64::INFINITY,
            NoiseSource::Measured | NoiseSource::Repeats => rmse / self.noise_rmse(),
        }
    }

    /// Records to fit in a fold.
    #[must_use]
    pub fn learning(&self, fold: usize) -> Vec<&Record> {
        self.folds[fold].learning.iter().collect()
    }

    /// All records of the first fold, those that are learned from first.
    pub(crate) fn first_fold(&self) -> Vec<&Record> {
        let fold = &self.folds[0];
        let judging = fold.judging.iter().map(|judging| &judging.record);
        fold.learning.iter().chain(judging).collect()
    }

    /// The same with their leads: what precedes the samples that are judged is not scored.
    pub(crate) fn scored_records(&self) -> Vec<Record> {
        let fold = &self.folds[0];
        let judging = fold.judging.iter().map(|judging| Record {
            lead: judging.scored_from(),
            ..judging.record.clone()
        });
        fold.learning.iter().cloned().chain(judging).collect()
    }

    /// How `model` is fitted: with the constant where it has one.
    #[must_use]
    pub fn options_for(&self, model: &Model) -> FitOptions {
        FitOptions {
            constant: self.options.constant || model.constant != 0.0,
            ..self.options
        }
    }

    /// Places of the coordinates of `model` that a fit moves.
    pub(crate) fn free(&self, model: &Model) -> Vec<usize> {
        let constant = self.options_for(model).constant;
        let coordinates = model.coordinates();
        let moves = |i: &usize| {
            let fixed = coordinates[*i].parameter().is_some_and(|p| p.low >= p.high);
            !fixed && (*i > 0 || constant)
        };
        (0..coordinates.len()).filter(moves).collect()
    }

    /// y − y_sim from a sample on; a run that diverges is far off everywhere.
    fn error(model: &Model, record: &Record, from: usize) -> Result<Vec<f64>, SimulateError> {
        let measured = record.y.iter().skip(from);
        match model.free_run(record) {
            Ok(run) => Ok(measured
                .zip(run.iter().skip(from))
                .map(|(y, sim)| y - sim)
                .collect()),
            Err(SimulateError::Diverged { .. }) => {
                let largest = record.y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
                Ok(measured.map(|_| RULES.diverged * largest).collect())
            }
            Err(error) => Err(error),
        }
    }

    /// Errors of one model per fold on what was held out from it.
    pub(crate) fn held_out<'m>(
        &self,
        models: impl Fn(usize) -> &'m Model + Sync,
    ) -> Result<HeldOut, SimulateError> {
        self.held_out_of(&self.folds, models)
    }

    fn held_out_of<'m>(
        &self,
        folds: &[Fold],
        models: impl Fn(usize) -> &'m Model + Sync,
    ) -> Result<HeldOut, SimulateError> {
        let judged: Vec<(usize, &Judging)> = folds
            .iter()
            .enumerate()
            .flat_map(|(fold, split)| split.judging.iter().map(move |judging| (fold, judging)))
            .collect();
        let each = judged.par_iter().map(|(fold, judging)| {
            Self::error(models(*fold), &judging.record, judging.scored_from())
        });
        let errors: Vec<Result<Vec<f64>, SimulateError>> = each.collect();
        let mut errors: Vec<Vec<f64>> = errors.into_iter().collect::<Result<_, _>>()?;
        let Some(scatter) = &self.options.level_scatter else {
            return Ok(HeldOut::new(errors));
        };
        let measured = errors.iter().map(|e| dot(e, e)).sum();
        for (error, (_, judging)) in errors.iter_mut().zip(&judged) {
            let y = judging.last(error.len());
            scatter.shrink(error, y, 1);
        }
        Ok(HeldOut::new(errors).beside_scatter(measured))
    }

    /// The first fold's fit judged, with the other folds' from there.
    ///
    /// # Errors
    /// A missing channel, or a free run that diverges in another fold.
    pub fn judged_from(&self, first: Fit) -> Result<Judged, SimulateError> {
        let options = self.options_for(&first.model);
        let others: Vec<Result<Fit, SimulateError>> = (1..self.folds.len())
            .into_par_iter()
            .map(|fold| fit(&first.model, &self.learning(fold), &options))
            .collect();
        let mut fits = vec![first];
        for other in others {
            fits.push(other?);
        }
        let held_out = self.held_out(|fold| &fits[fold].model)?;
        let drifted = match &self.whole {
            Some(whole) => self.held_out_of(whole, |fold| &fits[fold].model)?.rmse(),
            None => held_out.rmse(),
        };
        Ok(Judged {
            held_out,
            drifted,
            fits,
        })
    }

    /// A model refitted in free run in every fold, its structure kept.
    ///
    /// # Errors
    /// A missing channel, or a free run that diverges.
    pub fn refitted(&self, model: &Model) -> Result<Judged, SimulateError> {
        let options = self.options_for(model);
        self.judged_from(fit(model, &self.learning(0), &options)?)
    }

    /// The model that is handed over: fitted to everything that may be learned from.
    #[must_use]
    pub fn final_fit(&self, judged: &Judged) -> Fit {
        let own = judged.fits[0].clone();
        if self.held_out_by == HeldOutBy::Records && self.options.level_scatter.is_none() {
            return own;
        }
        self.fitted_to_all(&own.model).unwrap_or(own)
    }

    /// Every record that may be learned from.
    pub(super) fn everything(&self) -> Vec<&Record> {
        self.identify.iter().collect()
    }

    /// A model fitted to everything that may be learned from.
    ///
    /// # Errors
    /// As [`fit`].
    pub(super) fn fitted_to_all(&self, model: &Model) -> Result<Fit, SimulateError> {
        // What is handed over is off by as little as can be, wherever that comes from.
        let options = FitOptions {
            level_scatter: None,
            ..self.options_for(model)
        };
        fit(model, &self.everything(), &options)
    }

    /// The held-out error of the model that is handed over for `judged`, where that can be told.
    pub(crate) fn handed_over(&self, judged: &Judged, end: &Model) -> HeldOut {
        let fitted_anew =
            self.held_out_by == HeldOutBy::Records && self.options.level_scatter.is_some();
        let anew = fitted_anew.then(|| self.held_out(|_| end).ok()).flatten();
        anew.unwrap_or_else(|| judged.held_out.clone())
    }

    /// Σ e² over Σ (y − ȳ)² on what is judged.
    pub(crate) fn unexplained_share(&self, held_out: &HeldOut) -> f64 {
        let judging = self.folds.iter().flat_map(|fold| &fold.judging);
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for (judging, errors) in judging.zip(&held_out.errors) {
            let y = &judging.record.y;
            for y in &y[y.len() - errors.len()..] {
                n += 1.0;
                sum += y;
                squares += y * y;
            }
        }
        let spread = squares - sum * sum / f64::max(n, 1.0);
        if spread > 0.0 {
            held_out.measured / spread
        } else {
            1.0
        }
    }

    /// e² above the noise, per sample.
    pub(crate) fn excess(&self, held_out: &HeldOut) -> f64 {
        (held_out.rmse().powi(2) - self.noise_rmse().powi(2)).max(0.0)
    }

    /// p-value of "the error is not above `margin` times the noise floor".
    pub(crate) fn p_above_noise(&self, held_out: &HeldOut, margin: f64) -> f64 {
        p_above_noise(held_out, &self.floor, margin * margin)
    }

    /// How else than as in `own` the flow may take jets of part strength.
    pub(crate) fn other_gradings(&self, own: Grading) -> Vec<Grading> {
        let others = Grading::ALL.into_iter();
        others
            .filter(|other| self.full_is_one && *other != own)
            .collect()
    }

    /// Whether one model leaves the measurement further than the other where free
    /// runs are not started anew: what is better in pieces must not drift more.
    #[must_use]
    pub fn drifts_more(&self, one: &Judged, other: &Judged) -> bool {
        self.whole.is_some() && one.drifted > other.drifted
    }
}
