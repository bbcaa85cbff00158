//! The rigs that a board runs in lockstep with the host, and the host with it:
//! the same function builds both.

use crate::controller::{Controller, Reading, Settings};
use crate::law::{Direct, Law, Relay, RelaySettings};
use crate::link::lockstep::BATCH;
use crate::sensor::{Calibration, Range};
use crate::tracking::Track;
use identified::{averaged, effects, full};
use model_core::average::MovingAverage;
use model_core::history::{BitHistory, DelayLine};

/// How many cases there are.
pub const CASES: [&str; 4] = ["full model", "averaged model", "effects", "law"];

/// Calibration and limits of the lockstep rig.
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
    residual_envelope: 1.0,
};

/// Thresholds of the relay in the model cases.
pub const RELAY: RelaySettings = RelaySettings {
    opens_below: 0.45,
    shuts_above: 0.55,
    min_on: 20,
    min_off: 20,
};

/// An armed controller around `law`.
pub fn armed<L: Law>(law: L) -> Controller<L> {
    let mut controller = Controller::new(SETTINGS, law);
    controller.arm();
    controller
}

/// One step of a case.
#[inline]
pub fn step<L: Law>(controller: &mut Controller<L>, counts: u16) -> (f32, bool) {
    let tick = controller.tick(Reading {
        counts: f32::from(counts),
        periods: 1,
    });
    (tick.predicted, tick.open)
}

const _: () = assert!(BATCH <= 32, "decisions of a batch fit in 32 bits");

type FullOutputs = DelayLine<f32, { full::OUTPUTS }>;
type FullJets = BitHistory<{ full::WORDS }>;
type Full = Relay<full::Identified, FullOutputs, FullJets, Direct>;
type Averaged = Relay<
    averaged::Identified,
    DelayLine<f32, { averaged::OUTPUTS }>,
    BitHistory<{ averaged::WORDS }>,
    MovingAverage<f32, { averaged::WINDOW as usize }>,
>;
type Effects = Relay<
    effects::Identified,
    DelayLine<f32, { effects::OUTPUTS }>,
    DelayLine<f32, { effects::JETS }>,
    Direct,
>;
type Tracked = Track<full::Identified, FullOutputs, FullJets, { full::LOOK_AHEAD }>;

/// All cases, each from rest when it is started.
pub struct Rigs {
    case: u8,
    full: Controller<Full>,
    averaged: Controller<Averaged>,
    effects: Controller<Effects>,
    law: Controller<Tracked>,
}

fn full_rig() -> Controller<Full> {
    let model = full::model();
    armed(Relay::new(model, full::state(&model), Direct, RELAY))
}

fn averaged_rig() -> Controller<Averaged> {
    let model = averaged::model();
    let state = averaged::state(&model);
    armed(Relay::new(model, state, MovingAverage::new(), RELAY))
}

fn effects_rig() -> Controller<Effects> {
    let model = effects::model();
    armed(Relay::new(model, effects::state(&model), Direct, RELAY))
}

fn law_rig() -> Controller<Tracked> {
    let model = full::model();
    armed(Track::new(full::LAW, model, full::state(&model)))
}

impl Rigs {
    /// Case 0, and all others, from rest.
    #[must_use]
    pub fn new() -> Self {
        Self {
            case: 0,
            full: full_rig(),
            averaged: averaged_rig(),
            effects: effects_rig(),
            law: law_rig(),
        }
    }

    /// Begins a case from rest; `false` if there is none of that number.
    pub fn start(&mut self, case: u8) -> bool {
        self.case = case;
        match case {
            0 => self.full = full_rig(),
            1 => self.averaged = averaged_rig(),
            2 => self.effects = effects_rig(),
            3 => self.law = law_rig(),
            _ => return false,
        }
        true
    }

    /// One step of the present case: prediction and decision.
    #[inline]
    pub fn step(&mut self, counts: u16) -> (f32, bool) {
        match self.case {
            0 => step(&mut self.full, counts),
            1 => step(&mut self.averaged, counts),
            2 => step(&mut self.effects, counts),
            _ => step(&mut self.law, counts),
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
    fn every_case_switches_and_starts_anew() {
        for case in 0..CASES.len() as u8 {
            let mut rigs = Rigs::new();
            let mut run = || {
                assert!(rigs.start(case));
                let mut trace = std::vec::Vec::new();
                let mut predicted = 0.0_f32;
                for k in 0..3000_u16 {
                    let counts = (800.0 + predicted * 2000.0).clamp(10.0, 4000.0) as u16 + k % 2;
                    let (next, open) = rigs.step(counts);
                    predicted = next;
                    trace.push((next.to_bits(), open));
                }
                trace
            };
            let first = run();
            assert_eq!(run(), first, "case {case}");
            assert!(first.windows(2).any(|w| w[0].1 && !w[1].1), "case {case}");
        }
        assert!(!Rigs::new().start(CASES.len() as u8));
    }
}
