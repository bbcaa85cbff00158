//! Open-loop blowing: steady or pulsed.

use crate::run::Controller;
use model_core::control::{Hold, HoldTimes, PulseTrain};

/// A pulse train independent of the sensor.
#[derive(Clone, Debug)]
pub struct OpenLoop {
    train: PulseTrain<Vec<(u32, u32)>>,
    times: HoldTimes,
    hold: Hold,
    at: u32,
}

impl OpenLoop {
    /// Steady blowing.
    #[must_use]
    pub fn steady() -> Self {
        let times = HoldTimes { on: 1, off: 1 };
        let train = PulseTrain {
            period: 1,
            pulses: vec![(0, 1)],
        };
        Self::train(train, times)
    }

    /// A square wave of `frequency` (Hz) and `duty` (0–1), at a sample every `period_s`.
    #[must_use]
    pub fn square(frequency: f64, duty: f64, times: HoldTimes, period_s: f64) -> Self {
        let period = (1.0 / (period_s * frequency)).round().clamp(1.0, 1e6) as u32;
        let on = (f64::from(period) * duty).round() as u32;
        let train = PulseTrain {
            period,
            pulses: vec![(0, on)],
        };
        Self::train(train, times)
    }

    /// Any pulse train.
    #[must_use]
    pub fn train(train: PulseTrain<Vec<(u32, u32)>>, times: HoldTimes) -> Self {
        Self {
            train,
            times,
            hold: Hold::closed(),
            at: 0,
        }
    }
}

impl Controller for OpenLoop {
    fn set_reference(&mut self, _reference: f64) {}
    fn command(&mut self, _reading: Option<f64>) -> bool {
        let wanted = self.train.next(&mut self.at);
        self.hold.pass(&self.times, wanted)
    }
}
