//! The answer of the program to a data set, and the differences of two answers.

use super::Change;
use super::records::Part;
use crate::strangers::answer::{Answer, ask};
use host_fit::data::{DataSet, Record, Use};
use serde_json::Value;
use std::path::Path;
use std::time::Duration;

/// Differences below these shares are rounding if the samples are the same, and scatter otherwise.
const SAME: f64 = 0.02;
const SCATTER: f64 = 0.15;

/// Answers of the program.
#[derive(Clone, Debug, Default)]
pub(super) struct Said {
    /// A command that did not end with exit code 0, with its message.
    failed: Option<String>,
    structure: String,
    has_law: bool,
    delays: Vec<f64>,
    fit_percent: f64,
    rmse: f64,
    /// 1 minus the larger of the largest pole magnitudes with the valve open and closed.
    decay: f64,
    /// Mean of the measured edges, samples.
    edges: Option<f64>,
    /// Half of the 95 % interval of the dead time, samples.
    delay_known_to: f64,
    /// The message of `delay`, if it fails.
    no_edges: Option<String>,
    /// Verdict and names; `None` if `diagnose` was not run.
    finding: Option<String>,
}

impl Said {
    /// Runs `identify`, `compare`, `delay` and perhaps `diagnose`; data set and model stay in `scratch`.
    pub(super) fn of(records: &[Part], diagnose: bool, scratch: &Path, limit: Duration) -> Self {
        let data = scratch.join("data");
        if let Err(reason) = write(records, &data) {
            return Self {
                failed: Some(reason),
                ..Self::default()
            };
        }
        let model = scratch.join("model.toml").to_string_lossy().into_owned();
        let data = data.to_string_lossy().into_owned();
        // The model of the preceding case must not count as an answer to this one.
        let _ = std::fs::remove_file(&model);
        let run = |name: &str, arguments: &[&str]| {
            let arguments: Vec<String> = arguments.iter().map(|a| (*a).to_owned()).collect();
            ask(name, &arguments, scratch, limit)
        };
        let identified = run("identify", &["identify", &data, "-o", &model]);
        let compared = run("compare", &["compare", &model, &data]);
        let delay = run("delay", &["delay", &data]);
        let diagnosed = diagnose.then(|| run("diagnose", &["diagnose", &model, &data]));
        let all = [Some(&identified), Some(&compared), diagnosed.as_ref()];
        let failed = all
            .into_iter()
            .flatten()
            .find(|answer| answer.exit != Some(0));
        let failed = failed.map(|answer| format!("{}: {}", answer.command, answer.complaint()));
        let judged = judged(&compared);
        let numbers = |value: &Value| -> Vec<f64> {
            let list = value.as_array().into_iter().flatten();
            list.filter_map(Value::as_f64).collect()
        };
        let lags = &identified.document["delays"];
        let poles = numbers(&identified.document["poles"]);
        Self {
            failed,
            structure: format!(
                "N1 = {}, N2 = {}",
                numbers(&lags["state"]).len(),
                numbers(&lags["product"]).len()
            ),
            has_law: !lags["law"].is_null(),
            delays: numbers(&lags["input"]),
            fit_percent: judged["fit_percent"].as_f64().unwrap_or(f64::NAN),
            rmse: judged["rmse"].as_f64().unwrap_or(f64::NAN),
            decay: 1.0 - poles.iter().fold(0.0, |most: f64, pole| most.max(*pole)),
            edges: delay.document["statistics"]["all"]["mean"].as_f64(),
            delay_known_to: {
                let dead_time = &delay.document["dead_time"];
                let end = |key: &str| dead_time[key].as_f64().unwrap_or(0.0);
                (end("high_samples") - end("low_samples")) / 2.0
            },
            no_edges: (delay.exit != Some(0)).then(|| delay.complaint()),
            finding: diagnosed.as_ref().map(finding),
        }
    }
}

impl Said {
    /// Whether both models have the same lags and the same kind of delay.
    pub(super) fn is_built_as(&self, other: &Self) -> bool {
        self.structure == other.structure && self.has_law == other.has_law
    }
}

