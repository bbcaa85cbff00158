//! The valve's hold times are kept for any input of the law.

use closed_loop::{Controller, OpenLoop, Relay, TrackingController};
use model_core::Parts;
use model_core::control::budget::Budget;
use model_core::control::{Air, Hold, HoldTimes, PulseTrain, Reachable, Switches, Tracking};
use model_core::delay::FixedDelay;
use model_core::model::{Averaging, Params};
use model_core::recursion::LagConvention;
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

type Small = Params<f32, 1, 1, 1, FixedDelay<[u16; 1]>, ()>;

fn small_model() -> Small {
    Params {
        convention: LagConvention::OneStep,
        averaging: Averaging {
            window: 8,
            averaged_model: false,
        },
        grading: model_core::recursion::Grading::Proportional,
        constant: 0.0,
        state_lags: [1],
        a: SVector::from([0.9]),
        product_lags: [1],
        b: SVector::from([0.2]),
        c: SMatrix::from([[-0.1]]),
        delay: FixedDelay { delays: [6] },
        effects: (),
    }
}

/// Fails if a position was left too early; a valve that has always been closed may open at once.
fn kept(times: HoldTimes, valve: &[bool]) -> Result<(), TestCaseError> {
    let (mut position, mut length) = (false, u32::MAX);
    for &on in valve {
        if on == position {
            length = length.saturating_add(1);
        } else {
            prop_assert!(
                length >= times.of(position),
                "{position} for {length} under {times:?}"
            );
            (position, length) = (on, 1);
        }
    }
    Ok(())
}

fn hold_times() -> impl Strategy<Value = HoldTimes> {
    (0_u32..20, 0_u32..20).prop_map(|(on, off)| HoldTimes { on, off })
}

/// Readings of every kind: plausible, extreme, NaN, missing.
fn reading() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![
        6 => (-0.5..1.5_f64).prop_map(Some),
        1 => any::<f64>().prop_map(Some),
        1 => Just(None),
    ]
}

proptest! {
    #[test]
    fn the_guard_keeps_them(
        times in hold_times(),
        wanted in prop::collection::vec(any::<bool>(), 1..400),
    ) {
        let mut hold = Hold::closed();
        let valve: Vec<bool> = wanted.iter().map(|w| hold.pass(&times, *w)).collect();
        kept(times, &valve)?;
        // The guard delays requests and adds none: the valve only moves to a requested position.
        for (k, on) in valve.iter().enumerate() {
            let before = k > 0 && valve[k - 1];
            prop_assert!(*on == before || *on == wanted[k]);
        }
    }

    #[test]
    fn the_tracking_law_keeps_them(
        times in hold_times(),
        references in prop::collection::vec(any::<f32>(), 1..4),
        readings in prop::collection::vec(reading(), 1..400),
        budget in any::<bool>(),
        observer in 0.0..=1.0_f32,
    ) {
        let model = small_model();
        let tracking = Tracking {
            reference: 0.5,
            reachable: Reachable { low: 0.0, high: 1.0 },
            slope: 0.0,
            hold: times,
            anticipation: times,
            budget: if budget {
                Budget {
                    switches: Some(Switches { samples_per_switch: 7, saved: 4 }),
                    air: Some(Air { per_mille: 400, saved: 30 }),
                }
            } else {
                Budget::default()
            },
            lead: 6,
            opening: 0,
            closing: 0,
            observer,
            bias_rate: 0.02,
            integral_rate: 0.01,
            settled: 0.2,
            play: 0.01,
            correction_limit: 0.5,
            residual_limit: 0.5,
        };
        let mut law = TrackingController::new(&model, tracking, model.on_off_state::<16, 1>(), Vec::new());
        let mut valve = Vec::new();
        for (k, reading) in readings.iter().enumerate() {
            let reference = references[k * references.len() / readings.len()];
            law.set_reference(f64::from(reference));
            valve.push(law.command(*reading));
        }
        kept(times, &valve)?;
    }

    #[test]
    fn relay_and_pulses_keep_them(
        times in hold_times(),
        readings in prop::collection::vec(reading(), 1..400),
        period in 0_u32..40,
        pulses in prop::collection::vec((0_u32..40, 0_u32..40), 0..4),
    ) {
        let mut relay = Relay::new(times, 0.01);
        relay.set_reference(0.5);
        let valve: Vec<bool> = readings.iter().map(|y| relay.command(*y)).collect();
        kept(times, &valve)?;
        let mut train = OpenLoop::train(PulseTrain { period, pulses }, times);
        let valve: Vec<bool> = readings.iter().map(|y| train.command(*y)).collect();
        kept(times, &valve)?;
    }
}
