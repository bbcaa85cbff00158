//! Where the records of a study begin to count: as the preparation says, and no sooner than what they show is answered.

use crate::data::{DataSet, Record, Use};
use crate::preparation::Preparation;

/// A record with what is known of its beginning.
pub(super) struct Begun {
    /// From its first sample that answers nothing from before it.
    pub(super) whole: Record,
    /// The same where an edge before its first sample was only inferred: what answers that does not count.
    shown: Option<Record>,
}

impl Begun {
    /// Every record of a data set.
    pub(super) fn all(set: &DataSet) -> Vec<Self> {
        let prepared = Preparation::of(&set.records);
        let dead_time = prepared.reference.map_or(0.0, |r| r.dead_time);
        let answers = dead_time.ceil() as usize + 2;
        let each = set.records.iter().zip(&prepared.records);
        each.map(|(record, prepared)| Self::of(record, prepared, answers))
            .collect()
    }

    /// `answers` is how long a command before the record is answered at most, samples.
    fn of(record: &Record, prepared: &Record, answers: usize) -> Self {
        let whole = Record {
            u_before: prepared.u_before,
            // What is slower is the free state of a plant.
            followed: first_of(&prepared.followed, answers),
            ..record.clone()
        };
        let first = record.u.first().copied();
        let inferred = record.u_before.is_none() && whole.u_before != first;
        let is_shown = whole.u.iter().any(|u| Some(*u) != first);
        let shown = (inferred && is_shown).then(|| Record {
            u_before: first,
            followed: first_of(&whole.y, answers.min(whole.len() / 4)),
            ..whole.clone()
        });
        Self { whole, shown }
    }

    pub(super) fn is_learned(&self) -> bool {
        self.whole.role == Use::Identify
    }

    /// What a plant is fitted to: an edge that is a few samples off makes a dead time of that and another time constant.
    pub(super) fn sure(&self) -> &Record {
        self.shown.as_ref().unwrap_or(&self.whole)
    }
}

fn first_of(series: &[f64], count: usize) -> Vec<f64> {
    series.iter().take(count).copied().collect()
}
