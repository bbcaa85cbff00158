//! Closed-loop run of a controller and a plant, and its record.

use std::fmt::Write as _;

/// Length of a run whose samples are `period_s` apart: `samples`, or the same number of milliseconds if that is
/// longer.
///
/// Models store a number of samples, so at any period from 1 ms on a run of a fixed number of samples shows the
/// same part of a model's response. At shorter periods a sample is a smaller part of the flow's own time, so the
/// length in time counts.
///
/// ```
/// assert_eq!(closed_loop::span(12_000, 0.1), 12_000);
/// assert_eq!(closed_loop::span(12_000, 0.001), 12_000);
/// assert_eq!(closed_loop::span(12_000, 0.0002), 60_000);
/// ```
#[must_use]
pub fn span(samples: usize, period_s: f64) -> usize {
    // For a NaN period the samples are kept.
    samples.max((samples as f64 * 1e-3 / period_s).round() as usize)
}

/// A plant whose true friction is known in addition to the reading.
pub trait Controlled {
    /// Hold time of a command, s.
    fn sample_period_s(&self) -> f64;
    /// Holds the command for one sample, then reads the sensor (y); `None` when
    /// the reading is lost.
    fn step(&mut self, command: bool) -> Option<f64>;
    /// The present friction, before sensor dynamics and noise (y).
    fn friction(&self) -> f64;
}

/// A controller of the valve.
pub trait Controller {
    /// Sets the reference (y).
    fn set_reference(&mut self, reference: f64);
    /// The valve's position from this sample to the next, given the reading of this sample (`None` if it is
    /// missing).
    fn command(&mut self, reading: Option<f64>) -> bool;
}

/// A sample of a closed-loop run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The reference (y).
    pub reference: f64,
    /// The friction of the flow (y).
    pub friction: f64,
    /// The reading of the controller (y).
    pub reading: Option<f64>,
    /// The command.
    pub on: bool,
}

/// A closed-loop run.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Time from one sample to the next, s.
    pub sample_period_s: f64,
    /// The samples.
    pub samples: Vec<Sample>,
}

/// Runs `controller` on `flow` for as many samples as there are references.
///
/// The first sample has no reading: nothing has been measured yet.
pub fn run(
    controller: &mut impl Controller,
    flow: &mut impl Controlled,
    references: impl IntoIterator<Item = f64>,
) -> Trace {
    let mut reading = None;
    let mut told = f64::NAN;
    let mut samples = Vec::new();
    for reference in references {
        if reference != told {
            controller.set_reference(reference);
            told = reference;
        }
        let friction = flow.friction();
        let on = controller.command(reading);
        samples.push(Sample {
            reference,
            friction,
            reading,
            on,
        });
        reading = flow.step(on);
    }
    Trace {
        sample_period_s: flow.sample_period_s(),
        samples,
    }
}

impl Trace {
    /// As CSV with the columns t, reference, friction, y, u; y is empty where
    /// the reading was lost.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from("t,reference,friction,y,u\n");
        // Below 1 ms, three digits would print equal times.
        let digits = if self.sample_period_s < 1e-3 { 6 } else { 3 };
        for (k, sample) in self.samples.iter().enumerate() {
            let t = k as f64 * self.sample_period_s;
            let _ = write!(
                text,
                "{t:.digits$},{},{:.6},",
                sample.reference, sample.friction
            );
            if let Some(y) = sample.reading {
                let _ = write!(text, "{y:.6}");
            }
            let _ = writeln!(text, ",{}", u8::from(sample.on));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_the_periods() {
        let sample = Sample {
            reference: 0.5,
            friction: 0.25,
            reading: None,
            on: true,
        };
        for (sample_period_s, last) in [
            (0.1, "\n0.100,"),
            (0.001, "\n0.001,"),
            (0.00025, "\n0.000250,"),
        ] {
            let trace = Trace {
                sample_period_s,
                samples: vec![sample; 2],
            };
            assert!(trace.to_csv().contains(last), "{}", trace.to_csv());
        }
    }
}
