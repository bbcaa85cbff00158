//! The model and law that the boards run: `on_board` of `identified`.

use crate::controller::{Controller, Settings};
use crate::law::{Designed, Driven, driven};
use crate::link::service::Board;
use crate::sensor::Channel;
use crate::start::{self, Failure};
use identified::on_board as model;
use model_core::average::MovingAverage;
use model_core::control::period::loop_period_us;

/// Constants of the rig file used in this build.
pub const SETTINGS: Settings = Settings {
    channel: match model::REFERENCES.as_slice() {
        [] => None,
        [reference, ..] => Some(Channel::of(*reference)),
    },
    ..Settings::of_rig(model::SAMPLE_PERIOD_S)
};

/// Properties of the board, as reported to the host.
pub const BOARD: Board = Board {
    period_us: PERIOD_US,
    model: model::CHECKSUM,
};

/// The law with its model.
pub type OnBoard = driven!(model::Law, model);

/// The model's sample period in whole µs, for the boards' timers and the host.
pub const PERIOD_US: u32 = match loop_period_us(model::SAMPLE_PERIOD_S as f64) {
    Some(period) => period,
    // `host-fit design` and `codegen --board` report the same with the key of the model file.
    None => panic!("the boards' timers and watchdogs support sample periods of 0.2 to 100 ms"),
};

/// Watchdog timeout for a sample, µs: 20 ms, or four periods if that is longer.
pub const PATIENCE_US: u32 = if PERIOD_US > 5000 {
    4 * PERIOD_US
} else {
    20_000
};

/// RAM that the loop may use of the boards' 128 KiB, bytes. There may be a copy of it while it is built, and one
/// more for the self-test; 8 KiB remain for log, serial line and calls.
pub const MOST: usize = (128 - 8) * 1024 / 4;

// `host-fit codegen --board` reports the same with the key of the model file.
const _: () = {
    assert!(
        model::CHANNELS.len() <= 1,
        "the model's effects need more measured channels than the one spare input of the board"
    );
    assert!(
        size_of::<Controller<OnBoard>>() <= MOST,
        "model and law do not fit the board's memory: use shorter lags or delays"
    );
};

/// The loop, disarmed and at rest.
#[must_use]
pub fn controller() -> Controller<OnBoard> {
    let model = model::model();
    let state = model::state(&model);
    Controller::new(
        SETTINGS,
        Driven::new(model::LAW, model, state, MovingAverage::new()),
    )
}