/// The results of `compare` for the validation records or, without any, for the others.
fn judged(compared: &Answer) -> &Value {
    match &compared.document["validate"] {
        Value::Null => &compared.document["identify"],
        some => some,
    }
}

/// Whether each of two models describes the other's records equally well; the records then do not distinguish the
/// structures. Their data sets and models are in `before` and `after`.
pub(super) fn is_near_tie(before: &Path, after: &Path, limit: Duration) -> bool {
    let error = |model: &Path, data: &Path| {
        let [model, data] = [model.join("model.toml"), data.join("data")]
            .map(|path| path.to_string_lossy().into_owned());
        let compared = ask(
            "compare",
            &["compare".to_owned(), model, data],
            after,
            limit,
        );
        judged(&compared)["rmse"].as_f64().unwrap_or(f64::NAN)
    };
    [(before, after), (after, before)]
        .into_iter()
        .all(|(own, other)| error(other, own) <= (1.0 + SAME) * error(own, own))
}

fn finding(answer: &Answer) -> String {
    let verdict = answer.document["verdict"].as_str().unwrap_or("none");
    let names = answer.document["missing"].as_array().into_iter().flatten();
    let names: Vec<&str> = names.filter_map(Value::as_str).collect();
    format!("{verdict} {}", names.join(", "))
        .trim_end()
        .to_owned()
}

fn write(records: &[Part], folder: &Path) -> Result<(), String> {
    // The folder may contain the preceding case.
    let _ = std::fs::remove_dir_all(folder);
    let records = records.iter().map(|part| {
        let role = if part.held_out {
            Use::Validate
        } else {
            Use::Identify
        };
        Record::new(
            &part.name,
            role,
            part.period_s,
            part.u.clone(),
            part.y.clone(),
        )
    });
    let set = DataSet::from_records(None, records.collect()).map_err(|e| e.to_string())?;
    set.save(folder).map_err(|error| error.to_string())
}

/// Differences between two answers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Differences {
    /// Differences in structure, delays and poles of the model.
    pub(super) of_model: Vec<String>,
    /// Differences in everything else: verdict, errors, measured delays.
    pub(super) of_answer: Vec<String>,
}

impl Differences {
    /// All of them.
    pub(super) fn all(self) -> Vec<String> {
        self.of_model.into_iter().chain(self.of_answer).collect()
    }
}

