//! Shared test functions, and properties that every effect of the catalogue must have.

use super::{AnyEffect, SPECS};
use crate::delay::FixedDelay;
use crate::effect::{Effect, Flow, Influence, Instant, Physics, Place, Setting, Spec};
use crate::history::DelayLine;
use crate::model::{Averaging, Input, Params, Parts, matrix, step, vector};
use crate::real::Real;
use crate::recursion::{Grading, LagConvention};
use std::vec::Vec;

type Any<T> = AnyEffect<T, DelayLine<T, 1024>>;

/// 1 kHz, a channel whose reference is 10.
fn setting<T: Real>(period: f64) -> Setting<T> {
    Setting {
        period: T::from_f64(period),
        channel: 0,
        reference: T::from_f64(10.0),
    }
}

/// The effect at 1 kHz.
pub(super) fn prepared<E: Physics<f64>>(parameters: &[f64]) -> E {
    E::new(parameters, &setting(0.001))
}

fn instant(jet: f64, channels: &[f64]) -> Instant<'_, f64> {
    Instant {
        command: jet,
        flow: 0.0,
        arrived: jet,
        present: jet,
        channels,
    }
}

/// The jet strength after the effect over one second.
pub(super) fn jets<E: Effect<f64>>(effect: &E, jet: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut state = effect.start();
    let shaped = |k| effect.jet(&mut state, jet(k), &instant(jet(k), &[]));
    (0..1000).map(shaped).collect()
}

/// The reading of a signal over one second while `jet` arrives.
pub(super) fn readings<E: Effect<f64>>(
    effect: &E,
    signal: impl Fn(usize) -> f64,
    jet: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let mut state = effect.start();
    let shown = |k| effect.sense(&mut state, signal(k), &instant(jet(k), &[]));
    (0..1000).map(shown).collect()
}

/// A first-order flow with a time constant of 50 samples that rises to `level` from rest, with the
/// effect, over two seconds.
pub(super) fn flow<E: Effect<f64>>(effect: &E, level: impl Fn(usize) -> f64) -> Vec<f64> {
    const RELAXATION: f64 = 0.02;
    let mut state = effect.start();
    let (mut before, mut now) = (0.0, 0.0);
    let step = |k| {
        let next = now + RELAXATION * (level(k) - now);
        let seen = Flow {
            now,
            before,
            next,
            relaxation: RELAXATION,
            separated: 1.0,
            released: next - now,
        };
        before = now;
        now = next + effect.drive(&mut state, &seen, &instant(0.0, &[]));
        now
    };
    (0..2000).map(step).collect()
}

/// A flow with the effect under pulses of several strengths, for y of size `y` and a sample period of
/// `period` s.
fn run<T: Real>(spec: &Spec, parameters: &[f64], y: f64, period: f64) -> Vec<f64> {
    let number = T::from_f64;
    let parameters: Vec<T> = parameters.iter().map(|p| number(*p)).collect();
    let model = Params {
        convention: LagConvention::OneStep,
        averaging: Averaging {
            window: 50,
            averaged_model: false,
        },
        grading: Grading::Proportional,
        constant: T::ZERO,
        state_lags: [1],
        a: vector([number(0.97)]),
        product_lags: [1],
        b: vector([number(0.035 * y)]),
        c: matrix([[number(-0.005)]]),
        delay: FixedDelay { delays: [20_u16] },
        effects: Any::new(spec.name, &parameters, &setting::<T>(period)).expect("in the catalogue"),
    };
    let mut state = model.graded_state::<64, 64>();
    let each = (0..1500_usize).map(|k| {
        let level = [0.0, 1.0, 0.0, 0.6, 0.0, -0.4][k / 90 % 6];
        let input = Input {
            command: number(level),
            channels: &[number(10.0 + (k as f64 * 0.01).sin())],
        };
        step(&model, &mut state, &input).measured.value()
    });
    each.collect()
}

/// The middle of the starting values.
fn middle(spec: &Spec) -> Vec<f64> {
    let each = spec.parameters.iter();
    each.map(|p| p.starts[p.starts.len() / 2]).collect()
}

fn effects() -> impl Iterator<Item = &'static Spec> {
    SPECS.iter().filter(|spec| spec.place != Place::Delay)
}

/// A chain on the host calls an effect only at the place on its card.
#[test]
fn an_effect_acts_at_the_place_on_its_card_only() {
    let flow = Flow {
        now: 0.4,
        before: 0.3,
        next: 0.6,
        relaxation: 0.02,
        separated: 0.5,
        released: 0.1,
    };
    let bases = super::NUISANCES.into_iter();
    for spec in effects().chain(bases) {
        let effect = Any::<f64>::new(spec.name, &middle(spec), &setting(0.001));
        let effect = effect.expect("an effect of the catalogue");
        assert_eq!(effect.place(), spec.place);
        assert_eq!(
            Effect::<f64>::drives(&effect),
            spec.place == Place::Flow,
            "{}",
            spec.name
        );
        let mut state = effect.start();
        for k in 0..500 {
            let jet = f64::from(k / 100 % 2);
            let at = instant(jet, &[11.0]);
            let (shaped, drive, read) = (
                effect.jet(&mut state, jet, &at),
                effect.drive(&mut state, &flow, &at),
                effect.sense(&mut state, 0.4, &at),
            );
            let acts = [shaped != jet, drive != 0.0, read != 0.4];
            let places = [Place::Jet, Place::Flow, Place::Sensor];
            for (acts, place) in acts.into_iter().zip(places) {
                assert!(!acts || place == spec.place, "{}: {place:?}", spec.name);
            }
        }
    }
}