/// The start-up self-test of constants, model and law.
///
/// # Errors
/// The failed test.
#[inline(never)]
pub fn self_test() -> Result<(), Failure> {
    let model = model::model();
    start::self_test(
        &model,
        model::state(&model),
        &model::REFERENCES,
        model::CHECKSUM,
        &model::GOLDEN,
    )?;
    let holds = <model::Law as Designed<_, _, _, { model::LOOK_AHEAD }>>::holds(
        &model::LAW,
        &model::LAW_GOLDEN,
        &model,
        model::state(&model),
        &model::REFERENCES,
    );
    holds.then_some(()).ok_or(Failure::Law)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::{Mode, Reading};
    use crate::fault::Fault;
    use crate::law::{Change, Unchanged};

    /// The law's observer follows a faulty sensor within its limit; the fault must still be detected.
    #[test]
    fn a_sensor_that_leaves_the_model_is_found_out() {
        for away in [0.9_f32, 1.5, -0.35] {
            let mut controller = controller();
            controller.arm();
            let counts = SETTINGS.calibration.counts(away);
            let mut k = 0;
            while controller.mode() == Mode::Armed {
                let counts = counts + (k % 2) as f32;
                controller.tick(Reading {
                    counts,
                    channel: 2048.0,
                    periods: 1,
                });
                k += 1;
                assert!(k < 400, "{away}");
            }
            assert_eq!(controller.mode(), Mode::Faulted(Fault::Residual));
        }
    }

    #[test]
    fn what_is_generated_passes_and_holds_its_reference() {
        assert_eq!(self_test(), Ok(()));
        let mut controller = controller();
        controller.arm();
        let (mut predicted, mut sum) = (0.0_f32, 0.0);
        for k in 0..10_000_u16 {
            let counts = SETTINGS.calibration.counts(predicted) + f32::from(k % 2);
            let reading = Reading {
                counts,
                channel: 2048.0,
                periods: 1,
            };
            predicted = controller.tick(reading).predicted;
            if k >= 5_000 {
                sum += predicted / 5_000.0;
            }
        }
        assert_eq!(controller.mode(), Mode::Armed);
        assert!((sum - model::LAW.reference).abs() < 0.02, "{sum}");
    }

    /// A running law accepts changes within their bounds; an invalid value closes the valve.
    #[test]
    fn a_running_law_takes_what_is_within_bounds_and_stops_at_nonsense() {
        let mut controller = controller();
        let designed = controller.law_settings();
        let [low, high] = designed.reachable;
        let mut predicted = 0.0_f32;
        let mut run = |controller: &mut Controller<OnBoard>, samples: u16| {
            let mut sum = 0.0;
            for k in 0..samples {
                let counts = SETTINGS.calibration.counts(predicted) + f32::from(k % 2);
                let tick = controller.tick(Reading {
                    counts,
                    channel: 2048.0,
                    periods: 1,
                });
                predicted = tick.predicted;
                sum += predicted / f32::from(samples);
            }
            sum
        };
        let lower = designed.target - 0.2 * (high - low);
        let target = Change::Target(lower);
        assert_eq!(controller.change(target), Err(Unchanged::NotRunning));
        controller.arm();
        run(&mut controller, 3000);
        assert_eq!(controller.change(target), Ok(()));
        run(&mut controller, 3000);
        let held = run(&mut controller, 5000);
        assert!((held - lower).abs() < 0.03, "{held} for {lower}");
        assert!(controller.pause());
        run(&mut controller, 500);
        assert!(!controller.is_open() && controller.mode() == Mode::Paused);
        controller.arm();
        run(&mut controller, 100);
        // The pause has kept the changed target.
        assert_eq!(controller.law_settings().target, lower);
        for nonsense in [
            Change::Target(f32::NAN),
            Change::Target(f32::INFINITY),
            Change::Target(low),
            Change::Target(high),
            Change::Target(-1e30),
            Change::Air(0),
            Change::Air(1001),
            Change::Air(u16::MAX),
        ] {
            controller.disarm();
            controller.arm();
            run(&mut controller, 300);
            assert_eq!(controller.change(nonsense), Err(Unchanged::Outside));
            assert_eq!(controller.mode(), Mode::Faulted(Fault::Setting));
            assert!(!controller.is_open());
            run(&mut controller, 100);
            assert!(!controller.is_open());
            // No change of a setting can restart the faulted law.
            assert_eq!(controller.change(target), Err(Unchanged::NotRunning));
            controller.disarm();
            assert_eq!(controller.law_settings(), designed);
        }
    }

    #[test]
    fn a_ramp_is_completed_before_the_next_target() {
        let mut law = model::LAW;
        law.slope = 0.001;
        let model = model::model();
        let state = model::state(&model);
        let driven: OnBoard = Driven::new(law, model, state, MovingAverage::new());
        let mut controller = Controller::new(SETTINGS, driven);
        controller.arm();
        let mut k = 0_u16;
        let mut tick = |controller: &mut Controller<OnBoard>| {
            k += 1;
            controller.tick(Reading {
                counts: SETTINGS.calibration.counts(0.4) + f32::from(k % 2),
                channel: 2048.0,
                periods: 1,
            });
        };
        tick(&mut controller);
        let change = Change::Target(law.reference - 0.05);
        assert_eq!(controller.change(change), Err(Unchanged::Pending));
        let mut steps = 1;
        while controller.change(change).is_err() {
            tick(&mut controller);
            steps += 1;
            assert!(steps < 5000 && controller.mode() == Mode::Armed, "{steps}");
        }
        assert!(
            (f32::from(steps as u16) * law.slope - law.reference).abs() < 0.01,
            "{steps}"
        );
    }
}
