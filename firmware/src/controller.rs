//! One sample of the loop: from a reading to the valve's position.

use crate::fault::Fault;
use crate::law::{Change, Law, Unchanged};
use crate::sensor::{Calibration, Channel, Range, Watch};
use identified::rig;
use model_core::control::HoldTimes;
use model_core::control::period::samples_at_least;

/// Mode of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// Valves shut.
    Disarmed,
    /// The law drives the valves.
    Armed,
    /// A command drives the valves; the law and its model only observe.
    Playing,
    /// Valves shut; the law keeps its settings and continues when armed again.
    Paused,
    /// Valves shut until the operator disarms.
    Faulted(Fault),
}

/// Constants of the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Conversion from counts to y.
    pub calibration: Calibration,
    /// Limits of a healthy sensor.
    pub range: Range,
    /// The measured channel, where the model needs one.
    pub channel: Option<Channel>,
    /// The valve's shortest times, samples: a shorter command is not played.
    pub hold: HoldTimes,
    /// Limit of the residual averaged over about 64 samples, y. The average is over samples, not time,
    /// because its purpose is to reduce the noise.
    pub residual_envelope: f32,
}

/// Smallest number of equal readings that count as a stuck sensor: at long sample periods some readings are equal
/// accidentally.
const FEWEST_EQUAL: u32 = 20;

impl Settings {
    /// The constants of the rig file, without a channel, at this sample period. Times in seconds are rounded
    /// up to samples.
    #[must_use]
    pub const fn of_rig(period_s: f32) -> Self {
        let period_s = period_s as f64;
        let stuck_after = samples_at_least(rig::STUCK_AFTER_S as f64, period_s);
        Self {
            calibration: Calibration {
                zero: rig::ZERO,
                per_count: rig::PER_COUNT,
            },
            range: Range {
                lower_rail: rig::RAILS[0],
                upper_rail: rig::RAILS[1],
                stuck_after: if stuck_after > FEWEST_EQUAL {
                    stuck_after
                } else {
                    FEWEST_EQUAL
                },
            },
            channel: None,
            hold: HoldTimes {
                on: samples_at_least(rig::SHORTEST_S[0] as f64, period_s),
                off: samples_at_least(rig::SHORTEST_S[1] as f64, period_s),
            },
            residual_envelope: rig::RESIDUAL_ENVELOPE,
        }
    }
}

/// The input of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Counts of the sensor.
    pub counts: f32,
    /// Counts of the measured channel; ignored if the model needs no channel.
    pub channel: f32,
    /// Sample periods since the previous reading: more than 1 if one was missed.
    pub periods: u32,
}

/// The result of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Valve position.
    pub open: bool,
    /// Predicted reading of the model.
    pub predicted: f32,
    /// Reading (averaged if the model is) minus prediction.
    pub residual: f32,
    /// The reading.
    pub reading: Reading,
    /// The mode after this sample.
    pub mode: Mode,
}

/// The loop's state.
#[derive(Clone, Debug)]
pub struct Controller<L> {
    settings: Settings,
    law: L,
    watch: Watch,
    /// Monitor of the measured channel.
    channel: Watch,
    mode: Mode,
    /// Samples since the start; a 64-bit counter does not overflow in practice.
    samples: u64,
    /// Low-pass-filtered residual.
    strayed: f32,
    last: f32,
    open: bool,
    /// Valve position requested by a command.
    demand: bool,
    /// Samples for which a law must still leave the valve closed.
    rest: u32,
}

impl<L: Law> Controller<L> {
    /// Weight of a residual in the average of residuals.
    const SHARE: f32 = 1.0 / 64.0;

    /// The initial state, disarmed.
    pub fn new(settings: Settings, law: L) -> Self {
        Self {
            settings,
            law,
            watch: Watch::new(),
            channel: Watch::new(),
            mode: Mode::Disarmed,
            samples: 0,
            strayed: 0.0,
            last: 0.0,
            open: false,
            demand: false,
            rest: 0,
        }
    }

    /// Arms the law, or ends its pause; a latched fault must be disarmed first. The law waits until the valve has been
    /// closed for its shortest time.
    pub fn arm(&mut self) {
        if matches!(self.mode, Mode::Disarmed | Mode::Paused) {
            if self.mode == Mode::Disarmed {
                self.strayed = 0.0;
            }
            self.mode = Mode::Armed;
            #[cfg(feature = "defmt")]
            defmt::info!("armed at sample {}", self.samples);
        }
    }

    /// Closes the valve until the law is armed again. The law keeps its settings. Returns whether a law was running.
    #[inline(never)]
    pub fn pause(&mut self) -> bool {
        let runs = self.is_running();
        if runs {
            self.shut();
            self.mode = Mode::Paused;
        }
        runs
    }

    /// Changes a setting of the running law. A value outside its bounds closes the valve.
    ///
    /// # Errors
    /// [`Unchanged`]; the settings stay as they were.
    pub fn change(&mut self, change: Change) -> Result<(), Unchanged> {
        if !self.is_running() {
            return Err(Unchanged::NotRunning);
        }
        let result = self.law.change(change);
        if result == Err(Unchanged::Outside) {
            self.latch(Fault::Setting);
        }
        result
    }

