//! Public measured sets, where the folder with them is there; never bundled.

use host_fit::data::{DataSet, InputFile, Record, Use};
use host_fit::fit::{FitOptions, fit, fit_with_effect};
use host_fit::indicators::score;
use host_fit::model::{Delay, Model, Start};
use model_core::effects;
use std::path::{Path, PathBuf};

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
