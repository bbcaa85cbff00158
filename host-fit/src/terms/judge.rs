//! The judge of models: fitted by free-run error on some records, validated by free-run error on others.

use super::RULES;
use super::evidence::{HeldOut, p_above_noise};
use super::folds::{Fold, HeldOutBy, Judging, folds};
use crate::data::{Record, Use};
use crate::fit::{Fit, FitOptions, LevelScatter, fit, pieces_of};
use crate::model::Model;
use crate::noise::without_outliers;
use crate::parallel;
use crate::residual::{NoiseSource, noise_floor};
use crate::simulate::SimulateError;
use model_core::recursion::Grading;
use numerics::linalg::dot;

/// A model with its fits, one per fold, and its validation error.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The fits.
    pub fits: Vec<Fit>,
    /// y − y_sim on the validation samples.
    pub(crate) held_out: HeldOut,
    /// Root mean square error of free runs without restarts, y; equal to [`rmse`](Self::rmse) for rigs that
    /// do not drift.
    pub(crate) drifted: f64,
}

impl Judged {
    /// The model of the first fold.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.fits[0].model
    }

    /// Root mean square of the validation error, y.
    #[must_use]
    pub fn rmse(&self) -> f64 {
        self.held_out.rmse()
    }

    /// ln of the validation error plus the penalty of all parameters, by which models with different delay
    /// laws are compared.
    pub(crate) fn size(&self) -> f64 {
        size(self.rmse(), self.model())
    }
}

/// ln of an error plus the penalty of all parameters of its model.
pub(crate) fn size(rmse: f64, model: &Model) -> f64 {
    rmse.ln() + RULES.price * model.coordinates().len() as f64
}

/// Estimation and validation records with the noise level of the latter.
pub struct Judge {
    pub(crate) folds: Vec<Fold>,
    /// The folds with free runs over whole records; set where `folds` restarts them.
    whole: Option<Vec<Fold>>,
    /// How the validation error is obtained.
    pub held_out_by: HeldOutBy,
    /// All estimation records, for the final fit.
    identify: Vec<Record>,
    /// Whether the command is on/off.
    pub on_off: bool,
    /// Whether a full jet is a command of 1 in the user's units; otherwise the fraction of full strength has no
    /// meaning.
    pub(crate) full_is_one: bool,
    /// Noise variance σ² per validation sample, without the scatter of the level.
    floor: Vec<Vec<f64>>,
    /// Root mean square of the noise including the scatter of the level, y.
    measured_noise: f64,
    /// Where the noise level comes from.
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
    /// A judge over `records`. With `restarted`, free runs are restarted after this many samples. `None`
    /// without estimation records.
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
            identify = pieces_of(&identify, samples);
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

    /// Noise level on the validation samples, y rms: measured or estimated, without the scatter of the level.
    #[must_use]
    pub fn noise_rmse(&self) -> f64 {
        root_mean(&self.floor)
    }

    /// Noise level including the scatter of the level, y rms: comparable with an error as measured.
    #[must_use]
    pub fn measured_noise_rmse(&self) -> f64 {
        self.measured_noise
    }

    /// Relative scatter of a record's level between repeats; none if the records do not show it.
    #[must_use]
    pub fn level_scatter(&self) -> Option<f64> {
        Some(self.options.level_scatter?.deviation)
    }

    /// The error over the noise level; 1 is the least attainable. If the slow noise is unknown, the noise level is
    /// unknown too, and the ratio is never close to 1.
    #[must_use]
    pub fn over_noise(&self, rmse: f64) -> f64 {
        match self.noise_source {
            NoiseSource::Scatter => f64::INFINITY,
            NoiseSource::Measured | NoiseSource::Repeats => rmse / self.noise_rmse(),
        }
    }

    /// Estimation records of a fold.
    #[must_use]
    pub fn learning(&self, fold: usize) -> Vec<&Record> {
        self.folds[fold].learning.iter().collect()
    }

    /// All records of the first fold, estimation records first.
    pub(crate) fn first_fold(&self) -> Vec<&Record> {
        let fold = &self.folds[0];
        let judging = fold.judging.iter().map(|judging| &judging.record);
        fold.learning.iter().chain(judging).collect()
    }

    /// The validation records with their leads; samples of the lead are not scored.
    pub(crate) fn scored_records(&self) -> Vec<Record> {
        let fold = &self.folds[0];
        let judging = fold.judging.iter().map(|judging| Record {
            lead: judging.scored_from(),
            ..judging.record.clone()
        });
        fold.learning.iter().cloned().chain(judging).collect()
    }

    /// Fit options for `model`: with the constant term if it has one.
    #[must_use]
    pub fn options_for(&self, model: &Model) -> FitOptions {
        FitOptions {
            constant: self.options.constant || model.constant != 0.0,
            ..self.options
        }
    }

    /// Indices of the coordinates of `model` that a fit varies.
    pub(crate) fn free(&self, model: &Model) -> Vec<usize> {
        let constant = self.options_for(model).constant;
        let coordinates = model.coordinates();
        let moves = |i: &usize| {
            let fixed = coordinates[*i].parameter().is_some_and(|p| p.low >= p.high);
            !fixed && (*i > 0 || constant)
        };
        (0..coordinates.len()).filter(moves).collect()
    }

    /// y − y_sim from a sample on; a large constant error if the run diverges.
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

    /// Validation errors of one model per fold.
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
        let errors = parallel::each(&judged, |(fold, judging)| {
            Self::error(models(*fold), &judging.record, judging.scored_from())
        });
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

