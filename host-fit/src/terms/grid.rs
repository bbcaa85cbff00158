//! Parameter vectors over the ranges of an effect's card.

use super::RULES;
use crate::data::Record;
use crate::model::Model;
use model_core::effect::{Facts, Parameter, Spec, StartValue, Starts, Unit};

/// The longest lag that is tried in records of at least `shortest` samples.
pub(super) fn longest_lag(period_s: f64, shortest: usize) -> u16 {
    let longest = (RULES.longest_lag_s / period_s).round();
    let share = RULES.longest_lag_share * shortest as f64;
    longest.min(share).clamp(2.0, 4096.0) as u16
}

/// What the records say, for ranges and starting values.
#[derive(Clone, Debug)]
pub struct Known {
    sorted_y: Vec<f64>,
    y_per_sample: f64,
    longest: usize,
}

impl Known {
    /// Of records in the search's own units.
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

    fn facts(&self, model: &Model) -> Facts<'_> {
        let period = model.sample_period_s;
        let record = self.longest as f64 * period;
        Facts {
            y: 1.0,
            u: 1.0,
            time: 1.0,
            y_per_sample: self.y_per_sample,
            sorted_y: &self.sorted_y,
            // In the middle of a law's range: y is of order 1.
            delay: model.delay.present(0.5, period),
            period,
            record,
            time_constant: model.time_constant().min(record),
        }
    }
}

/// Parameter vectors from which `spec` is screened, for `model`.
#[must_use]
pub(super) fn grid(spec: &Spec, model: &Model, known: &Known) -> Vec<Vec<f64>> {
    let facts = known.facts(model);
    if let Starts::Rows(rows) = spec.starts {
        let values = |row: &&[StartValue]| {
            let each = row.iter().zip(spec.parameters);
            each.map(|(start, p)| start.value(p, &facts)).collect()
        };
        return rows.iter().map(values).collect();
    }
    let linear = spec.amplitude.filter(|amplitude| amplitude.linear);
    let scales = |p: &Parameter| linear.is_some_and(|amplitude| amplitude.parameter == p.name);
    let free = spec
        .parameters
        .iter()
        .filter(|p| !scales(p) && p.low < p.high);
    let points = RULES.grid[free.count().clamp(1, RULES.grid.len()) - 1];
    let along = |p: &Parameter| -> Vec<f64> {
        let middle = |starts: &[f64]| starts.get(starts.len() / 2).copied().unwrap_or(p.low);
        if scales(p) {
            vec![StartValue::Number(middle(p.starts)).value(p, &facts)]
        } else if p.low >= p.high {
            vec![p.low]
        } else if p.unit == Unit::Hertz {
            logarithmic(p, RULES.grid_of_frequencies)
        } else if p.is_logarithmic() {
            logarithmic(p, points)
        } else if p.unit == Unit::Y {
            let (low, high) = (facts.quantile(0.05), facts.quantile(0.95));
            let levels = RULES.grid_of_levels.iter();
            levels.map(|q| low + q * (high - low)).collect()
        } else {
            let values = p.starts.iter();
            values
                .map(|v| StartValue::Number(*v).value(p, &facts))
                .collect()
        }
    };
    let mut all = vec![Vec::new()];
    for parameter in spec.parameters {
        let values = along(parameter);
        let longer = all.iter().flat_map(|start: &Vec<f64>| {
            let with = |value: &f64| [start.as_slice(), &[*value]].concat();
            values.iter().map(with)
        });
        all = longer.collect();
    }
    // Where levels come in pairs, the first is the upper one.
    let levels: Vec<usize> = (0..spec.parameters.len())
        .filter(|i| {
            let p = &spec.parameters[*i];
            p.unit == Unit::Y && !scales(p)
        })
        .collect();
    if let [first, second] = levels.as_slice() {
        all.retain(|values| values[*first] > values[*second]);
    }
    all
}

/// The middles of equal shares of the logarithmic range.
fn logarithmic(p: &Parameter, count: usize) -> Vec<f64> {
    let share = |i: usize| (i as f64 + 0.5) / count as f64;
    let values = (0..count).map(|i| p.low * (p.high / p.low).powf(share(i)));
    values.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use model_core::effects::SPECS;

    #[test]
    fn every_effect_has_a_grid_of_bearable_size_inside_its_ranges() {
        let y: Vec<f64> = (0..2000).map(|k| (k % 100) as f64 / 100.0).collect();
        let record = Record::new("r", Use::Identify, 0.001, vec![0.0; 2000], y);
        let model = Model::default();
        let known = Known::of(&[&record]);
        for spec in SPECS {
            let grid = grid(spec, &model, &known);
            assert!(
                (1..=RULES.grid_of_frequencies * RULES.grid[1]).contains(&grid.len()),
                "{}: {}",
                spec.name,
                grid.len()
            );
            for values in &grid {
                assert_eq!(values.len(), spec.parameters.len(), "{}", spec.name);
                assert!(values.iter().all(|v| v.is_finite()), "{}", spec.name);
            }
        }
    }
}
