//! Discovery of a term outside the catalogue.

use super::memory::Work;
use super::onlooker::watched;
use super::prepared::prepared;
use super::verdict::{p_bound, times};
use super::{Answer, Onlooker, StepError, Tone, check_period, trained_in_free_run};
use crate::data::{DataSet, Record};
use crate::diagnose::Rung;
use crate::discover::{
    Discovery, FoundTerm, Options, RULES as DISCOVER, Smallest, Trace, discover as search,
};
use crate::excitation::says_little;
use crate::experiment::Separation;
use crate::indicators::{Scores, score};
use crate::model::{Model, Training};
use crate::picture::{listed, significant, time};
use crate::residual::NoiseSource;
use crate::terms::HeldOutBy;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// A discovery with its reports. Serialises to the keys of `discover --json`.
#[derive(Clone, Debug)]
pub struct Terms {
    /// The model with the terms, with its training record.
    pub model: Model,
    /// The discovery.
    pub discovery: Discovery,
    /// The answer: verdict, evidence, confidence, next command.
    pub answer: Answer,
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
            answer: &'a Answer,
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
            answer: &self.answer,
            ladder: &found.ladder,
            smallest_seen: &found.smallest_seen,
            held_out_by: found.held_out_by,
            noise_source: found.noise_source,
            noise_estimate: found.noise_estimate,
            curves_looked_at: found.looked_at,
            trace: found.trace.as_ref(),
            experiment: found.separation.as_ref(),
            words: self.answer.sentence(),
        };
        document.serialize(serializer)
    }
}

/// Finds the terms that `model` lacks on `set`, whether they are in a catalogue or not.
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
/// println!("{}", found.answer.words());
/// found.model.save("with-a-new-term.toml".as_ref())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`]: different sampling periods, no estimation record, an interrupt before the first result.
pub fn discover(
    model: &Model,
    set: &DataSet,
    options: &Options,
    onlooker: &dyn Onlooker,
) -> Result<Terms, StepError> {
    check_period(model, set)?;
    Work::Discover.fits(set)?;
    let prepared = prepared(set)?;
    let records = model.targets(&prepared.records);
    let mut discovery = watched(onlooker, "discovery", || {
        let progress = |what: &str| onlooker.now(what);
        search(model, &records, options, onlooker.interrupt(), &progress)
    })?;
    let runs_before = score(model, &records).ok().map(|(_, runs)| runs);
    let (scores, runs) = as_written(&mut discovery, model, &records)?;
    let mut answer = answer(&discovery);
    if let Some(remark) = says_little(&records) {
        answer.note(remark);
    }
    if let Some(trace) = &discovery.trace {
        answer.note(where_it_enters(trace));
    }
    if let Some(moving) = &discovery.moving_zero {
        answer.note(moving.to_string());
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
        answer,
        scores,
        runs_before,
        runs,
        discovery,
    })
}

/// The final model by its free-run error over whole `records`: the found one, or the given one if its error is
/// smaller. Every step of the ladder refers to whole records.
fn as_written(
    discovery: &mut Discovery,
    given: &Model,
    records: &[Record],
) -> Result<(Scores, Vec<Vec<f64>>), StepError> {
    let rmse = |scores: &Scores| scores.held_out().map_or(f64::INFINITY, |all| all.rmse);
    let found = score(&discovery.model, records);
    let before = score(given, records);
    let (scores, runs) = match (found, before) {
        (Ok(found), Ok(before)) if rmse(&found.0) <= rmse(&before.0) => found,
        (_, Ok(before)) => {
            discovery.terms.clear();
            discovery.model = given.clone();
            let first = discovery.ladder.first().cloned();
            discovery.ladder.extend(first.map(Rung::once_more));
            before
        }
        (found, Err(_)) => found?,
    };
    if let Some(first) = discovery.ladder.first_mut() {
        first.model = Some(given.clone());
    }
    if let Some(last) = discovery.ladder.last_mut() {
        last.model = Some(discovery.model.clone());
    }
    for rung in &mut discovery.ladder {
        rung.as_compared(records);
    }
    Ok((scores, runs))
}

