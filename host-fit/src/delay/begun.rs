//! The first sample of each record that a delay study uses. The preparation determines it; it does not lie before
//! the response to the record's own commands.

use crate::data::{DataSet, Record, Use};
use crate::preparation::Preparation;

/// A record and the start of its usable part.
pub(super) struct Begun {
    /// The record from the first sample that no earlier command influences.
    pub(super) whole: Record,
    /// If an edge before the first sample was inferred: the record without the response to that edge.
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

    /// `answers` is the longest response time to a command before the record, samples.
    fn of(record: &Record, prepared: &Record, answers: usize) -> Self {
        let whole = Record {
            u: prepared.u.clone(),
            u_before: prepared.u_before,
            // Slower responses are part of the plant's free initial state.
            followed: first_of(&prepared.followed, answers),
            ..record.clone()
        };
        let first = whole.u.first().copied();
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

    /// The part for fitting a plant: an edge time that is wrong by a few samples would bias the dead time and
    /// a time constant.
    pub(super) fn sure(&self) -> &Record {
        self.shown.as_ref().unwrap_or(&self.whole)
    }
}

fn first_of(series: &[f64], count: usize) -> Vec<f64> {
    series.iter().take(count).copied().collect()
}
