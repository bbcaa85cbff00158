//! Whether a curve has the region in which the physics deviates.

use firmware_sim::recording::Recorded;
use host_fit::data::Record;

/// F1 score of the samples that `curve` assigns to the deviating region, if the truth is a `coordinate` above
/// `above`; 0 for a curve that assigns none.
///
/// The curve is cut in the middle between its highest and its lowest value on the samples. The side with fewer
/// samples counts as the deviating region.
pub(super) fn f1(set: &Recorded, coordinate: &str, above: f64, curve: &[(f64, f64)]) -> f64 {
    let records = set.data.records.iter().zip(&set.noise_free);
    let x: Vec<f64> = records
        .flat_map(|(record, y)| match coordinate {
            "y" => y.clone(),
            "rest before" => rests(record),
            _ => (0..y.len())
                .map(|k| k as f64 * record.sample_period_s)
                .collect(),
        })
        .collect();
    let g: Vec<f64> = x.iter().map(|x| at(curve, *x)).collect();
    let (low, high) = g
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), g| {
            (l.min(*g), h.max(*g))
        });
    if high <= low {
        return 0.0;
    }
    let middle = 0.5 * (low + high);
    let upper = g.iter().filter(|g| **g > middle).count();
    let broken_is_upper = 2 * upper <= g.len();
    let (mut both, mut told, mut true_) = (0, 0, 0);
    for (x, g) in x.iter().zip(&g) {
        let is_told = (*g > middle) == broken_is_upper;
        let is_true = *x > above;
        told += usize::from(is_told);
        true_ += usize::from(is_true);
        both += usize::from(is_told && is_true);
    }
    2.0 * both as f64 / (told + true_).max(1) as f64
}

/// Assumed rest before the record (s).
const LONG_AGO_S: f64 = 10.0;

/// Length of the rest before the last pulse (s), from the first pulse on.
fn rests(record: &Record) -> Vec<f64> {
    let period = record.sample_period_s;
    let (mut since_fall, mut rest, mut was_on) = (LONG_AGO_S, None, false);
    let mut all = Vec::new();
    for u in &record.u {
        let on = *u > 0.0;
        if on && !was_on {
            rest = Some(since_fall);
        }
        since_fall = if on { 0.0 } else { since_fall + period };
        was_on = on;
        all.extend(rest);
    }
    all
}

/// The curve's value, linear between its points and constant outside.
fn at(curve: &[(f64, f64)], x: f64) -> f64 {
    let after = curve.partition_point(|(own, _)| *own <= x);
    match (after.checked_sub(1).map(|i| curve[i]), curve.get(after)) {
        (Some((x0, g0)), Some((x1, g1))) => g0 + (g1 - g0) * (x - x0) / (x1 - x0),
        (Some((_, g)), None) | (None, Some(&(_, g))) => g,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_fit::data::{DataSet, Use};

    fn set() -> Recorded {
        let on = |k: usize| k % 10 >= 5 && k < 60 || (90..95).contains(&k);
        let u: Vec<f64> = (0..100).map(|k| f64::from(u8::from(on(k)))).collect();
        let y: Vec<f64> = (0..100).map(|k| 0.01 * k as f64).collect();
        let record = Record::new("one", Use::Identify, 0.001, u, y.clone());
        Recorded {
            data: DataSet::from_records(None, vec![record]).unwrap(),
            noise_free: vec![y],
        }
    }

    #[test]
    fn the_side_with_fewer_samples_is_the_broken_one() {
        let step = |at: f64| [(0.0, 0.1), (at - 1e-9, 0.1), (at, -0.2), (1.0, -0.2)];
        assert_eq!(f1(&set(), "y", 0.795, &step(0.795)), 1.0);
        // The curve finds ten of twenty samples, and no wrong one.
        assert!((f1(&set(), "y", 0.795, &step(0.895)) - 2.0 * 10.0 / 30.0).abs() < 1e-12);
        assert_eq!(f1(&set(), "y", 0.795, &[(0.0, 0.1), (1.0, 0.1)]), 0.0);
    }

    #[test]
    fn rests_are_those_of_the_command() {
        let curve = [(0.0, 0.0), (0.02, 0.0), (0.03, 1.0)];
        // The first pulse follows an infinitely long rest, the last one a rest of 30 ms.
        let rests = rests(&set().data.records[0]);
        assert_eq!(rests.len(), 95);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(rests[0] > 9.0 && close(rests[15], 0.005) && close(rests[94], 0.030));
        assert_eq!(f1(&set(), "rest before", 0.025, &curve), 1.0);
    }
}
