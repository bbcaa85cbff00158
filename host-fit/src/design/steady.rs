//! Steady states of a model under constant blowing, their stability and their time constants.

use super::DesignError;
use super::bench::Player;
use super::rules::RULES;
use crate::model::Model;
use serde::Serialize;

/// Longest time constant, samples.
const LONGEST_CONSTANT: usize = 10_000;

/// Steady state under a constant command.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Steady {
    /// Friction of the flow, y.
    pub friction: f64,
    /// Reading of the sensor, y.
    pub reading: f64,
    /// Largest pole modulus under the command; above 1 the model is unstable.
    pub modulus: f64,
}

/// The steady state of `model` with the valve constantly open or closed; closed means after two thousand
/// samples ([`closed_loop::span`]) of blowing.
///
/// # Errors
/// [`DesignError::Unsettled`] if it does not settle within [`RULES`]' longest wait,
/// [`DesignError::NotConverged`] if the poles cannot be found.
pub fn steady(model: &Model, on: bool) -> Result<Steady, DesignError> {
    let bench = Player::<f64>::of(model);
    let mut state = bench.at_rest();
    let each = bench.span(RULES.settled_mean);
    for _ in 0..each {
        bench.step(&mut state, true);
    }
    let mut mean = || {
        let (mut friction, mut reading) = (0.0, 0.0);
        for _ in 0..each {
            let output = bench.step(&mut state, on);
            friction += output.flow;
            reading += output.measured;
        }
        let count = each as f64;
        (friction / count, reading / count)
    };
    let modulus = model.largest_pole(on)?;
    let mut before = mean();
    let (mut waited, longest) = (2 * each, bench.span(RULES.longest_wait));
    while waited < longest {
        let now = mean();
        waited += each;
        let moved = (now.0 - before.0).abs().max((now.1 - before.1).abs());
        if moved < RULES.settled * now.0.abs().max(RULES.least_mean) {
            return Ok(Steady {
                friction: now.0,
                reading: now.1,
                modulus,
            });
        }
        before = now;
    }
    Err(DesignError::Unsettled {
        on,
        seconds: longest as f64 * model.sample_period_s,
        modulus,
    })
}

/// Attachment and separation time, s: from the arrival of an edge until y has covered 1 − 1/e of the distance
/// between the levels `low` and `high`. One to ten thousand samples ([`closed_loop::span`]).
#[must_use]
pub fn time_constants(model: &Model, low: f64, high: f64) -> [f64; 2] {
    let bench = Player::<f64>::of(model);
    let mut state = bench.at_rest();
    let period_s = model.sample_period_s;
    let most = bench.span(LONGEST_CONSTANT);
    [true, false].map(|on| {
        let (from, to) = if on { (low, high) } else { (high, low) };
        let goal = from + (to - from) * (1.0 - (-1.0_f64).exp());
        let mut arrived = None;
        for k in 0..3 * most {
            let output = bench.step(&mut state, on);
            if (output.arrived > 0.5) == on && arrived.is_none() {
                arrived = Some(k);
            }
            let there = if on {
                output.next >= goal
            } else {
                output.next <= goal
            };
            if let (Some(arrived), true) = (arrived, there) {
                let samples = k + 1 - arrived;
                // The model settles before the next edge.
                for _ in 0..most {
                    bench.step(&mut state, on);
                }
                return samples.clamp(1, most) as f64 * period_s;
            }
        }
        most as f64 * period_s
    })
}

#[cfg(test)]
mod tests {
    use super::super::tracking::tests::{paper_fixed, paper_state_dependent};
    use super::*;
    use model_core::recursion::LagConvention;

    /// Theory 2.1 and 2.2.
    #[test]
    fn poles_and_levels_of_the_papers_models() {
        let literal = paper_state_dependent(LagConvention::Literal);
        let one_step = paper_state_dependent(LagConvention::OneStep);
        let pole = |model: &Model, on| model.largest_pole(on).expect("eigenvalues");
        assert!((pole(&literal, true) - 1.000_16).abs() < 2e-5);
        assert!((pole(&one_step, true) - 1.000_01).abs() < 1e-5);
        assert!(pole(&one_step, false) < 0.9985);
        let fixed = paper_fixed(LagConvention::Literal);
        assert!((pole(&fixed, true) - 1.000_28).abs() < 2e-5);
        let blowing = steady(&one_step, true).unwrap();
        assert!((blowing.friction - 1.067).abs() < 0.03, "{blowing:?}");
        assert!(steady(&one_step, false).unwrap().friction.abs() < 1e-4);
    }

    #[test]
    fn a_growing_model_does_not_settle() {
        let fixed = paper_fixed(LagConvention::OneStep);
        let error = steady(&fixed, true).unwrap_err();
        let DesignError::Unsettled {
            on: true, modulus, ..
        } = error
        else {
            panic!("{error}");
        };
        assert!((modulus - 1.001_06).abs() < 2e-5, "{modulus}");
    }
}
