//! One sample of the loop: from a reading to the valve's position.

use crate::fault::Fault;
use crate::law::Law;
use crate::sensor::{Calibration, Range, Watch};

/// What the operator set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// Valves shut.
    Disarmed,
    /// The law drives the valves.
    Armed,
    /// Valves shut until the operator disarms.
    Faulted(Fault),
}

/// The rig's constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// From counts to y.
    pub calibration: Calibration,
    /// What a healthy sensor does not do.
    pub range: Range,
    /// Largest residual, averaged over about 64 samples, that the model's
    /// envelope allows, y.
    pub residual_envelope: f32,
}

/// What the sensor gave at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Counts of the converter.
    pub counts: f32,
    /// Sample periods since the reading before: 1 unless one was missed.
    pub periods: u32,
}

/// What came of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Where the valve is to be.
    pub open: bool,
    /// What the model said the sensor would show.
    pub predicted: f32,
    /// The mode after this sample.
    pub mode: Mode,
}

/// The loop's state.
#[derive(Clone, Debug)]
pub struct Controller<L> {
    settings: Settings,
    law: L,
    watch: Watch,
    mode: Mode,
    /// Samples since the start; 2⁶⁴ of them do not come.
    samples: u64,
    /// Residual, low-pass filtered.
    strayed: f32,
    last: f32,
    open: bool,
}

impl<L: Law> Controller<L> {
    /// Share of a residual that enters its average.
    const SHARE: f32 = 1.0 / 64.0;

    /// Disarmed.
    pub fn new(settings: Settings, law: L) -> Self {
        Self {
            settings,
            law,
            watch: Watch::new(),
            mode: Mode::Disarmed,
            samples: 0,
            strayed: 0.0,
            last: 0.0,
            open: false,
        }
    }

    /// Lets the law drive the valve; a latched fault must be disarmed first.
    pub fn arm(&mut self) {
        if self.mode == Mode::Disarmed {
            self.mode = Mode::Armed;
            self.strayed = 0.0;
            #[cfg(feature = "defmt")]
            defmt::info!("armed at sample {}", self.samples);
        }
    }

    /// Shuts the valve and takes note of a latched fault. A failed self-test is
    /// not cleared: damaged constants drive nothing.
    pub fn disarm(&mut self) {
        self.open = false;
        if matches!(self.mode, Mode::Disarmed | Mode::Faulted(Fault::SelfTest)) {
            return;
        }
        self.mode = Mode::Disarmed;
        #[cfg(feature = "defmt")]
        defmt::info!("disarmed at sample {}", self.samples);
    }

    /// Shuts the valve and latches `fault`; the first fault stays.
    pub fn latch(&mut self, fault: Fault) {
        self.open = false;
        if !matches!(self.mode, Mode::Faulted(_)) {
            self.mode = Mode::Faulted(fault);
            #[cfg(feature = "defmt")]
            defmt::error!("fault latched: {} at sample {}", fault, self.samples);
        }
    }

    /// The mode.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Samples since the start.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// y at the last sample.
    #[must_use]
    pub fn friction(&self) -> f32 {
        self.last
    }

    /// Whether the valve is open.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// One sample.
    #[inline]
    pub fn tick(&mut self, reading: Reading) -> Tick {
        self.samples = self.samples.wrapping_add(u64::from(reading.periods));
        let mut fault = self.watch.check(&self.settings.range, reading.counts);
        // A sensor that is ill before the start is seen at arming, not before.
        if reading.periods > 1 {
            fault = Some(Fault::Overrun);
        }
        if let (Some(fault), Mode::Armed) = (fault, self.mode) {
            self.latch(fault);
        }
        let y = self.settings.calibration.friction(reading.counts);
        self.last = y;
        // A reading that is no number must not enter the averages.
        let y = if y.is_finite() { y } else { 0.0 };
        let action = if self.mode == Mode::Armed {
            self.law.act(y)
        } else {
            self.law.idle(y)
        };
        self.strayed += (action.residual - self.strayed) * Self::SHARE;
        let strayed = self.strayed.abs();
        // Also true for NaN: a model that has left all bounds is caught here.
        let within = strayed <= self.settings.residual_envelope;
        self.open = action.open;
        if self.mode == Mode::Armed && !within {
            self.latch(Fault::Residual);
        }
        Tick {
            open: self.open,
            predicted: action.predicted,
            mode: self.mode,
        }
    }

