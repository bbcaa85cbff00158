//! The program from the user's side: exit codes, JSON shapes, messages, files.

use std::path::{Path, PathBuf};
use std::process::Output;

use host_fit::data::DataSet;
use host_fit::model::{Law, Model};
use host_fit::user_effect::Definition;
use model_core::recursion::LagConvention;
use scenarios::campaign::Part;
use scenarios::{FIXED_DELAY, Parts, QUICK_DESIGN, first_order, host_fit};
use serde_json::Value;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../data")
        .join(name)
}

fn run(line: &str, parts: Parts<'_>) -> Output {
    host_fit(line, parts).output().expect("the program starts")
}

#[track_caller]
fn json(line: &str, parts: Parts<'_>) -> Value {
    let output = run(&format!("--json {line}"), parts);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{error}");
    serde_json::from_slice(&output.stdout).expect("one JSON document and nothing else")
}

/// Exit 1, one paragraph with every part, nothing on standard output.
#[track_caller]
fn refused(line: &str, parts: Parts<'_>, told: &[&str]) {
    let output = run(line, parts);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(output.stdout.is_empty());
    assert!(
        error.starts_with("error: ") && error.trim_end().lines().count() == 1,
        "{error}"
    );
    assert!(!error.contains("panicked"), "{error}");
    contains_all(&error, told);
}

#[track_caller]
fn contains_all(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no `{part}` in: {text}");
    }
}

#[track_caller]
fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// A quick design.
fn quick(line: &str) -> String {
    format!("{line} {QUICK_DESIGN}")
}

/// A model with a state-dependent delay.
fn table_two() -> PathBuf {
    data("paper/table-2-state-dependent.toml")
}

#[track_caller]
fn keys(value: &Value, expected: &str) {
    let object = value.as_object().expect("an object");
    for key in expected.split_whitespace() {
        assert!(object.contains_key(key), "no key `{key}` in {value}");
    }
}

const INDICATORS: &str = "name use samples epsilon fit_percent correlation rmse noise_rmse";

#[test]
fn wrong_usage_is_exit_2() {
    for line in ["nonsense", "compare", "extend a b -o c", "simulate a b"] {
        assert_eq!(run(line, &[]).status.code(), Some(2), "{line}");
    }
    assert_eq!(run("--help", &[]).status.code(), Some(0));
}

/// `--set` changes a rule for one run, and the decision that depends on it.
#[test]
fn a_rule_is_changed_for_a_run() {
    let listed = |change: &str| {
        let books = json(&format!("rules delay {change}"), &[]);
        let rules = books[0]["rules"].as_array().expect("rules").clone();
        let rule = rules.iter().find(|rule| rule["name"] == "worst-error");
        rule.expect("the rule")["value"].as_f64()
    };
    assert_eq!(listed(""), Some(5.0));
    let change = "--set delay.worst-error=0.06";
    assert_eq!(listed(change), Some(0.06));
    let ramp = data("hidden-ramp");
    let edges = |change: &str| {
        let answer = json(&format!("delay {{}} {change}"), &[&ramp]);
        answer["statistics"]["all"]["count"]
            .as_u64()
            .expect("a count")
    };
    assert!(edges(change) < edges(""));
    for (change, part) in [
        ("level=0.1", "write terms.level or diagnose.level"),
        (
            "worst-error=-1",
            "`delay.worst-error` needs a value from 0.05 to 500",
        ),
        ("no-such=1", "there is no rule `no-such`"),
    ] {
        let output = run("rules --set {}", &[&change]);
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&output.stderr).contains(part));
    }
}

