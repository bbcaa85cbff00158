//! Start-up checks: the constants, and the reason of the start.

use crate::controller::Controller;
use crate::fault::Fault;
use crate::law::Law;
use model_core::Parts;
use model_core::history::Memory;
use model_core::model::StateOf;
use model_core::self_test::{Golden, checksum};

/// A failed self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Failure {
    /// Structure and coefficients differ from the generated ones.
    Checksum,
    /// The model does not reproduce its reference run.
    Golden,
    /// The law does not reproduce its reference run.
    Law,
}

/// Compares the constants' checksum and runs the reference trajectory.
///
/// # Errors
/// The failed test.
pub fn self_test<M, Y, J, const N: usize>(
    model: &M,
    state: StateOf<f32, M, Y, J>,
    references: &[f32],
    expected: u32,
    golden: &Golden<N>,
) -> Result<(), Failure>
where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
{
    if checksum(model) != expected {
        Err(Failure::Checksum)
    } else if !golden.holds(model, state, references) {
        Err(Failure::Golden)
    } else {
        Ok(())
    }
}

/// Latches a fault found at the start: the operator must acknowledge it before arming.
pub fn latch<L: Law>(
    controller: &mut Controller<L>,
    tested: Result<(), Failure>,
    by_watchdog: bool,
) {
    if let Err(_failure) = tested {
        #[cfg(feature = "defmt")]
        defmt::error!("self-test: {}", _failure);
        controller.latch(Fault::SelfTest);
    } else if by_watchdog {
        controller.latch(Fault::Watchdog);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::{RELAY, SETTINGS};
    use crate::controller::Mode;
    use crate::law::{Driven, driven};
    use crate::relay::Relay;
    use identified::full;
    use model_core::average::MovingAverage;
    use model_core::model::vector;

    fn tested(model: &full::Base) -> Result<(), Failure> {
        self_test(
            model,
            full::state(&full::model()),
            &full::REFERENCES,
            full::CHECKSUM,
            &full::GOLDEN,
        )
    }

    #[test]
    fn damage_is_told_apart() {
        let mut model = full::BASE;
        assert_eq!(tested(&model), Ok(()));
        model.delay.law.floor += 1.0;
        assert_eq!(tested(&model), Err(Failure::Golden));
        model.b = vector([0.009]);
        assert_eq!(tested(&model), Err(Failure::Checksum));
    }

    #[test]
    fn nothing_is_armed_after_a_bad_start() {
        for (test, by_watchdog, fault) in [
            (Ok(()), true, Fault::Watchdog),
            (Err(Failure::Golden), false, Fault::SelfTest),
            (Err(Failure::Checksum), true, Fault::SelfTest),
        ] {
            let model = full::model();
            let relay: driven!(Relay, full) =
                Driven::new(RELAY, model, full::state(&model), MovingAverage::new());
            let mut controller = Controller::new(SETTINGS, relay);
            latch(&mut controller, test, by_watchdog);
            controller.arm();
            assert_eq!(controller.mode(), Mode::Faulted(fault));
            // A restart can be acknowledged by the operator, damaged constants cannot.
            controller.disarm();
            controller.arm();
            let armed = fault == Fault::Watchdog;
            assert_eq!(controller.mode() == Mode::Armed, armed);
        }
    }
}
