//! What the boards run: the model that `identified` calls `on_board`, and its law.
//!
//! Another kind of law than the one that holds a reference is put here: [`Relay`](crate::law::Relay)
//! takes any model.

use crate::controller::{Controller, Settings};
use crate::sensor::{Calibration, Range};
use crate::start::{self, Failure};
use crate::tracking::Track;
use identified::on_board as model;
use model_core::history::{BitHistory, DelayLine};

/// The rig's constants: measure them before the air is on (`WIRING.md`).
pub const SETTINGS: Settings = Settings {
    calibration: Calibration {
        zero: 800.0,
        per_count: 0.0005,
    },
    range: Range {
        lower_rail: 8.0,
        upper_rail: 4087.0,
        stuck_after: 500,
    },
    residual_envelope: 0.5,
};

type Outputs = DelayLine<f32, { model::OUTPUTS }>;
type Jets = BitHistory<{ model::WORDS }>;

/// The law with its model.
pub type OnBoard = Track<model::Identified, Outputs, Jets, { model::LOOK_AHEAD }>;

/// The loop, disarmed and at rest.
#[must_use]
pub fn controller() -> Controller<OnBoard> {
    let model = model::model();
    let law = Track::new(model::LAW, model, model::state(&model));
    Controller::new(SETTINGS, law)
}

/// The start-up self-test of constants, model and law.
///
/// # Errors
/// What is wrong.
pub fn self_test() -> Result<(), Failure> {
    let model = model::model();
    start::self_test(
        &model,
        model::state(&model),
        &model::REFERENCES,
        model::CHECKSUM,
        &model::GOLDEN,
    )?;
    let state = model::state(&model);
    let holds = model::LAW_GOLDEN.holds::<_, _, _, { model::LOOK_AHEAD }>(
        &model::LAW,
        &model,
        state,
        &model::REFERENCES,
    );
    holds.then_some(()).ok_or(Failure::Law)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::{Mode, Reading};
    use crate::fault::Fault;

    /// The law follows a sensor only so far; the fault must not follow with it.
    #[test]
    fn a_sensor_that_leaves_the_model_is_found_out() {
        for away in [0.9_f32, 1.5, -0.35] {
            let mut controller = controller();
            controller.arm();
            let counts = SETTINGS.calibration.zero + away / SETTINGS.calibration.per_count;
            let mut k = 0;
            while controller.mode() == Mode::Armed {
                let counts = counts + (k % 2) as f32;
                controller.tick(Reading { counts, periods: 1 });
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
            let counts = SETTINGS.calibration.zero
                + predicted / SETTINGS.calibration.per_count
                + f32::from(k % 2);
            predicted = controller.tick(Reading { counts, periods: 1 }).predicted;
            if k >= 5_000 {
                sum += predicted / 5_000.0;
            }
        }
        assert_eq!(controller.mode(), Mode::Armed);
        assert!((sum - model::LAW.reference).abs() < 0.02, "{sum}");
    }
}
