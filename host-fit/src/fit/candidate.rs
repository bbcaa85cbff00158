//! A base model with one more effect, all parameters refitted.

use super::lean::{fresh_starts, settle_fixed_delay, with_law_of};
use super::rules::RULES;
use super::starts::starts;
use super::{Fit, FitOptions, fit};
use crate::data::Record;
use crate::model::{Delay, Model};
use crate::order;
use crate::parallel;
use crate::user_effect::Definition;
use model_core::effect::{Needs, Place, Spec};
use model_core::recursion::Grading;
use std::cmp::Ordering;
use thiserror::Error;

/// Why an effect could not be tried.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CandidateError {
    /// A record lacks the channel.
    #[error(
        "effect `{effect}` needs the measured channel `{channel}`, which record `{record}` does not have. \
         Add the column `{channel}` to that record's CSV file, or choose another effect."
    )]
    MissingChannel {
        /// The effect.
        effect: String,
        /// The channel.
        channel: String,
        /// The record.
        record: String,
    },
    /// No starting point gave a stable free run.
    #[error(
        "effect `{effect}`: the free run diverges from every starting point. \
         The model is close to unstable; identify it with fewer lags or with `--objective free-run`."
    )]
    Unstable {
        /// The effect.
        effect: String,
    },
}

/// Refits `base` with `spec` added, from several starting points.
///
/// # Errors
/// [`CandidateError`].
pub fn fit_with_effect(
    base: &Model,
    spec: &'static Spec,
    records: &[&Record],
    options: &FitOptions,
) -> Result<Fit, CandidateError> {
    let reference = channel_reference(spec, records)?;
    let with = |base: &Model, parameters: &[f64]| {
        let mut model = base.clone();
        model.add(spec, parameters, reference);
        model
    };
    let mut models: Vec<Model> = starts(base, spec, records)
        .iter()
        .map(|parameters| with(base, parameters))
        .collect();
    if needs_fresh_starts(base, spec) {
        let few = starts(base, spec, records);
        let few = few.iter().step_by((few.len() / RULES.input_starts).max(1));
        let fresh = fresh_starts(base, records);
        models.extend(few.flat_map(|own| fresh.iter().map(move |base| with(base, own))));
    }
    let mut tried = tried_briefly(models, records, options);
    if spec.place == Place::Jet {
        // The response to jets of part strength can only be identified if an effect causes them.
        let regraded = tried.iter().take(RULES.regraded).flat_map(|fit| {
            let others = Grading::ALL.into_iter().filter(|g| *g != base.grading);
            others.map(|grading| Model {
                grading,
                ..fit.model.clone()
            })
        });
        tried.extend(tried_briefly(regraded.collect(), records, options));
        order::ascending(&mut tried, Fit::mean_square);
    }
    let mut met = Vec::new();
    let leading = tried.iter().enumerate().filter(|(place, fit)| {
        let first_of_its_grading = !met.contains(&fit.model.grading);
        met.push(fit.model.grading);
        *place < RULES.followed || first_of_its_grading
    });
    let leading: Vec<&Fit> = leading.map(|(_, fit)| fit).collect();
    let finished = parallel::some(&leading, |start| {
        let lost_its_law = spec.parameters.is_empty()
            && matches!(start.model.delay, Delay::Fixed { .. })
            && !matches!(base.delay, Delay::Fixed { .. });
        if lost_its_law {
            return with_law_of(&start.model, base, records).ok();
        }
        let fitted = fit(&start.model, records, options).ok()?;
        // A fixed delay has no derivative, and the base's delay may imitate the effect.
        settle_fixed_delay(fitted, records, options).ok()
    });
    finished
        .into_iter()
        .min_by(best_first)
        .ok_or_else(|| CandidateError::Unstable {
            effect: spec.name.to_owned(),
        })
}

/// Whether a base model fitted without this effect is a bad starting point for the model with it. Three kinds of
/// effects are concerned. A sensor that shows only the size of the friction, and a channel that y or its rate follows,
/// change the gain, the delay and the time constant of the base. A pickup can pull the delay of the base to 0, where pickup and
/// response are not distinguishable.
#[must_use]
pub fn needs_fresh_starts(base: &Model, spec: &Spec) -> bool {
    let dead_time = base.delay.present(0.0, base.sample_period_s);
    let at_once = spec.needs == Needs::DeadTime && spec.needs.unmet(true, dead_time).is_some();
    at_once
        || spec.parameters.is_empty()
        || base
            .definition(spec.name)
            .is_some_and(Definition::biases_the_base)
}

/// Several starting points after a few iterations each, best first. Fewer iterations would rank thresholds poorly,
/// because stepwise parameters converge slowly.
fn tried_briefly(models: Vec<Model>, records: &[&Record], options: &FitOptions) -> Vec<Fit> {
    let brief = FitOptions {
        iterations: RULES.brief,
        ..*options
    };
    let mut fits = parallel::some(&models, |model| fit(model, records, &brief).ok());
    order::ascending(&mut fits, Fit::mean_square);
    fits
}

fn best_first(a: &Fit, b: &Fit) -> Ordering {
    a.mean_square().total_cmp(&b.mean_square())
}

/// The mean of the effect's channel over the records, in its unit; `None` for an effect without a channel.
///
/// # Errors
/// [`CandidateError::MissingChannel`] for the first record that lacks it.
pub(crate) fn channel_reference(
    spec: &Spec,
    records: &[&Record],
) -> Result<Option<f64>, CandidateError> {
    let Some(channel) = spec.channel else {
        return Ok(None);
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for record in records {
        let Some(values) = record.channels.get(channel) else {
            return Err(CandidateError::MissingChannel {
                effect: spec.name.to_owned(),
                channel: channel.to_owned(),
                record: record.name.clone(),
            });
        };
        for value in values {
            sum += value;
            count += 1.0;
        }
    }
    Ok(Some(sum / f64::max(count, 1.0)))
}
