//! A diagnosis in words.

use super::{Words, aligned, lines, short};
use host_fit::data::Plant;
use host_fit::diagnose::{Diagnosis, ParameterEstimate, RULES, Ranked, Rung};
use host_fit::indicators::ErrorKind;
use host_fit::picture::listed;
use host_fit::residual::Failures;
use host_fit::steps::{Finding, Terms, effect_in_words, p_bound};
use model_core::effects::spec;

impl Words for Finding {
    fn words(&self) -> String {
        let mut told = vec![self.answer.words()];
        told.push(format!(
            "\n{}",
            ladder_table(
                &self.diagnosis.ladder,
                self.diagnosis.held_out_by.compared()
            )
        ));
        if !self.diagnosis.ranking.is_empty() {
            let (diagnosis, plant) = (&self.diagnosis, self.plant);
            let rows = ranking_rows(diagnosis, plant);
            if !rows.is_empty() {
                told.push(format!("\n{}", ranking_table(&rows)));
            }
            let screened = screened_only(diagnosis, plant);
            told.extend(screened.map(|words| format!("\n{words}")));
        }
        told.push("\nwhere the model fails".to_owned());
        told.extend(self.failures.iter().flat_map(Failures::describe));
        told.extend(self.unstable.clone());
        told.extend(self.detectable.iter().map(|d| format!("  {}", d.words)));
        if !self.diagnosis.not_tried.is_empty() {
            told.push("\nnot tried".to_owned());
            let each = self.diagnosis.not_tried.iter();
            told.extend(each.map(|entry| {
                let effect = effect_in_words(&entry.effect, self.plant);
                format!("  {effect}: {}", entry.reason)
            }));
        }
        lines(told)
    }
}

impl Words for Terms {
    fn words(&self) -> String {
        let mut told = vec![self.answer.words()];
        told.push(format!(
            "\n{}",
            ladder_table(
                &self.discovery.ladder,
                self.discovery.held_out_by.compared()
            )
        ));
        for term in &self.discovery.terms {
            let head = [
                format!("{} ({})", term.coordinate, term.coordinate_unit),
                format!("{} ({})", term.changes, term.unit),
                "95 % band".to_owned(),
            ];
            let rows = term.curve.iter().map(|point| {
                vec![
                    short(point.x),
                    short(point.value),
                    format!("{} … {}", short(point.low), short(point.high)),
                ]
            });
            let rows: Vec<Vec<String>> = rows.collect();
            told.push(format!(
                "\n{}",
                aligned(&head.each_ref().map(String::as_str), &rows, 0)
            ));
        }
        lines(told)
    }
}

pub(crate) fn ladder_rows(ladder: &[Rung]) -> Vec<Vec<String>> {
    let row = |rung: &Rung| {
        vec![
            rung.step.clone(),
            format!("{:.5}", rung.validate_rmse),
            format!("{:.2}", rung.validate_fit_percent),
            rung.noise_rmse
                .map_or_else(|| "–".into(), |noise| format!("{noise:.5}")),
        ]
    };
    ladder.iter().map(row).collect()
}

/// The ladder of errors as an aligned table.
fn ladder_table(ladder: &[Rung], kind: ErrorKind) -> String {
    let steps = format!("{}, step by step", kind.name());
    let head = [steps.as_str(), "RMSE", "FIT %", "noise"];
    let table = aligned(&head, &ladder_rows(ladder), 1);
    match ladder_caption(ladder) {
        "" => table,
        caption => format!("{table}\n{caption}"),
    }
}

/// Why the error of the second step is larger than that of the given model; empty if it is not.
pub(crate) fn ladder_caption(ladder: &[Rung]) -> &'static str {
    match ladder {
        [given, next, _, ..] if next.validate_rmse > (1.0 + RULES.alike) * given.validate_rmse => {
            "The second step leaves out lags and terms of the given model that could hide an effect; the error is \
             therefore larger there."
        }
        _ => "",
    }
}

/// `name value unit (low … high)`, or that the records do not determine it: its interval spans its whole range, or more
/// than the factor of the rule `diagnose.identified`.
fn estimate_words(name: &str, p: &ParameterEstimate) -> String {
    let unit = if p.unit == "-" { "" } else { p.unit.as_str() };
    let space = if unit.is_empty() { "" } else { " " };
    format!("{name} {}{space}{unit} ({})", short(p.value), interval(p))
}