#[test]
fn compare_prints_the_indicators_of_the_contract() {
    let model = table_two();
    let found = json("compare {} {}", &[&model, &data("paper-like")]);
    keys(&found, "records identify validate where");
    let records = found["records"].as_array().expect("records");
    assert_eq!(records.len(), 6);
    for record in records
        .iter()
        .chain([&found["identify"], &found["validate"]])
    {
        keys(record, INDICATORS);
        assert!(record["noise_rmse"].is_null(), "no y_sd in this set");
    }
    // The values ε² of the records add up, and RMSE = ε/√n.
    let of = |role: &str| {
        let all = records.iter().filter(|r| r["use"] == role);
        all.map(|r| number(&r["epsilon"]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    for role in ["identify", "validate"] {
        let all = &found[role];
        assert!((number(&all["epsilon"]) - of(role)).abs() < 1e-9);
        let rmse = number(&all["epsilon"]) / number(&all["samples"]).sqrt();
        assert!((number(&all["rmse"]) - rmse).abs() < 1e-12);
    }
    assert_eq!(found["identify"]["samples"], 40_000);
}

#[test]
fn several_models_are_compared_side_by_side() {
    let models = [data("paper/table-2-fixed.toml"), table_two()];
    let folder = tempfile::tempdir().expect("a folder");
    let set = part_of_the_ramp(folder.path());
    let found = json("compare {} {} {}", &[&models[0], &models[1], &set]);
    let listed = found["models"].as_array().expect("models");
    assert_eq!(listed.len(), 2);
    for (listed, model) in listed.iter().zip(&models) {
        keys(
            listed,
            "model parameters effects records identify validate where",
        );
        // The result for each model equals that for the model alone.
        let alone = json("compare {} {}", &[&model, &set]);
        assert_eq!(listed["records"], alone["records"]);
        let name = model.file_stem().expect("a name").to_string_lossy();
        assert_eq!(listed["model"], name.as_ref());
    }
    let page = folder.path().join("out.html");
    let output = run(
        "compare {} {} {} --report {}",
        &[&models[0], &models[1], &set, &page],
    );
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(
        text.contains("table-2-fixed ") && text.contains("RMSE / noise"),
        "{text}"
    );
    contains_all(&text, &["Confidence:", "Next:       host-fit diagnose "]);
    let page = std::fs::read_to_string(page).expect("a page");
    assert!(page.contains("table-2-state-dependent"));
}

#[test]
fn a_model_is_written_in_every_language() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = table_two();
    for (language, file, holds) in [
        ("rust", "x.rs", "pub const STATE_LAGS"),
        (
            "c",
            "x.c",
            "real model_step(real command, const real *channels)",
        ),
        ("python", "x.py", "class Model"),
        ("matlab", "x.m", "function [y, s] = x(u, s, channels, more)"),
    ] {
        let path = folder.path().join(file);
        let output = run("codegen {} --lang {} -o {}", &[&model, &language, &path]);
        assert_eq!(output.status.code(), Some(0), "{language}");
        let text = std::fs::read_to_string(&path).expect("the file");
        assert!(text.contains(holds), "{text}");
    }
}

#[test]
fn a_comparison_leaves_a_page_and_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("out.html");
    let pictures = folder.path().join("pictures");
    let model = table_two();
    let output = run(
        "compare {} {} --report {} --pictures {}",
        &[&model, &data("hidden-ramp"), &page, &pictures],
    );
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(
        text.contains("random-b  validate") && text.contains("together"),
        "{text}"
    );
    let page = std::fs::read_to_string(page).expect("the page");
    assert!(page.starts_with("<!doctype html>") && page.contains("<svg"));
    // The page contains its own script and loads nothing from the network.
    assert!(page.contains("Content-Security-Policy") && !page.contains("<script src"));
    assert_eq!(std::fs::read_dir(pictures).expect("pictures").count(), 8);
}

#[test]
fn simulate_is_the_models_free_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let input = folder.path().join("in.csv");
    let out = folder.path().join("out.csv");
    let mut text = "t,u\n".to_owned();
    let u: Vec<f64> = (0..3000)
        .map(|k| f64::from(u8::from(k > 100 && k % 400 < 200)))
        .collect();
    for (k, u) in u.iter().enumerate() {
        text.push_str(&format!("{:.3},{u}\n", k as f64 * 0.001));
    }
    std::fs::write(&input, text).expect("written");
    let path = table_two();
    let found = json("simulate {} {} -o {}", &[&path, &input, &out]);
    keys(&found, "model output samples");
    let model = host_fit::model::Model::load(&path).expect("bundled");
    let expected = model
        .run_free(&host_fit::simulate::Signals::commanded(&model, &u))
        .expect("bounded");
    let written = std::fs::read_to_string(&out).expect("written");
    let mut lines = written.lines();
    assert_eq!(lines.next(), Some("t,u,y"));
    for (k, (line, expected)) in lines.zip(&expected).enumerate() {
        let y: f64 = line
            .rsplit(',')
            .next()
            .and_then(|y| y.parse().ok())
            .expect("a number");
        assert_eq!(y.to_bits(), expected.to_bits(), "sample {k}");
    }
    assert_eq!(written.lines().count(), 3001);
}

