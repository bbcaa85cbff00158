//! Free run of a model over a command.

use std::io;

use serde::Serialize;

use super::StepError;
use crate::data::{InputFile, Record, Use};
use crate::model::{Model, Start};
use crate::preparation::Preparation;
use crate::simulate::Signals;

/// A free run. Serialises to the keys of `simulate --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Simulation {
    /// Number of samples.
    pub samples: usize,
    /// Mean of y.
    pub mean: f64,
    /// Lowest y.
    pub lowest: f64,
    /// Highest y.
    pub highest: f64,
    /// Where the run leaves the training range of the model, one sentence each.
    pub outside_training: Vec<String>,
    /// Sampling period, s.
    #[serde(skip)]
    pub sample_period_s: f64,
    /// Time of the first sample, s.
    #[serde(skip)]
    pub t0_s: f64,
    /// The command.
    #[serde(skip)]
    pub u: Vec<f64>,
    /// The run.
    #[serde(skip)]
    pub y: Vec<f64>,
}

impl Simulation {
    /// Writes the run as CSV with the columns t, u, y.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn write_csv(&self, out: impl io::Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(["t", "u", "y"])?;
        for (k, (u, y)) in self.u.iter().zip(&self.y).enumerate() {
            let t = self.t0_s + k as f64 * self.sample_period_s;
            // Rounded to 1 ns: multiples of the period would print 0.30000000000000004.
            let t = (t * 1e9).round() / 1e9;
            csv.write_record([t.to_string(), u.to_string(), y.to_string()])?;
        }
        csv.flush()
    }
}

/// Runs `model` free over `input`.
///
/// ```
/// use host_fit::data::InputFile;
/// use host_fit::model::Model;
/// use host_fit::steps::simulate;
///
/// let model = Model::load("../data/paper/table-2-state-dependent.toml".as_ref())?;
/// let input = InputFile::load("../data/paper-like/sq4-50.csv".as_ref(), None)?;
/// let run = simulate(&model, &input)?;
/// assert_eq!(run.samples, 10_000);
/// let mut csv = Vec::new();
/// run.write_csv(&mut csv)?;
/// assert!(csv.starts_with(b"t,u,y\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError`] when the sampling periods differ, a column is missing or the run diverges.
pub fn simulate(model: &Model, input: &InputFile) -> Result<Simulation, StepError> {
    let place = || Box::new(input.place(None));
    let period = model.sample_period_s;
    if !model.is_sampled_at(input.sample_period_s) {
        return Err(StepError::InputPeriod {
            place: place(),
            input: input.sample_period_s,
            model: period,
        });
    }
    let channels = model.channels().into_iter().map(|channel| {
        let values = input.channels.get(&channel).map(Vec::as_slice);
        values.ok_or_else(|| StepError::NoChannel {
            place: place(),
            channel,
        })
    });
    // A model that starts from measurements starts as in `compare`, if the input contains y.
    let measured = input.y.as_ref().filter(|_| model.start == Start::Measured);
    let prepared = measured.map(|y| {
        let record = Record::new("", Use::Validate, period, input.u.clone(), y.clone());
        Preparation::of(&[record]).records
    });
    let begun = prepared.as_ref().and_then(|records| records.first());
    let signals = Signals {
        y: begun.map(|record| record.y.as_slice()),
        u_before: begun.and_then(|record| record.u_before.map(|u| model.command.share(u))),
        y_before: begun.and_then(|record| record.y_before),
        followed: begun.map_or(&[], |record| &record.followed),
        channels: channels.collect::<Result<_, _>>()?,
        ..Signals::commanded(model, &input.u)
    };
    let y = model
        .run_free(&signals)
        .map_err(|sample| StepError::Diverges {
            place: place(),
            time_s: input.t0 + sample as f64 * period,
        })?;
    Ok(Simulation {
        samples: y.len(),
        mean: y.iter().sum::<f64>() / y.len().max(1) as f64,
        lowest: y.iter().copied().fold(f64::INFINITY, f64::min),
        highest: y.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        outside_training: model.outside_training(&input.u, &y),
        sample_period_s: period,
        t0_s: input.t0,
        u: input.u.clone(),
        y,
    })
}