/// The 95 % interval of a parameter, or that the records do not determine it.
pub(crate) fn interval(p: &ParameterEstimate) -> String {
    let wide = p.low > 0.0 && p.high >= RULES.identified * p.low;
    match p.determined && p.low.is_finite() && p.high.is_finite() && !wide {
        true => format!("{} … {}", short(p.low), short(p.high)),
        false => "not determined by these records".to_owned(),
    }
}

/// The amplitude of a candidate, if its interval contains 0. The refitted model has a lower error, which the p-value
/// tests; the interval also has the scatter of the amplitude between records, which is large where the candidate only
/// imitates another effect.
fn undetermined_amplitude(r: &Ranked) -> Option<&'static str> {
    let amplitude = spec(&r.effect)?.amplitude.filter(|card| card.linear)?;
    let estimate = r.parameters.get(amplitude.parameter)?;
    (estimate.low <= 0.0 && estimate.high >= 0.0).then_some(amplitude.parameter)
}

/// A share in percent with one decimal; never "−0.0".
fn percent(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let rounded = (10.0 * value).round() / 10.0;
    let sign = if rounded < 0.0 { "−" } else { "" };
    format!("{sign}{:.1} %", rounded.abs())
}

/// A whole number with a true minus sign; never "−0".
fn whole(number: f64) -> String {
    format!("{:.0}", number + 0.0).replace('-', "−")
}

/// The outcome of a candidate, with the reason.
fn outcome(r: &Ranked, diagnosis: &Diagnosis, plant: Plant) -> String {
    let own = outcome_alone(r, diagnosis, plant);
    match undetermined_amplitude(r) {
        Some(amplitude) if r.significant => format!("{own}; its {amplitude} is not determined"),
        _ => own,
    }
}

fn outcome_alone(r: &Ranked, diagnosis: &Diagnosis, plant: Plant) -> String {
    if diagnosis.missing.contains(&r.effect) {
        let others = diagnosis.missing.iter().filter(|name| **name != r.effect);
        let others: Vec<String> = others.map(|name| effect_in_words(name, plant)).collect();
        return match is_named_beside(r, diagnosis) {
            true => format!("named beside {}", listed(&others)),
            false => "named".to_owned(),
        };
    }
    if diagnosis.certified.contains(&r.effect) {
        return "certified".to_owned();
    }
    if diagnosis.stand_ins.contains(&r.effect) {
        return "surrogate".to_owned();
    }
    let set = diagnosis.sets.iter().find(|set| set.contains(&r.effect));
    if let Some(first) = set.and_then(|set| set.first()) {
        return format!("not distinguishable from {}", effect_in_words(first, plant));
    }
    if !r.refitted {
        return "screened only".to_owned();
    }
    if r.p_value > RULES.level {
        return "not significant".to_owned();
    }
    if !r.significant {
        return "below the practical margin".to_owned();
    }
    match diagnosis.missing.as_slice() {
        [] => "significant, but explains too little".to_owned(),
        named if plant == Plant::Flow => format!("imitates {}", listed(named)),
        [_] => "imitates the named behaviour".to_owned(),
        _ => "imitates the named behaviours".to_owned(),
    }
}

/// Whether an effect is named although alone it is not significant.
fn is_named_beside(r: &Ranked, diagnosis: &Diagnosis) -> bool {
    let named = &diagnosis.missing;
    named.len() > 1 && named.contains(&r.effect) && r.refitted && r.p_value > RULES.level
}

/// Whether a candidate was fitted, or is part of the answer.
pub(crate) fn is_told(r: &Ranked, diagnosis: &Diagnosis) -> bool {
    let answer = [
        &diagnosis.missing,
        &diagnosis.certified,
        &diagnosis.stand_ins,
    ];
    let sets = diagnosis.sets.iter().flatten();
    let mut named = answer.into_iter().flatten().chain(sets);
    r.refitted || named.any(|name| *name == r.effect)
}

/// The candidates of which only a first estimate exists, in one sentence; `None` if there are none.
pub(crate) fn screened_only(diagnosis: &Diagnosis, plant: Plant) -> Option<String> {
    let all = diagnosis.ranking.iter();
    let screened: Vec<&Ranked> = all.filter(|r| !is_told(r, diagnosis)).collect();
    let fall = |r: &&&Ranked| r.error_reduction_percent;
    let most = screened.iter().max_by(|a, b| fall(a).total_cmp(&fall(b)))?;
    let name = effect_in_words(&most.effect, plant);
    let lowers = match percent(most.error_reduction_percent.max(0.0)).as_str() {
        "0.0 %" => "does not lower the error".to_owned(),
        share => format!("lowers the error by {share}"),
    };
    Some(match screened.len() {
        1 => format!("{name} was screened only: by a first estimate it {lowers}."),
        count => format!(
            "{count} candidates were screened only: by a first estimate, the best of them ({name}) {lowers}."
        ),
    })
}