/// A third of the bundled set, saved into `folder`. The test of docs/start.md uses the whole set.
fn part_of_the_ramp(folder: &Path) -> PathBuf {
    let path = folder.join("ramp");
    let set = DataSet::load(&data("hidden-ramp")).expect("bundled");
    let part = DataSet::from_records(set.title.clone(), Part::THIRD.of(&set)).expect("a data set");
    part.save(&path).expect("saved");
    path
}

#[test]
fn extend_finds_the_hidden_plenum() {
    let folder = tempfile::tempdir().expect("a folder");
    let ramp = part_of_the_ramp(folder.path());
    let out = folder.path().join("new.toml");
    let again = || {
        let line = "extend {} {} --effect plenum-droop -o {}";
        json(line, &[&table_two(), &ramp, &out])
    };
    let found = again();
    keys(&found, "model effect parameters before after");
    keys(&found["before"], INDICATORS);
    keys(&found["after"], INDICATORS);
    assert_eq!(found["effect"], "plenum-droop");
    // The truth is in answer.toml: 0.840 s and 0.386 1/s.
    let parameter = |name: &str| number(&found["parameters"][name]["value"]);
    assert!((parameter("recovery_time") / 0.8403 - 1.0).abs() < 0.1);
    assert!((parameter("depletion_rate") / 0.3859 - 1.0).abs() < 0.1);
    keys(&found["parameters"]["recovery_time"], "value unit low high");
    let after = &found["after"];
    assert!(number(&after["rmse"]) < 1.05 * number(&after["noise_rmse"]));
    // The same run again gives the same file, and the written model has the printed error.
    let first = std::fs::read(&out).expect("written");
    again();
    assert_eq!(std::fs::read(&out).expect("written"), first);
    let compared = json("compare {} {}", &[&out, &ramp]);
    assert_eq!(compared["validate"]["rmse"], after["rmse"]);
}

/// `identify` imitates the droop by base terms. With the droop they are dropped, and the error is that of the diagnosis.
/// Each command is the one that the command before it prints, up to the code of a law.
#[test]
fn the_printed_commands_lead_from_a_diagnosis_to_code() {
    let folder = tempfile::tempdir().expect("a folder");
    let ramp = part_of_the_ramp(folder.path());
    let imitating = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/imitates-a-droop.toml");
    let followed = |command: &str| -> (Value, String) {
        let line = command.replacen("host-fit", "--json", 1);
        let output = host_fit(&line, &[]).current_dir(folder.path()).output();
        let output = output.expect("the program starts");
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{command}: {error}");
        let found: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
        let next = found["answer"]["next"].as_str().unwrap_or_default();
        (found.clone(), next.to_owned())
    };
    let (imitating, ramp) = (imitating.display(), ramp.display());
    let (found, next) = followed(&format!("host-fit diagnose {imitating} {ramp} -o by.toml"));
    assert_eq!(found["missing"], serde_json::json!(["plenum-droop"]));
    let (extended, next) = followed(&next);
    let dropped = serde_json::json!(["slow-wake", "level-rate", "reading-curve", "lags"]);
    assert_eq!(extended["dropped"], dropped);
    let error = |of: &Value| number(&of["rmse"]);
    let (by_diagnosis, _) = followed(&format!("host-fit compare by.toml {ramp}"));
    assert!(error(&extended["after"]) < 1.01 * error(&by_diagnosis["validate"]));
    assert!(error(&extended["after"]) < error(&extended["before"]));
    // The extended model is at the noise level, so its command and that of its comparison are the design of a law.
    let (compared, compared_next) = followed(&format!("host-fit compare better.toml {ramp}"));
    assert_eq!(compared["validate"]["rmse"], extended["after"]["rmse"]);
    assert!(next.contains(" --target "), "{next}");
    assert_eq!(compared_next, next);
    let (designed, next) = followed(&next);
    let kept = |case: &Value| case["kept"] == true;
    assert!(kept(&designed["cases"][0]) && kept(&designed["cases"][1]));
    followed(&next);
    let code = std::fs::read_to_string(folder.path().join("identified.rs"));
    assert!(code.expect("written").contains("PlenumDroop"));
}

