//! The bench on which candidates are judged: everything is refitted with each of
//! them, and the free run on held-out records decides.

use super::evidence::{HeldOut, p_above_noise};
use super::folds::{Fold, HeldOutBy, folds};
use super::{DiagnoseError, NotTried, Rung};
use crate::data::Record;
use crate::fit::{Fit, FitOptions, fit, fit_with_effect, lean_base, pieces};
use crate::model::Model;
use crate::residual::{FailureCoordinate, NoiseSource, examine, noise_floor};
use crate::simulate::SimulateError;
use model_core::effect::{Place, Spec};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// A model within this factor of the noise floor is not searched further.
const AT_THE_FLOOR: f64 = 1.005;
/// A misfit below this factor is within what y_sd itself is known to.
pub(super) const FLOOR_MARGIN: f64 = 1.10;
/// Level of the tests.
pub(super) const LEVEL: f64 = 0.05;
/// Where slow noise is not known, a misfit counts if it depends on something
/// (cross-validated share that one coordinate explains) …
const DEPENDS: f64 = 0.1;
/// … or if it is more than noise can be in a recording worth fitting: the share
/// of the variance of y.
const TOO_MUCH: f64 = 0.06;
/// A run that diverges counts as this many times the largest |y| off.
const DIVERGED: f64 = 10.0;
/// Decoys per candidate.
const DECOYS: usize = 19;

/// A model with its fits, one per fold, and its held-out error.
#[derive(Clone, Debug)]
pub(super) struct Judged {
    pub(super) fits: Vec<Fit>,
    pub(super) learned: HeldOut,
    pub(super) held_out: HeldOut,
    /// Root mean square error of free runs that are not started anew, y: the same
    /// for rigs that do not drift.
    pub(super) drifted: f64,
}

impl Judged {
    /// The model of the first fold.
    pub(super) fn model(&self) -> &Model {
        &self.fits[0].model
    }

    /// Parameters that were fitted.
    pub(super) fn parameters(&self) -> usize {
        self.fits[0].free.len()
    }
}

/// What a round of candidates gave.
#[derive(Default)]
pub(super) struct Round {
    pub(super) candidates: Vec<(&'static Spec, Judged)>,
    pub(super) not_tried: Vec<NotTried>,
}

pub(super) struct Bench<'a> {
    pub(super) folds: Vec<Fold>,
    /// The folds with free runs over whole records, where `folds` start them anew.
    whole: Option<Vec<Fold>>,
    pub(super) held_out_by: HeldOutBy,
    /// Everything that may be learned from, for the model that is handed over.
    identify: Vec<Record>,
    on_off: bool,
    /// σ² of the noise per judged sample.
    floor: Vec<Vec<f64>>,
    pub(super) noise_source: NoiseSource,
    /// Shifts of the decoys, as fractions of a record.
    pub(super) shifts: Vec<f64>,
    pub(super) options: FitOptions,
    pub(super) interrupt: &'a AtomicBool,
}

