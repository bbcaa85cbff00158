//! Exported models: `cargo xtask agreement` compares all of them; here some are compared. A further test checks
//! that no text of a model file becomes code in any language.

use host_fit::codegen::portable::{self, Precision};
use host_fit::codegen::{Language, write};
use host_fit::model::{Delay, Model, Training};
use host_fit::user_effect::Definition;
use model_core::effects::StateDependentDelay;
use scenarios::agreement::{Case, Gradings, Tool, cases, run};
use std::fs;

#[test]
fn exported_models_say_what_the_host_says() {
    let all = cases(Gradings::InTurn);
    // The other cases run in `cargo xtask agreement`.
    let some: Vec<Case> = all
        .into_iter()
        .filter(|case| ["effects", "own: every function"].contains(&case.name.as_str()))
        .collect();
    assert_eq!(some.len(), 2);
    for tool in Tool::ALL.into_iter().filter(|tool| tool.is_installed()) {
        let folder = tempfile::tempdir().expect("a folder");
        for row in run(tool, &some, folder.path()).expect("the tool runs") {
            assert!(row.agrees, "{row:?}");
        }
    }
}

/// Text that ends every kind of comment and string.
const HOSTILE: &str = "x */ #error\n#error injected\r\nraise SystemExit(7)\n\"\"\"\n'; error('injected'); %{\n\\\n??/\n\u{2028}error(1)";

#[test]
fn no_text_of_a_model_becomes_code() {
    let effect = r##"
name = "hostile"
place = "jet"
summary = "*/ \"\"\" ' #error %{"
source = "\n#error"
channel = "wind"
expression = "jet * (1 + gain * (wind - reference))"
[[parameter]]
name = "gain"
unit = "*/ \u2028 raise SystemExit(7)"
low = -1.0
high = 1.0
starts = [0.1]
"##;
    let definition = Definition::from_toml(effect, "hostile.toml").expect("an effect");
    let mut model = Model {
        training: Training {
            data_hash: HOSTILE.to_owned(),
            tool_version: HOSTILE.to_owned(),
            objective: HOSTILE.to_owned(),
            ..Training::default()
        },
        a: vec![0.9],
        b: vec![0.1],
        ..Model::default()
    };
    model.define(definition).expect("no other");
    model.add(definition.spec(), &[0.1], Some(10.0));
    model.effects[0].channel = Some(HOSTILE.to_owned());
    // The file is compiled and run. Text that escaped from a comment or string would not parse, or would
    // end the run.
    let case = Case {
        name: "hostile".to_owned(),
        model: model.clone(),
        is_bundled: false,
    };
    for tool in Tool::ALL.into_iter().filter(|tool| tool.is_installed()) {
        let folder = tempfile::tempdir().expect("a folder");
        let rows = run(tool, std::slice::from_ref(&case), folder.path()).expect("it runs");
        assert!(rows.iter().all(|row| row.agrees), "{rows:?}");
    }
    for language in [
        Language::C(Precision::Double),
        Language::Python,
        Language::Matlab(portable::function_name("x'; error(1)")),
    ] {
        let text = write(&model, &language).expect("a file");
        for line in text.lines() {
            let begins = ["#error", "raise", "error(", "'", "x '"]
                .iter()
                .any(|code| line.trim_start().starts_with(code));
            assert!(!begins, "{language:?}: {line}");
        }
    }
    let rust = write(&model, &Language::Rust).expect("constants");
    let head = rust.lines().take_while(|line| !line.starts_with("use "));
    assert!(
        head.clone().count() > 4
            && head
                .clone()
                .all(|line| line.is_empty() || line.starts_with("//!"))
    );
}

/// The delay of a diverged state is no number of samples.
#[test]
fn a_model_that_diverges_ends_in_nan_in_python() {
    if !Tool::Python.is_installed() {
        return;
    }
    let model = Model {
        a: vec![1.5],
        b: vec![0.1],
        delay: Delay::of::<StateDependentDelay<f64>>(&[40.0, 10.0, -4.0], vec![1.0], true),
        ..Model::default()
    };
    let folder = tempfile::tempdir().expect("a folder");
    let text = write(&model, &Language::Python).expect("a file");
    fs::write(folder.path().join("flow.py"), text).expect("written");
    let program = "import numpy, flow; y = flow.Model().simulate(numpy.ones(5000)); \
                   assert y[0] == 0 and numpy.isnan(y[-1]), y";
    let mut python = Tool::Python.command();
    let python = python.args(["-c", program]).current_dir(folder.path());
    let said = python.output().expect("Python");
    let errors = String::from_utf8_lossy(&said.stderr);
    assert!(said.status.success(), "{errors}");
}
