//! How well a free run matches a measurement: the paper's indicators
//! (9)–(11), the error's size and the noise level.

use crate::data::{Record, Use};
use crate::model::{Model, Rounding};
use crate::simulate::{Signals, SimulateError, Simulator};
use serde::{Deserialize, Serialize};

/// Indicators of a free run over a record, or over several together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Indicators {
    /// The record's name; `identify` or `validate` for all records of this use.
    pub name: String,
    /// `identify` or `validate`.
    #[serde(rename = "use")]
    pub role: Use,
    /// Samples that were judged.
    pub samples: usize,
    /// ε = ‖x − x_simu‖₂, eq. (9), in y.
    pub epsilon: f64,
    /// FIT, eq. (10), in percent; 100 is a perfect fit, 0 is as good as the mean of y.
    pub fit_percent: f64,
    /// ρ, eq. (11), −1 to 1.
    pub correlation: f64,
    /// Root mean square error, in y.
    pub rmse: f64,
    /// Root mean square of the standard error `y_sd`: the error of a perfect
    /// model. None without `y_sd`.
    pub noise_rmse: Option<f64>,
    /// Fraction of samples inside [y_min, y_max]; none without an envelope.
    pub inside_envelope: Option<f64>,
}

/// Sums from which indicators are computed; sums of several records add.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    samples: f64,
    y: f64,
    sim: f64,
    y_y: f64,
    sim_sim: f64,
    y_sim: f64,
    error: f64,
    noise: Option<f64>,
    inside: Option<f64>,
}

impl Sums {
    fn of(record: &Record, simulated: &[f64]) -> Self {
        let (lead, mut sums) = (record.lead, Self::default());
        for (y, sim) in record.y.iter().zip(simulated).skip(lead) {
            sums.samples += 1.0;
            sums.y += y;
            sums.sim += sim;
            sums.y_y += y * y;
            sums.sim_sim += sim * sim;
            sums.y_sim += y * sim;
            sums.error += (y - sim) * (y - sim);
        }
        let judged = |series: &Vec<f64>| series.iter().skip(lead).map(|sd| sd * sd).sum();
        sums.noise = record.y_sd.as_ref().map(judged);
        if let (Some(low), Some(high)) = (&record.y_min, &record.y_max) {
            let bounds = low.iter().zip(high).zip(simulated).skip(lead);
            let inside = bounds.filter(|((low, high), sim)| *low <= *sim && *sim <= *high);
            sums.inside = Some(inside.count() as f64);
        }
        sums
    }

    fn add(&mut self, other: &Self) {
        let both = |a: Option<f64>, b: Option<f64>| Some(a? + b?);
        *self = if self.samples == 0.0 {
            *other
        } else {
            Self {
                samples: self.samples + other.samples,
                y: self.y + other.y,
                sim: self.sim + other.sim,
                y_y: self.y_y + other.y_y,
                sim_sim: self.sim_sim + other.sim_sim,
                y_sim: self.y_sim + other.y_sim,
                error: self.error + other.error,
                noise: both(self.noise, other.noise),
                inside: both(self.inside, other.inside),
            }
        };
    }

    fn indicators(&self, name: &str, role: Use) -> Indicators {
        let n = self.samples.max(1.0);
        let nothing = self.samples == 0.0;
        let spread = (self.y_y - self.y * self.y / n).max(0.0);
        let sim_spread = (self.sim_sim - self.sim * self.sim / n).max(0.0);
        let covariance = self.y_sim - self.y * self.sim / n;
        let both = (spread * sim_spread).sqrt();
        Indicators {
            name: name.to_owned(),
            role,
            samples: self.samples as usize,
            epsilon: self.error.sqrt(),
            fit_percent: if spread > 0.0 {
                100.0 * (1.0 - (self.error / spread).sqrt())
            } else if nothing {
                f64::NAN
            } else {
                0.0
            },
            correlation: if both > 0.0 { covariance / both } else { 0.0 },
            rmse: if nothing {
                f64::NAN
            } else {
                (self.error / n).sqrt()
            },
            noise_rmse: self.noise.map(|noise| (noise / n).sqrt()),
            inside_envelope: self.inside.map(|inside| inside / n),
        }
    }
}

/// The records on which an error is computed. It determines the names of the error and of the records in all texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// On the records marked `validate`.
    Validation,
    /// On the estimation records, because no record is marked `validate`.
    Estimation,
    /// On each estimation record, predicted by a model fitted to the others.
    CrossValidation,
    /// On the end of the only record, predicted by a model fitted to its beginning.
    RecordEnd,
}