impl<'a> Bench<'a> {
    pub(super) fn new(
        records: &[Record],
        restarted: Option<usize>,
        seed: u64,
        options: FitOptions,
        interrupt: &'a AtomicBool,
    ) -> Result<Self, DiagnoseError> {
        use rand::{RngExt, SeedableRng};
        let (mut folds, held_out_by) = folds(records);
        let mut identify: Vec<Record> = records
            .iter()
            .filter(|r| r.role == crate::data::Use::Identify)
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
            return Err(DiagnoseError::NothingToLearnFrom);
        }
        let judging = || folds.iter().flat_map(|fold| &fold.judging);
        let whole: Vec<&Record> = judging().map(|judging| &judging.record).collect();
        let measured: Vec<Vec<f64>> = whole.iter().map(|record| record.y.clone()).collect();
        let (mut floor, noise_source) = noise_floor(&whole, &measured);
        for (variance, judging) in floor.iter_mut().zip(judging()) {
            variance.drain(..judging.from.min(variance.len()));
        }
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        Ok(Self {
            identify,
            on_off: records.iter().all(Record::is_on_off),
            folds,
            whole: whole_runs,
            held_out_by,
            floor,
            noise_source,
            shifts: (0..DECOYS).map(|_| rng.random_range(0.1..0.9)).collect(),
            options,
            interrupt,
        })
    }

    pub(super) fn interrupted(&self) -> bool {
        self.interrupt.load(Ordering::Relaxed)
    }

    pub(super) fn is_on_off(&self) -> bool {
        self.on_off
    }

    /// Root mean square of the noise on what is judged, y: measured or estimated.
    pub(super) fn noise_rmse(&self) -> f64 {
        let all = self.floor.iter().flatten();
        let (sum, count) = all.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
        f64::sqrt(sum / f64::max(count, 1.0))
    }

    fn learning(&self, fold: usize) -> Vec<&Record> {
        self.folds[fold].learning.iter().collect()
    }

    /// y − y_sim from a sample on; a run that diverges is far off everywhere.
    fn error(model: &Model, record: &Record, from: usize) -> Result<Vec<f64>, SimulateError> {
        let from = from.max(model.warm_up());
        let measured = record.y.iter().skip(from);
        match model.free_run(record) {
            Ok(run) => Ok(measured
                .zip(run.iter().skip(from))
                .map(|(y, sim)| y - sim)
                .collect()),
            Err(SimulateError::Diverged { .. }) => {
                let largest = record.y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
                Ok(measured.map(|_| DIVERGED * largest).collect())
            }
            Err(error) => Err(error),
        }
    }

    /// Errors of one model per fold on what was held out from it.
    pub(super) fn held_out<'m>(
        &self,
        models: impl Fn(usize) -> &'m Model + Sync,
    ) -> Result<HeldOut, SimulateError> {
        Self::held_out_of(&self.folds, models)
    }

    fn held_out_of<'m>(
        folds: &[Fold],
        models: impl Fn(usize) -> &'m Model + Sync,
    ) -> Result<HeldOut, SimulateError> {
        let judged: Vec<(usize, &super::folds::Judging)> = folds
            .iter()
            .enumerate()
            .flat_map(|(fold, split)| split.judging.iter().map(move |judging| (fold, judging)))
            .collect();
        let each = judged
            .par_iter()
            .map(|(fold, judging)| Self::error(models(*fold), &judging.record, judging.from));
        let errors: Vec<Result<Vec<f64>, SimulateError>> = each.collect();
        Ok(HeldOut::new(errors.into_iter().collect::<Result<_, _>>()?))
    }

    pub(super) fn judge(&self, fits: Vec<Fit>) -> Result<Judged, SimulateError> {
        let learned: Vec<Vec<f64>> = fits
            .iter()
            .enumerate()
            .flat_map(|(fold, fit)| {
                let records = &self.folds[fold].learning;
                records.iter().map(|r| Self::error(&fit.model, r, 0))
            })
            .collect::<Result<_, _>>()?;
        let held_out = self.held_out(|fold| &fits[fold].model)?;
        let drifted = match &self.whole {
            Some(whole) => Self::held_out_of(whole, |fold| &fits[fold].model)?.rmse(),
            None => held_out.rmse(),
        };
        Ok(Judged {
            learned: HeldOut::new(learned),
            held_out,
            drifted,
            fits,
        })
    }

    /// A model refitted in free run in every fold, its structure and delays kept.
    pub(super) fn refitted(&self, model: &Model) -> Result<Judged, SimulateError> {
        let fits = (0..self.folds.len())
            .map(|fold| fit(model, &self.learning(fold), &self.options))
            .collect::<Result<_, _>>()?;
        self.judge(fits)
    }

    /// The leanest base, with the effects that the given model has already.
    pub(super) fn lean(&self, given: &Model) -> Result<Judged, SimulateError> {
        let mut bare = given.clone();
        // What was added before stays: the question is what is missing still.
        let kept = std::mem::take(&mut bare.effects);
        let mut model = lean_base(&bare, &self.learning(0))?.model;
        model.effects = kept;
        self.refitted(&model)
    }

    /// The model that is handed over: fitted to everything that may be learned from.
    pub(super) fn final_fit(&self, judged: &Judged) -> Fit {
        let own = judged.fits[0].clone();
        if self.held_out_by == HeldOutBy::Records {
            return own;
        }
        let all: Vec<&Record> = self.identify.iter().collect();
        fit(&own.model, &all, &self.options).unwrap_or(own)
    }

    /// Σ e² over Σ (y − ȳ)² on what is judged.
    fn unexplained_share(&self, held_out: &HeldOut) -> f64 {
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
            held_out.sum_of_squares / spread
        } else {
            1.0
        }
    }

    pub(super) fn rung(&self, held_out: &HeldOut, effects: &[String], step: &str) -> Rung {
        Rung {
            effects: effects.to_vec(),
            validate_rmse: held_out.rmse(),
            validate_fit_percent: 100.0 * (1.0 - self.unexplained_share(held_out).sqrt()),
            noise_rmse: (self.noise_source == NoiseSource::Measured).then(|| self.noise_rmse()),
            step: step.to_owned(),
        }
    }

    /// Why a candidate makes no sense on this data or in this model.
    fn pointless(&self, model: &Model, spec: &Spec) -> Option<String> {
        if model.effect_names().iter().any(|name| name == spec.name) {
            return Some("it is in the model already".to_owned());
        }
        spec.needs.unmet(self.on_off).map(str::to_owned)
    }

    /// Refits `current` with each candidate that is `wanted` and judges it on the
    /// held-out records.
    pub(super) fn round(&self, current: &Judged, wanted: &dyn Fn(&str) -> bool) -> Round {
        let candidates: Vec<&'static Spec> = current
            .model()
            .candidates()
            .filter(|spec| wanted(spec.name))
            .collect();
        let tried: Vec<(&'static Spec, Result<Judged, String>)> = candidates
            .into_par_iter()
            .map(|spec| {
                if let Some(reason) = self.pointless(current.model(), spec) {
                    return (spec, Err(reason));
                }
                if self.interrupted() {
                    return (spec, Err("interrupted".to_owned()));
                }
                (spec, self.with(current, spec))
            })
            .collect();
        let mut round = Round::default();
        for (spec, outcome) in tried {
            match outcome {
                Ok(judged) => round.candidates.push((spec, judged)),
                Err(reason) => round.not_tried.push(NotTried {
                    effect: spec.name.to_owned(),
                    reason,
                }),
            }
        }
        round
    }

    /// `current` with one more effect, judged.
    pub(super) fn with(&self, current: &Judged, spec: &'static Spec) -> Result<Judged, String> {
        let judging = || self.folds.iter().flat_map(|fold| &fold.judging);
        if let Some(channel) = spec.channel
            && let Some(judging) = judging().find(|j| !j.record.channels.contains_key(channel))
        {
            let error = crate::fit::CandidateError::MissingChannel {
                effect: spec.name.to_owned(),
                channel: channel.to_owned(),
                record: judging.record.name.clone(),
            };
            return Err(error.to_string());
        }
        // The first fold finds the basin; the others descend from there.
        let first = fit_with_effect(current.model(), spec, &self.learning(0), &self.options)
            .map_err(|e| e.to_string())?;
        let mut fits = vec![first];
        for fold in 1..self.folds.len() {
            let next = fit(&fits[0].model, &self.learning(fold), &self.options);
            fits.push(next.map_err(|e| e.to_string())?);
        }
        self.judge(fits).map_err(|e| e.to_string())
    }

    /// `current` refitted without one of its effects.
    pub(super) fn without(&self, current: &Judged, spec: &Spec, base: &Model) -> Option<Judged> {
        let fits = (0..self.folds.len()).map(|fold| {
            let mut model = current.fits[fold].model.clone();
            model.effects.retain(|effect| effect.name != spec.name);
            if spec.place == Place::Delay {
                model.delay = base.delay.clone();
            }
            fit(&model, &self.learning(fold), &self.options).ok()
        });
        self.judge(fits.collect::<Option<_>>()?).ok()
    }

    pub(super) fn at_the_floor(&self, held_out: &HeldOut) -> bool {
        self.noise_source != NoiseSource::Scatter
            && held_out.rmse() <= AT_THE_FLOOR * self.noise_rmse()
    }

    /// e² above the noise, per sample.
    pub(super) fn excess(&self, held_out: &HeldOut) -> f64 {
        (held_out.rmse().powi(2) - self.noise_rmse().powi(2)).max(0.0)
    }

    /// Whether one model leaves the measurement further than the other where free
    /// runs are not started anew: what is better in pieces must not drift more.
    pub(super) fn drifts_more(&self, one: &Judged, other: &Judged) -> bool {
        self.whole.is_some() && one.drifted > other.drifted
    }

    /// Whether the error is above the noise by more than chance, and more than
    /// the noise is known.
    pub(super) fn is_above_floor(&self, judged: &Judged) -> bool {
        let margin = FLOOR_MARGIN * FLOOR_MARGIN;
        let p = p_above_noise(&judged.held_out, &self.floor, margin);
        p < LEVEL
            && (self.noise_source != NoiseSource::Scatter
                || self.unexplained_share(&judged.held_out) > TOO_MUCH
                || self.depends(judged))
    }

    /// Whether the held-out error depends on anything but its own frequency.
    fn depends(&self, judged: &Judged) -> bool {
        let (mut records, mut runs) = (Vec::new(), Vec::new());
        for (fold, fit) in self.folds.iter().zip(&judged.fits) {
            for judging in &fold.judging {
                let Ok(run) = fit.model.free_run(&judging.record) else {
                    return true;
                };
                records.push(&judging.record);
                runs.push(run);
            }
        }
        let model = judged.model();
        let failures = examine(&records, runs, model.warm_up(), model.longest_delay());
        failures
            .by
            .iter()
            .filter(|place| place.coordinate != FailureCoordinate::FrequencyBand)
            .any(|place| place.explained_fraction > DEPENDS)
    }
}
