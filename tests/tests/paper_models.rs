//! The published coefficients and their known properties (steady values, stability, the five-second delay).

use std::path::Path;

use host_fit::model::Model;
use host_fit::simulate::Signals;
use model_core::recursion::LagConvention;

fn model(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../data/paper/{name}.toml"));
    Model::load(&path).expect("a bundled model")
}

fn run(model: &Model, u: &[f64]) -> Result<Vec<f64>, usize> {
    model.run_free(&Signals::commanded(model, u))
}

fn on_then_off(on: usize, off: usize) -> Vec<f64> {
    let mut u = vec![1.0; on];
    u.resize(on + off, 0.0);
    u
}

/// y_ss(1) = Σb / (1 − Σa − Σc), summed over the given inputs.
fn steady(model: &Model, inputs: &[usize]) -> f64 {
    let lags = model.product_lags.len();
    let a: f64 = model.a.iter().sum();
    let b: f64 = inputs.iter().map(|l| model.b[*l]).sum();
    let c: f64 = inputs
        .iter()
        .flat_map(|l| &model.c[l * lags..(l + 1) * lags])
        .sum();
    b / (1.0 - a - c)
}

#[track_caller]
fn near(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{found} is not {expected} ± {tolerance}"
    );
}

#[test]
fn steady_values_follow_from_the_printed_digits() {
    near(steady(&model("table-2-state-dependent"), &[0]), 1.067, 1e-3);
    near(steady(&model("table-2-fixed"), &[0]), 1.050, 1e-3);
    near(steady(&model("table-4-fixed"), &[0, 1]), 1.026, 1e-3);
    let averaged = model("table-4-state-dependent");
    near(steady(&averaged, &[0]), 1.010, 2e-3);
    near(steady(&averaged, &[0, 1]), 0.255, 1e-3);
}

#[test]
fn the_state_dependent_model_rises_as_the_theory_page_says() {
    let step = run(&model("table-2-state-dependent"), &vec![1.0; 2001]).expect("bounded");
    for (seconds, expected) in [(0.1, 0.15), (0.2, 0.27), (0.5, 0.62), (1.0, 0.84)] {
        let k = (seconds * 1000.0_f64).round() as usize;
        near(step[k], expected, 0.01);
    }
    let mut literal = model("table-2-state-dependent");
    literal.convention = LagConvention::Literal;
    let step = run(&literal, &vec![1.0; 2001]).expect("bounded");
    for (seconds, expected) in [(0.1, 0.11), (0.2, 0.23), (0.5, 0.54), (1.0, 0.79)] {
        let k = (seconds * 1000.0_f64).round() as usize;
        near(step[k], expected, 0.01);
    }
}

/// Neither convention of the lags is right for all tables.
#[test]
fn which_reading_is_stable() {
    let minutes = vec![1.0; 240_000];
    // Table II, state-dependent delay: the model is bounded for minutes with one-step lags, and
    // unstable with literal lags.
    let mut state = model("table-2-state-dependent");
    let last = run(&state, &minutes).expect("bounded");
    let size = |y: &[f64]| y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
    assert!(size(&last[200_000..]) < 1.3, "{}", size(&last));
    state.convention = LagConvention::Literal;
    let literal = run(&state, &minutes);
    assert!(literal.is_err() || literal.is_ok_and(|y| size(&y) > 10.0));
    // Table II, fixed delay: the model is bounded for 20 s with literal lags, but not with one-step
    // lags.
    let mut fixed = model("table-2-fixed");
    let short = run(&fixed, &minutes[..20_000]).expect("bounded for 20 s");
    assert!(size(&short) < 1.3);
    assert!(run(&fixed, &minutes).is_err());
    fixed.convention = LagConvention::OneStep;
    assert!(run(&fixed, &minutes[..19_000]).map_or(true, |y| size(&y) > 10.0));
}

/// c of Table IV by columns; by rows the simulations become negative or diverge.
#[test]
fn only_the_column_reading_of_c_works() {
    for (name, lowest) in [("table-4-fixed", -0.01), ("table-4-state-dependent", -0.01)] {
        let columns = model(name);
        let u = on_then_off(8_000, 2_000);
        let y = run(&columns, &u).expect("bounded");
        assert!(y.iter().all(|y| *y > lowest), "{name}");
        let mut rows = columns;
        rows.c.swap(1, 2);
        let wrong = run(&rows, &u);
        let negative = wrong.is_ok_and(|y| y.iter().all(|y| *y > lowest && *y < 1.5));
        assert!(!negative, "{name}: the row reading works too");
    }
}

/// The second input of Table IV depends only on whether the jets were on five seconds ago.
#[test]
fn the_five_second_delay_stands_for_switching_off() {
    let averaged = model("table-4-state-dependent");
    let after = |on: usize| {
        let y = run(&averaged, &on_then_off(on, 2_100)).expect("bounded");
        [y[on + 500], y[on + 1000], y[on + 2000]]
    };
    // After blowing for 5 s the flow separates, as expected.
    for (found, expected) in after(5_000).into_iter().zip([0.375, 0.158, 0.024]) {
        near(found, expected, 2e-3);
    }
    // After blowing for 3 s the flow does not separate for two seconds.
    for (found, expected) in after(3_000).into_iter().zip([0.98, 0.92, 0.79]) {
        near(found, expected, 2e-2);
    }
    // During blowing for 8 s the flow separates while the jets still blow.
    let y = run(&averaged, &vec![1.0; 8_000]).expect("bounded");
    near(y[4_900], 1.010, 5e-3);
    near(y[7_999], 0.26, 1e-2);
    // Without the second input, the flow stays attached for seconds after the jets are off.
    let mut without = averaged;
    without.c[2] = 0.0;
    without.c[3] = 0.0;
    let y = run(&without, &on_then_off(5_000, 2_100)).expect("bounded");
    assert!(y[7_000] > 0.5, "{}", y[7_000]);
}
