//! The bundled simulated sets agree with their README.

use std::path::{Path, PathBuf};

use firmware_sim::hidden_set::HiddenSetPlan;
use firmware_sim::paper_like::{Disturbances, LagReading, paper_like_set};
use host_fit::data::DataSet;

fn bundled(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../data")
        .join(name)
}

fn same(found: &[f64], made: &[f64], what: &str) {
    assert_eq!(found.len(), made.len(), "{what}");
    for (k, (found, made)) in found.iter().zip(made).enumerate() {
        assert!(
            (found - made).abs() <= 0.500_001e-5,
            "{what}, sample {k}: {found} bundled, {made} made"
        );
    }
}

fn compare(bundled: &DataSet, made: &DataSet, with_sd: bool) {
    assert_eq!(bundled.records.len(), made.records.len());
    for (found, made) in bundled.records.iter().zip(&made.records) {
        assert_eq!(found.name, made.name);
        assert_eq!(found.role, made.role);
        same(&found.u, &made.u, &found.name);
        same(&found.y, &made.y, &found.name);
        if with_sd {
            let sd = found.y_sd.as_deref().expect("y_sd");
            same(sd, made.y_sd.as_deref().expect("y_sd"), &found.name);
        }
    }
}

#[test]
fn the_paper_like_set_is_made_by_its_command() {
    let set = DataSet::load(&bundled("paper-like")).expect("bundled");
    let made = paper_like_set(LagReading::OneStep, Disturbances::default(), 1).expect("a set");
    compare(&set, &made, false);
}

#[test]
fn the_hidden_set_hides_what_its_answer_says() {
    let set = DataSet::load(&bundled("hidden-ramp")).expect("bundled");
    let answer = std::fs::read_to_string(bundled("hidden-ramp/answer.toml")).expect("bundled");
    let plan = HiddenSetPlan::draw(&["plenum-droop"], &[], 11).expect("a plan");
    let made = plan.build().expect("a set");
    assert_eq!(plan.answer(), answer);
    compare(&set, &made.data, true);
}
