//! Folds of estimation and validation: the `validate` records, each record in turn, or the end of the only
//! record.

use super::RULES;
use crate::data::{Record, Use};
use crate::fit::{pieces, pieces_of};
use crate::indicators::ErrorKind;

/// One split into estimation and validation samples.
#[derive(Clone, Debug)]
pub(crate) struct Fold {
    /// Estimation records.
    pub(crate) learning: Vec<Record>,
    /// Validation records, each scored from a sample on.
    pub(crate) judging: Vec<Judging>,
}

/// A validation record that is scored from a sample on. The run starts earlier, but its lead is not scored.
#[derive(Clone, Debug)]
pub(crate) struct Judging {
    pub(crate) record: Record,
    pub(crate) from: usize,
}

impl Judging {
    /// The first sample that is scored.
    pub(crate) fn scored_from(&self) -> usize {
        self.from.max(self.record.lead)
    }

    /// y of the last `samples` samples: those that are scored.
    pub(crate) fn last(&self, samples: usize) -> &[f64] {
        let y = &self.record.y;
        &y[y.len().saturating_sub(samples)..]
    }
}

impl Fold {
    /// This split with free runs restarted every `samples` samples.
    pub(crate) fn restarted(&self, samples: usize) -> Self {
        let judging = (self.judging.iter())
            .flat_map(|judging| pieces(&judging.record, judging.from, samples));
        Self {
            learning: pieces_of(&self.learning, samples),
            judging: judging.map(|record| Judging { record, from: 0 }).collect(),
        }
    }
}

/// The records by which models are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeldOutBy {
    /// The data set has `validate` records.
    Records,
    /// No `validate` record: cross-validation with each record left out in turn.
    Turns,
    /// One record only: estimated on its beginning, validated on its end.
    End,
}

impl HeldOutBy {
    /// The error by which hypotheses are compared.
    #[must_use]
    pub fn judged(self) -> ErrorKind {
        match self {
            Self::Records => ErrorKind::Validation,
            Self::Turns => ErrorKind::CrossValidation,
            Self::End => ErrorKind::RecordEnd,
        }
    }

    /// The error of a written model, as `compare` prints it.
    #[must_use]
    pub fn compared(self) -> ErrorKind {
        match self {
            Self::Records => ErrorKind::Validation,
            Self::Turns | Self::End => ErrorKind::Estimation,
        }
    }
}

/// The folds of a data set; none without estimation records.
pub(crate) fn folds(records: &[Record]) -> (Vec<Fold>, HeldOutBy) {
    let of = |role: Use| -> Vec<&Record> { records.iter().filter(|r| r.role == role).collect() };
    let (identify, validate) = (of(Use::Identify), of(Use::Validate));
    let owned = |records: &[&Record]| -> Vec<Record> {
        records.iter().map(|record| (*record).clone()).collect()
    };
    let whole = |record: &Record| Judging {
        record: record.clone(),
        from: 0,
    };
    if identify.is_empty() {
        return (Vec::new(), HeldOutBy::Records);
    }
    if !validate.is_empty() {
        let fold = Fold {
            learning: owned(&identify),
            judging: validate.iter().map(|r| whole(r)).collect(),
        };
        return (vec![fold], HeldOutBy::Records);
    }
    if let [only] = identify.as_slice() {
        // Before the first edge the records do not identify the response.
        let rest = first_edge(&only.u).unwrap_or(0);
        let from = rest + (RULES.learned_share * (only.len() - rest) as f64) as usize;
        let fold = Fold {
            learning: vec![only.part(0, from)],
            judging: vec![Judging {
                record: (*only).clone(),
                from,
            }],
        };
        return (vec![fold], HeldOutBy::End);
    }
    let count = identify.len().min(RULES.most_folds);
    let fold = |turn: usize| {
        let mut fold = Fold {
            learning: Vec::new(),
            judging: Vec::new(),
        };
        for (i, record) in identify.iter().enumerate() {
            if i % count == turn {
                fold.judging.push(whole(record));
            } else {
                fold.learning.push((*record).clone());
            }
        }
        fold
    };
    ((0..count).map(fold).collect(), HeldOutBy::Turns)
}

