//! Step responses and poles of a model at two operating points: command off, command on.

use crate::model::Model;
use crate::simulate::Signals;
use numerics::linalg::poles as poles_of;

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
/// Changes of the command for a linearisation, fractions of a full jet. The responses to both are compared.
const SMALL: [f64; 2] = [1e-4, 1e-3];
/// Largest difference of the two responses per unit of the command, and largest change over the last quarter of a
/// settled response; shares of the largest change of y.
const SAME: f64 = 0.02;
const SETTLED: f64 = 1e-3;

/// The step response of `model` from rest and from steady blowing; none if a free run diverges or the model needs
/// measured channels.
#[must_use]
pub fn step_response(model: &Model) -> Option<StepResponse> {
    let reach = reach(model)?;
    let rest = reach / 4;
    let y = run(model, &[(rest, 0.0), (reach, 1.0), (reach, 0.0)])?;
    let change = |from: usize, sign: f64| {
        let start = y.get(from.checked_sub(1)?).copied()?;
        let after = y.get(from..from + reach)?;
        let each = after.iter().enumerate();
        Some(
            each.map(|(k, y)| (k as f64 * model.sample_period_s, sign * (y - start)))
                .collect::<Vec<_>>(),
        )
    };
    Some(StepResponse {
        opening: change(rest, 1.0)?,
        closing: change(rest + reach, -1.0)?,
    })
}

/// The response of `model` to a small step of the command at a level of [`step_response`]: rest (`command` 0) or the
/// steady blown state (`command` 1). Change of y per full jet, from the sample of the step on, until it has settled.
///
/// None if there is no [`step_response`], if y does not settle, or if the response is not proportional to a small
/// step.
pub(super) fn small_step(model: &Model, command: u8) -> Option<Vec<f64>> {
    let level = f64::from(command);
    let mut reach = reach(model)?;
    loop {
        let lead = [(reach / 4, 0.0), (reach, level)];
        let held = run(model, &[lead[0], lead[1], (reach, level)])?;
        let after = |size: f64| {
            // The steps stay between 0 and 1: upwards from rest, downwards from the full jet.
            let size = if command == 0 { size } else { -size };
            let moved = run(model, &[lead[0], lead[1], (reach, level + size)])?;
            let change = moved.iter().zip(&held).skip(reach / 4 + reach);
            Some(
                change
                    .map(|(y, held)| (y - held) / size)
                    .collect::<Vec<_>>(),
            )
        };
        let [found, larger] = SMALL.map(after);
        let (found, larger) = (found?, larger?);
        let most = found.iter().fold(0.0, |most: f64, y| most.max(y.abs()));
        let differ = found.iter().zip(&larger).map(|(a, b)| (a - b).abs());
        if most <= 0.0 || differ.fold(0.0, f64::max) > SAME * most {
            return None;
        }
        let end = found.last().copied()?;
        let late = found.iter().skip(found.len() * 3 / 4);
        if late.map(|y| (y - end).abs()).fold(0.0, f64::max) <= SETTLED * most {
            return Some(found);
        }
        if reach == LONGEST {
            return None;
        }
        reach = (2 * reach).min(LONGEST);
    }
}

/// Length of a step response, samples; none if the model needs measured channels or has no sampling period.
fn reach(model: &Model) -> Option<usize> {
    let period = model.sample_period_s;
    if period.is_nan() || period <= 0.0 || !model.channels().is_empty() {
        return None;
    }
    let constant = model.time_constant();
    let slow = if constant.is_finite() { constant } else { 1.0 };
    let reach = (REACH * slow / period) as usize + 2 * model.longest_delay();
    Some(reach.clamp(100, LONGEST))
}

/// The free run under a command with `steps`: samples, and fraction of a full jet. None if it diverges.
fn run(model: &Model, steps: &[(usize, f64)]) -> Option<Vec<f64>> {
    let each = steps.iter();
    let u: Vec<f64> = each
        .flat_map(|(samples, share)| std::iter::repeat_n(model.command.command(*share), *samples))
        .collect();
    model.run_free(&Signals::commanded(model, &u)).ok()
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
    use crate::model::{CommandRange, Delay};

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
    fn a_step_is_a_full_jet_in_the_unit_of_the_command() {
        let unit = Model {
            sample_period_s: 0.001,
            state_lags: vec![1],
            a: vec![0.99],
            b: vec![0.01],
            delay: Delay::Fixed { delays: vec![7] },
            ..Model::default()
        };
        let volts = Model {
            command: CommandRange {
                off: 2.0,
                full: 7.0,
            },
            ..unit.clone()
        };
        let found = step_response(&unit).unwrap();
        assert_eq!(step_response(&volts).unwrap(), found);
        let last = found.opening.last().unwrap().1;
        assert!((last - 1.0).abs() < 0.01, "{last}");
    }

    #[test]
    fn an_oscillation_has_its_frequency_and_damping() {
        // The poles s = −5 ± 2π·20 j are sampled at 1 kHz.
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
