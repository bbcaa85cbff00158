//! The delay of every edge, and the law through them.

use std::io;

use serde::{Serialize, Serializer};

use super::StepError;
use crate::data::{DataSet, Use};
use crate::delay::{DelayOptions, DelayStudy, EdgeDelay, study_delays};
use crate::excitation::Excitation;

/// The delays of a data set. Serialises to the keys of `delay --json`.
#[derive(Clone, Debug)]
pub struct DelayReport {
    /// Sampling period, s.
    pub sample_period_s: f64,
    /// W of the averaged output ỹ, samples.
    pub window: u32,
    /// Names of the records.
    pub records: Vec<String>,
    /// What was measured.
    pub study: DelayStudy,
    /// What the commands cannot tell, one sentence each.
    pub remarks: Vec<String>,
}

/// One edge as JSON and CSV have it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EdgeReport<'a> {
    record: &'a str,
    #[serde(rename = "use")]
    role: Use,
    edge: &'static str,
    sample: usize,
    time_s: f64,
    delay_samples: Option<f64>,
    standard_error_samples: Option<f64>,
    half_response_samples: Option<f64>,
    mean_output: Option<f64>,
    not_measured: Option<&'static str>,
}

impl<'a> From<&'a EdgeDelay> for EdgeReport<'a> {
    fn from(e: &'a EdgeDelay) -> Self {
        let onset = e.onset.ok();
        Self {
            record: &e.record,
            role: e.role,
            edge: if e.edge.rising { "rising" } else { "falling" },
            sample: e.edge.sample,
            time_s: e.time_s,
            delay_samples: onset.map(|o| o.delay),
            standard_error_samples: onset.map(|o| o.standard_error),
            half_response_samples: onset.and_then(|o| o.half_response),
            mean_output: e.mean_output,
            not_measured: e.onset.err().map(|u| u.words()),
        }
    }
}

impl DelayReport {
    /// Every edge as JSON and CSV have it.
    #[must_use]
    pub fn edges(&self) -> Vec<EdgeReport<'_>> {
        self.study.edges.iter().map(EdgeReport::from).collect()
    }

    /// Writes every edge as CSV.
    ///
    /// # Errors
    /// What the writer says.
    pub fn write_csv(&self, out: impl io::Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        for edge in self.edges() {
            csv.serialize(edge)?;
        }
        csv.flush()
    }
}

impl Serialize for DelayReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Document<'a> {
            sample_period_s: f64,
            window_samples: u32,
            law: Option<&'a crate::delay::DelayLawFit>,
            statistics: Option<&'a crate::delay::DelayStatistics>,
            verdict: crate::delay::DelayVerdict,
            words: &'a str,
            remarks: &'a [String],
            p_law: Option<f64>,
            p_law_within_direction: Option<f64>,
            p_direction: Option<f64>,
            direction_offset_samples: Option<f64>,
            edges: Vec<EdgeReport<'a>>,
        }
        let study = &self.study;
        let document = Document {
            sample_period_s: self.sample_period_s,
            window_samples: self.window,
            law: study.law.as_ref(),
            statistics: study.statistics.as_ref(),
            verdict: study.verdict,
            words: &study.words,
            remarks: &self.remarks,
            p_law: study.p_law,
            p_law_within_direction: study.p_law_within_direction,
            p_direction: study.p_direction,
            direction_offset_samples: study.direction_offset,
            edges: self.edges(),
        };
        document.serialize(serializer)
    }
}

/// Measures the delay of the response to every edge of the command, and fits the law (2) to the identify records.
///
/// ```
/// use host_fit::data::DataSet;
/// use host_fit::delay::DelayOptions;
/// use host_fit::steps::measure_delays;
///
/// let set = DataSet::load("../data/paper-like".as_ref())?;
/// let measured = measure_delays(&set, &DelayOptions::default())?;
/// let law = measured.study.law.as_ref().ok_or("no law")?;
/// println!("{}", measured.study.words);
/// assert!((20.0..80.0).contains(&law.p0.value));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError::Data`] when the command is not on/off.
pub fn measure_delays(set: &DataSet, options: &DelayOptions) -> Result<DelayReport, StepError> {
    Ok(DelayReport {
        sample_period_s: set.sample_period_s,
        window: options.window,
        records: set.records.iter().map(|r| r.name.clone()).collect(),
        study: study_delays(set, options)?,
        remarks: Excitation::of(set, options.max_delay).remarks,
    })
}
