//! Checks of the program's output against a case's expected answer and against general requirements.

use super::Row;
use super::answer::Answer;
use super::case::{Case, Right, Step};
use super::rehearsal::{judged, rows};
use host_fit::baseline::BaselineFits;
use host_fit::data::{DataSet, Record};
use serde_json::Value;

/// Points of FIT by which a model may be below the best baseline.
const BELOW_BASELINE: f64 = 1.0;
/// Least share of scored samples.
const SCORED: f64 = 0.5;
/// Tolerances of two equal answers: points of FIT, and samples of delay.
const SAME_FIT: f64 = 0.5;
/// The accuracy of an edge in a sampled command and a sampled response.
const HALF_A_SAMPLE: f64 = 0.5;

/// All output of the program for a case.
#[derive(Debug, Default)]
pub(super) struct Heard {
    /// Why the records could not be passed to a command.
    pub(super) unusable: Option<String>,
    /// The data set passed to the commands.
    pub(super) data: Option<DataSet>,
    pub(super) import: Option<Answer>,
    pub(super) delay: Option<Answer>,
    /// Commands that wrote a model, each with `compare` of its file.
    pub(super) models: Vec<(Step, Answer, Option<Answer>)>,
    /// The baselines on the samples that `compare` scored.
    pub(super) fits: BaselineFits,
}

impl Heard {
    pub(super) fn found(&self, step: Step) -> Option<&Answer> {
        let mut models = self.models.iter();
        models.find(|(s, ..)| *s == step).map(|(_, found, _)| found)
    }

    /// The document of `compare` on the file of a step.
    pub(super) fn compared(&self, step: Step) -> Option<&Value> {
        let mut models = self.models.iter();
        let (.., compared) = models.find(|(s, ..)| *s == step)?;
        Some(&compared.as_ref()?.document)
    }

    pub(super) fn answers(&self) -> impl Iterator<Item = &Answer> {
        let models = self.models.iter();
        let models = models.flat_map(|(_, found, compared)| [Some(found), compared.as_ref()]);
        let first = [self.import.as_ref(), self.delay.as_ref()];
        first.into_iter().chain(models).flatten()
    }
}

/// N1, N2 and the delay of an identified model in words.
pub(super) fn structure(document: &Value) -> String {
    let delays = &document["delays"];
    let list = |name: &str| numbers(&delays[name]);
    if delays.is_null() {
        return String::new();
    }
    let (n1, n2) = (list("state").len(), list("product").len());
    let law = numbers(&delays["law"]);
    let input = match law.is_empty() {
        true => list("input")
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(", "),
        false => {
            let law: Vec<String> = law.iter().map(|p| format!("{p:.3}")).collect();
            format!("law {}", law.join(", "))
        }
    };
    format!("N1 = {n1}, N2 = {n2}, delay {input}")
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().into_iter().flatten();
    list.filter_map(Value::as_f64).collect()
}

/// All problems, one sentence each.
pub(super) fn wrong(case: &Case, heard: &Heard) -> Vec<String> {
    let mut wrong = exits(&case.right, heard);
    if let Some(reason) = &heard.unusable {
        let expected = case.right.exit.get("import").is_some_and(|code| *code != 0);
        if wrong.is_empty() && !expected {
            wrong.push(reason.clone());
        }
        return wrong;
    }
    wrong.extend(of_data(&case.right, heard));
    wrong.extend(of_words(&case.right, heard));
    if case.commands.contains(&Step::Identify) {
        wrong.extend(of_identify(&case.right, heard));
    }
    wrong.extend(of_delay(&case.right, heard));
    wrong.extend(of_dead_time(&case.right, heard));
    wrong.extend(of_diagnose(&case.right, heard));
    if let (Some(most), Some(found)) = (case.right.terms_at_most, heard.found(Step::Discover)) {
        let terms = found.document["terms"].as_array().map_or(0, Vec::len);
        if terms > most {
            wrong.push(format!("discover: {terms} terms, at most {most} are right"));
        }
    }
    for (step, found, compared) in &heard.models {
        if *step != Step::Identify
            && let (Some(compared), Some(given)) = (compared, heard.compared(Step::Identify))
        {
            wrong.extend(of_written(*step, found, &compared.document, given));
        }
    }
    wrong
}

fn exits(right: &Right, heard: &Heard) -> Vec<String> {
    let mut wrong = Vec::new();
    for answer in heard.answers() {
        let code = right.exit.get(&answer.command).copied().unwrap_or(0);
        // An effect without a gain is rejected, and nothing is written.
        let refused = answer.command == "extend"
            && answer.exit == Some(1)
            && answer.complaint().contains("nothing was written: with");
        if answer.exit != Some(code) && !refused {
            let exit = answer
                .exit
                .map_or("none".to_owned(), |code| code.to_string());
            wrong.push(format!(
                "{}: exit code {exit}, correct: {code}: {}",
                answer.command,
                answer.complaint()
            ));
        }
    }
    wrong
}