/// The differences of the answers before and after a change that multiplies errors by `factor`.
pub(super) fn broken(change: Change, factor: f64, before: &Said, after: &Said) -> Differences {
    let mut found = Differences::default();
    if before.failed.is_some() || after.failed.is_some() {
        let words = |said: &Said| said.failed.clone().unwrap_or_else(|| "done".to_owned());
        // If both fail, there is no difference between them, but no answer either.
        found.of_answer = vec![format!("{} → {}", words(before), words(after))];
        return found;
    }
    let same = |list: &mut Vec<String>, what: &str, one: &str, two: &str| {
        if one != two {
            list.push(format!("{what} {one} → {two}"));
        }
    };
    let of_model = &mut found.of_model;
    same(of_model, "", &before.structure, &after.structure);
    let law = |said: &Said| said.has_law.to_string();
    same(of_model, "law", &law(before), &law(after));
    let finding = |said: &Said| said.finding.clone().unwrap_or_default();
    let of_answer = &mut found.of_answer;
    same(of_answer, "verdict", &finding(before), &finding(after));
    let (share, samples, points) = match change.changes_samples() {
        true => (SCATTER, 1.0, 1.0),
        false => (SAME, 0.5, 0.1),
    };
    let near = |one: f64, two: f64, within: f64| (one - two).abs() <= within;
    let delays_agree = before.delays.len() == after.delays.len() && {
        let mut pairs = before.delays.iter().zip(&after.delays);
        pairs.all(|(one, two)| near(*one, *two, samples))
    };
    if !delays_agree {
        of_model.push(format!("delay {:?} → {:?}", before.delays, after.delays));
    }
    // FIT is relative to the scatter of y, which additional rest reduces.
    if change != Change::Rest && !near(before.fit_percent, after.fit_percent, points) {
        let (one, two) = (before.fit_percent, after.fit_percent);
        of_answer.push(format!("FIT {one:.2} % → {two:.2} %"));
    }
    let expected = factor * before.rmse;
    if !near(expected, after.rmse, share * expected) {
        of_answer.push(format!("error {expected:.5} expected → {:.5}", after.rmse));
    }
    // The poles are those at u = 0 and u = 1.
    let has_poles = !matches!(change, Change::Command);
    if has_poles && !near(before.decay, after.decay, share * before.decay.abs()) {
        of_model.push(format!(
            "slowest decay {:.5} → {:.5}",
            before.decay, after.decay
        ));
    }
    if before.no_edges.is_none()
        && let Some(words) = &after.no_edges
    {
        of_answer.push(format!("delay: {words}"));
        return found;
    }
    // With other samples, estimates must agree within their stated uncertainty.
    let known_to = match change.changes_samples() {
        true => samples.max(before.delay_known_to.min(after.delay_known_to)),
        false => samples,
    };
    match (before.edges, after.edges) {
        (Some(one), Some(two)) if near(one, two, known_to) => {}
        (None, None) => {}
        (one, two) => {
            let told = |delay: Option<f64>, said: &Said| match delay {
                Some(delay) => format!("{delay:.2} ± {:.2}", said.delay_known_to),
                None => "none".to_owned(),
            };
            let (one, two) = (told(one, before), told(two, after));
            of_answer.push(format!("measured delay {one} → {two}"));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said() -> Said {
        Said {
            structure: "N1 = 1, N2 = 1".to_owned(),
            delays: vec![15.0],
            fit_percent: 97.0,
            rmse: 0.01,
            decay: 0.02,
            edges: Some(15.1),
            finding: Some("nothing-missing".to_owned()),
            ..Said::default()
        }
    }

    #[test]
    fn answers_that_are_the_same_are_not_broken() {
        let mut after = said();
        after.rmse = 0.25;
        let differs = |change, factor, after: &Said| broken(change, factor, &said(), after).all();
        assert!(differs(Change::Output, 25.0, &after).is_empty());
        after.rmse = 0.01;
        after.delays = vec![16.0];
        assert!(differs(Change::Cut, 1.0, &after).is_empty());
        assert_eq!(
            differs(Change::Clock, 1.0, &after),
            ["delay [15.0] → [16.0]"]
        );
    }

    #[test]
    fn a_model_that_describes_the_others_records_worse_is_no_near_tie() {
        let response = |time: f64| {
            let u = |k: usize| f64::from(u8::from(k / 90 % 2 == 1));
            let rise = |y: &mut f64, k: usize| {
                let now = *y;
                *y += (u(k) - *y) / time;
                Some(now + 1e-3 * (0.7 * k as f64).sin())
            };
            Part {
                name: "run".to_owned(),
                held_out: false,
                period_s: 0.001,
                u: (0..900).map(u).collect(),
                y: (0..900).scan(0.0, rise).collect(),
            }
        };
        let scratch = tempfile::tempdir().expect("a folder");
        let limit = Duration::from_secs(60);
        let folders = [("quick", 20.0), ("again", 20.0), ("slow", 26.0)].map(|(name, time)| {
            let folder = scratch.path().join(name);
            std::fs::create_dir_all(&folder).expect("a folder");
            let said = Said::of(&[response(time)], false, &folder, limit);
            assert_eq!(said.failed, None);
            folder
        });
        let [quick, again, slow] = &folders;
        assert!(is_near_tie(quick, again, limit));
        assert!(!is_near_tie(quick, slow, limit));
    }

    #[test]
    fn every_difference_is_told() {
        let after = Said {
            structure: "N1 = 2, N2 = 1".to_owned(),
            has_law: true,
            delays: Vec::new(),
            fit_percent: f64::NAN,
            rmse: f64::NAN,
            decay: 0.0,
            edges: None,
            finding: None,
            ..Said::default()
        };
        let differs = broken(Change::Cut, 1.0, &said(), &after);
        assert_eq!((differs.of_model.len(), differs.of_answer.len()), (4, 4));
        let failed = Said {
            failed: Some("delay: no message".to_owned()),
            ..said()
        };
        assert_eq!(
            broken(Change::Rest, 1.0, &said(), &failed).all(),
            ["done → delay: no message"]
        );
    }
}
