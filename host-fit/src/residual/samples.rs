//! Samples in each bar of "where it fails".

use super::binned::values;
use super::{Failures, Where};
use crate::data::Record;
use crate::picture::Stretches;

impl Failures {
    /// Bin of each sample, per coordinate and record, for highlighting on a page; validation and other
    /// records alike. `runs` are the free runs of `records`, `delay` the dead time from command to flow in
    /// samples.
    #[must_use]
    pub fn samples(
        &self,
        records: &[Record],
        runs: &[Vec<f64>],
        delay: usize,
    ) -> Vec<Vec<Stretches>> {
        let along = |found: &Where| {
            let pairs = records.iter().zip(runs);
            pairs
                .map(|(record, run)| {
                    let values = values(&found.coordinate, record, run, delay);
                    stretches(values.into_iter().map(|value| bin_of(found, value)))
                })
                .collect()
        };
        self.by.iter().map(along).collect()
    }
}

fn bin_of(found: &Where, value: f64) -> Option<u16> {
    let last = found.bins.len().checked_sub(1)?;
    let holds = |(i, bin): &(usize, &crate::picture::FailureBin)| {
        let below = if *i == last || bin.from == bin.to {
            value <= bin.to
        } else {
            value < bin.to
        };
        value >= bin.from && below
    };
    let (index, _) = found.bins.iter().enumerate().find(holds)?;
    u16::try_from(index).ok()
}

fn stretches(bins: impl Iterator<Item = Option<u16>>) -> Stretches {
    let mut found: Stretches = Vec::new();
    for bin in bins {
        match found.last_mut() {
            Some((before, count)) if *before == bin => *count += 1,
            _ => found.push((bin, 1)),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use crate::data::{Record, Use};
    use crate::residual::{FailureCoordinate, examine};

    /// The samples of a bar have the bar's error.
    #[test]
    fn the_samples_of_a_bar_have_its_error() {
        let n = 6000;
        let u: Vec<f64> = (0..n).map(|k| f64::from((k / 200) % 2)).collect();
        let run: Vec<f64> = (0..n).map(|k| (f64::from(k) * 0.01).sin()).collect();
        let y: Vec<f64> = run
            .iter()
            .enumerate()
            .map(|(k, y)| y + if k % 400 > 300 { 0.2 } else { 0.01 })
            .collect();
        let mut record = Record::new("r", Use::Validate, 0.001, u, y);
        record.y_sd = Some(vec![0.001; n as usize]);
        let failures = examine(&[&record], vec![run.clone()], 0);
        let records = [record];
        let samples = failures.samples(&records, std::slice::from_ref(&run), 0);
        let mut checked = 0;
        for (found, places) in failures.by.iter().zip(&samples) {
            if matches!(found.coordinate, FailureCoordinate::FrequencyBand) {
                assert!(places[0].is_empty());
                continue;
            }
            assert_eq!(places[0].iter().map(|(_, n)| n).sum::<usize>(), 6000);
            for (bin, bar) in found.bins.iter().enumerate() {
                let mut at = 0;
                let mut squares = Vec::new();
                for (place, count) in &places[0] {
                    if *place == Some(bin as u16) {
                        let errors = (at..at + count).map(|k| records[0].y[k] - run[k]);
                        squares.extend(errors.map(|e| e * e));
                    }
                    at += count;
                }
                let mean = squares.iter().sum::<f64>() / squares.len() as f64;
                if bar.rmse.is_finite() {
                    assert!(
                        (mean.sqrt() - bar.rmse).abs() < 1e-9,
                        "{}",
                        found.coordinate
                    );
                    checked += 1;
                }
            }
        }
        assert!(checked > 60, "{checked}");
    }
}