fn of_data(right: &Right, heard: &Heard) -> Vec<String> {
    let mut wrong = Vec::new();
    let Some(data) = &heard.data else {
        return vec!["the data set cannot be read back".to_owned()];
    };
    let period = data.sample_period_s;
    if right.period_s.is_some_and(|range| !within(period, range)) {
        wrong.push(format!("sampling period {period} s"));
    }
    let samples: usize = data.records.iter().map(Record::len).sum();
    if right
        .samples
        .is_some_and(|[low, high]| !(low..=high).contains(&samples))
    {
        wrong.push(format!("{samples} samples"));
    }
    let range = |values: fn(&Record) -> &Vec<f64>| {
        let all = data.records.iter().flat_map(|r| values(r).iter().copied());
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
            [low.min(v), high.max(v)]
        })
    };
    if let Some([low, high]) = right.u {
        let [least, most] = range(|r| &r.u);
        let near = 0.01 * (high - low);
        // A command that does not reach full strength is valid if its values lie inside the range.
        if least < low - near || most > high + near || most <= least {
            wrong.push(format!("u from {least} to {most}"));
        }
    }
    if let Some([low, high]) = right.y {
        let [least, most] = range(|r| &r.y);
        if least < low || most > high {
            wrong.push(format!("y from {least} to {most}"));
        }
    }
    wrong
}

fn within(value: f64, [low, high]: [f64; 2]) -> bool {
    (low..=high).contains(&value)
}

fn of_words(right: &Right, heard: &Heard) -> Vec<String> {
    let mut wrong = Vec::new();
    for words in &right.not_said {
        for answer in heard.answers().filter(|a| a.said.contains(words)) {
            wrong.push(format!("{}: says \"{words}\"", answer.command));
        }
    }
    for words in &right.said {
        // Remarks of `compare` on channels are not part of the diagnosis.
        let diagnosis = heard.found(Step::Diagnose);
        if diagnosis.is_some_and(|answer| !answer.document["words"].to_string().contains(words)) {
            wrong.push(format!("diagnose: does not say \"{words}\""));
        }
    }
    wrong
}

fn of_identify(right: &Right, heard: &Heard) -> Vec<String> {
    let mut wrong = Vec::new();
    let Some(found) = heard.found(Step::Identify).filter(|a| a.exit == Some(0)) else {
        return wrong;
    };
    let Some(compared) = heard.compared(Step::Identify) else {
        return vec!["identify: exit code 0 and no model".to_owned()];
    };
    for key in ["records", "identify", "validate"] {
        if found.document[key] != compared[key] {
            wrong.push(format!(
                "identify: the printed `{key}` differs from that of compare for the file ({} and {})",
                error_of(&found.document),
                error_of(compared),
            ));
            break;
        }
    }
    if let Some(data) = &heard.data {
        let least = right.scored_at_least.unwrap_or(SCORED);
        for record in &data.records {
            let row = rows(compared).find(|row| row["name"] == *record.name);
            let scored = row.and_then(|row| row["samples"].as_u64()).unwrap_or(0);
            // A lead-in is never scored.
            let all = record.len() - record.lead;
            if (scored as f64) < least * all as f64 {
                wrong.push(format!(
                    "{scored} of {all} samples of `{}` are scored; required: at least {:.0} %",
                    record.name,
                    100.0 * least
                ));
            }
        }
    }
    wrong.extend(of_structure(right, &found.document));
    let Some(fit) = judged(compared)["fit_percent"].as_f64() else {
        wrong.push("compare: no FIT of the file that identify wrote".to_owned());
        return wrong;
    };
    if let Some(least) = right.fit_at_least.filter(|least| fit < *least) {
        wrong.push(format!("FIT {fit:.2} %; required: at least {least} %"));
    }
    if let Some((name, best)) = heard
        .fits
        .best()
        .filter(|best| fit < best.1 - BELOW_BASELINE)
    {
        wrong.push(format!("FIT {fit:.2} %, a {name} has {best:.2} %"));
    }
    wrong
}

fn error_of(document: &Value) -> String {
    judged(document)["rmse"].to_string()
}

fn of_structure(right: &Right, document: &Value) -> Vec<String> {
    let mut wrong = Vec::new();
    let delays = &document["delays"];
    for (name, key, most) in [
        ("N1", "state", right.n1_at_most),
        ("N2", "product", right.n2_at_most),
    ] {
        let count = numbers(&delays[key]).len();
        if let Some(most) = most.filter(|most| count > *most) {
            wrong.push(format!("{name} = {count}; required: at most {most}"));
        }
    }
    if let Some([low, high]) = right.delay_samples {
        // A law with one parameter is a constant unrounded delay.
        let law = numbers(&delays["law"]);
        let input = if law.len() == 1 {
            law.clone()
        } else {
            numbers(&delays["input"])
        };
        let is_right = |delay: &f64| within(*delay, [low, high]);
        if law.len() > 1 || input.is_empty() || !input.iter().all(is_right) {
            let said = structure(document);
            wrong.push(format!(
                "{said}; correct: a constant delay of {low} to {high} samples"
            ));
        }
    }
    wrong
}