impl ErrorKind {
    /// The error of a model on records with this use.
    #[must_use]
    pub fn of(role: Use) -> Self {
        match role {
            Use::Validate => Self::Validation,
            Use::Identify => Self::Estimation,
        }
    }

    /// The error of a model on a data set: validation error if a record is marked `validate`, otherwise estimation
    /// error.
    #[must_use]
    pub fn on(records: &[Record]) -> Self {
        let validate = records.iter().any(|record| record.role == Use::Validate);
        Self::of(if validate {
            Use::Validate
        } else {
            Use::Identify
        })
    }

    /// Name of the error within a sentence, for example "validation error".
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Validation => "validation error",
            Self::Estimation => "estimation error",
            Self::CrossValidation => "cross-validation error",
            Self::RecordEnd => "end-of-record error",
        }
    }

    /// [`ErrorKind::name`] with a capital letter, for headings and axes.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Validation => "Validation error",
            Self::Estimation => "Estimation error",
            Self::CrossValidation => "Cross-validation error",
            Self::RecordEnd => "End-of-record error",
        }
    }

    /// The records on which the error is computed, for example "validation records".
    #[must_use]
    pub fn records(self) -> &'static str {
        match self {
            Self::Validation => "validation records",
            Self::Estimation => "estimation records",
            Self::CrossValidation => "left-out records",
            Self::RecordEnd => "end of the record",
        }
    }
}

/// Indicators of a model on a data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// One entry per record, in the data set's order.
    pub records: Vec<Indicators>,
    /// All identify records together; `None` without such records.
    pub identify: Option<Indicators>,
    /// All validate records together; `None` without such records.
    pub validate: Option<Indicators>,
}

impl Scores {
    /// The validation indicators, or those of the identify records if there are no validation records.
    #[must_use]
    pub fn held_out(&self) -> Option<&Indicators> {
        self.validate.as_ref().or(self.identify.as_ref())
    }
}

/// √Σ (y_{k+1} − prediction from the measured past)² over the identify records
/// among `records` (as the model sees them, see [`Model::targets`]).
///
/// # Errors
/// A missing channel.
pub fn one_step_norm(model: &Model, records: &[Record]) -> Result<f64, SimulateError> {
    let simulator = Simulator::with_values(model, &model.values(), Rounding::Samples);
    let mut sum = 0.0;
    for record in records.iter().filter(|r| r.role == Use::Identify) {
        let signals = Signals::of(model, record)?;
        simulator.predict(&signals, |k, predicted: f64| {
            if k >= record.lead {
                sum += record.y.get(k).map_or(0.0, |y| (y - predicted).powi(2));
            }
        });
    }
    Ok(sum.sqrt())
}

/// Runs `model` free over every record and judges it; also gives the runs.
///
/// # Errors
/// A missing channel, or a free run that diverges.
pub fn score(model: &Model, records: &[Record]) -> Result<(Scores, Vec<Vec<f64>>), SimulateError> {
    score_with(model, records, |_, error| Err(error))
}

/// As [`score`], for a model whose free runs may diverge: the indicators of such a record are NaN. The records that
/// diverge are returned too.
///
/// # Errors
/// A missing channel.
pub fn score_new(
    model: &Model,
    records: &[Record],
) -> Result<(Scores, Vec<SimulateError>), SimulateError> {
    let mut diverged = Vec::new();
    let (scores, _) = score_with(model, records, |record, error| match error {
        SimulateError::Diverged { .. } => {
            diverged.push(error);
            Ok(vec![f64::NAN; record.len()])
        }
        other => Err(other),
    })?;
    Ok((scores, diverged))
}

fn score_with(
    model: &Model,
    records: &[Record],
    mut instead: impl FnMut(&Record, SimulateError) -> Result<Vec<f64>, SimulateError>,
) -> Result<(Scores, Vec<Vec<f64>>), SimulateError> {
    let mut scores = Scores {
        records: Vec::new(),
        identify: None,
        validate: None,
    };
    let (mut identify, mut validate) = (Sums::default(), Sums::default());
    let mut runs = Vec::new();
    for record in records {
        let run = match model.free_run(record) {
            Ok(run) => run,
            Err(error) => instead(record, error)?,
        };
        let sums = Sums::of(record, &run);
        scores
            .records
            .push(sums.indicators(&record.name, record.role));
        match record.role {
            Use::Identify => identify.add(&sums),
            Use::Validate => validate.add(&sums),
        }
        runs.push(run);
    }
    let together =
        |sums: &Sums, name, role| (sums.samples > 0.0).then(|| sums.indicators(name, role));
    scores.identify = together(&identify, "identify", Use::Identify);
    scores.validate = together(&validate, "validate", Use::Validate);
    Ok((scores, runs))
}
