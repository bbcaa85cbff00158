//! The term that is missing where no catalogue has it.

use super::onlooker::watched;
use super::{Onlooker, StepError, check_period, trained_in_free_run};
use crate::data::DataSet;
use crate::diagnose::Rung;
use crate::discover::{Discovery, FoundTerm, Options, Smallest, Trace, discover as search};
use crate::experiment::Separation;
use crate::indicators::{Scores, score};
use crate::model::{Model, Training};
use crate::picture::significant;
use crate::residual::NoiseSource;
use crate::terms::HeldOutBy;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// A discovery with all that is said of it. Serialises to the keys of `discover --json`.
#[derive(Clone, Debug)]
pub struct Terms {
    /// The model with the terms, with its training record.
    pub model: Model,
    /// The discovery.
    pub discovery: Discovery,
    /// It in a few words.
    pub headline: String,
    /// It in sentences.
    pub meaning: String,
    /// Indicators of the model.
    pub scores: Scores,
    /// The free run of the given model over each record, y; none if it diverges.
    pub runs_before: Option<Vec<Vec<f64>>>,
    /// The free run of the final model over each record, y.
    pub runs: Vec<Vec<f64>>,
}

impl Serialize for Terms {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Document<'a> {
            terms: &'a [FoundTerm],
            ladder: &'a [Rung],
            smallest_seen: &'a BTreeMap<String, Smallest>,
            held_out_by: HeldOutBy,
            noise_source: NoiseSource,
            noise_estimate: f64,
            curves_looked_at: usize,
            trace: Option<&'a Trace>,
            experiment: Option<&'a Separation>,
            words: String,
        }
        let found = &self.discovery;
        let document = Document {
            terms: &found.terms,
            ladder: &found.ladder,
            smallest_seen: &found.smallest_seen,
            held_out_by: found.held_out_by,
            noise_source: found.noise_source,
            noise_estimate: found.noise_estimate,
            curves_looked_at: found.looked_at,
            trace: found.trace.as_ref(),
            experiment: found.separation.as_ref(),
            words: format!("{}. {}", self.headline, self.meaning),
        };
        document.serialize(serializer)
    }
}

/// Finds the terms that `model` lacks on `set`, whether a catalogue has them or not.
///
/// ```no_run
/// use host_fit::data::DataSet;
/// use host_fit::discover::Options;
/// use host_fit::model::Model;
/// use host_fit::steps::discover;
///
/// let model = Model::load("model.toml".as_ref())?;
/// let set = DataSet::load("data/hidden-ramp".as_ref())?;
/// let found = discover(&model, &set, &Options::default(), &())?;
/// println!("{}. {}", found.headline, found.meaning);
/// found.model.save("with-a-new-term.toml".as_ref())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`]: different sampling periods, nothing to learn from, a user who ended it at once.
pub fn discover(
    model: &Model,
    set: &DataSet,
    options: &Options,
    onlooker: &dyn Onlooker,
) -> Result<Terms, StepError> {
    check_period(model, set)?;
    let records = model.targets(&set.records);
    let discovery = watched(onlooker, "discovery", || {
        let progress = |what: &str| onlooker.now(what);
        search(model, &records, options, onlooker.interrupt(), &progress)
    })?;
    let runs_before = score(model, &records).ok().map(|(_, runs)| runs);
    let (scores, runs) = score(&discovery.model, &records)?;
    let (headline, mut meaning) = words(&discovery);
    if let Some(trace) = &discovery.trace {
        meaning += &where_it_enters(trace);
    }
    if let Some(moving) = &discovery.moving_zero {
        meaning += &format!(" {moving}");
    }
    let found = discovery.terms.iter().map(|term| term.effect.clone());
    Ok(Terms {
        model: Model {
            training: Training {
                stand_ins: found.collect(),
                ..trained_in_free_run(set, &scores, 0)
            },
            ..discovery.model.clone()
        },
        headline,
        meaning,
        scores,
        runs_before,
        runs,
        discovery,
    })
}

