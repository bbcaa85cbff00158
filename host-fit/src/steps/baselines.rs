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
        Self {
            words: found.words(&fits),
            fits,
            scored_samples: scored,
            samples,
        }
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
