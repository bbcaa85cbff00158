//! The hot film and its cable: from the friction at the film to a reading, before noise.

use super::fault::Fault;
use super::part::{Moment, Piece, SensorPart};

/// A chain of parts behind the film.
#[derive(Debug, Clone)]
pub(crate) struct Sensor {
    parts: Vec<Box<dyn SensorPart>>,
    /// Input of each part, and output of the last one.
    signals: Vec<f64>,
    /// Whether any part has dynamics; otherwise the output is computed only when it is read.
    takes_time: bool,
    freeze: Option<(f64, f64)>,
    last_reading: f64,
}

impl Sensor {
    /// The parts in the order of the signals.
    pub(crate) fn new(parts: Vec<Box<dyn SensorPart>>, faults: &[Fault]) -> Self {
        let mut freeze = None;
        for fault in faults {
            match *fault {
                Fault::FreezingSensor { from_s, to_s } => freeze = Some((from_s, to_s)),
                Fault::MissingPulse { .. } | Fault::StickingValve { .. } => {}
            }
        }
        Self {
            signals: vec![0.0; parts.len() + 1],
            takes_time: parts.iter().any(|part| part.takes_time()),
            parts,
            freeze,
            last_reading: 0.0,
        }
    }

    fn pass(&mut self, felt: f64, mut through: impl FnMut(&mut dyn SensorPart, f64, f64) -> f64) {
        let mut signal = felt;
        for (part, before) in self.parts.iter_mut().zip(&mut self.signals) {
            let from = std::mem::replace(before, signal);
            signal = through(part.as_mut(), from, signal);
        }
        if let Some(last) = self.signals.last_mut() {
            *last = signal;
        }
    }

    /// Advances by `dt` while the film's input changes linearly to `felt`.
    pub(crate) fn advance(&mut self, dt: f64, felt: f64) {
        if self.takes_time {
            self.pass(felt, |part, from, to| part.advance(&Piece { dt, from, to }));
        } else {
            self.signals[0] = felt;
        }
    }

    /// The film's input jumps to `felt`.
    pub(crate) fn jump(&mut self, felt: f64) {
        if self.takes_time {
            self.pass(felt, |part, _, to| part.jump(to));
        } else {
            self.signals[0] = felt;
        }
    }

    /// The reading at a moment.
    pub(crate) fn read(&mut self, at: &Moment) -> f64 {
        if self
            .freeze
            .is_some_and(|(from, to)| at.t >= from && at.t < to)
        {
            return self.last_reading;
        }
        if !self.takes_time {
            self.pass(self.signals[0], |part, _, to| part.jump(to));
        }
        let film = self.signals.last().copied().unwrap_or(0.0);
        let reading = self.parts.iter().fold(film, |y, part| part.read(y, at));
        self.last_reading = reading;
        reading
    }
}

/// Access for the tests of parts.
#[cfg(test)]
pub(crate) mod bench {
    use super::*;
    use crate::plant::part::Part;

    pub(crate) fn sensor(parts: impl IntoIterator<Item = Part>) -> Sensor {
        let parts = parts.into_iter().map(|part| match part {
            Part::Sensor(part) => part,
            _ => panic!("it does not act on the sensor"),
        });
        Sensor::new(parts.collect(), &[])
    }

    pub(crate) fn read(sensor: &mut Sensor, t: f64, command: f64) -> f64 {
        sensor.read(&Moment { t, command })
    }

    /// The first reading after a film input of `s`.
    pub(crate) fn reading(sensor: &mut Sensor, s: f64) -> f64 {
        sensor.advance(5e-5, s);
        read(sensor, 0.0, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::bench::read;
    use super::*;

    #[test]
    fn a_frozen_sensor_repeats_its_last_reading() {
        let fault = Fault::FreezingSensor {
            from_s: 1.0,
            to_s: 2.0,
        };
        let mut sensor = Sensor::new(Vec::new(), &[fault]);
        sensor.advance(0.1, 0.4);
        assert_eq!(read(&mut sensor, 0.999, 0.0), 0.4);
        sensor.advance(0.1, 0.9);
        assert_eq!(read(&mut sensor, 1.5, 0.0), 0.4);
        assert_eq!(read(&mut sensor, 2.0, 0.0), 0.9);
    }
}