/// Headline and meaning.
fn words(discovery: &Discovery) -> (String, String) {
    let noise = discovery.noise_estimate;
    let last = discovery
        .ladder
        .last()
        .map_or(f64::NAN, |rung| rung.validate_rmse);
    let floor = match discovery.noise_source {
        NoiseSource::Measured | NoiseSource::Repeats => format!(
            "the noise floor is {} ({:.2} times it is left)",
            significant(noise, 3),
            last / noise
        ),
        NoiseSource::Scatter => "the noise floor is not known".to_owned(),
    };
    if discovery.terms.is_empty() {
        let mut meaning = format!(
            "{} curves were looked at and none lowers the held-out error by more than chance or than the flow's own \
             memory does: it is {}, {floor}.",
            discovery.looked_at,
            significant(last, 3)
        );
        for (place, smallest) in &discovery.smallest_seen {
            meaning += &format!(
                " At the {place} a term of {} to {} (rms) would have counted, depending on its coordinate.",
                spoken(smallest.from, smallest.unit),
                spoken(smallest.to, smallest.unit)
            );
        }
        return ("no term was found".to_owned(), meaning);
    }
    let each = discovery
        .terms
        .iter()
        .map(|term| format!("at the {} by {}", term.place.word(), term.coordinate));
    let headline = format!(
        "a term was found {}",
        each.collect::<Vec<_>>().join(", and one ")
    );
    let mut meaning = String::new();
    for term in &discovery.terms {
        meaning += &format!(
            "The {} depends on {}: it takes {:.0} % of the excess of the held-out error (p {}). ",
            term.changes,
            term.coordinate,
            term.excess_taken_percent,
            if term.p_value < 0.001 {
                "< 0.001".to_owned()
            } else {
                format!("= {}", significant(term.p_value, 1))
            }
        );
        if term.is_formula {
            let values = term.parameters.iter().map(|(name, estimate)| {
                format!(
                    "{name} {} {}",
                    significant(estimate.value, 3),
                    estimate.unit
                )
            });
            meaning += &format!(
                "As a formula: {}, with {}. ",
                term.formula,
                values.collect::<Vec<_>>().join(", ")
            );
        } else {
            meaning += "No formula on the list does as well as its curve, which is handed over as a table. ";
        }
        if !term.resembles.is_empty() {
            meaning += &format!("It resembles {}. ", term.resembles.join(", "));
        }
        if !term.alike.is_empty() {
            let others = term.alike.iter().map(|other| {
                let place = other.place.word();
                format!("one at the {place} by {}", other.coordinate)
            });
            meaning += &format!(
                "These records cannot tell it from {}. ",
                others.collect::<Vec<_>>().join(", or ")
            );
        }
        meaning += &format!(
            "Place and coordinate come out best in {:.0} % of the resamples of the held-out records. ",
            term.stability_percent
        );
    }
    if let Some(separation) = &discovery.separation {
        meaning += &format!("{} ", separation.words());
    }
    meaning += &format!("The held-out error is {}; {floor}.", significant(last, 3));
    (headline, meaning)
}

/// Where the misfit enters, by its trace.
fn where_it_enters(trace: &Trace) -> String {
    let odds = trace
        .odds
        .iter()
        .map(|(place, odds)| format!("{place} {:.0} %", 100.0 * odds));
    let odds = odds.collect::<Vec<_>>().join(", ");
    match trace.place {
        Some(place) => format!(
            " Whatever it depends on, what is missing beside the flow's own memory enters at the {} (odds: {odds}).",
            place.word()
        ),
        None => format!(
            " A free signal at one place explains the misfit as well as at another: these records cannot tell where it enters (odds: {odds})."
        ),
    }
}

fn spoken(value: f64, unit: &str) -> String {
    match unit {
        "-" => format!("{} %", significant(100.0 * value, 2)),
        "s" => format!("{} ms", significant(1000.0 * value, 2)),
        unit => format!("{} in {unit}", significant(value, 2)),
    }
}
