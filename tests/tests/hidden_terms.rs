//! A small sample of the hidden-terms campaign on short records, with separate seeds; the whole campaign is `cargo
//! xtask hidden-terms`.

use firmware_sim::family::Family;
use firmware_sim::plant::RateLaw;
use host_fit::data::DataSet;
use host_fit::discover::{FoundTerm, Options};
use host_fit::model::Model;
use host_fit::steps::discover;
use scenarios::campaign::terms::Row;
use scenarios::campaign::{Case, Group, Part};
use scenarios::first_order;

const DELAY: &str = "law = \"state-dependent\"
delay_floor = 35.0
delay_rise = 10.0
delay_rate = 6.0
factors = [1.0]
\
     interpolated = true";

fn asked(group: Group, family: Family, hidden: &[&str], seed: u64) -> Row {
    let case = Case::new(group, family, hidden, seed);
    let plan = case.plan().expect("a rig");
    let set = plan.build().expect("records").data;
    let records = Part::THIRD.of(&set);
    let set = DataSet::from_records(set.title, records).expect("a data set");
    let guess = Model::from_toml(&first_order(0.98, 0.02, DELAY), "guess.toml").expect("a model");
    let options = Options {
        terms: 1,
        ..Options::default()
    };
    let start = std::time::Instant::now();
    let found = discover(&guess, &set, &options, &()).expect("a search");
    let document = serde_json::to_value(&found).expect("a document");
    // Only terms that are not distinguishable come with an experiment.
    let alone = |term: &FoundTerm| term.alike.is_empty();
    let is_alone = found.discovery.terms.iter().all(alone);
    assert!(
        document["experiment"].is_null() || !is_alone,
        "{document:#}"
    );
    let best = |term: &FoundTerm| term.stability_percent > 0.0 && term.stability_percent < 100.1;
    assert!(found.discovery.terms.iter().all(best), "{document:#}");
    let mut row = Row::of(&case);
    row.expect(&plan);
    row.hear(&document).expect("terms");
    eprintln!(
        "{case}: {}, curve {:?}, formula {:?}, {:.1} s",
        row.said(),
        row.curve_taken,
        row.formula_taken,
        start.elapsed().as_secs_f64()
    );
    row
}

fn is_found(family: Family, hidden: &str, seed: u64) {
    let row = asked(Group::Beyond, family, &[hidden], seed);
    assert!(row.has_place_in_set(), "{}", row.said());
    assert!(row.has_coordinate_in_set(), "{}", row.said());
    assert!(row.curve_taken >= Some(0.6), "{:?}", row.curve_taken);
    assert!(row.formula_taken >= Some(0.6), "{:?}", row.formula_taken);
}

#[test]
#[ignore = "the demo finds one in CI; this one: cargo xtask kept-rigs"]
fn a_jet_that_tires_with_every_pulse_is_found() {
    // If a part jet changes the level and not the rate, a sensor with decreasing sensitivity gives the same
    // readings.
    let bilinear = |seed: &u64| {
        let case = Case::new(Group::Beyond, Family::FirstOrder, &["tiring-jet"], *seed);
        let plan = case.plan().expect("a rig");
        plan.plant.base.rate_law == RateLaw::Bilinear
    };
    let seed = (1310..).find(bilinear).expect("every third rig");
    is_found(Family::FirstOrder, "tiring-jet", seed);
}

#[test]
#[ignore = "40 s of processor time: cargo xtask kept-rigs"]
fn a_line_that_takes_longer_after_a_rest_is_found() {
    is_found(Family::FirstOrder, "rest-line", 1302);
}

#[test]
fn a_sensor_with_a_power_law_is_found() {
    is_found(Family::FirstOrder, "power-law", 1303);
}

/// The lags of the memory are searched with every term.
#[test]
#[ignore = "90 s of processor time: cargo xtask kept-rigs"]
fn a_sensor_with_a_power_law_is_found_beside_a_memory_of_the_flow() {
    is_found(Family::Memory1, "power-law", 1303);
}

#[test]
fn where_nothing_is_missing_no_term_is_told() {
    let row = asked(Group::Nothing, Family::Memory1, &[], 1304);
    assert!(!row.is_needless(), "{}", row.said());
}