    /// Whether a law is armed, paused or not.
    fn is_running(&self) -> bool {
        matches!(self.mode, Mode::Armed | Mode::Paused)
    }

    /// The settings of the law that may be changed.
    #[must_use]
    pub fn law_settings(&self) -> wire::reply::Settings {
        self.law.settings()
    }

    /// Starts playing a command ([`Self::demand`]) with the valve closed; returns whether it is permitted.
    pub fn play(&mut self) -> bool {
        if self.mode != Mode::Disarmed {
            return false;
        }
        self.mode = Mode::Playing;
        self.demand = false;
        #[cfg(feature = "defmt")]
        defmt::info!("playing from sample {}", self.samples);
        true
    }

    /// Sets the commanded valve position. It acts only while a command is played.
    pub fn demand(&mut self, open: bool) {
        self.demand = open;
    }

    /// Closes the valve and acknowledges a latched fault. A failed self-test is not cleared: damaged
    /// constants must not drive a valve.
    #[inline(never)]
    pub fn disarm(&mut self) {
        self.shut();
        if matches!(self.mode, Mode::Disarmed | Mode::Faulted(Fault::SelfTest)) {
            return;
        }
        // A law that is armed anew starts with the settings of its design.
        self.law.restore();
        self.mode = Mode::Disarmed;
        #[cfg(feature = "defmt")]
        defmt::info!("disarmed at sample {}", self.samples);
    }

    /// Closes the valve and latches `fault`; the first fault is kept.
    // Out of line, as `pause` and `disarm`: a copy at each of their calls would take flash.
    #[cold]
    #[inline(never)]
    pub fn latch(&mut self, fault: Fault) {
        self.shut();
        if !matches!(self.mode, Mode::Faulted(_)) {
            self.mode = Mode::Faulted(fault);
            #[cfg(feature = "defmt")]
            defmt::error!("fault latched: {} at sample {}", fault, self.samples);
        }
    }

    /// Closes the valve for at least its shortest time.
    #[inline]
    fn shut(&mut self) {
        self.open = false;
        if matches!(self.mode, Mode::Armed | Mode::Playing) {
            self.rest = self.settings.hold.of(false);
        }
    }

