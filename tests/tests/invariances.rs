//! Changes that must not change the answer of the program, on a few rigs; `cargo xtask invariances` has two
//! hundred.

use scenarios::invariances::{Change, Options, run};
use std::time::Duration;

/// Rigs on which each change is tried here.
const CASES: u64 = 2;

#[track_caller]
fn holds(change: Change) {
    let options = Options {
        cases: CASES,
        seed: 1000,
        strangers: false,
        diagnose_every: 0,
        only: vec![change],
        limit: Duration::from_secs(120),
        jobs: 1,
    };
    let outcome = run(&options, |_| ()).expect("a temporary folder");
    assert_eq!(outcome.tried, [(change, CASES)]);
    assert!(outcome.broken.is_empty(), "{}", outcome.table());
}

#[test]
fn scale_and_level_of_the_output_do_not_matter() {
    holds(Change::Output);
}

#[test]
fn scale_and_level_of_the_command_do_not_matter() {
    holds(Change::Command);
}

#[test]
fn a_command_may_be_inverted() {
    holds(Change::Inverted);
}

#[test]
fn the_clock_does_not_matter() {
    holds(Change::Clock);
}

#[test]
fn rest_in_front_does_not_matter() {
    holds(Change::Rest);
}

#[test]
fn records_may_be_cut() {
    holds(Change::Cut);
}

#[test]
fn order_and_names_of_records_do_not_matter() {
    holds(Change::Order);
    holds(Change::Names);
}
