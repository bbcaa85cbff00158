//! Synthetic plants with a hidden effect, on which the split is tested.

use super::{FailureCoordinate, Failures, where_it_fails};
use crate::data::{Record, Use};
use crate::fit::lean_base;
use crate::model::{Delay, Model};
use crate::terms::measured_inputs;
use firmware_sim::hidden_set::HiddenSetPlan;
use model_core::effects::StateDependentDelay;

/// The records of a plant in the user's format, 10 s long.
pub(crate) fn long_records(effects: &[&str], faults: &[&str], seed: u64) -> Vec<Record> {
    let plan = HiddenSetPlan::draw(effects, faults, seed).expect("a known effect");
    let set = plan.build().expect("a possible plant");
    set.data.records
}

/// The first 5 s of each record of a plant: enough for most decisions, in half the time.
pub(crate) fn records(effects: &[&str], faults: &[&str], seed: u64) -> Vec<Record> {
    let records = long_records(effects, faults, seed);
    records.iter().map(|record| record.part(0, 5000)).collect()
}

/// Adds a drift of the sensor to every record: exponential approaches with an amplitude (y) and a time constant (s).
pub(crate) fn drift(records: &mut [Record], parts: &[(f64, f64)]) {
    for record in records {
        let period = record.sample_period_s;
        for (k, y) in record.y.iter_mut().enumerate() {
            let time = k as f64 * period;
            let each = parts.iter();
            *y += each
                .map(|(size, after)| size * (1.0 - (-time / after).exp()))
                .sum::<f64>();
        }
    }
}

/// A base model with the effects of a measured channel of this name, which varies.
pub(crate) fn base_with_channel(name: &str) -> Model {
    let mut records = records(&[], &[], 1);
    records.truncate(1);
    let wander = |k: usize| 300.0 + 20.0 * (k as f64 / 90.0).sin();
    let values = (0..records[0].len()).map(wander).collect();
    records[0].channels.insert(name.to_owned(), values);
    base(&records).with_inputs(measured_inputs(&records))
}

/// The lowest-order bilinear model with a state-dependent delay, identified on the records.
pub(crate) fn base(records: &[Record]) -> Model {
    let learning: Vec<&Record> = records.iter().filter(|r| r.role == Use::Identify).collect();
    let given = Model {
        a: vec![0.98],
        b: vec![0.02],
        delay: Delay::of::<StateDependentDelay<f64>>(&[30.0, 10.0, 5.0], vec![1.0], false),
        ..Model::default()
    };
    lean_base(&given, &learning).expect("a stable model").model
}

pub(crate) fn split(effects: &[&str], faults: &[&str], seed: u64) -> Failures {
    let records = long_records(effects, faults, seed);
    where_it_fails(&base(&records), &records).expect("a stable model")
}

/// Three faults outside the catalogue for which the correct coordinate must have the largest share.
#[test]
fn faults_are_pointed_at() {
    for seed in 100..103 {
        let pulses = split(&[], &["missing-pulse"], seed);
        assert!(pulses.by[0].coordinate.is_cycle());
        let frozen = split(&[], &["freezing-sensor"], seed);
        let time = FailureCoordinate::TimeInRecord;
        assert_eq!(frozen.by[0].coordinate, time, "{seed}");
        let stuck = split(&[], &["sticking-valve"], seed);
        let falling = |w: &&super::Where| w.coordinate == FailureCoordinate::SinceFallingEdge;
        let falling = stuck.by.iter().find(falling).expect("the coordinate");
        assert!(
            falling.explained_fraction > 0.8 * stuck.by[0].explained_fraction,
            "{seed}"
        );
    }
}

#[test]
fn a_perfect_model_has_nothing_to_explain() {
    let found = split(&[], &[], 100);
    assert!(!found.above_noise && found.by.iter().all(|w| w.explained_fraction == 0.0));
    assert!(found.describe()[0].contains("is at the noise level"));
    let json = serde_json::to_value(&found.by).expect("plain data");
    for key in [
        "coordinate",
        "explained_fraction",
        "worst_from",
        "worst_to",
        "worst_rmse",
    ] {
        assert!(json[0].get(key).is_some(), "{key}");
    }
}

/// A white error far above the stated noise is a function of no coordinate.
#[test]
fn pure_noise_explains_nothing() {
    use firmware_sim::instrument::{Noise, NoiseSignal};
    use rand::SeedableRng;
    let records = records(&[], &[], 3);
    let held_out: Vec<&Record> = records.iter().filter(|r| r.role == Use::Validate).collect();
    let model = base(&records);
    let runs: Vec<Vec<f64>> = held_out
        .iter()
        .map(|r| model.free_run(r).expect("stable"))
        .collect();
    let (mut alarms, mut coordinates) = (0, 0);
    for seed in 0..40 {
        let noisy: Vec<Record> = held_out
            .iter()
            .zip(&runs)
            .enumerate()
            .map(|(i, (record, run))| {
                let rng = rand_chacha::ChaCha8Rng::seed_from_u64(1000 * seed + i as u64);
                let mut noise = NoiseSignal::new(Noise::HOT_FILM, rng);
                let y = run.iter().map(|sim| sim + noise.sample()).collect();
                Record {
                    y,
                    ..(*record).clone()
                }
            })
            .collect();
        let noisy: Vec<&Record> = noisy.iter().collect();
        let found = super::examine(&noisy, runs.clone(), 40);
        assert!(found.above_noise, "four times the stated noise");
        // Coloured noise does occupy a frequency band.
        let itself = FailureCoordinate::FrequencyBand;
        let other = found.by.iter().filter(|w| w.coordinate != itself);
        coordinates += other.clone().count();
        alarms += other.filter(|w| w.explained_fraction > 0.05).count();
    }
    println!("{alarms} of {coordinates} coordinates claim more than 5 %");
    assert!(50 * alarms <= coordinates, "{alarms} of {coordinates}");
}