    /// The rig's constants.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// y* at this sample; NaN for a law without a reference.
    #[must_use]
    pub fn reference(&self) -> f32 {
        self.law.reference()
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
        let mut value = 0.0;
        if let Some(channel) = &self.settings.channel {
            if self
                .channel
                .check(&channel.range, reading.channel)
                .is_some()
            {
                fault = fault.or(Some(Fault::Channel));
            }
            value = channel.calibration.value(reading.channel);
            if !value.is_finite() {
                value = channel.reference;
            }
        }
        let channels = [value];
        // A sensor fault before the start is detected at arming.
        if reading.periods > 1 {
            fault = Some(Fault::Overrun);
        }
        if let (Some(fault), Mode::Armed | Mode::Playing | Mode::Paused) = (fault, self.mode) {
            self.latch(fault);
        }
        let y = self.settings.calibration.value(reading.counts);
        self.last = y;
        // A non-finite reading must not enter the averages.
        let y = if y.is_finite() { y } else { 0.0 };
        // While a command is played, the residual does not close the valve, because a command may explore
        // behaviour unknown to the model.
        let action = match self.mode {
            Mode::Armed if self.rest == 0 => self.law.act(y, &channels),
            mode => {
                self.rest = self.rest.saturating_sub(1);
                let demand = mode == Mode::Playing && self.demand;
                self.law.follow(demand, y, &channels)
            }
        };
        self.strayed += (action.residual - self.strayed) * Self::SHARE;
        let strayed = self.strayed.abs();
        // The condition is written so that NaN counts as outside: a diverged model is detected.
        let within = strayed <= self.settings.residual_envelope;
        self.open = action.open;
        if self.is_running() && !within {
            self.latch(Fault::Residual);
        }
        Tick {
            open: self.open,
            predicted: action.predicted,
            residual: action.residual,
            reading,
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
    use crate::law::{Driven, driven};
    use crate::on_board::{self, OnBoard};
    use crate::relay::Relay;
    use identified::{full, own};
    use model_core::average::MovingAverage;

    type Law = driven!(Relay, full);

    const RELAY: Relay = Relay {
        opens_below: 0.45,
        shuts_above: 0.55,
        hold: HoldTimes { on: 20, off: 20 },
    };

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
        channel: None,
        hold: RELAY.hold,
        residual_envelope: 0.3,
    };

    fn reading(counts: f32) -> Reading {
        Reading {
            counts,
            channel: 0.0,
            periods: 1,
        }
    }

    fn controller() -> Controller<Law> {
        let model = full::model();
        let state = full::state(&model);
        Controller::new(
            SETTINGS,
            Driven::new(RELAY, model, state, MovingAverage::new()),
        )
    }

    /// A sensor that shows the model's prediction with one flickering count.
    fn healthy(controller: &mut Controller<Law>, samples: u32) -> Tick {
        let mut tick = controller.tick(reading(500.5));
        for k in 1..samples {
            let counts = (500.0 + tick.predicted / 0.0005).clamp(9.0, 4086.0) + (k % 2) as f32;
            tick = controller.tick(reading(counts));
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
                periods: 2,
                ..reading(600.0)
            }),
            (Fault::NotFinite, |_| reading(f32::NAN)),
            (Fault::AtRail, |_| reading(4095.0)),
            (Fault::Stuck, |_| reading(700.0)),
            (Fault::Residual, |k| reading(3500.0 + (k % 3) as f32)),
        ];
        for (fault, ill) in ill {
            let mut controller = controller();
            controller.arm();
            assert!(healthy(&mut controller, 100).open);
            let mut k = 0;
            while controller.mode() == Mode::Armed {
                controller.tick(ill(k));
                k += 1;
                assert!(k < 400, "{fault:?} was not seen");
            }
            assert_eq!(controller.mode(), Mode::Faulted(fault));
            // The sensor has recovered: the fault stays latched, and arming is refused.
            controller.arm();
            let tick = healthy(&mut controller, 10);
            assert_eq!((tick.open, tick.mode), (false, Mode::Faulted(fault)));
            controller.disarm();
            controller.arm();
            assert_eq!(controller.mode(), Mode::Armed);
        }
    }

    /// A law that is armed again at once does not open the valve before its shortest time is over, whatever closed it.
    #[test]
    fn the_valve_rests_before_a_law_opens_it_again() {
        type Stop = fn(&mut Controller<OnBoard>);
        let stops: [Stop; 4] = [
            |controller| controller.disarm(),
            |controller| assert!(controller.pause()),
            |controller| {
                controller.latch(Fault::Residual);
                controller.disarm();
            },
            |controller| {
                controller.disarm();
                assert!(controller.play());
                controller.demand(true);
                controller.tick(reading(800.5));
                controller.disarm();
            },
        ];
        for stop in stops {
            let mut controller = on_board::controller();
            controller.arm();
            while !controller.tick(reading(800.0)).open {}
            stop(&mut controller);
            controller.arm();
            let rest = controller.settings().hold.off;
            assert_eq!(rest, 4);
            let mut closed = 0;
            while !controller.tick(reading(800.0)).open {
                closed += 1;
            }
            assert!(closed >= rest, "{closed}");
        }
    }

    /// The bundled rig: the shortest time of its valve is 4 ms, and equal readings for half a
    /// second mean a stuck sensor.
    #[test]
    fn the_rigs_times_are_kept_at_any_period() {
        for (period_s, hold, stuck_after) in [
            (0.0002, 20, 2500),
            (0.001, 4, 500),
            (0.003, 2, 167),
            (0.01, 1, 50),
            (0.1, 1, 20),
        ] {
            let settings = Settings::of_rig(period_s);
            assert_eq!(
                settings.hold,
                HoldTimes {
                    on: hold,
                    off: hold
                },
                "{period_s}"
            );
            assert_eq!(settings.range.stuck_after, stuck_after, "{period_s}");
        }
    }

    /// The channel reaches the model, and a faulty channel closes the valve without corrupting the model.
    #[test]
    fn the_measured_channel_reaches_the_model_and_is_watched() {
        let settings = Settings {
            channel: Some(Channel {
                calibration: Calibration {
                    zero: 0.0,
                    per_count: 0.01,
                },
                range: Range {
                    lower_rail: 8.0,
                    upper_rail: 4087.0,
                    stuck_after: u32::MAX,
                },
                reference: own::REFERENCES[0],
            }),
            residual_envelope: 10.0,
            ..SETTINGS
        };
        let model = own::model();
        let law: driven!(Relay, own) =
            Driven::new(RELAY, model, own::state(&model), MovingAverage::new());
        let mut cold = Controller::new(settings, law);
        cold.arm();
        let mut warm = cold.clone();
        let tick = |controller: &mut Controller<_>, k: u32, channel: f32| {
            let counts = 600.0 + (k % 2) as f32;
            controller.tick(Reading {
                counts,
                channel,
                periods: 1,
            })
        };
        let run = |controller: &mut Controller<_>, channel: f32| {
            let ticks = (0..900).map(|k| tick(controller, k, channel));
            ticks.map(|tick| tick.predicted).fold(0.0, f32::max)
        };
        // The temperatures are 20 and 25 °C; the warm film reads less.
        let (at_20, at_25) = (run(&mut cold, 2000.0), run(&mut warm, 2500.0));
        assert!(at_20 > 0.1 && at_25 < 0.95 * at_20, "{at_20} {at_25}");
        let ill = tick(&mut cold, 0, f32::NAN);
        assert_eq!((ill.mode, ill.open), (Mode::Faulted(Fault::Channel), false));
        assert!(tick(&mut cold, 1, 2000.0).predicted.is_finite());
        assert_eq!(
            tick(&mut warm, 0, 4095.0).mode,
            Mode::Faulted(Fault::Channel)
        );
    }

    /// 2³² samples are 49 days at 1 kHz; the loop must continue after them.
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
