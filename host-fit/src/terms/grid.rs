//! Parameter vectors over the ranges of an effect's card.

use super::RULES;
use crate::fit::{Known, combinations, rows};
use crate::model::Model;
use model_core::effect::{Influence, Parameter, Place, Spec, StartValue, Starts, Unit};

/// The longest lag that is tried in records of at least `shortest` samples.
pub(super) fn longest_lag(period_s: f64, shortest: usize) -> u16 {
    let longest = (RULES.longest_lag_s / period_s).round();
    let share = RULES.longest_lag_share * shortest as f64;
    longest.min(share).clamp(2.0, 4096.0) as u16
}

/// Whether the first-order prediction of an effect is useless at a wrong grid point: a threshold that is never crossed,
/// or limits outside the range of the biased base. The card of such an effect lists its grid points, or has parameters
/// that act in steps.
pub(super) fn hides(spec: &Spec) -> bool {
    let mut parameters = spec.parameters.iter();
    let acts_in_steps = parameters.any(|p| p.influence == Influence::Stepwise);
    acts_in_steps || (spec.place != Place::Delay && matches!(spec.starts, Starts::Rows(_)))
}

/// Parameter vectors from which `spec` is screened, for `model`.
#[must_use]
pub(super) fn grid(spec: &Spec, model: &Model, known: &Known) -> Vec<Vec<f64>> {
    // y and u are of order 1 in inner units.
    let facts = known.facts(model, 1.0, 1.0);
    if let Some(rows) = rows(spec, &facts) {
        return rows;
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
            let levels = RULES.grid_of_levels.iter();
            levels
                .map(|share| StartValue::Level(*share).value(p, &facts))
                .collect()
        } else {
            let values = p.starts.iter();
            values
                .map(|v| StartValue::Number(*v).value(p, &facts))
                .collect()
        }
    };
    combinations(spec.parameters.iter().map(along))
}

/// Midpoints of equal parts of a logarithmic range.
fn logarithmic(p: &Parameter, count: usize) -> Vec<f64> {
    let share = |i: usize| (i as f64 + 0.5) / count as f64;
    let values = (0..count).map(|i| p.low * (p.high / p.low).powf(share(i)));
    values.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Record, Use};
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

    /// A user's effect with a threshold is screened over the levels of the records, wherever its own start is.
    #[test]
    fn a_threshold_in_y_is_screened_over_the_range_of_the_records() {
        const THRESHOLD: [Parameter; 1] =
            [Parameter::new("threshold", Unit::Y, [-10.0, 10.0], &[7.0]).stepwise()];
        let spec = Spec {
            parameters: &THRESHOLD,
            ..Spec::PLAIN
        };
        let y: Vec<f64> = (0..2000).map(|k| (k % 100) as f64 / 100.0).collect();
        let record = Record::new("r", Use::Identify, 0.001, vec![0.0; 2000], y);
        let levels = grid(&spec, &Model::default(), &Known::of(&[&record])).concat();
        assert_eq!(levels.len(), RULES.grid_of_levels.len());
        assert!(
            levels.iter().all(|y| (0.05..0.95).contains(y)),
            "{levels:?}"
        );
    }

    #[test]
    fn what_acts_at_thresholds_or_limits_hides_and_what_bends_the_flow_does_not() {
        let hiding = SPECS
            .iter()
            .filter(|spec| hides(spec))
            .map(|spec| spec.name);
        let hiding: Vec<&str> = hiding.collect();
        for name in ["attachment-hysteresis", "sensor-saturation"] {
            assert!(hiding.contains(&name), "{hiding:?}");
        }
        for name in [
            "echo-path",
            "hot-film-lag",
            "state-dependent-delay",
            "quadratic-drag",
        ] {
            assert!(!hiding.contains(&name), "{hiding:?}");
        }
    }
}
