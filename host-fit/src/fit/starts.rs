//! Starting values of the search of an effect's parameters: those of its card, for these records and this model.

use super::rules::RULES;
use crate::data::Record;
use crate::model::Model;
use model_core::effect::{Facts, Spec, StartValue, Starts};

/// The size of a signal: 1 if it is of order 1, for which the catalogue's ranges are valid.
fn size_of(records: &[&Record], signal: impl Fn(&Record) -> &[f64]) -> f64 {
    let values = records.iter().flat_map(|record| signal(record));
    let size = values.fold(0.0, |size: f64, value| size.max(value.abs()));
    if (RULES.order_one_low..RULES.order_one_high).contains(&size) || size == 0.0 {
        1.0
    } else {
        size
    }
}

/// Properties of the records from which ranges and starting values are computed.
#[derive(Clone, Debug)]
pub struct Known {
    sorted_y: Vec<f64>,
    /// Root mean square change of y over a sample.
    y_per_sample: f64,
    longest: usize,
}

impl Known {
    /// The properties of records in the units in which models are fitted.
    #[must_use]
    pub fn of(records: &[&Record]) -> Self {
        let mut sorted_y: Vec<f64> = records.iter().flat_map(|r| r.y.iter().copied()).collect();
        sorted_y.sort_by(f64::total_cmp);
        let changes = records
            .iter()
            .flat_map(|r| r.y.windows(2).map(|pair| pair[1] - pair[0]));
        let (sum, count) =
            changes.fold((0.0, 0.0), |(s, n), change| (s + change * change, n + 1.0));
        Self {
            sorted_y,
            y_per_sample: f64::sqrt(sum / f64::max(count, 1.0)),
            longest: records.iter().map(|r| r.len()).max().unwrap_or(0),
        }
    }

    /// The properties that cards use, for `model`; `y` and `u` are the sizes of the signals.
    pub(crate) fn facts(&self, model: &Model, y: f64, u: f64) -> Facts<'_> {
        let period = model.sample_period_s;
        let record = self.longest as f64 * period;
        Facts {
            y,
            u,
            time: 1.0,
            y_per_sample: self.y_per_sample,
            sorted_y: &self.sorted_y,
            // The delay is that in the middle of a law's range.
            delay: model.delay.present(0.5 * y, period),
            period,
            record,
            time_constant: model.time_constant().min(record),
        }
    }
}

/// Parameter vectors at which a fit of `base` with `spec` starts.
pub(crate) fn starts(base: &Model, spec: &Spec, records: &[&Record]) -> Vec<Vec<f64>> {
    let (y, u) = (
        size_of(records, |record| &record.y),
        size_of(records, |record| &record.u),
    );
    let known = Known::of(records);
    let facts = known.facts(base, y, u);
    if let Some(rows) = rows(spec, &facts) {
        return rows;
    }
    let all = combinations(spec.parameters.iter().map(|parameter| {
        let values = parameter.starts.iter();
        values
            .map(|value| StartValue::Number(*value).value(parameter, &facts))
            .collect()
    }));
    // The list is reduced evenly, so that no parameter keeps only its first value.
    let stride = all.len().div_ceil(RULES.most_starts).max(1);
    all.into_iter().step_by(stride).collect()
}

/// The starting values that a card lists; `None` if the card specifies a grid.
pub(crate) fn rows(spec: &Spec, facts: &Facts<'_>) -> Option<Vec<Vec<f64>>> {
    let Starts::Rows(rows) = spec.starts else {
        return None;
    };
    let values = |row: &&[StartValue]| {
        let each = row.iter().zip(spec.parameters);
        each.map(|(start, p)| start.value(p, facts)).collect()
    };
    Some(rows.iter().map(values).collect())
}

/// Every combination of one value of each list; the last list changes fastest.
pub(crate) fn combinations(lists: impl Iterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
    lists.fold(vec![Vec::new()], |all, values| {
        let longer = all.iter().flat_map(|start: &Vec<f64>| {
            let with = |value: &f64| [start.as_slice(), &[*value]].concat();
            values.iter().map(with)
        });
        longer.collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use crate::model::Delay;
    use model_core::effects::spec;

    fn found(name: &str, y: f64) -> Vec<Vec<f64>> {
        let record = Record::new(
            "r",
            Use::Identify,
            0.001,
            vec![1.0; 1001],
            (0..1001).map(|k| y * f64::from(k) / 1000.0).collect(),
        );
        let base = Model {
            delay: Delay::Fixed { delays: vec![40] },
            ..Model::default()
        };
        starts(&base, spec(name).expect("in the catalogue"), &[&record])
    }

    #[test]
    fn starts_follow_cards_and_data() {
        assert_eq!(found("thermal-drift", 1.0).len(), 3);
        assert_eq!(found("state-dependent-delay", 1.0)[0], [37.0, 10.0, 4.0]);
        assert_eq!(found("edge-dependent-delay", 1.0)[0], [0.046, 0.034]);
        assert_eq!(found("sensor-saturation", 1.0)[0], [0.05, 0.95]);
        // The usual change of y is 1/1000.
        let level = found("dry-friction", 1.0)[1][0];
        assert!((level - 0.03e-3).abs() < 1e-12);
        let levels = found("attachment-hysteresis", 1.0);
        let between = |row: &Vec<f64>| 0.05 < row[1] && row[1] < row[0] && row[0] < 0.95;
        assert!(levels.iter().all(between), "{levels:?}");
        assert!(found("bouc-wen-hysteresis", 1.0).len() <= RULES.most_starts);
    }

    /// In other units of y the same physics is tried.
    #[test]
    fn starts_scale_with_y() {
        for spec in model_core::effects::SPECS {
            for (one, other) in found(spec.name, 1.0).iter().zip(found(spec.name, 50.0)) {
                for (i, p) in spec.parameters.iter().enumerate() {
                    let expected = one[i] * p.unit.scale(50.0, 1.0, 1.0);
                    let off = (other[i] - expected).abs() / expected.abs().max(1e-9);
                    assert!(
                        off < 1e-9,
                        "{}.{}: {} {expected}",
                        spec.name,
                        p.name,
                        other[i]
                    );
                }
            }
        }
    }
}
