//! Made-up output, correct and wrong.

use super::*;
use host_fit::data::Use;
use serde_json::json;

fn answer(command: &str, document: Value) -> Answer {
    Answer {
        command: command.to_owned(),
        exit: Some(0),
        said: document.to_string(),
        document,
        seconds: 0.1,
    }
}

/// A document of `compare` for a model of one record of 100 samples.
fn compared(rmse: f64, fit: f64, scored: usize) -> Value {
    let row = json!({"name": "run", "use": "identify", "samples": scored, "rmse": rmse, "fit_percent": fit});
    json!({"records": [row], "identify": row, "validate": null})
}

fn identified(rmse: f64, fit: f64, scored: usize, delays: Value) -> Value {
    let mut document = compared(rmse, fit, scored);
    document["delays"] = delays;
    document
}

/// A correct answer: one lag of each kind, delay 15.
fn heard() -> Heard {
    let y = (0..100).map(f64::from).collect();
    let record = Record::new("run", Use::Identify, 1.0, vec![0.5; 100], y);
    let delays = json!({"state": [1], "product": [1], "input": [15], "law": null});
    let ladder = json!([{"validate_rmse": 0.2}]);
    let diagnosis =
        json!({"verdict": "nothing-missing", "missing": [], "ladder": ladder, "words": "fine"});
    Heard {
        data: DataSet::from_records(None, vec![record]).ok(),
        delay: Some(answer("delay", json!({"edges": [{"delay_samples": 15.2}]}))),
        models: vec![
            (
                Step::Identify,
                answer("identify", identified(0.2, 98.0, 95, delays)),
                Some(answer("compare-identify", compared(0.2, 98.0, 95))),
            ),
            (
                Step::Diagnose,
                answer("diagnose", diagnosis),
                Some(answer("compare-diagnose", compared(0.2, 98.0, 95))),
            ),
        ],
        fits: BaselineFits {
            fopdt: Some(98.9),
            ..BaselineFits::default()
        },
        ..Heard::default()
    }
}

fn case() -> Case {
    Case {
        commands: vec![Step::Identify, Step::Delay, Step::Diagnose],
        right: Right {
            delay_samples: Some([14.0, 16.0]),
            edge_delay_samples: Some([14.0, 16.0]),
            n1_at_most: Some(1),
            verdicts: vec!["nothing-missing".to_owned()],
            fit_at_least: Some(97.0),
            scored_at_least: Some(0.9),
            not_said: vec!["integrates".to_owned()],
            ..Right::default()
        },
        ..Case::default()
    }
}

#[track_caller]
fn one(heard: &Heard, part: &str) {
    let wrong = wrong(&case(), heard);
    assert!(wrong.len() == 1 && wrong[0].contains(part), "{wrong:?}");
}

#[test]
fn a_right_answer_has_nothing_wrong() {
    assert_eq!(wrong(&case(), &heard()), Vec::<String>::new());
}

#[test]
fn each_fault_is_named() {
    let with = |change: fn(&mut Heard)| {
        let mut heard = heard();
        change(&mut heard);
        heard
    };
    one(
        &with(|h| h.models[0].1.exit = Some(1)),
        "identify: exit code 1, correct: 0",
    );
    one(
        &with(|h| h.models[0].1.document["delays"]["input"] = json!([12])),
        "delay 12",
    );
    one(
        &with(|h| h.models[0].1.document["delays"]["law"] = json!([3.0, 1.0, 0.1])),
        "law 3",
    );
    one(
        &with(|h| h.models[0].1.document["delays"]["state"] = json!([1, 2])),
        "N1 = 2",
    );
    one(
        &with(|h| h.models[0].1.document["identify"]["rmse"] = json!(0.1)),
        "differs from that of compare",
    );
    one(&with(|h| h.fits.sopdt = Some(99.1)), "second order");
    one(
        &with(|h| h.delay = Some(answer("delay", json!({"edges": []})))),
        "no edge",
    );
    one(
        &with(|h| h.models[1].1.document["verdict"] = json!("unexplained")),
        "verdict",
    );
    one(
        &with(|h| h.models[1].1.document["missing"] = json!(["dry-friction"])),
        "dry-friction",
    );
    one(
        &with(|h| h.models[1].1.said += "The rig integrates"),
        "says \"integrates\"",
    );
    one(
        &with(|h| h.models[1].1.document["ladder"][0]["validate_rmse"] = json!(0.15)),
        "prints an error of 0.15, compare says 0.2",
    );
    let mut heard = heard();
    heard.models[0].1.document["records"][0]["samples"] = json!(60);
    if let Some(compared) = &mut heard.models[0].2 {
        compared.document["records"][0]["samples"] = json!(60);
    }
    one(&heard, "60 of 100 samples of `run` are scored");
}

#[test]
fn a_model_that_is_handed_over_may_not_be_worse() {
    let mut heard = heard();
    heard.models[1].1.document["ladder"][0]["validate_rmse"] = json!(0.3);
    heard.models[1].2 = Some(answer("compare-diagnose", compared(0.3, 97.0, 95)));
    one(
        &heard,
        "hands over a model of error 0.3, given was one of 0.2",
    );
}

#[test]
fn cases_that_must_agree_are_held_to_it() {
    let row = |case: &str, verdict: &str| Row {
        set: "set".to_owned(),
        case: case.to_owned(),
        verdict: Some(verdict.to_owned()),
        ..Row::default()
    };
    let cases = [
        Case::default(),
        Case {
            same_answer_as: Some("a".to_owned()),
            ..Case::default()
        },
    ];
    let mut rows = [row("a", "nothing-missing"), row("b", "unexplained")];
    same_answers(&cases, &mut rows);
    assert_eq!(
        rows[1].wrong,
        ["verdict unexplained, for `a` nothing-missing"]
    );
}
