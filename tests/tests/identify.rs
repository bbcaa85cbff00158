//! `host-fit identify` from a script: keys, seeds, threads, options.

use std::path::Path;
use std::process::{Command, Output};

use scenarios::host_fit;
use serde_json::Value;

/// `identify` on a bundled set; the model goes to `model`.
fn identify(set: &str, model: &Path, options: &str) -> Command {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data");
    host_fit(
        &format!("--json identify {{}} -o {{}} {options}"),
        &[&data.join(set), &model],
    )
}

/// The document and the model of a run that succeeds.
#[track_caller]
fn found(set: &str, options: &str) -> (Value, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("model.toml");
    let output = identify(set, &model, options).output();
    let output = output.expect("the program starts");
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{options}: {error}");
    let document = serde_json::from_slice(&output.stdout).expect("one JSON document");
    (
        document,
        std::fs::read_to_string(model).expect("the model is there"),
    )
}

/// A search small enough for a test.
fn small(objective: &str, more: &str) -> String {
    format!("--n1 2 --n2 2 --max-lag 60 --objective {objective} {more}")
}

#[test]
fn the_document_has_the_keys_that_scripts_rely_on() {
    let (document, _) = found("ramp-cfd", &small("one-step", ""));
    for key in [
        "model",
        "objective",
        "objective_value",
        "one_step_norm",
        "evaluations",
        "wall_time_s",
        "records",
        "identify",
        "validate",
        "delays",
        "excitation",
    ] {
        assert!(document.get(key).is_some(), "{key}");
    }
    let records = document["records"].as_array().expect("a list");
    assert_eq!(records.len(), 4);
    for indicators in records
        .iter()
        .chain([&document["identify"], &document["validate"]])
    {
        for key in ["samples", "epsilon", "fit_percent", "correlation", "rmse"] {
            assert!(indicators[key].is_number(), "{key}: {indicators}");
        }
        assert!(indicators["noise_rmse"].is_null(), "there is no y_sd");
    }
    for key in ["state", "product", "input", "factors"] {
        assert!(document["delays"][key].is_array(), "{key}");
    }
    // The bundled square waves repeat every 250 samples, which the longest lag reaches.
    let (document, _) = found("ramp-cfd", "--evaluations 50 --objective one-step");
    let warnings = document["excitation"].as_array().expect("a list");
    assert!(
        warnings
            .iter()
            .any(|w| w.as_str().is_some_and(|w| w.contains("249 to 251 samples"))),
        "{warnings:?}"
    );
}

#[test]
fn a_seed_repeats_bit_for_bit_with_any_number_of_threads() {
    for objective in ["one-step", "free-run"] {
        let run = |more: &str| {
            let options = small(objective, &format!("--evaluations 400 {more}"));
            let (mut document, model) = found("ramp-cfd", &options);
            for changing in ["wall_time_s", "model"] {
                document[changing] = Value::Null;
            }
            // The next command contains the name of the model's file.
            document["answer"]["next"] = Value::Null;
            (document.to_string(), model)
        };
        let first = run("--seed 3");
        assert_eq!(first, run("--seed 3"), "{objective}");
        assert_eq!(first, run("--seed 3 --threads 2"), "{objective}");
    }
}

#[test]
fn every_kind_of_model_is_identified() {
    let (document, model) = found("ramp-cfd", &small("one-step", "--averaged"));
    assert!(model.contains("averaged = true"));
    assert_eq!(
        document["delays"]["input"].as_array().map(Vec::len),
        Some(2)
    );

    let (document, model) = found(
        "ramp-cfd",
        &small("one-step", "--effect amplitude-saturation"),
    );
    assert!(model.contains("amplitude-saturation"));
    assert!(
        document["identify"]["fit_percent"]
            .as_f64()
            .expect("a number")
            > 50.0
    );

    let (document, model) = found(
        "ramp-cfd",
        &small("one-step", "--delay-law 9,2,10 --factors 1"),
    );
    assert!(model.contains("one-step"));
    assert_eq!(document["delays"]["factors"], serde_json::json!([1.0]));
    assert_eq!(
        document["delays"]["law"],
        serde_json::json!([9.0, 2.0, 10.0])
    );

    let (document, _) = found("ramp-cfd", &small("one-step", "--delay fixed"));
    assert_eq!(
        document["delays"]["input"].as_array().map(Vec::len),
        Some(1)
    );
    assert_eq!(document["delays"]["factors"], serde_json::json!([]));
}

/// The averaged model is refined on the averages that it describes.
#[test]
fn averaged_models_are_refined_on_their_free_run() {
    let options = "--averaged --n3 1 --max-lag 30 --objective free-run --evaluations 300";
    let (document, _) = found("ramp-cfd", options);
    let epsilon = &document["refinement"]["identify_epsilon"];
    let (before, after) = (epsilon[0].as_f64(), epsilon[1].as_f64());
    let before = before.expect("a number");
    let objective = document["objective_value"].as_f64().expect("a number");
    assert!(after.expect("a number") <= before);
    assert!(
        (before / objective - 1.0).abs() < 1e-6,
        "{before} {objective}"
    );
}

/// Delay laws with a lower validation error are kept (the flow simulation); other laws are replaced by a constant
/// delay.
#[test]
fn the_validation_error_decides_between_a_law_and_a_constant_delay() {
    let fit = |set: &str, delay: &str| {
        let options = format!("--n1 2 --n2 2 --max-lag 150 --evaluations 600 --delay {delay}");
        let (document, model) = found(set, &options);
        let fit = document["validate"]["fit_percent"].as_f64();
        (
            fit.expect("validation records"),
            model.contains("law = \"state-dependent\""),
        )
    };
    let (law, constant) = (fit("ramp-cfd", "state-dependent"), fit("ramp-cfd", "fixed"));
    assert!(law.1 && law.0 > constant.0 + 1.0, "{law:?} {constant:?}");
    let (law, constant) = (
        fit("paper-like", "state-dependent"),
        fit("paper-like", "fixed"),
    );
    assert!(!law.1 && law.0 >= constant.0, "{law:?} {constant:?}");
}

#[test]
fn factors_need_a_law() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("model.toml");
    for options in ["--factors 1", "--factors=-1 --delay-law=9,2,10"] {
        let output = identify("ramp-cfd", &model, options).output();
        let output = output.expect("the program starts");
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(error.contains("--factors"), "{error}");
        assert!(!model.exists());
    }
}

/// Ctrl-C returns the best model so far. On a busy machine the first wait may end before there is one.
#[cfg(unix)]
#[test]
fn an_interrupt_keeps_the_best_so_far() {
    let interrupted = [5.0, 20.0, 40.0].into_iter().find_map(|seconds| {
        let folder = tempfile::tempdir().expect("a folder");
        let model = folder.path().join("model.toml");
        let output = interrupted_after(seconds, &model);
        output.status.success().then(|| (output, model.is_file()))
    });
    let (output, is_written) = interrupted.expect("a model after 40 s");
    let document: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    assert_eq!(document["stop"], "interrupted");
    assert!(is_written);
}

/// A search that is interrupted after the given time.
#[cfg(unix)]
fn interrupted_after(seconds: f64, model: &Path) -> Output {
    // Ten lags take minutes.
    let process = identify("paper-like", model, "--n1 5")
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("the program starts");
    std::thread::sleep(std::time::Duration::from_secs_f64(seconds));
    let asked = Command::new("kill")
        .args(["-INT", &process.id().to_string()])
        .status();
    assert!(asked.expect("kill runs").success());
    process.wait_with_output().expect("it ends")
}
