//! The loops that a board runs in lockstep with the host, one for each model in `identified`.

use crate::controller::{Controller, Reading, Settings};
use crate::law::{Driven, Law, driven};
use crate::link::lockstep::BATCH;
use crate::relay::Relay;
use crate::sensor::Channel;
use model_core::average::MovingAverage;
use model_core::control::{HoldTimes, Pulses, Tracking};

/// The lockstep rig at 1 kHz, without a measured channel.
pub const SETTINGS: Settings = settings(&[], 0.001);

/// The law of a model that has no designed law.
pub const RELAY: Relay = Relay {
    opens_below: 0.45,
    shuts_above: 0.55,
    hold: HoldTimes { on: 20, off: 20 },
};

/// The lockstep rig for a model whose channels have these `references`, at this sample period.
#[must_use]
pub const fn settings(references: &[f32], period_s: f32) -> Settings {
    let channel = match references {
        [] => None,
        [reference, ..] => Some(Channel::around(*reference)),
    };
    Settings {
        channel,
        // There is no residual limit, because the plant differs from the models.
        residual_envelope: f32::INFINITY,
        ..Settings::of_rig(period_s)
    }
}

/// The law of a generated file: its constants, or no law.
pub trait OrRelay {
    /// Type of the law.
    type Law;
    /// The law; `relay` if the file has no law.
    fn or(self, relay: Relay) -> Self::Law;
}

impl OrRelay for () {
    type Law = Relay;
    fn or(self, relay: Relay) -> Relay {
        relay
    }
}

impl OrRelay for Tracking<f32> {
    type Law = Self;
    fn or(self, _relay: Relay) -> Self {
        self
    }
}

impl<P> OrRelay for Pulses<P> {
    type Law = Self;
    fn or(self, _relay: Relay) -> Self {
        self
    }
}

/// An armed controller around `law`.
pub fn armed<L: Law>(settings: Settings, law: L) -> Controller<L> {
    let mut controller = Controller::new(settings, law);
    controller.arm();
    controller
}

/// One step of a case.
#[inline]
pub fn step<L: Law>(controller: &mut Controller<L>, counts: u16, channel: u16) -> (f32, bool) {
    let tick = controller.tick(Reading {
        counts: f32::from(counts),
        channel: f32::from(channel),
        periods: 1,
    });
    (tick.predicted, tick.open)
}

const _: () = assert!(BATCH <= 32, "decisions of a batch fit in 32 bits");

macro_rules! rigs {
    ($($model:ident)+) => {
        /// The models, in the order of their case numbers.
        pub const CASES: &[&str] = &[$(stringify!($model)),+];

        /// A loop, from rest.
        #[allow(non_camel_case_types, reason = "named as the models are")]
        #[allow(clippy::large_enum_variant, reason = "there is one")]
        enum Rig {
            $($model(
                Controller<
                    driven!(<identified::$model::Law as OrRelay>::Law, identified::$model)
                >,
            ),)+
        }

        impl Rig {
            /// The case with this number, an index of `CASES`.
            fn new(case: u8) -> Option<Self> {
                let mut next = 0;
                $(
                    if case == next {
                        return Some(Self::$model($model()));
                    }
                    next += 1;
                )+
                let _ = next;
                None
            }

            #[inline]
            fn step(&mut self, counts: u16, channel: u16) -> (f32, bool) {
                match self {
                    $(Self::$model(controller) => step(controller, counts, channel),)+
                }
            }
        }

        $(
            #[inline(never)]
            fn $model() -> Controller<
                driven!(<identified::$model::Law as OrRelay>::Law, identified::$model)
            > {
                use identified::$model::{LAW, REFERENCES, SAMPLE_PERIOD_S, model, state};
                let model = model();
                let state = state(&model);
                let law = Driven::new(LAW.or(RELAY), model, state, MovingAverage::new());
                armed(settings(&REFERENCES, SAMPLE_PERIOD_S), law)
            }
        )+
    };
}
identified::each_model!(rigs);

/// The present case.
pub struct Rigs {
    rig: Option<Rig>,
}

impl Rigs {
    /// No case yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { rig: None }
    }

    /// Starts a case from rest; `false` if the number is invalid.
    pub fn start(&mut self, case: u8) -> bool {
        self.rig = Rig::new(case);
        self.rig.is_some()
    }

    /// One step of the present case: prediction and decision.
    #[inline]
    pub fn step(&mut self, counts: u16, channel: u16) -> (f32, bool) {
        match &mut self.rig {
            Some(rig) => rig.step(counts, channel),
            None => (0.0, false),
        }
    }
}

impl Default for Rigs {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_with_a_channel_reads_it() {
        assert_eq!(SETTINGS.channel, None);
        let channel = settings(&[20.0], 0.001).channel.expect("a channel");
        assert_eq!(
            (channel.reference, channel.calibration.value(2048.0)),
            (20.0, 20.0)
        );
    }

    #[test]
    fn every_case_switches_and_starts_anew() {
        let mut rigs = Rigs::new();
        for case in 0..CASES.len() as u8 {
            let mut run = || {
                assert!(rigs.start(case));
                let mut trace = std::vec::Vec::new();
                let mut predicted = 0.0_f32;
                for k in 0..3000_u16 {
                    let counts = (800.0 + predicted * 2000.0).clamp(10.0, 4000.0) as u16 + k % 2;
                    let (next, open) = rigs.step(counts, 2048 + k % 100);
                    predicted = next;
                    trace.push((next.to_bits(), open));
                }
                trace
            };
            let first = run();
            assert_eq!(run(), first, "case {case}");
            assert!(first.windows(2).any(|w| w[0].1 && !w[1].1), "case {case}");
        }
        assert!(!rigs.start(CASES.len() as u8));
    }
}