/// The first sample whose command differs from that of the preceding sample.
fn first_edge(u: &[f64]) -> Option<usize> {
    Some(u.windows(2).position(|pair| pair[0] != pair[1])? + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn record(name: &str, role: Use) -> Record {
        Record {
            name: name.to_owned(),
            role,
            sample_period_s: 0.001,
            t0: 0.0,
            u_before: None,
            lead: 0,
            y_before: None,
            followed: Vec::new(),
            u: vec![0.0; 10],
            y: (0..10).map(f64::from).collect(),
            y_sd: Some(vec![0.1; 10]),
            y_min: None,
            y_max: None,
            channels: BTreeMap::from([("u_inf".to_owned(), vec![9.0; 10])]),
        }
    }

    fn names(fold: &Fold) -> (Vec<&str>, Vec<&str>) {
        (
            fold.learning.iter().map(|r| r.name.as_str()).collect(),
            fold.judging
                .iter()
                .map(|j| j.record.name.as_str())
                .collect(),
        )
    }

    #[test]
    fn records_that_were_held_out_are_never_learned_from() {
        let set = [record("a", Use::Identify), record("b", Use::Validate)];
        let (folds, by) = folds(&set);
        assert_eq!(by, HeldOutBy::Records);
        assert_eq!(
            (by.judged(), by.compared()),
            (ErrorKind::Validation, ErrorKind::Validation)
        );
        assert_eq!(folds.len(), 1);
        assert_eq!(names(&folds[0]), (vec!["a"], vec!["b"]));
    }

    #[test]
    fn every_record_is_judged_once_in_turn() {
        let set: Vec<Record> = ["a", "b", "c", "d", "e"]
            .map(|n| record(n, Use::Identify))
            .into();
        let (folds, by) = folds(&set);
        assert_eq!(by, HeldOutBy::Turns);
        assert_eq!(
            (by.judged(), by.compared()),
            (ErrorKind::CrossValidation, ErrorKind::Estimation)
        );
        let mut judged: Vec<&str> = folds.iter().flat_map(|fold| names(fold).1).collect();
        judged.sort_unstable();
        assert_eq!(judged, ["a", "b", "c", "d", "e"]);
        for fold in &folds {
            let (learned, judged) = names(fold);
            assert_eq!(learned.len() + judged.len(), 5);
            assert!(judged.iter().all(|name| !learned.contains(name)));
        }
    }

    #[test]
    fn restarts_keep_every_sample_once() {
        let (folds, _) = folds(&[record("a", Use::Identify)]);
        let fold = folds[0].restarted(3);
        let lengths = |records: &[Record]| records.iter().map(Record::len).collect::<Vec<_>>();
        assert_eq!(lengths(&fold.learning), [3, 3]);
        let judged: Vec<f64> = fold
            .judging
            .iter()
            .flat_map(|j| j.record.y.clone())
            .collect();
        assert_eq!(judged, [6.0, 7.0, 8.0, 9.0]);
        assert!((fold.learning[1].t0 - 0.003).abs() < 1e-12);
    }

    /// A run that began at the first validated sample would lack the commands that are still in the delay.
    #[test]
    fn the_first_piece_follows_the_measurement_too() {
        let mut only = record("a", Use::Identify);
        only.u = vec![0.0; 100];
        only.y = (0..100).map(f64::from).collect();
        let (folds, _) = folds(&[only]);
        let from = folds[0].judging[0].from;
        let fold = folds[0].restarted(16);
        let first = &fold.judging[0].record;
        assert!(first.lead > 0 && first.followed.len() == first.lead);
        assert_eq!(first.y[first.lead], from as f64);
    }

    #[test]
    fn the_only_record_is_judged_at_its_end() {
        let (folds, by) = folds(&[record("a", Use::Identify)]);
        assert_eq!(by, HeldOutBy::End);
        assert_eq!(
            (by.judged(), by.compared()),
            (ErrorKind::RecordEnd, ErrorKind::Estimation)
        );
        assert_eq!(folds[0].learning[0].len(), 6);
        assert_eq!(folds[0].learning[0].channels["u_inf"].len(), 6);
        assert_eq!(folds[0].judging[0].from, 6);
        assert_eq!(folds[0].judging[0].record.len(), 10);
    }

    /// A single record is split after its first edge, so that the estimation part of a step test with a long rest
    /// contains the step.
    #[test]
    fn the_only_record_is_divided_from_its_first_edge_on() {
        let mut late = record("a", Use::Identify);
        late.u[5..].fill(1.0);
        let (folds, _) = folds(&[late]);
        assert_eq!(folds[0].learning[0].len(), 8);
        assert_eq!(folds[0].judging[0].from, 8);
    }
}