    /// Validates the first fold's fit, and fits the other folds starting from it.
    ///
    /// # Errors
    /// A missing channel, or a free run that diverges in another fold.
    pub fn judged_from(&self, first: Fit) -> Result<Judged, SimulateError> {
        let options = self.options_for(&first.model);
        let others = parallel::each(1..self.folds.len(), |fold| {
            fit(&first.model, &self.learning(fold), &options)
        });
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

    /// The model refitted to the free-run error in every fold, with its structure unchanged.
    ///
    /// # Errors
    /// A missing channel, or a free run that diverges.
    pub fn refitted(&self, model: &Model) -> Result<Judged, SimulateError> {
        let options = self.options_for(model);
        self.judged_from(fit(model, &self.learning(0), &options)?)
    }

    /// The final model, fitted to all estimation records.
    #[must_use]
    pub fn final_fit(&self, judged: &Judged) -> Fit {
        let own = judged.fits[0].clone();
        if self.held_out_by == HeldOutBy::Records && self.options.level_scatter.is_none() {
            return own;
        }
        self.fitted_to_all(&own.model).unwrap_or(own)
    }

    /// All estimation records.
    pub(super) fn everything(&self) -> Vec<&Record> {
        self.identify.iter().collect()
    }

    /// A model fitted to all estimation records.
    ///
    /// # Errors
    /// As [`fit`].
    pub(super) fn fitted_to_all(&self, model: &Model) -> Result<Fit, SimulateError> {
        // The final model is fitted for the least total error, scatter of the level included.
        let options = FitOptions {
            level_scatter: None,
            ..self.options_for(model)
        };
        fit(model, &self.everything(), &options)
    }

    /// The validation error of the final model for `judged`, if there are validation records.
    pub(crate) fn handed_over(&self, judged: &Judged, end: &Model) -> HeldOut {
        let fitted_anew =
            self.held_out_by == HeldOutBy::Records && self.options.level_scatter.is_some();
        let anew = fitted_anew.then(|| self.held_out(|_| end).ok()).flatten();
        anew.unwrap_or_else(|| judged.held_out.clone())
    }

    /// Unexplained variance Σ e² over Σ (y − ȳ)² on the validation samples.
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

    /// Mean square validation error over the variance of y in all records, both without single wrong readings, which are
    /// no motion. The validation samples alone may be at rest, as at the end of a step test.
    pub(crate) fn error_of_motion(&self, held_out: &HeldOut) -> f64 {
        let all = self.first_fold();
        let read: Vec<f64> = all
            .iter()
            .flat_map(|record| without_outliers(&record.y))
            .collect();
        let samples = read.len().max(1) as f64;
        let mean = read.iter().sum::<f64>() / samples;
        let variance = read.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / samples;
        let errors: Vec<f64> = held_out
            .errors
            .iter()
            .flat_map(|e| without_outliers(e))
            .collect();
        // The part along the level's scatter is motion as well.
        let scatter = held_out.measured - held_out.sum_of_squares;
        if variance > 0.0 {
            (dot(&errors, &errors) + scatter) / errors.len().max(1) as f64 / variance
        } else {
            1.0
        }
    }

    /// Unexplained variance e² − σ² per sample.
    pub(crate) fn excess(&self, held_out: &HeldOut) -> f64 {
        (held_out.rmse().powi(2) - self.noise_rmse().powi(2)).max(0.0)
    }

    /// p-value of the null hypothesis that the error is not above `margin` times the noise level.
    pub(crate) fn p_above_noise(&self, held_out: &HeldOut, margin: f64) -> f64 {
        p_above_noise(held_out, &self.floor, margin * margin)
    }

    /// All responses to jets of part strength except that of `own`.
    pub(crate) fn other_gradings(&self, own: Grading) -> Vec<Grading> {
        let others = Grading::ALL.into_iter();
        others
            .filter(|other| self.full_is_one && *other != own)
            .collect()
    }

    /// Whether one model has a larger free-run error without restarts than the other: a gain with restarts
    /// must not cost more drift.
    #[must_use]
    pub fn drifts_more(&self, one: &Judged, other: &Judged) -> bool {
        self.whole.is_some() && one.drifted > other.drifted
    }
}

#[cfg(test)]
mod tests {
    use crate::data::{Record, Use};
    use crate::model::Model;
    use crate::terms::Bench;

    /// One step of a first-order plant that is at rest long before its end: the validation part is noise about a
    /// level.
    #[test]
    fn a_step_test_is_judged_by_its_motion() {
        let u: Vec<f64> = (0..600).map(|k| f64::from(u8::from(k >= 100))).collect();
        let mut noise = 1_u32;
        let mut level = 0.0;
        let y = u.iter().map(|u| {
            let shown = level;
            level += 0.03 * (u - level);
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            shown + 0.04 * (f64::from(noise) / f64::from(u32::MAX) - 0.5)
        });
        let record = Record::new("step", Use::Identify, 0.001, u.clone(), y.collect());
        let given = Model {
            a: vec![0.97],
            b: vec![0.03],
            ..Model::default()
        };
        let judge = Bench::of(&given, &[record]).expect("a record").judge;
        let held_out = judge.held_out(|_| &given).expect("stable");
        assert!(judge.error_of_motion(&held_out) < 0.01);
        assert!(judge.unexplained_share(&held_out) > 0.5);
    }
}
