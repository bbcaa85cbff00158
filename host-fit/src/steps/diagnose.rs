//! Which physical effect is missing.

use serde::{Serialize, Serializer};

use super::onlooker::watched;
use super::{Onlooker, StepError, check_period, trained_in_free_run, verdict};
use crate::data::DataSet;
use crate::diagnose::{
    Diagnosis, HeldOutBy, Memory, NotTried, Options, Quoted, Ranked, Rung, Verdict,
    diagnose as search,
};
use crate::discover::{Glance, glance};
use crate::experiment::Separation;
use crate::indicators::{Scores, score, score_new};
use crate::model::{Model, Training};
use crate::power::{Detectable, detectable};
use crate::residual::{Failures, NoiseSource, Where, where_it_fails};
use crate::simulate::SimulateError;
use crate::terms::{MovingZero, tared};

/// A diagnosis with all that is said of it. Serialises to the keys of `diagnose --json`.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The model that it ends in, with its training record: what was missing is in it.
    pub model: Model,
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// It in a few words.
    pub headline: String,
    /// It in sentences.
    pub meaning: String,
    /// Where that model still fails; none if its free run diverges.
    pub failures: Option<Failures>,
    /// Why there is none.
    pub unstable: Option<String>,
    /// Indicators of that model.
    pub scores: Scores,
    /// The free run of the given model over each record, y; none if it diverges.
    pub runs_before: Option<Vec<Vec<f64>>>,
    /// The free run of the final model over each record, y; none if it diverges.
    pub runs: Option<Vec<Vec<f64>>>,
    /// What a term that no catalogue has would do; looked for where the catalogue explains too little.
    pub beyond: Option<Glance>,
    /// What of each effect would have been seen, had it been there; said where nothing is missing.
    pub detectable: Vec<Detectable>,
}

impl Serialize for Finding {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Document<'a> {
            verdict: Verdict,
            missing: &'a [String],
            stand_ins: &'a [String],
            sets: &'a [Vec<String>],
            memory: &'a [Memory],
            ladder: &'a [Rung],
            ranking: &'a [Ranked],
            not_tried: &'a [NotTried],
            #[serde(rename = "where")]
            places: &'a [Where],
            detectable: &'a [Detectable],
            beyond: Option<&'a Glance>,
            held_out_by: HeldOutBy,
            quoted: Option<&'a Quoted>,
            alternatives: usize,
            p_value: Option<f64>,
            restarted_s: Option<f64>,
            noise_source: NoiseSource,
            noise_estimate: f64,
            experiment: Option<&'a Separation>,
            words: String,
        }
        let found = &self.diagnosis;
        let document = Document {
            verdict: found.verdict,
            missing: &found.missing,
            stand_ins: &found.stand_ins,
            sets: &found.sets,
            memory: &found.memory,
            ladder: &found.ladder,
            ranking: &found.ranking,
            not_tried: &found.not_tried,
            places: self.failures.as_ref().map_or(&[], |f| &f.by),
            detectable: &self.detectable,
            beyond: self.beyond.as_ref(),
            held_out_by: found.held_out_by,
            quoted: found.quoted.as_ref(),
            alternatives: found.alternatives,
            p_value: found.p_value,
            restarted_s: found.restarted_s,
            noise_source: found.noise_source,
            noise_estimate: found.noise_estimate,
            experiment: found.separation.as_ref(),
            words: format!("{}. {}", self.headline, self.meaning),
        };
        document.serialize(serializer)
    }
}

/// Finds what `model` lacks on `set`, judged in free run on held-out records. Effects of the user's own are tried with
/// those of the catalogue if the model knows them ([`Model::define`]).
///
/// ```no_run
/// use host_fit::data::DataSet;
/// use host_fit::diagnose::Options;
/// use host_fit::model::Model;
/// use host_fit::steps::diagnose;
///
/// let model = Model::load("model.toml".as_ref())?;
/// let set = DataSet::load("data/hidden-ramp".as_ref())?;
/// let found = diagnose(&model, &set, &Options::default(), &())?;
/// println!("{}. {}", found.headline, found.meaning);
/// found.model.save("with-what-was-missing.toml".as_ref())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`]: different sampling periods, nothing to learn from, a missing channel, a user who ended it at once.
pub fn diagnose(
    model: &Model,
    set: &DataSet,
    options: &Options,
    onlooker: &dyn Onlooker,
) -> Result<Finding, StepError> {
    check_period(model, set)?;
    let records = model.targets(&set.records);
    let (diagnosis, failures, detectable, beyond) = watched(onlooker, "diagnosis", || {
        let progress = |what: &str| onlooker.now(what);
        let diagnosis = search(model, &records, options, onlooker.interrupt(), &progress)?;
        let failures = where_it_fails(&diagnosis.model, &tared(&records));
        let detectable = match diagnosis.verdict {
            Verdict::NothingMissing => {
                detectable(&diagnosis.model, &records, diagnosis.usual_by_chance)
            }
            Verdict::EffectMissing | Verdict::PartlyExplained | Verdict::Unexplained => {
                Ok(Vec::new())
            }
        };
        let beyond = match diagnosis.verdict {
            Verdict::PartlyExplained | Verdict::Unexplained => {
                progress("a first look beyond the catalogue");
                glance(&diagnosis.model, &records, onlooker.interrupt())
            }
            Verdict::NothingMissing | Verdict::EffectMissing => None,
        };
        Ok::<_, StepError>((diagnosis, failures, detectable, beyond))
    })?;
    let (failures, unstable) = match failures {
        Ok(failures) => (Some(failures), None),
        Err(error @ SimulateError::Diverged { .. }) => (None, Some(error.to_string())),
        Err(error) => return Err(error.into()),
    };
    let detectable = match detectable {
        // A model on the verge of instability has no amplitudes to tell.
        Err(SimulateError::Diverged { .. }) => Vec::new(),
        other => other?,
    };
    let runs_before = score(model, &records).ok().map(|(_, runs)| runs);
    let (scores, runs) = match score(&diagnosis.model, &records) {
        Ok((scores, runs)) => (scores, Some(runs)),
        Err(_) => (score_new(&diagnosis.model, &records)?.0, None),
    };
    let (headline, mut meaning) = verdict::words(&diagnosis);
    if let Some(beyond) = &beyond {
        meaning += &verdict::beyond(beyond);
    }
    if let Some(moving) = MovingZero::of(&records) {
        meaning += &format!(" {moving}");
    }
    Ok(Finding {
        model: Model {
            training: Training {
                stand_ins: diagnosis.stand_ins.clone(),
                ..trained_in_free_run(set, &scores, options.seed)
            },
            ..diagnosis.model.clone()
        },
        headline,
        meaning,
        failures,
        unstable,
        scores,
        runs_before,
        runs,
        beyond,
        detectable,
        diagnosis,
    })
}
