//! Reference runs of the laws: bit-exact comparison of board and host.

use crate::control::constants::Tracking;
use crate::control::pulses::{Played, Pulses};
use crate::control::tracking::TrackingState;
use crate::effect::Effect;
use crate::history::Memory;
use crate::model::{Parts, StateOf};
use crate::self_test::{Crc32, command};

/// Expected decisions of a law in the reference run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GoldenLaw {
    /// Length of the run, samples.
    pub samples: u32,
    /// CRC-32 over every decision; for a tracking law also over estimate, prediction and bias.
    pub expected: u32,
}

/// Runs `law` from `state` and returns the CRC-32 of its decisions, or `None` if one of its numbers was not
/// finite.
///
/// The law reads its own estimate with disturbances: ±1/8 of the residual limit with the sign of the reference
/// command, occasional outliers beyond the limit, and no reading for a sixteenth of the time.
pub fn run<M, Y, J, const A: usize>(
    law: &Tracking<f32>,
    model: &M,
    mut state: TrackingState<f32, StateOf<f32, M, Y, J>, A>,
    channels: &[f32],
    samples: u32,
) -> Option<u32>
where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
    <M::Effects as Effect<f32>>::State: Clone,
{
    let mut crc = Crc32::new();
    let mut estimate = 0.0;
    for k in 0..samples {
        let share = match (k % 97, command(k)) {
            (0, _) => 2.0,
            (_, true) => 0.125,
            (_, false) => -0.125,
        };
        let reading = (k / 64 % 16 != 15).then_some(estimate + share * law.residual_limit);
        let decision = law.step(model, &mut state, reading, channels);
        estimate = decision.estimate;
        for number in [decision.estimate, decision.foreseen, decision.bias] {
            if !number.is_finite() {
                return None;
            }
            crc = crc.word(number.to_bits());
        }
        crc = crc.word(decision.on.into());
    }
    Some(crc.value())
}

/// Plays `pulses` for this many samples and returns the CRC-32 of the valve positions.
pub fn play<P: AsRef<[(u32, u32)]>>(pulses: &Pulses<P>, samples: u32) -> u32 {
    let mut played = Played::new();
    let valve = (0..samples).map(|_| pulses.step(&mut played));
    valve
        .fold(Crc32::new(), |crc, on| crc.word(on.into()))
        .value()
}

impl GoldenLaw {
    /// Whether `pulses` match their expected CRC.
    #[must_use]
    pub fn holds_for_pulses<P: AsRef<[(u32, u32)]>>(&self, pulses: &Pulses<P>) -> bool {
        play(pulses, self.samples) == self.expected
    }

    /// Whether `law` on `model` matches its expected CRC, from `state` at rest with `channels` at their
    /// references.
    #[must_use]
    pub fn holds<M, Y, J, const A: usize>(
        &self,
        law: &Tracking<f32>,
        model: &M,
        state: StateOf<f32, M, Y, J>,
        channels: &[f32],
    ) -> bool
    where
        M: Parts<f32>,
        Y: Memory<f32>,
        J: Memory<f32>,
        <M::Effects as Effect<f32>>::State: Clone,
    {
        let start = law.start::<_, A>(state);
        run(law, model, start, channels, self.samples) == Some(self.expected)
    }
}
