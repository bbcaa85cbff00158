//! The delays of all edges, and the law fitted to them.

use std::io;

use serde::{Serialize, Serializer};

use super::StepError;
use super::memory::Work;
use crate::data::{DataSet, Use};
use crate::delay::{DeadTime, DelayOptions, DelayStudy, EdgeDelay, study_delays};
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
    /// The measurement.
    pub study: DelayStudy,
    /// Remarks on the excitation, one sentence each.
    pub remarks: Vec<String>,
}

/// An edge in JSON and CSV.
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
    delay_s: Option<f64>,
    standard_error_s: Option<f64>,
    mean_output: Option<f64>,
    not_measured: Option<&'static str>,
}

impl<'a> EdgeReport<'a> {
    fn of(e: &'a EdgeDelay, sample_period_s: f64) -> Self {
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
            delay_s: onset.map(|o| o.delay * sample_period_s),
            standard_error_s: onset.map(|o| o.standard_error * sample_period_s),
            mean_output: e.mean_output,
            not_measured: e.onset.err().map(|u| u.words()),
        }
    }
}

impl DelayReport {
    /// All edges for JSON and CSV.
    #[must_use]
    pub fn edges(&self) -> Vec<EdgeReport<'_>> {
        let each = self.study.edges.iter();
        each.map(|e| EdgeReport::of(e, self.sample_period_s))
            .collect()
    }

    /// Writes all edges as CSV.
    ///
    /// # Errors
    /// Errors of the writer.
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
        /// A dead time in samples and in seconds.
        #[derive(Serialize)]
        struct Both {
            samples: f64,
            standard_error_samples: f64,
            low_samples: f64,
            high_samples: f64,
            seconds: f64,
            standard_error_s: f64,
            low_s: f64,
            high_s: f64,
        }
        let both = |time: DeadTime| {
            let in_seconds = time.scaled(self.sample_period_s);
            Both {
                samples: time.samples,
                standard_error_samples: time.standard_error,
                low_samples: time.low,
                high_samples: time.high,
                seconds: in_seconds.samples,
                standard_error_s: in_seconds.standard_error,
                low_s: in_seconds.low,
                high_s: in_seconds.high,
            }
        };
        #[derive(Serialize)]
        struct Document<'a> {
            sample_period_s: f64,
            window_samples: u32,
            max_delay_samples: usize,
            reach_samples: usize,
            method: crate::delay::DelayMethod,
            plant: Option<crate::delay::ResponsePlant>,
            dead_time: Option<Both>,
            dead_time_rising: Option<Both>,
            dead_time_falling: Option<Both>,
            law_not_kept: Option<&'a str>,
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
            max_delay_samples: study.max_delay,
            reach_samples: study.reach,
            method: study.method,
            plant: study.plant,
            dead_time: study.dead_time.map(both),
            dead_time_rising: study.rising.map(both),
            dead_time_falling: study.falling.map(both),
            law_not_kept: study.law_not_kept.as_deref(),
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
/// let dead_time = measured.study.dead_time.ok_or("no response")?;
/// println!("{}", measured.study.words);
/// assert!((40.0..65.0).contains(&dead_time.samples));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError::Data`] when an on/off command has values that are neither 0 nor 1.
pub fn measure_delays(set: &DataSet, options: &DelayOptions) -> Result<DelayReport, StepError> {
    Work::Delay.fits(set)?;
    let study = study_delays(set, options)?;
    Ok(DelayReport {
        sample_period_s: set.sample_period_s,
        window: options.window,
        records: set.records.iter().map(|r| r.name.clone()).collect(),
        remarks: Excitation::of(set, study.max_delay).remarks,
        study,
    })
}
