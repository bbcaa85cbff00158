//! Public measured sets, where the folder with them is there; never bundled.

use host_fit::data::{DataSet, InputFile, Record, Use};
use host_fit::diagnose::{Diagnosis, Options, diagnose};
use host_fit::fit::{FitOptions, fit, fit_with_effect};
use host_fit::indicators::score;
use host_fit::model::{Delay, Model, Start};
use model_core::effects;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

fn folder(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data/real")
        .join(name);
    let there = path.is_dir();
    if !there {
        eprintln!("skipped: {} is not there", path.display());
    }
    there.then_some(path)
}

fn record(path: &Path, role: Use, period_s: f64) -> Record {
    assert!(
        InputFile::load(path, Some(period_s)).is_ok(),
        "{}",
        path.display()
    );
    let set = DataSet::load(path).expect("a record");
    let mut record = set.records.into_iter().next().expect("one record");
    record.role = role;
    record
}

fn held_out(model: &Model, record: &Record) -> f64 {
    let (scores, _) = score(model, std::slice::from_ref(record)).expect("a stable run");
    scores.validate.expect("a held-out record").rmse
}

/// Silverbox, an electronic Duffing circuit: a linear model leaves 6.95 mV, the
/// best published models 0.3 mV; what is missing is a cubic stiffness.
#[test]
fn silverbox_lacks_a_cubic_stiffness() {
    let Some(folder) = folder("silverbox") else {
        return;
    };
    let period_s = 0.001_638_4;
    let train = record(
        &folder.join("silverbox_train_multisine.csv"),
        Use::Identify,
        period_s,
    );
    let test = record(
        &folder.join("silverbox_test_multisine.csv"),
        Use::Validate,
        period_s,
    );
    let linear = Model {
        sample_period_s: train.sample_period_s,
        start: Start::Measured,
        state_lags: vec![1, 2],
        a: vec![1.46, -0.93],
        product_lags: Vec::new(),
        b: vec![0.45, 0.0],
        c: Vec::new(),
        delay: Delay::Fixed { delays: vec![0, 2] },
        ..Model::default()
    };
    let options = FitOptions {
        constant: true,
        ..FitOptions::default()
    };
    let linear = fit(&linear, &[&train], &options)
        .expect("a linear fit")
        .model;
    let before = held_out(&linear, &test);
    assert!((0.0066..0.0075).contains(&before), "linear: {before}");
    let spec = effects::spec("amplitude-saturation").expect("in the catalogue");
    let cubic = fit_with_effect(&linear, spec, &[&train], &options)
        .expect("a fit")
        .model;
    let after = held_out(&cubic, &test);
    assert!(after < 0.0015, "with the cubic term: {after}");
}

/// A linear model of second order, as an engineer would hand it in.
fn second_order(period_s: f64, delay: u16, a: [f64; 2], b: f64) -> Model {
    Model {
        sample_period_s: period_s,
        start: Start::Measured,
        state_lags: vec![1, 2],
        a: a.to_vec(),
        product_lags: Vec::new(),
        b: vec![b],
        c: Vec::new(),
        delay: Delay::Fixed {
            delays: vec![delay],
        },
        ..Model::default()
    }
}

fn diagnosed(model: &Model, train: Record, test: Record, most_effects: usize) -> Diagnosis {
    let options = Options {
        most_effects,
        ..Options::default()
    };
    diagnose(model, &[train, test], &options, &AtomicBool::new(false)).expect("a diagnosis")
}

/// EMPS, a ball screw under position control. A known grey-box fit has 20.39 N of
/// dry friction on 95.11 kg: 2.14e-7 m per sample off the motion at every sample.
#[test]
fn the_ball_screws_dry_friction_is_that_of_the_literature() {
    let Some(folder) = folder("emps") else {
        return;
    };
    let train = record(&folder.join("emps_train.csv"), Use::Identify, 0.001);
    let test = record(&folder.join("emps_test_pulses.csv"), Use::Validate, 0.001);
    let options = FitOptions {
        constant: true,
        ..FitOptions::default()
    };
    let model = second_order(0.001, 1, [1.9979, -0.9979], 3.3e-7);
    let linear = fit(&model, &[&train], &options)
        .expect("a linear fit")
        .model;
    let spec = effects::spec("dry-friction").expect("in the catalogue");
    let rubbing = fit_with_effect(&linear, spec, &[&train], &options)
        .expect("a fit")
        .model;
    let level = *rubbing.effects[0].parameters.first().expect("a level");
    let literature = 20.39 / 95.11 * 1e-6;
    assert!(
        (level / literature - 1.0).abs() < 0.25,
        "{level} for {literature}"
    );
    let (before, after) = (held_out(&linear, &test), held_out(&rubbing, &test));
    assert!(before < 0.008 && after < 0.9 * before, "{before} {after}");
}

/// A motor that is driven up and coasts down: two time constants are the product
/// of input and output, which the base class has. It is no missing effect.
#[test]
fn the_motors_two_time_constants_are_in_the_base_class() {
    let Some(folder) = folder("dc_motor_generator") else {
        return;
    };
    let train = record(
        &folder.join("dc_motor_generator_train.csv"),
        Use::Identify,
        1.0,
    );
    let test = record(
        &folder.join("dc_motor_generator_test.csv"),
        Use::Validate,
        1.0,
    );
    let model = second_order(1.0, 0, [0.8, 0.05], 100.0);
    let found = diagnosed(&model, train, test, 4);
    assert!(
        found.ladder[1].step.contains("product"),
        "{:?}",
        found.ladder
    );
    let last = found.ladder.last().expect("a rung");
    assert!(
        last.validate_fit_percent > 85.0 && found.ladder[0].validate_fit_percent < 60.0,
        "{:?}",
        found.ladder
    );
}