#[test]
fn diagnose_names_the_hidden_plenum() {
    let folder = tempfile::tempdir().expect("a folder");
    let ramp = part_of_the_ramp(folder.path());
    let (out, page) = (
        folder.path().join("new.toml"),
        folder.path().join("out.html"),
    );
    let found = json(
        "diagnose {} {} --report {} -o {}",
        &[&table_two(), &ramp, &page, &out],
    );
    keys(&found, "verdict missing ladder ranking where");
    assert_eq!(found["verdict"], "effect-missing");
    assert_eq!(found["missing"], serde_json::json!(["plenum-droop"]));
    let ladder = found["ladder"].as_array().expect("a list");
    for rung in ladder {
        keys(
            rung,
            "effects validate_rmse validate_fit_percent noise_rmse",
        );
    }
    assert_eq!(ladder[0]["effects"], serde_json::json!([]));
    let first = &found["ranking"][0];
    keys(
        first,
        "effect validate_rmse error_reduction_percent p_value parameters confounded_with",
    );
    assert_eq!(first["effect"], "plenum-droop");
    keys(&first["parameters"]["recovery_time"], "value unit low high");
    let last = ladder.last().expect("a rung");
    assert!(number(&last["validate_rmse"]) < 1.05 * number(&last["noise_rmse"]));
    // The written models have the errors of the ladder, before and after.
    let after = json("compare {} {}", &[&out, &ramp]);
    let apart = number(&after["validate"]["rmse"]) / number(&last["validate_rmse"]) - 1.0;
    assert!(apart.abs() < 1e-9, "{apart}");
    let page = std::fs::read_to_string(&page).expect("a page");
    assert!(page.contains("plenum-droop") && !page.contains("<script src"));
}

#[test]
fn the_catalogue_is_listed_whole() {
    let found = json("effects", &[]);
    let names: Vec<&str> = found
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|entry| entry["name"].as_str())
        .collect();
    let catalogue = model_core::effects::SPECS.iter();
    assert_eq!(names, catalogue.map(|spec| spec.name).collect::<Vec<_>>());
    let text = String::from_utf8(run("effects", &[]).stdout).expect("text");
    assert!(names.iter().all(|name| text.contains(name)));
}

#[test]
fn bad_input_is_one_paragraph_and_leaves_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        path
    };
    let model = table_two();
    let out = folder.path().join("never.toml");
    let nan = file("nan.csv", "t,u,y\n0,0,0\n0.001,1,nan\n0.002,1,0\n");
    refused(
        "compare {} {}",
        &[&model, &nan],
        &["nan.csv", "line 3", "column `y`"],
    );
    let slow = file("slow.csv", "t,u,y\n0,0,0\n0.01,1,0\n0.02,1,0\n");
    refused(
        "compare {} {}",
        &[&model, &slow],
        &["sample_period_s", "0.01"],
    );
    let text = std::fs::read_to_string(&model).expect("bundled");
    let version = file(
        "version.toml",
        &text.replace("format_version = 1", "format_version = 7"),
    );
    refused(
        "compare {} {}",
        &[&version, &data("paper-like")],
        &["version.toml", "format_version"],
    );
    let short = file(
        "short.toml",
        &text.replace("b = [0.008]", "b = [0.008, 0.1]"),
    );
    refused(
        "compare {} {}",
        &[&short, &data("paper-like")],
        &["short.toml", "coefficients"],
    );
    refused(
        "compare {} {}",
        &[&model, &folder.path().join("none")],
        &["none"],
    );
    let ramp = data("hidden-ramp");
    let extend = |effect: &str, told: &[&str]| {
        let line = "extend {} {} --effect {} -o {}";
        refused(line, &[&model, &ramp, &effect, &out], told);
    };
    extend("plenum-drop", &["Did you mean `plenum-droop`?"]);
    extend("free-stream-variation", &["u_inf", "column"]);
    extend("state-dependent-delay", &["in the model already"]);
    let diverging = file(
        "diverging.toml",
        &text.replace("a = [0.9759", "a = [1.9759"),
    );
    refused(
        "compare {} {}",
        &[&diverging, &data("paper-like")],
        &["diverges", "at sample 78"],
    );
    let input = file("in.csv", "t,u\n0,0\n0.001,1\n0.002,x\n");
    let csv = folder.path().join("never.csv");
    refused(
        "simulate {} {} -o {}",
        &[&model, &input, &csv],
        &["in.csv", "line 4", "column `u`"],
    );
    assert!(!out.exists() && !csv.exists());
    let left = std::fs::read_dir(folder.path()).expect("the folder");
    assert_eq!(left.count(), 6, "only what the test wrote");
}