/// Candidates, the named ones first: effect, outcome, error reduction, evidence, p, parameters.
pub(crate) fn every_candidate(diagnosis: &Diagnosis, plant: Plant) -> Vec<Vec<String>> {
    let row = |r| candidate_row(r, diagnosis, plant);
    named_first(diagnosis).into_iter().map(row).collect()
}

/// As [`every_candidate`], without those of which only a first estimate exists.
pub(crate) fn ranking_rows(diagnosis: &Diagnosis, plant: Plant) -> Vec<Vec<String>> {
    let told = named_first(diagnosis).into_iter();
    let told = told.filter(|r| is_told(r, diagnosis));
    told.map(|r| candidate_row(r, diagnosis, plant)).collect()
}

fn candidate_row(r: &Ranked, diagnosis: &Diagnosis, plant: Plant) -> Vec<String> {
    // Parameters of a candidate without a gain are meaningless.
    let telling = r.significant || diagnosis.missing.contains(&r.effect);
    let parameters: Vec<String> = r
        .parameters
        .iter()
        .filter(|_| telling)
        .map(|(name, p)| estimate_words(name, p))
        .collect();
    // What an effect adds to the others is a matter of the model with all of them.
    let beside = diagnosis.certificates.get(&r.effect);
    let (nats, p_value) = match beside.filter(|_| is_named_beside(r, diagnosis)) {
        Some(own) => (Some(own.evidence_nats), Some(own.p_value())),
        None => (r.gain_nats, r.refitted.then_some(r.p_value)),
    };
    let none = || "–".to_owned();
    vec![
        effect_in_words(&r.effect, plant),
        outcome(r, diagnosis, plant),
        percent(falls_at_its_step(r, diagnosis)),
        nats.map_or_else(none, |nats| whole(nats.round())),
        p_value.map_or_else(none, p_bound),
        parameters.join(", "),
    ]
}

/// By how much the error falls at the step of the ladder that adds the effect, %; for an effect without a step, when it is
/// added alone.
fn falls_at_its_step(r: &Ranked, diagnosis: &Diagnosis) -> f64 {
    let steps = diagnosis.ladder.windows(2);
    let mut own = steps.filter(|pair| pair[1].effects.last() == Some(&r.effect));
    own.next().map_or(r.error_reduction_percent, |pair| {
        100.0 * (1.0 - pair[1].validate_rmse / pair[0].validate_rmse)
    })
}

/// The ranking with the named effects first, then the surrogates, then the others, each in their order.
pub(crate) fn named_first(diagnosis: &Diagnosis) -> Vec<&Ranked> {
    let mut all: Vec<&Ranked> = diagnosis.ranking.iter().collect();
    all.sort_by_key(|r| {
        let named = diagnosis.missing.iter().position(|name| *name == r.effect);
        let surrogate = diagnosis.stand_ins.contains(&r.effect);
        match (named, surrogate) {
            (Some(place), _) => place,
            (None, true) => diagnosis.missing.len(),
            (None, false) => diagnosis.missing.len() + 1,
        }
    });
    all
}

fn ranking_table(rows: &[Vec<String>]) -> String {
    let head = [
        "each candidate",
        "outcome",
        "error falls",
        "nats",
        "p",
        "parameters (95 % interval)",
    ];
    aligned_last_left(&head, rows)
}

/// As [`aligned`], with the last column left-aligned.
fn aligned_last_left(head: &[&str], rows: &[Vec<String>]) -> String {
    let cut = head.len().saturating_sub(1);
    let numbers: Vec<Vec<String>> = rows
        .iter()
        .map(|row| row.iter().take(cut).cloned().collect())
        .collect();
    let table = aligned(head.get(..cut).unwrap_or(head), &numbers, 2);
    let last = head
        .last()
        .map(|cell| (*cell).to_owned())
        .into_iter()
        .chain(
            rows.iter()
                .map(|row| row.get(cut).cloned().unwrap_or_default()),
        );
    let lines: Vec<String> = table
        .lines()
        .zip(last)
        .map(|(line, last)| format!("{line}  {last}").trim_end().to_owned())
        .collect();
    lines.join("\n")
}
