//! PI control of the duty with pulse-width modulation, with or without a Smith predictor.

use crate::run::Controller;
use model_core::control::{Hold, HoldTimes};
use std::collections::VecDeque;

/// PI gains: duty = proportional·e + integral·∫e dt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Duty per y.
    pub proportional: f64,
    /// Duty per (y·s).
    pub integral: f64,
}

/// First order with dead time, the model of the Smith predictor: gain (y per duty), time constant and delay
/// (s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrder {
    /// y per duty.
    pub gain: f64,
    /// Time constant, s.
    pub time_s: f64,
    /// Dead time, s.
    pub delay_s: f64,
}

/// A PI controller with a pulse-width modulator.
#[derive(Clone, Debug)]
pub struct PulseWidth {
    gains: Gains,
    smith: Option<Smith>,
    /// Time between two commands, s.
    period_s: f64,
    /// Length of a modulation period, samples.
    carrier: u32,
    at: u32,
    width: u32,
    times: HoldTimes,
    hold: Hold,
    reference: f64,
    integral: f64,
    reading: f64,
}

#[derive(Clone, Debug)]
struct Smith {
    kept: f64,
    gain: f64,
    ahead: f64,
    past: VecDeque<f64>,
}

impl PulseWidth {
    /// PI at the modulation `frequency` (Hz), with a sample every `period_s`: the duty is renewed once a modulation
    /// period.
    #[must_use]
    pub fn new(gains: Gains, frequency: f64, times: HoldTimes, period_s: f64) -> Self {
        Self {
            gains,
            smith: None,
            period_s,
            carrier: (1.0 / (period_s * frequency)).round().max(2.0) as u32,
            at: 0,
            width: 0,
            times,
            hold: Hold::closed(),
            reference: 0.0,
            integral: 0.0,
            reading: 0.0,
        }
    }

    /// Adds a Smith predictor on the model `flow`.
    #[must_use]
    pub fn with_smith(mut self, flow: FirstOrder) -> Self {
        let delay = (flow.delay_s / self.period_s).round().max(1.0) as usize;
        self.smith = Some(Smith {
            kept: (-self.period_s / flow.time_s).exp(),
            gain: flow.gain,
            ahead: 0.0,
            past: VecDeque::from(vec![0.0; delay]),
        });
        self
    }

    /// The requested duty, 0–1, with anti-windup.
    fn duty(&mut self, interval_s: f64) -> f64 {
        let seen = match &self.smith {
            None => self.reading,
            Some(smith) => self.reading + smith.ahead - smith.past.front().copied().unwrap_or(0.0),
        };
        let error = self.reference - seen;
        let integral = self.integral + self.gains.integral * error * interval_s;
        let duty = self.gains.proportional * error + integral;
        // Conditional integration: the integral stops while the duty is saturated.
        if (0.0..=1.0).contains(&duty) || (duty > 1.0) != (error > 0.0) {
            self.integral = integral.clamp(0.0, 1.0);
        }
        duty.clamp(0.0, 1.0)
    }

    /// The pulse for a duty, rounded to the hold times.
    fn pulse(&self, duty: f64) -> u32 {
        let width = (duty * f64::from(self.carrier)).round() as u32;
        let (on, off) = (self.times.of(true), self.times.of(false));
        if width < on {
            if 2 * width >= on { on } else { 0 }
        } else if self.carrier - width < off {
            if 2 * (self.carrier - width) >= off {
                self.carrier.saturating_sub(off)
            } else {
                self.carrier
            }
        } else {
            width
        }
    }
}

impl Controller for PulseWidth {
    fn set_reference(&mut self, reference: f64) {
        self.reference = reference;
    }
    fn command(&mut self, reading: Option<f64>) -> bool {
        if let Some(y) = reading {
            // The reading is averaged over the carrier period, to avoid aliasing of its ripple.
            self.reading += (y - self.reading) * 2.0 / f64::from(self.carrier + 1);
        }
        if self.at == 0 {
            let duty = self.duty(f64::from(self.carrier) * self.period_s);
            self.width = self.pulse(duty);
        }
        let wanted = self.at < self.width;
        self.at = (self.at + 1) % self.carrier;
        let on = self.hold.pass(&self.times, wanted);
        if let Some(smith) = &mut self.smith {
            smith.past.pop_front();
            smith.past.push_back(smith.ahead);
            let drive = smith.gain * f64::from(u8::from(on));
            smith.ahead = drive + smith.kept * (smith.ahead - drive);
        }
        on
    }
}