/// The simulator has no plant for a user's own effect: the law is written nevertheless and tried on a plant without
/// the effect.
#[test]
fn a_law_is_designed_for_a_model_with_an_effect_of_ones_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let (own, controlled) = (folder.path().join("own.toml"), folder.path().join("c.toml"));
    let ringing =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/effects/supply-line-ringing.toml");
    let mut model = Model::load(&table_two()).expect("the model");
    model.convention = LagConvention::OneStep;
    let definition = Definition::load(&ringing).expect("the effect");
    model.define(definition).expect("a new name");
    model.add(definition.spec(), &[0.3, 10.0, 0.06], None);
    model.save(&own).expect("saved");
    let line = quick("design {} -o {} --target 0.6");
    let design = json(&line, &[&own, &controlled]);
    let notes = design["not_tried"].to_string();
    assert!(notes.contains("without supply-line-ringing"), "{notes}");
    assert!(
        design["cases"]
            .as_array()
            .is_some_and(|cases| cases.len() > 20)
    );
    assert!(design["relay"]["mean"].is_number() && design["track"].is_object());
    let model = Model::load(&controlled).expect("the model with its law");
    let names = model.effect_names();
    assert_eq!(names, ["supply-line-ringing", "state-dependent-delay"]);
    assert!(model.law.is_some());
}

/// Table II with one-step lags, saved into `folder`.
fn paper_model(folder: &Path) -> PathBuf {
    let path = folder.join("m.toml");
    let mut paper = Model::load(&table_two()).expect("the model");
    paper.convention = LagConvention::OneStep;
    paper.save(&path).expect("saved");
    path
}

/// At half the friction an unknown King's law causes a loss of attachment (docs/law.md). The records do not support
/// it, so the law is written with a warning, and the constants do not mention it.
#[test]
fn stress_warns_and_refuses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let (controlled, constants) = (path("c.toml"), path("c.rs"));
    let model = paper_model(folder.path());
    let line = quick("design {} -o {} --target 0.5");
    let output = run(&line, &[&model, &controlled]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}");
    contains_all(
        &said,
        &[
            "warning: on plants that are not consistent with the records",
            "LOST",
            "Robustness margin",
            "the law was tried only on the model",
        ],
    );
    assert!(path("c-margin.svg").exists() && path("c-loop.svg").exists());
    json("codegen {} -o {}", &[&controlled, &constants]);
    let text = std::fs::read_to_string(&constants).expect("constants");
    assert!(!text.contains("ATTACHMENT"), "{text}");
}

/// With a valve that stays closed for 0.6 s, attachment is lost on the model itself. No file is written and the
/// targets that pass are listed; with `--force`, the file and the constants state the loss.
#[test]
fn a_law_that_loses_its_own_model_is_refused_with_the_targets_that_pass() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let (controlled, constants) = (path("c.toml"), path("c.rs"));
    let model = path("m.toml");
    // A time constant of 0.2 s and a constant delay.
    std::fs::write(&model, first_order(0.995, 0.005, FIXED_DELAY)).expect("a file");
    // Trials of half the length give the same decision, and three of nine other targets suffice.
    let line = |more: &str| quick(&format!("design {{}} -o {{}} --target 0.5 {more}"));
    let refused = |more: &str, parts: &[&str]| {
        let output = run(&line(more), &[&model, &controlled]);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{error}");
        contains_all(&error, parts);
        assert!(!controlled.exists());
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let said = refused(
        "--min-off 0.35 --set design.targets=4",
        &[
            "the model, noisy sensor",
            "Targets that pass: 0.",
            "--force",
        ],
    );
    assert!(said.contains("--target 0.25 --min-off 0.35"), "{said}");
    // With the shortest pause of three time constants the valve stays open at the other targets.
    refused(
        "--min-off 0.6 --set design.targets=4",
        &["the model itself", "No target in the reachable interval"],
    );
    let design = json(
        &line("--min-off 0.6 --set design.targets=1 --force"),
        &[&model, &controlled],
    );
    let lost = design["law"]["lost"].as_array().expect("trials");
    let written = Model::load(&controlled).expect("the model with its law");
    let named = written.law.expect("a law");
    assert!(!lost.is_empty() && named.lost().len() == lost.len());
    json("codegen {} -o {}", &[&controlled, &constants]);
    let text = std::fs::read_to_string(&constants).expect("constants");
    assert!(text.contains("LOSES ATTACHMENT in these trials: the model itself"));
}

