//! Step responses and poles of a model at two operating points: command off, command on.

use crate::linalg::poles as poles_of;
use crate::model::Model;
use crate::simulate::Signals;

/// Responses of the free run to a step of the command at two levels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepResponse {
    /// Time since the step, s, and change of y after the command opens (0 → 1) from rest.
    pub opening: Vec<(f64, f64)>,
    /// Time since the step, s, and change of y after the command closes (1 → 0) from the steady blown state; the sign
    /// is reversed.
    pub closing: Vec<(f64, f64)>,
}

/// A pole of the recursion with a constant command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pole {
    /// Command, 0 or 1.
    pub command: u8,
    /// Modulus per sample; below 1 for a stable model.
    pub modulus: f64,
    /// Time in which the mode decays to 1/e, s.
    pub time_constant_s: f64,
    /// Frequency of the mode's oscillation, Hz; 0 for a real pole.
    pub hz: f64,
    /// Damping ratio, 0 to 1 for a stable oscillation; 1 for a real pole.
    pub damping: f64,
}

/// Length of a response in time constants.
const REACH: f64 = 6.0;
/// Longest response, samples.
const LONGEST: usize = 20_000;

/// The step response of `model` from rest and from steady blowing; none if a free run diverges or the model needs
/// measured channels.
#[must_use]
pub fn step_response(model: &Model) -> Option<StepResponse> {
    let period = model.sample_period_s;
    if period.is_nan() || period <= 0.0 || !model.channels().is_empty() {
        return None;
    }
    let constant = model.time_constant();
    let slow = if constant.is_finite() { constant } else { 1.0 };
    let reach = (REACH * slow / period) as usize + 2 * model.longest_delay();
    let reach = reach.clamp(100, LONGEST);
    let rest = reach / 4;
    let u: Vec<f64> = (0..rest + 2 * reach)
        .map(|k| f64::from(u8::from((rest..rest + reach).contains(&k))))
        .collect();
    let y = model.run_free(&Signals::commanded(model, &u)).ok()?;
    let change = |from: usize, sign: f64| {
        let start = y.get(from.checked_sub(1)?).copied()?;
        let after = y.get(from..from + reach)?;
        let each = after.iter().enumerate();
        Some(
            each.map(|(k, y)| (k as f64 * period, sign * (y - start)))
                .collect::<Vec<_>>(),
        )
    };
    Some(StepResponse {
        opening: change(rest, 1.0)?,
        closing: change(rest + reach, -1.0)?,
    })
}

/// The `most` slowest poles with the command at 0 and at 1, one of each conjugate pair; poles of the bilinear
/// recursion without effects. None if the recursion is too long for an eigenvalue iteration.
#[must_use]
pub fn poles(model: &Model, most: usize) -> Vec<Pole> {
    let at = |command: u8| {
        let weights = model.recursion(command == 1);
        let found = poles_of(&weights).unwrap_or_default();
        let kept = found.into_iter().filter(|(_, im)| *im >= 0.0).take(most);
        kept.map(move |(re, im)| pole(command, re, im, model.sample_period_s))
            .collect::<Vec<_>>()
    };
    [at(0), at(1)].concat()
}

fn pole(command: u8, re: f64, im: f64, period: f64) -> Pole {
    let modulus = re.hypot(im);
    let (decay, turn) = (modulus.ln() / period, im.atan2(re) / period);
    Pole {
        command,
        modulus,
        time_constant_s: -1.0 / decay,
        hz: turn / std::f64::consts::TAU,
        damping: if im == 0.0 && re > 0.0 {
            1.0
        } else {
            -decay / decay.hypot(turn)
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_order_lag_has_its_pole_and_its_step_response() {
        let a = (-0.01_f64).exp();
        let model = Model {
            sample_period_s: 0.001,
            state_lags: vec![1],
            a: vec![a],
            ..Model::default()
        };
        let found = poles(&model, 3);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].time_constant_s - 0.1).abs() < 1e-9);
        assert_eq!((found[0].hz, found[0].damping), (0.0, 1.0));
    }

    #[test]
    fn an_oscillation_has_its_frequency_and_damping() {
        // s = −5 ± 2π·20 j, sampled at 1 kHz.
        let (decay, turn) = (-5.0_f64, std::f64::consts::TAU * 20.0);
        let r = (decay * 0.001).exp();
        let model = Model {
            sample_period_s: 0.001,
            state_lags: vec![1, 2],
            a: vec![2.0 * r * (turn * 0.001).cos(), -r * r],
            ..Model::default()
        };
        let found = poles(&model, 3)[0];
        assert!((found.hz - 20.0).abs() < 1e-6, "{found:?}");
        assert!((found.damping - 5.0 / decay.hypot(turn)).abs() < 1e-6);
    }
}