    #[cfg(test)]
    fn set_samples(&mut self, samples: u64) {
        self.samples = samples;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Direct, Relay, RelaySettings};
    use identified::full;

    type Law = Relay<
        full::Identified,
        model_core::history::DelayLine<f32, { full::OUTPUTS }>,
        model_core::history::BitHistory<{ full::WORDS }>,
        Direct,
    >;

    const SETTINGS: Settings = Settings {
        calibration: Calibration {
            zero: 500.0,
            per_count: 0.0005,
        },
        range: Range {
            lower_rail: 8.0,
            upper_rail: 4087.0,
            stuck_after: 200,
        },
        residual_envelope: 0.3,
    };

    fn controller() -> Controller<Law> {
        let model = full::model();
        let relay = Relay::new(
            model,
            full::state(&model),
            Direct,
            RelaySettings {
                opens_below: 0.45,
                shuts_above: 0.55,
                min_on: 20,
                min_off: 20,
            },
        );
        Controller::new(SETTINGS, relay)
    }

    /// A sensor that shows what the model says, with the last count flickering.
    fn healthy(controller: &mut Controller<Law>, samples: u32) -> Tick {
        let mut tick = Tick {
            open: false,
            predicted: 0.0,
            mode: controller.mode(),
        };
        for k in 0..samples {
            let counts = (500.0 + tick.predicted / 0.0005).clamp(9.0, 4086.0) + (k % 2) as f32;
            tick = controller.tick(Reading { counts, periods: 1 });
        }
        tick
    }

    #[test]
    fn it_holds_the_flow_while_armed_and_shuts_otherwise() {
        let mut controller = controller();
        assert!(!healthy(&mut controller, 500).open);
        controller.arm();
        let tick = healthy(&mut controller, 3000);
        assert_eq!(tick.mode, Mode::Armed);
        assert!((0.3..0.7).contains(&tick.predicted), "{}", tick.predicted);
        controller.disarm();
        assert!(!healthy(&mut controller, 1).open);
        assert_eq!(controller.samples(), 3501);
    }

    #[test]
    fn each_fault_shuts_the_valve_and_stays_until_disarmed() {
        type Ill = (Fault, fn(u32) -> Reading);
        let ill: [Ill; 5] = [
            (Fault::Overrun, |_| Reading {
                counts: 600.0,
                periods: 2,
            }),
            (Fault::NotFinite, |_| Reading {
                counts: f32::NAN,
                periods: 1,
            }),
            (Fault::AtRail, |_| Reading {
                counts: 4095.0,
                periods: 1,
            }),
            (Fault::Stuck, |_| Reading {
                counts: 700.0,
                periods: 1,
            }),
            (Fault::Residual, |k| Reading {
                counts: 3500.0 + (k % 3) as f32,
                periods: 1,
            }),
        ];
        for (fault, reading) in ill {
            let mut controller = controller();
            controller.arm();
            assert!(healthy(&mut controller, 100).open);
            let mut k = 0;
            while controller.mode() == Mode::Armed {
                controller.tick(reading(k));
                k += 1;
                assert!(k < 400, "{fault:?} was not seen");
            }
            assert_eq!(controller.mode(), Mode::Faulted(fault));
            // The sensor is well again: the fault stays, and arming does not help.
            controller.arm();
            let tick = healthy(&mut controller, 10);
            assert_eq!((tick.open, tick.mode), (false, Mode::Faulted(fault)));
            controller.disarm();
            controller.arm();
            assert_eq!(controller.mode(), Mode::Armed);
        }
    }

    /// 49 days at 1 kHz: nothing may happen at 2³².
    #[test]
    fn time_goes_on_beyond_32_bits() {
        let mut near = controller();
        let mut fresh = controller();
        near.set_samples((1 << 32) - 500);
        near.arm();
        fresh.arm();
        for _ in 0..1000 {
            assert_eq!(healthy(&mut near, 1), healthy(&mut fresh, 1));
        }
        assert_eq!(near.samples(), (1 << 32) + 500);
    }
}
