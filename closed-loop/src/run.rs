//! A controller that sees readings and gives commands, a flow that sees commands
//! and gives readings, and the record of the two.

use std::fmt::Write as _;

/// Seconds between two commands.
pub const SAMPLE_PERIOD_S: f64 = 0.001;

/// What can be controlled: a flow whose true friction is known besides the reading.
pub trait Controlled {
    /// Holds the command for one sample, then reads the sensor (y); `None` when
    /// the reading is lost.
    fn step(&mut self, command: bool) -> Option<f64>;
    /// The friction now, before film and noise (y).
    fn friction(&self) -> f64;
}

/// What can be in charge of the valve.
pub trait Controller {
    /// Where the loop is told to go, from now on (y).
    fn set_reference(&mut self, reference: f64);
    /// The valve from this sample to the next, given the reading of this sample
    /// (`None` where there is none).
    fn command(&mut self, reading: Option<f64>) -> bool;
}

/// A sample of a closed-loop run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// What was asked for (y).
    pub reference: f64,
    /// The friction of the flow (y).
    pub friction: f64,
    /// What the controller was shown (y).
    pub reading: Option<f64>,
    /// What it commanded.
    pub on: bool,
}

/// A closed-loop run, 1 ms a sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
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
    Trace { samples }
}

impl Trace {
    /// As CSV with the columns t, reference, friction, y, u; y is empty where
    /// the reading was lost.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from("t,reference,friction,y,u\n");
        for (k, sample) in self.samples.iter().enumerate() {
            let t = k as f64 * SAMPLE_PERIOD_S;
            let _ = write!(text, "{t:.3},{},{:.6},", sample.reference, sample.friction);
            if let Some(y) = sample.reading {
                let _ = write!(text, "{y:.6}");
            }
            let _ = writeln!(text, ",{}", u8::from(sample.on));
        }
        text
    }
}
