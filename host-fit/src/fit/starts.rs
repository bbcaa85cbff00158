//! Where the search of an effect's parameters sets out: what its card says, for
//! these records and this model.

use super::rules::RULES;
use crate::data::Record;
use crate::model::Model;
use model_core::effect::{Facts, Parameter, Spec, StartValue, Starts};

/// The size of a signal: 1 where it is of order 1, as the catalogue's ranges are.
fn size_of(records: &[&Record], signal: impl Fn(&Record) -> &[f64]) -> f64 {
    let values = records.iter().flat_map(|record| signal(record));
    let size = values.fold(0.0, |size: f64, value| size.max(value.abs()));
    if (RULES.order_one_low..RULES.order_one_high).contains(&size) || size == 0.0 {
        1.0
    } else {
        size
    }
}

/// Root mean square change of y over a sample.
fn y_per_sample(records: &[&Record]) -> f64 {
    let changes = records
        .iter()
        .flat_map(|r| r.y.windows(2).map(|pair| pair[1] - pair[0]));
    let (sum, count) = changes.fold((0.0, 0.0), |(s, n), change| (s + change * change, n + 1.0));
    f64::sqrt(sum / f64::max(count, 1.0))
}

/// Parameter vectors from which a fit of `base` with `spec` sets out.
pub(super) fn starts(base: &Model, spec: &Spec, records: &[&Record]) -> Vec<Vec<f64>> {
    let mut sorted_y: Vec<f64> = records.iter().flat_map(|r| r.y.iter().copied()).collect();
    sorted_y.sort_by(f64::total_cmp);
    let period = base.sample_period_s;
    let longest = records.iter().map(|r| r.len()).max().unwrap_or(0);
    let y = size_of(records, |record| &record.y);
    let facts = Facts {
        y,
        u: size_of(records, |record| &record.u),
        time: 1.0,
        y_per_sample: y_per_sample(records),
        sorted_y: &sorted_y,
        // In the middle of a law's range.
        delay: base.delay.present(0.5 * y, period),
        period,
        record: longest as f64 * period,
        time_constant: base.time_constant().min(longest as f64 * period),
    };
    match spec.starts {
        Starts::Grid => product(spec.parameters, &facts),
        Starts::Rows(rows) => {
            let values = |row: &&[StartValue]| {
                let each = row.iter().zip(spec.parameters);
                each.map(|(start, p)| start.value(p, &facts)).collect()
            };
            rows.iter().map(values).collect()
        }
    }
}

/// Every combination of the catalogue's starting values.
fn product(parameters: &[Parameter], facts: &Facts<'_>) -> Vec<Vec<f64>> {
    let mut all = vec![Vec::new()];
    for parameter in parameters {
        let extended = all.iter().flat_map(|start| {
            parameter.starts.iter().map(move |value| {
                let mut longer = start.clone();
                longer.push(StartValue::Number(*value).value(parameter, facts));
                longer
            })
        });
        all = extended.collect();
    }
    // Thinned evenly, so that no parameter keeps only its first value.
    let stride = all.len().div_ceil(RULES.most_starts).max(1);
    all.into_iter().step_by(stride).collect()
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
        assert!(found("attachment-hysteresis", 1.0).len() <= RULES.most_starts);
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