/// Records in volts with an offset: target, interval and trials are in volts, the law equals that for the same
/// records in units of friction, and times shorter than those of the records are refused.
#[test]
fn a_law_is_asked_for_in_the_units_of_the_sensor() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let mut set = firmware_sim::family::RigPlan::draw(
        firmware_sim::family::Family::FirstOrder,
        &[],
        firmware_sim::family::NoiseKind::White,
        &[],
        1,
    )
    .expect("a rig")
    .build()
    .expect("records")
    .data;
    let in_volts = |y: &mut Vec<f64>| y.iter_mut().for_each(|y| *y = 2.4 + 0.05 * *y);
    for record in &mut set.records {
        in_volts(&mut record.y);
        for channel in [&mut record.y_min, &mut record.y_max] {
            channel.iter_mut().for_each(in_volts);
        }
        if let Some(sd) = &mut record.y_sd {
            sd.iter_mut().for_each(|sd| *sd *= 0.05);
        }
    }
    let (data, model, law) = (path("volts"), path("m.toml"), path("c.toml"));
    set.save(&data).expect("saved");
    json("identify {} -o {}", &[&data, &model]);
    let line = quick("design {} {} -o {} --target 2.425");
    let design = json(&line, &[&model, &data, &law]);
    let close = |value: &serde_json::Value, to: f64| {
        let value = value.as_f64().expect("a number");
        assert!((value - to).abs() < 0.002, "{value} is not {to}");
    };
    close(&design["sensor_zero"], 2.4);
    close(&design["track"]["target"], 2.425);
    close(&design["track"]["reachable"][0], 2.4);
    close(&design["track"]["reachable"][1], 2.453);
    for case in design["cases"].as_array().expect("cases") {
        if case["group"] == "possible" || case["group"] == "model" {
            close(&case["mean"], 2.425);
            assert_eq!(case["kept"], true, "{case}");
        }
    }
    let Some(Law::Track(track)) = Model::load(&law).expect("a model").law else {
        panic!("a tracking law");
    };
    assert!(
        (track.reference - 0.025).abs() < 5e-4,
        "{}",
        track.reference
    );
    let output = run(
        "design {} -o {} --target 2.425 --min-on 5ms",
        &[&model, &law],
    );
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    contains_all(
        &error,
        &["--min-on 0.005 s is too short", "0.033 s", "records"],
    );
}

#[test]
fn files_of_other_programs_become_a_data_set() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("set");
    let made = |name: &str| data("..").join("recordings/tests/import").join(name);
    let file = made("v7.mat");
    let found = json("import {} -o {} --u-threshold 2.5", &[&file, &out]);
    keys(&found, "dataset hash sample_period_s files");
    assert_eq!(found["files"][0]["mapping"]["u"], "valve");
    let set = host_fit::data::DataSet::load(&out).expect("a data set");
    assert_eq!(found["hash"], set.hash);
    assert!(set.is_on_off());
    // The next run of the rig is imported like the first.
    let (next, other) = (made("german.csv"), folder.path().join("other"));
    refused(
        "import {} -o {} --like {}",
        &[&next, &other, &out],
        &["german.csv", "no variable `valve`", "`Zeit` (0 to 39)"],
    );
    assert!(!other.exists(), "nothing half-written");
}
