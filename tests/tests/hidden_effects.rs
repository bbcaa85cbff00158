//! A small draw of the hidden-effects campaign, with seeds of its own; the whole
//! of it is `cargo run --release -p scenarios --bin hidden-effects`.

use host_fit::diagnose::Verdict;
use scenarios::campaign::{Case, Hidden, Outcome, run};

fn diagnosed(hidden: Hidden, seed: u64) -> Outcome {
    run(&Case { hidden, seed }).expect("a diagnosis")
}

fn effect(name: &str) -> Hidden {
    Hidden::Effects(vec![name.to_owned()])
}

#[test]
fn a_rig_that_hides_nothing_raises_no_alarm() {
    let outcome = diagnosed(Hidden::Nothing, 707);
    assert_eq!(outcome.verdict, Verdict::NothingMissing);
    assert!(outcome.missing.is_empty());
}

#[test]
fn bad_delays_in_the_given_model_are_no_missing_effect() {
    let outcome = diagnosed(Hidden::WrongStart, 708);
    assert_eq!(outcome.verdict, Verdict::NothingMissing);
}

/// The paper's own step: a fixed-delay model of a flow whose delay follows its state.
#[test]
fn a_state_dependent_delay_is_the_first_hidden_effect() {
    let outcome = diagnosed(effect("state-dependent-delay"), 709);
    assert_eq!(outcome.missing, ["state-dependent-delay"]);
    assert!(outcome.over_noise < 1.25, "{}", outcome.over_noise);
    assert_eq!(
        outcome.parameters_hit(),
        Some(true),
        "{:?}",
        outcome.parameters
    );
}

#[test]
fn one_effect_of_each_place_is_found_with_its_parameters() {
    for name in ["valve-lag", "hot-film-lag", "quadratic-drag"] {
        let outcome = diagnosed(effect(name), 710);
        assert_eq!(outcome.missing.first().map(String::as_str), Some(name));
        assert!(outcome.over_noise < 1.25, "{name}: {}", outcome.over_noise);
        assert_eq!(
            outcome.parameters_hit(),
            Some(true),
            "{:?}",
            outcome.parameters
        );
    }
}

/// Hysteresis alone bends to imitate the friction as well, and friction added to it
/// so bent finds nothing left: they are found the other way round.
#[test]
fn two_effects_of_which_one_imitates_both_are_found() {
    let names = ["dry-friction", "bouc-wen-hysteresis"].map(str::to_owned);
    let outcome = diagnosed(Hidden::Effects(names.into()), 712);
    assert!(outcome.is_found(), "{:?}", outcome.missing);
    assert!(outcome.over_noise < 1.25, "{}", outcome.over_noise);
}

#[test]
fn what_the_catalogue_does_not_have_stays_unexplained() {
    let outcome = diagnosed(Hidden::Fault("missing-pulse".to_owned()), 711);
    assert_eq!(outcome.verdict, Verdict::Unexplained);
}
