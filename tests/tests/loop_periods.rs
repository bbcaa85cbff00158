//! A law can be designed for any valid loop period, and its constants written for those of the boards. Invalid periods are
//! refused before the design.

use std::path::Path;
use std::process::Output;

use host_fit::model::{Law, Model};
use host_fit::terms::Units;
use model_core::recursion::LagConvention;
use scenarios::{Parts, QUICK_DESIGN, host_fit};

/// The paper's flow on a rig that is slower by the ratio of the period to 1 ms.
fn paper_at(period_s: f64) -> Model {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/paper/table-2-state-dependent.toml");
    let mut model = Model::load(&path).expect("the model");
    model.convention = LagConvention::OneStep;
    let spec = model_core::effects::spec("valve-lag").expect("in the catalogue");
    model.add(spec, &[0.004, 0.006], None);
    let clock = Units {
        time: period_s / model.sample_period_s,
        ..Units::NONE
    };
    Model {
        sample_period_s: period_s,
        ..clock.model_out(&model)
    }
}

fn run(line: &str, parts: Parts<'_>) -> Output {
    host_fit(line, parts).output().expect("the program starts")
}

fn error_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_slower_rig_gets_the_same_law_and_constants_with_its_period() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut laws = Vec::new();
    for period_s in [0.001, 0.1, 60.0] {
        let name = |suffix: &str| folder.path().join(suffix).to_string_lossy().into_owned();
        let [model, controlled, constants] = [name("m.toml"), name("c.toml"), name("c.rs")];
        paper_at(period_s).save(Path::new(&model)).expect("saved");
        let line = "--json design {} -o {} --target 0.8 --min-on 12samples --min-off 12samples";
        let output = run(&format!("{line} {QUICK_DESIGN}"), &[&model, &controlled]);
        assert_eq!(output.status.code(), Some(0), "{}", error_of(&output));
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(json["sample_period_s"].as_f64(), Some(period_s));
        let law = Model::load(Path::new(&controlled)).expect("a model").law;
        let Some(Law::Track(law)) = law else {
            panic!("{law:?}");
        };
        laws.push(law);
        let output = run("codegen {} --board -o {}", &[&controlled, &constants]);
        if period_s > 0.1 {
            // No board has such a timer; the law is exported.
            let error = error_of(&output);
            assert!(error.contains("0.2 to 100 ms"), "{error}");
            let next = json["answer"]["next"].as_str().expect("a command");
            assert!(next.contains("--lang c"), "{next}");
            let output = run("codegen {} --lang c -o {}", &[&controlled, &constants]);
            assert_eq!(output.status.code(), Some(0), "{}", error_of(&output));
            continue;
        }
        assert_eq!(output.status.code(), Some(0), "{}", error_of(&output));
        let text = std::fs::read_to_string(&constants).expect("constants");
        let line = format!("pub const SAMPLE_PERIOD_S: f32 = {period_s};");
        assert!(text.contains(&line), "{line}");
    }
    let first = &laws[0];
    for law in &laws {
        assert_eq!(
            (law.hold, law.lead, law.look_ahead),
            (first.hold, first.lead, first.look_ahead)
        );
        assert_eq!((law.opening, law.closing), (first.opening, first.closing));
        for (a, b) in [
            (law.observer, first.observer),
            (law.bias_rate, first.bias_rate),
            (law.play, first.play),
            (law.reachable[1], first.reachable[1]),
        ] {
            assert!((a - b).abs() < 1e-6 * b.abs(), "{law:?} {first:?}");
        }
    }
}

#[test]
fn what_is_no_loops_period_is_refused_before_anything_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("m.toml").to_string_lossy().into_owned();
    let out = folder.path().join("c.toml").to_string_lossy().into_owned();
    for period_s in [0.0001, 7200.0] {
        paper_at(period_s).save(Path::new(&model)).expect("saved");
        // The period is checked before the target, which cannot be held, and before the rig file, which
        // does not exist.
        let output = run(
            "design {} -o {} --target 7 --rig none.toml",
            &[&model, &out],
        );
        let error = error_of(&output);
        assert_eq!(output.status.code(), Some(1), "{error}");
        for part in ["m.toml", "`sample_period_s`", "0.2 ms to 1 h", "identify"] {
            assert!(error.contains(part), "no `{part}` in: {error}");
        }
    }
    paper_at(0.1).save(Path::new(&model)).expect("saved");
    let at = |option: &str, value: &str| {
        let output = run(
            "design {} -o {} --target 0.8 {} {}",
            &[&model, &out, &option, &value],
        );
        (output.status.code(), error_of(&output))
    };
    for option in ["--min-on", "--min-off"] {
        let (code, error) = at(option, "20ms");
        assert_eq!(code, Some(1), "{error}");
        for part in [
            option,
            "shorter than the model's sample period",
            "0.1 s",
            "`sample_period_s`",
        ] {
            assert!(error.contains(part), "no `{part}` in: {error}");
        }
        let (code, error) = at(option, "soon");
        assert_eq!(code, Some(2), "{error}");
    }
}