#[test]
fn single_precision_follows_double() {
    for spec in effects() {
        let (single, double) = (
            run::<f32>(spec, &middle(spec), 1.0, 0.001),
            run::<f64>(spec, &middle(spec), 1.0, 0.001),
        );
        // A threshold may be crossed one sample earlier.
        let stepwise = |p: &crate::effect::Parameter| p.influence == Influence::Stepwise;
        let near = if spec.parameters.iter().any(stepwise) {
            1e-2
        } else {
            2e-4
        };
        for (k, (single, double)) in single.iter().zip(&double).enumerate() {
            let off = (single - double).abs();
            assert!(off < near, "{} at {k}: {single} {double}", spec.name);
        }
    }
}

/// Scaling all times according to their units gives the same samples.
#[test]
fn clocks_do_not_matter() {
    for spec in effects() {
        let scaled = |(p, v): (&crate::effect::Parameter, f64)| v * p.unit.scale(1.0, 20.0, 1.0);
        let slow: Vec<f64> = spec
            .parameters
            .iter()
            .zip(middle(spec))
            .map(scaled)
            .collect();
        let one = run::<f64>(spec, &middle(spec), 1.0, 0.001);
        let other = run::<f64>(spec, &slow, 1.0, 0.020);
        for (one, other) in one.iter().zip(&other) {
            assert!((one - other).abs() < 1e-9, "{}: {one} {other}", spec.name);
        }
    }
}

/// Scaling y and the parameters according to their units gives the same run. King's law is left out, because it assumes
/// a friction of 0 to 1.
#[test]
fn units_of_y_do_not_matter() {
    for spec in effects().filter(|spec| spec.name != super::HotFilmNonlinearity::<f64>::SPEC.name) {
        let scaled = |(p, v): (&crate::effect::Parameter, f64)| v * p.unit.scale(50.0, 1.0, 1.0);
        let large: Vec<f64> = spec
            .parameters
            .iter()
            .zip(middle(spec))
            .map(scaled)
            .collect();
        let one = run::<f64>(spec, &middle(spec), 1.0, 0.001);
        let other = run::<f64>(spec, &large, 50.0, 0.001);
        for (one, other) in one.iter().zip(&other) {
            let off = (50.0 * one - other).abs();
            assert!(off < 1e-8, "{}: {one} {other}", spec.name);
        }
    }
}

/// A linear effect doubles with its amplitude, and every effect vanishes at amplitude 0.
#[test]
fn amplitudes_are_what_their_cards_say() {
    for spec in effects() {
        let Some(card) = spec.amplitude else { continue };
        let index = spec.parameter(card.parameter).expect("its amplitude");
        let with = |size: f64| {
            let mut parameters = middle(spec);
            if card.together {
                let value = size * parameters[index];
                parameters.fill(value);
            } else {
                parameters[index] *= size;
            }
            added(spec, &parameters)
        };
        let (none, one, two) = (with(1e-9), with(1.0), with(2.0));
        let size = one.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!(size > 1e-6, "{} adds nothing", spec.name);
        for k in 0..one.len() {
            assert!(none[k].abs() < 1e-3 * size, "{} stays", spec.name);
            let doubles = (two[k] - 2.0 * one[k]).abs() < 1e-6 * size;
            assert!(doubles || !card.linear, "{} at {k}", spec.name);
        }
        let doubles = |k: usize| (two[k] - 2.0 * one[k]).abs() < 1e-6 * size;
        assert_eq!((0..one.len()).all(doubles), card.linear, "{}", spec.name);
    }
}

/// Contribution of the effect to jet, drive and reading for given signals.
fn added(spec: &Spec, parameters: &[f64]) -> Vec<f64> {
    let effect = Any::new(spec.name, parameters, &setting::<f64>(0.001)).expect("known");
    let mut state = effect.start();
    let mut before = 0.0;
    let each = (0..1500_usize).map(|k| {
        let jet = [0.0, 1.0, 0.0, 0.6][k / 90 % 4];
        let now = 0.5 - 0.5 * (k as f64 * 0.02).cos();
        let next = 0.5 - 0.5 * ((k + 1) as f64 * 0.02).cos();
        let channels = [10.0 + (k as f64 * 0.01).sin()];
        let at = instant(jet, &channels);
        let seen = Flow {
            now,
            before,
            next,
            relaxation: 0.03,
            separated: 1.0 - jet,
            released: (1.0 - jet) * (next - now),
        };
        before = now;
        let shaped = effect.jet(&mut state, jet, &at) - jet;
        let driven = effect.drive(&mut state, &seen, &at);
        let shown = effect.sense(&mut state, now, &at) - now;
        [shaped, driven, shown]
    });
    each.flatten().collect()
}