/// The answer of a discovery.
fn answer(discovery: &Discovery) -> Answer {
    let rmse = |rung: Option<&Rung>| rung.map_or(f64::NAN, |rung| rung.validate_rmse);
    let (first, last) = (
        rmse(discovery.ladder.first()),
        rmse(discovery.ladder.last()),
    );
    let noise = discovery.noise_estimate;
    let error = discovery.held_out_by.compared().name();
    let known = discovery.noise_source != NoiseSource::Scatter && noise > 0.0;
    if discovery.terms.is_empty() {
        let level = match known {
            true => format!(
                "{} × the noise level (RMSE {})",
                times(last / noise),
                significant(last, 3)
            ),
            false => format!("RMSE {}; the noise level is unknown", significant(last, 3)),
        };
        let mut answer = Answer::new(Tone::Warning, "no term was found")
            .evidence(format!("The {error} stays at {level}."))
            .confidence(match discovery.looked_at {
                0 => "No candidate curve was tried.".to_owned(),
                looked_at => format!(
                    "None of {looked_at} candidate curves lowers it significantly and by more than additional lags do."
                ),
            });
        for (place, smallest) in &discovery.smallest_seen {
            answer.note(format!(
                "At the {place}, a term with an rms value of {} to {}, depending on its coordinate, would have \
                     been detected.",
                spoken(smallest.from, smallest.unit),
                spoken(smallest.to, smallest.unit)
            ));
        }
        return answer;
    }
    let verdict = headline(&discovery.terms);
    let is_stable = |term: &FoundTerm| term.stability_percent >= 100.0 * DISCOVER.stable;
    let (from, to) = (significant(first, 3), significant(last, 3));
    let fall = match known {
        true => format!(
            "from {} to {} × the noise level (RMSE {from} → {to})",
            times(first / noise),
            times(last / noise)
        ),
        false => format!("from RMSE {from} to {to}"),
    };
    let explained = discovery.terms.iter().map(|term| {
        format!(
            "{} with {} explains {:.0} % of the model error above the noise",
            capitalised(term.changes),
            term.coordinate,
            term.excess_taken_percent
        )
    });
    let sure = discovery.terms.iter().map(|term| {
        let p = p_bound(term.p_value);
        let share = term.stability_percent;
        let stable = match is_stable(term) {
            true => {
                format!("stable: the same term wins in {share:.0} % of the bootstrap resamples")
            }
            false => format!(
                "not stable: the same term wins in only {share:.0} % of the bootstrap resamples"
            ),
        };
        let which = match discovery.terms.len() {
            1 => String::new(),
            _ => format!("At the {} with {}: ", term.place.word(), term.coordinate),
        };
        format!(
            "{which}p {p} over {} candidate curves; {stable}.",
            discovery.looked_at
        )
    });
    let mut answer = Answer::new(Tone::Finding, verdict)
        .evidence(format!(
            "The {error} falls {fall}. {}.",
            explained.collect::<Vec<_>>().join("; ")
        ))
        .confidence(sure.collect::<Vec<_>>().join(" "))
        .next("host-fit discover model.toml DATASET -o new.toml --effect-out own.toml");
    for term in &discovery.terms {
        describe_term(&mut answer, term);
    }
    if let Some(separation) = &discovery.separation {
        answer.note(separation.words());
    }
    answer
}

/// The verdict on the terms found. A term that wins in less than half of the resamples has no place and coordinate in it,
/// because other terms together win more often.
fn headline(terms: &[FoundTerm]) -> String {
    let decided = terms.iter().filter(|term| term.stability_percent >= 50.0);
    let each = decided.map(|term| {
        format!(
            "at the {}, depending on {}",
            term.place.word(),
            term.coordinate
        )
    });
    let each: Vec<String> = each.collect();
    let named = match each.as_slice() {
        [] => {
            return "something is missing; these records do not determine its place and coordinate"
                .to_owned();
        }
        [one] => format!("a term is missing {one}"),
        several => format!("terms are missing {}", listed(several)),
    };
    match each.len() == terms.len() {
        true => named,
        false => format!("{named}; these records do not determine the place of another term"),
    }
}

/// Adds a term's formula and its equivalent alternatives to the answer.
fn describe_term(answer: &mut Answer, term: &FoundTerm) {
    if term.is_formula {
        let values = term.parameters.iter().map(|(name, estimate)| {
            let value = significant(estimate.value, 3);
            match estimate.unit.as_str() {
                "-" | "" => format!("{name} {value}"),
                unit => format!("{name} {value} {unit}"),
            }
        });
        answer.note(format!(
            "Formula: {}, with {}.",
            term.formula,
            values.collect::<Vec<_>>().join(", ")
        ));
    } else {
        answer
            .note("No formula on the list fits equally well, so the curve is written as a table.");
    }
    if !term.resembles.is_empty() {
        answer.note(format!("It resembles {}.", term.resembles.join(", ")));
    }
    if !term.alike.is_empty() {
        let others = term.alike.iter().map(|other| {
            let place = other.place.word();
            format!("one at the {place} that depends on {}", other.coordinate)
        });
        answer.note(format!(
            "Not distinguishable on these data from {}.",
            others.collect::<Vec<_>>().join(", or ")
        ));
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

/// The place at which the error enters, according to the trace.
fn where_it_enters(trace: &Trace) -> String {
    let odds = trace
        .odds
        .iter()
        .map(|(place, odds)| format!("{place} {:.0} %", 100.0 * odds));
    let odds = odds.collect::<Vec<_>>().join(", ");
    match trace.place {
        Some(place) => format!(
            "The error enters at the {} (posterior: {odds}). This result assumes nothing about the quantity on which the error depends.",
            place.word()
        ),
        None => format!(
            "These records do not identify the place at which the error enters (posterior: {odds})."
        ),
    }
}

fn spoken(value: f64, unit: &str) -> String {
    match unit {
        "-" => format!("{} %", significant(100.0 * value, 2)),
        "s" => time(value, 2),
        unit => format!("{} in {unit}", significant(value, 2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curves::Place;
    use std::collections::BTreeMap;

    #[test]
    fn only_a_decided_term_has_a_place_in_the_verdict() {
        let term = |coordinate: &str, stability_percent: f64| FoundTerm {
            effect: "found".to_owned(),
            place: Place::Delay,
            changes: "change of the delay",
            coordinate: coordinate.to_owned(),
            coordinate_unit: "-",
            excess_taken_percent: 80.0,
            formula_taken_percent: 80.0,
            p_value: 1e-6,
            curve: Vec::new(),
            unit: "s",
            resembles: Vec::new(),
            formula: String::new(),
            is_formula: false,
            parameters: BTreeMap::new(),
            alike: Vec::new(),
            stability_percent,
            file: String::new(),
        };
        let y = "at the delay, depending on y";
        assert_eq!(
            headline(&[term("y", 62.0)]),
            format!("a term is missing {y}")
        );
        let undecided = headline(&[term("y", 38.0)]);
        assert!(undecided.starts_with("something is missing") && !undecided.contains("delay"));
        let both = headline(&[term("y", 95.0), term("pulse number", 38.0)]);
        assert!(both.contains(y) && both.contains("another term") && !both.contains("pulse"));
    }
}
