//! Reference models: FIT of standard linear models on the scored samples.

use crate::baseline::{BaselineFits, Baselines};
use crate::data::{Record, Use};
use crate::preparation::scored_samples;
use serde::Serialize;

/// Baselines with the scored samples.
#[derive(Clone, Debug, Serialize)]
pub struct Beside {
    /// FIT of each baseline, %: on the validation records, or on the estimation records if there are none.
    #[serde(rename = "baselines")]
    pub fits: BaselineFits,
    /// Number of scored samples in all records.
    pub scored_samples: usize,
    /// Samples of all records.
    #[serde(skip)]
    pub samples: usize,
    /// Samples per dead time, or per time constant if that is shorter, of the first order.
    #[serde(skip)]
    per_motion: Option<f64>,
    /// The baselines in words, one line each.
    #[serde(skip)]
    pub words: Vec<String>,
}

impl Beside {
    /// Fits the baselines to the estimation records among prepared `records`, and scores them like models.
    pub(super) fn of(records: &[Record]) -> Self {
        let of = |role: Use| -> Vec<&Record> {
            let own = records.iter().filter(|record| record.role == role);
            own.collect()
        };
        let (mut learning, mut judged) = (of(Use::Identify), of(Use::Validate));
        if learning.is_empty() {
            learning.clone_from(&judged);
        }
        if judged.is_empty() {
            judged.clone_from(&learning);
        }
        let found = Baselines::fit(&learning);
        let ranges = judged
            .iter()
            .map(|record| (*record, record.lead..record.len()));
        let fits = found.fit_percent(&ranges.collect::<Vec<_>>());
        let (scored, samples) = scored_samples(records);
        let period_s = records.first().map(|record| record.sample_period_s);
        let motion_s = found.fopdt.as_ref().map(|first| match first.dead_time_s {
            none if none <= 0.0 => first.time_constant_s,
            dead_time => dead_time.min(first.time_constant_s),
        });
        Self {
            per_motion: motion_s
                .zip(period_s)
                .map(|(motion, period)| motion / period),
            words: found.words(&fits),
            fits,
            scored_samples: scored,
            samples,
        }
    }

    /// A note if the records are long and much faster than the plant.
    pub(super) fn much_faster(&self) -> Option<String> {
        let per_motion = self.per_motion.filter(|samples| samples.is_finite())?;
        let rows = (per_motion / SAMPLES_ENOUGH).floor();
        (self.samples >= MANY_SAMPLES && rows >= LEAST_ROWS).then(|| {
            format!(
                "The records have {per_motion:.0} samples in the dead time or time constant of the plant. `host-fit import \
                 --mean-of {rows:.0}` makes means of {rows:.0} rows: less noise, and every step is faster by about this factor."
            )
        })
    }

    /// A note if the best baseline has a higher FIT.
    pub(super) fn better_than(&self, fit_percent: f64) -> Option<String> {
        let (name, best) = self.fits.best()?;
        let behind = best - fit_percent;
        (behind.is_nan() || behind > BEHIND_POINTS).then(|| {
            format!(
                "A {name} reaches {best:.1} % FIT on the same samples, more than this model ({fit_percent:.1} %): the \
                 structure over-fits these records. Record for longer, with a more varied command."
            )
        })
    }
}

/// A model is replaced by a baseline with a FIT higher by this many points.
const BEHIND_POINTS: f64 = 1.0;

/// Means of rows are proposed for data sets of at least this many samples.
const MANY_SAMPLES: usize = 100_000;
/// Samples that means leave in the dead time and in the time constant, and the least number of rows of a mean.
const SAMPLES_ENOUGH: f64 = 20.0;
const LEAST_ROWS: f64 = 4.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_rows_are_proposed_for_long_records_that_are_much_faster_than_the_plant() {
        let note = |samples: usize, per_motion: f64| {
            let beside = Beside {
                fits: BaselineFits::default(),
                scored_samples: samples,
                samples,
                per_motion: Some(per_motion),
                words: Vec::new(),
            };
            beside.much_faster()
        };
        let said = note(400_000, 245.0).expect("a note");
        assert!(
            said.contains("245 samples") && said.contains("--mean-of 12"),
            "{said}"
        );
        assert!(note(400_000, 79.0).is_none());
        assert!(note(99_999, 245.0).is_none());
        assert!(note(400_000, f64::NAN).is_none());
    }
}
