//! Restarts of free runs for integrating plants. Their free run drifts, so an error over a whole record would
//! measure the drift of that record instead of the plant.

use super::rules::RULES;
use crate::data::Record;
use crate::model::{Model, Start};

/// Number of samples after which free runs of `model` are restarted from the measurement. None if the model
/// forgets its initial state well within a record, or starts from rest.
#[must_use]
pub fn restart_after(model: &Model, records: &[Record]) -> Option<usize> {
    let shortest = records.iter().map(Record::len).min()?;
    if model.start != Start::Measured || !remembers(model, shortest) {
        return None;
    }
    let memory = model.longest_lag().max(model.longest_delay()) + 1;
    let samples = (shortest / RULES.pieces).max(RULES.memories * memory);
    (samples < shortest / 2).then_some(samples)
}

/// Whether the initial state still influences the output after this many samples.
fn remembers(model: &Model, samples: usize) -> bool {
    let left = |pole: f64| pole.powf(samples as f64);
    model
        .largest_pole(false)
        .is_ok_and(|pole| left(pole) > RULES.drifts)
}

/// The pieces of whole records.
pub(crate) fn pieces_of<'r>(
    records: impl IntoIterator<Item = &'r Record>,
    samples: usize,
) -> Vec<Record> {
    let records = records.into_iter();
    records
        .flat_map(|record| pieces(record, 0, samples))
        .collect()
}

/// A record from sample `first` on, cut into pieces of this many scored samples. Each piece is preceded by samples in
/// which the run follows the measurement; the remainder belongs to the last piece.
pub(crate) fn pieces(record: &Record, first: usize, samples: usize) -> Vec<Record> {
    let count = (record.len().saturating_sub(first) / samples.max(1)).max(1);
    let end = |piece: usize| {
        if piece + 1 == count {
            record.len()
        } else {
            first + (piece + 1) * samples
        }
    };
    let follow = samples / RULES.memories;
    let piece = |piece: usize| {
        let from = first + piece * samples;
        let before = from.saturating_sub(follow);
        let mut part = record.part(before, end(piece));
        if from > 0 {
            part.lead = from - before;
            part.followed = part.y[..part.lead].to_vec();
        }
        part
    };
    (0..count).map(piece).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    fn model(a: [f64; 2]) -> Model {
        Model {
            start: Start::Measured,
            state_lags: vec![1, 2],
            a: a.to_vec(),
            ..Model::default()
        }
    }

    #[test]
    fn an_integrator_drifts_and_a_damped_rig_does_not() {
        let y = vec![0.0; 2000];
        let records = [Record::new("a", Use::Identify, 0.001, y.clone(), y)];
        // The models have a double pole at 1, and a pole at 1 together with a fast one.
        for a in [[2.0, -1.0], [1.9, -0.9]] {
            assert!(restart_after(&model(a), &records).is_some(), "{a:?}");
        }
        // The models have poles at 0.9, and a pair of oscillating poles of radius 0.96.
        for a in [[1.8, -0.81], [1.46, -0.93]] {
            assert_eq!(restart_after(&model(a), &records), None, "{a:?}");
        }
        let at_rest = Model {
            start: Start::Rest,
            ..model([2.0, -1.0])
        };
        assert_eq!(restart_after(&at_rest, &records), None);
    }
}