fn of_delay(right: &Right, heard: &Heard) -> Vec<String> {
    let (Some(range), Some(answer)) = (right.edge_delay_samples, &heard.delay) else {
        return Vec::new();
    };
    let edges = answer.document["edges"].as_array().into_iter().flatten();
    let measured: Vec<f64> = edges
        .filter_map(|edge| edge["delay_samples"].as_f64())
        .collect();
    let outside = measured.iter().filter(|delay| !within(**delay, range));
    let outside: Vec<String> = outside.map(|delay| format!("{delay:.1}")).collect();
    let [low, high] = range;
    match (measured.is_empty(), outside.is_empty()) {
        (true, _) => vec!["delay: no edge is measured".to_owned()],
        (_, true) => Vec::new(),
        _ => vec![format!(
            "delay: {} of {} edges outside {low} to {high} samples: {}",
            outside.len(),
            measured.len(),
            outside
                .iter()
                .take(6)
                .cloned()
                .collect::<Vec<_>>()
                .join(", ")
        )],
    }
}

fn of_dead_time(right: &Right, heard: &Heard) -> Option<String> {
    let (truth, answer) = (right.dead_time_samples?, heard.delay.as_ref()?);
    let found = &answer.document["dead_time"];
    let bound = |end: &str| found[end].as_f64();
    let Some((low, high)) = bound("low_samples").zip(bound("high_samples")) else {
        return Some("delay: no dead time".to_owned());
    };
    let outside = !(low - HALF_A_SAMPLE..=high + HALF_A_SAMPLE).contains(&truth);
    outside.then(|| format!("delay: dead time {low:.1} to {high:.1} samples; correct: {truth}"))
}

fn of_diagnose(right: &Right, heard: &Heard) -> Vec<String> {
    let mut wrong = Vec::new();
    let Some(answer) = heard.found(Step::Diagnose).filter(|a| a.exit == Some(0)) else {
        return wrong;
    };
    let verdict = answer.document["verdict"].as_str().unwrap_or_default();
    let allowed = &right.verdicts;
    if !allowed.is_empty() && !allowed.iter().any(|v| v == verdict) {
        wrong.push(format!(
            "verdict {verdict}; correct: {}",
            allowed.join(" or ")
        ));
    }
    // For measured sets the correct names are unknown.
    if !allowed.is_empty() {
        let names = answer.document["missing"].as_array().into_iter().flatten();
        for name in names.filter_map(Value::as_str) {
            if !right.names.iter().any(|right| right == name) {
                wrong.push(format!("diagnose names {name}"));
            }
        }
    }
    wrong
}

/// The error printed for a model must equal that of its file, and must not exceed that of the given model.
fn of_written(step: Step, found: &Answer, compared: &Value, given: &Value) -> Vec<String> {
    let mut wrong = Vec::new();
    let command = &found.command;
    let printed = match step {
        Step::Extend => &found.document["after"]["rmse"],
        _ => {
            let ladder = found.document["ladder"].as_array();
            ladder
                .and_then(|rungs| rungs.last())
                .map_or(&Value::Null, |rung| &rung["validate_rmse"])
        }
    };
    let written = &judged(compared)["rmse"];
    if printed != written {
        wrong.push(format!(
            "{command}: prints an error of {printed}, compare says {written} of its file"
        ));
    }
    let (before, after) = (&judged(given)["rmse"], written);
    match (before.as_f64(), after.as_f64()) {
        (Some(before), Some(after)) if after <= before => {}
        (None, _) => {}
        _ => wrong.push(format!(
            "{command}: hands over a model of error {after}, given was one of {before}"
        )),
    }
    wrong
}

/// Adds the differences from the case with which the answers must agree.
pub(super) fn same_answers(cases: &[Case], rows: &mut [Row]) {
    let found: Vec<Row> = rows.to_vec();
    for (case, row) in cases.iter().zip(rows) {
        let Some(name) = &case.same_answer_as else {
            continue;
        };
        let same = |other: &&Row| other.set == row.set && other.case == *name;
        let Some(other) = found.iter().find(same) else {
            continue;
        };
        if row.skipped.is_some() || other.skipped.is_some() {
            continue;
        }
        let own = row.clone();
        let mut differs = |what: &str, one: &str, two: &str| {
            if one != two {
                row.wrong.push(format!("{what} {one}, for `{name}` {two}"));
            }
        };
        let said = |row: &Row| row.verdict.clone().unwrap_or_default();
        differs("verdict", &said(&own), &said(other));
        differs("names", &own.names.join(", "), &other.names.join(", "));
        differs("structure", &own.structure, &other.structure);
        if let (Some(one), Some(two)) = (own.fit_percent, other.fit_percent)
            && (one - two).abs() > SAME_FIT
        {
            differs("FIT", &format!("{one:.2} %"), &format!("{two:.2} %"));
        }
    }
}

#[cfg(test)]
mod tests;
