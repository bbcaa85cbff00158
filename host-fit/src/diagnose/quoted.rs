//! The final model's error on records that played no part in choosing it.

use super::RULES;
use crate::data::{Record, Use};
use crate::indicators::score;
use crate::model::Model;
use serde::Serialize;

/// Errors of the given and the final model on records that played no part in choosing the structure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quoted {
    /// Names of the records.
    pub records: Vec<String>,
    /// Root mean square of the given model's free-run error on these records, y.
    pub before_rmse: f64,
    /// Root mean square of the final model's free-run error on these records, y.
    pub validate_rmse: f64,
    /// The noise level on these records, y rms; none without y_sd.
    pub noise_rmse: Option<f64>,
}

/// Splits the validation records: every third one is set aside for an independent estimate, the structure is
/// chosen on the others. `None` if there are too few.
pub(crate) fn kept_back(records: &[Record]) -> Option<(Vec<Record>, Vec<Record>)> {
    let held_out = records.iter().filter(|r| r.role == Use::Validate).count();
    if held_out < RULES.enough_to_quote {
        return None;
    }
    let (mut chosen_by, mut kept) = (Vec::new(), Vec::new());
    let mut met = 0;
    for record in records {
        met += usize::from(record.role == Use::Validate);
        if record.role == Use::Validate && met % 3 == 0 {
            kept.push(record.clone());
        } else {
            chosen_by.push(record.clone());
        }
    }
    Some((chosen_by, kept))
}

impl Quoted {
    /// Errors of both models on `kept`; `None` if one diverges.
    pub(super) fn of(given: &Model, last: &Model, kept: &[Record]) -> Option<Self> {
        let (before, after) = (score(given, kept).ok()?.0, score(last, kept).ok()?.0);
        Some(Self {
            records: kept.iter().map(|record| record.name.clone()).collect(),
            before_rmse: before.validate?.rmse,
            validate_rmse: after.validate.as_ref()?.rmse,
            noise_rmse: after.validate?.noise_rmse,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_third_of_four_held_out_records_is_kept_back_and_of_three_none() {
        let record = |name: &str, role| Record::new(name, role, 0.001, vec![0.0; 4], vec![0.0; 4]);
        let set = |held_out: usize| -> Vec<Record> {
            let names = ["a", "b", "c", "d", "e", "f"];
            let held_out = names
                .iter()
                .take(held_out)
                .map(|n| record(n, Use::Validate));
            std::iter::once(record("own", Use::Identify))
                .chain(held_out)
                .collect()
        };
        let names = |records: &[Record]| -> Vec<String> {
            records.iter().map(|r| r.name.clone()).collect()
        };
        assert!(kept_back(&set(3)).is_none());
        let (_, kept) = kept_back(&set(4)).expect("enough to quote on");
        assert_eq!(names(&kept), ["c"]);
        let (chosen_by, kept) = kept_back(&set(6)).expect("enough to quote on");
        assert_eq!(names(&kept), ["c", "f"]);
        assert_eq!(names(&chosen_by), ["own", "a", "b", "d", "e"]);
    }
}
