//! Assignment of samples to the bins of each coordinate.

use super::coordinate::FailureCoordinate;
use super::rules::RULES;
use crate::data::Record;

/// Folds of the cross-validation of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Folds {
    /// Blocks of half a second in turn, for coordinates that repeat within a record.
    Blocks,
    /// Whole records, for time: an event in a single record does not count as a function of time.
    Records,
}

/// One coordinate over all records.
#[derive(Clone, Debug)]
pub(super) struct Binned {
    pub(super) coordinate: FailureCoordinate,
    pub(super) folds: Folds,
    /// Bin of every sample, per record; none where the coordinate is undefined.
    pub(super) bin: Vec<Vec<Option<u16>>>,
    /// Ends of the bins.
    pub(super) ranges: Vec<(f64, f64)>,
    /// For the time since an edge: ln of the dwell before it, in samples.
    pub(super) dwell: Option<Vec<Vec<f64>>>,
}

/// The data from which coordinates are computed; samples of a record's lead are not scored.
pub(super) struct Source<'a> {
    pub(super) records: &'a [&'a Record],
    /// y_sim per record.
    pub(super) simulated: &'a [Vec<f64>],
    /// Dead time from command to flow, samples.
    pub(super) delay: usize,
}

/// All coordinates that the records define.
pub(super) fn coordinates(source: &Source<'_>) -> Vec<Binned> {
    let period = source.records.first().map_or(1.0, |r| r.sample_period_s);
    let each = |coordinate: &FailureCoordinate| -> Vec<Vec<f64>> {
        let pairs = source.records.iter().zip(source.simulated);
        pairs
            .map(|(record, simulated)| values(coordinate, record, simulated, source.delay))
            .collect()
    };
    let time_folds = if source.records.len() > 1 {
        Folds::Records
    } else {
        Folds::Blocks
    };
    let mut all = Vec::new();
    let switches = source.records.iter().all(|r| has_edges(&r.u));
    if switches {
        for (coordinate, rising) in [
            (FailureCoordinate::SinceRisingEdge, true),
            (FailureCoordinate::SinceFallingEdge, false),
        ] {
            let since = each(&coordinate);
            let dwell = |r: &&Record| dwell_before_edge(&r.u, rising);
            let found = binned(source, coordinate, Folds::Blocks, &since);
            all.extend(found.map(|found| Binned {
                dwell: Some(source.records.iter().map(dwell).collect()),
                ..found
            }));
        }
    }
    let mut add = |coordinate: FailureCoordinate, folds| {
        let values = each(&coordinate);
        all.extend(binned(source, coordinate, folds, &values));
    };
    add(FailureCoordinate::LevelOfY, Folds::Blocks);
    let on_off = source.records.iter().all(|r| r.is_on_off());
    if !on_off {
        add(FailureCoordinate::LevelOfU, Folds::Blocks);
        add(FailureCoordinate::RateOfY, Folds::Blocks);
    }
    for samples in RULES.windows {
        let window_s = samples as f64 * period;
        if source.records.iter().any(|r| r.len() > 2 * samples) {
            let coordinate = if on_off {
                FailureCoordinate::Blowing { window_s }
            } else {
                FailureCoordinate::MeanInput { window_s }
            };
            add(coordinate, Folds::Blocks);
        }
    }
    add(FailureCoordinate::TimeInRecord, time_folds);
    let channels = source.records.first().map(|r| r.channels.keys());
    for channel in channels.into_iter().flatten() {
        if source
            .records
            .iter()
            .all(|r| r.channels.contains_key(channel))
        {
            add(FailureCoordinate::Channel(channel.clone()), Folds::Blocks);
        }
    }
    if switches {
        add(FailureCoordinate::PulseNumber, time_folds);
        let numbers = each(&FailureCoordinate::PulseNumber);
        for cycle in 2..=RULES.longest_cycle {
            all.push(modulo(source, &numbers, cycle));
        }
    }
    all
}

/// The coordinate at every sample of a record; NaN where it is undefined. `simulated` is the free run,
/// `delay` the dead time from command to flow in samples. Empty for the error's own frequency.
pub(super) fn values(
    coordinate: &FailureCoordinate,
    record: &Record,
    simulated: &[f64],
    delay: usize,
) -> Vec<f64> {
    let period = record.sample_period_s;
    match coordinate {
        FailureCoordinate::SinceRisingEdge => since_edge(&record.u, true, period),
        FailureCoordinate::SinceFallingEdge => since_edge(&record.u, false, period),
        FailureCoordinate::LevelOfY => simulated.to_vec(),
        FailureCoordinate::LevelOfU => record.u.clone(),
        FailureCoordinate::RateOfY => {
            let slopes = simulated
                .windows(2)
                .map(|pair| (pair[1] - pair[0]) / period);
            std::iter::once(0.0).chain(slopes).collect()
        }
        FailureCoordinate::Blowing { window_s } | FailureCoordinate::MeanInput { window_s } => {
            moving_mean(&record.u, window_samples(*window_s, period))
        }
        FailureCoordinate::TimeInRecord => (0..record.len()).map(|k| k as f64 * period).collect(),
        FailureCoordinate::Channel(name) => record.channels.get(name).cloned().unwrap_or_default(),
        FailureCoordinate::PulseNumber => pulse_number(&record.u, delay),
        FailureCoordinate::PulseInCycle { cycle } => {
            let numbers = pulse_number(&record.u, delay).into_iter();
            numbers.map(|number| number % *cycle as f64).collect()
        }
        FailureCoordinate::FrequencyBand => Vec::new(),
    }
}

fn window_samples(window_s: f64, period: f64) -> usize {
    (window_s / period).round().max(1.0) as usize
}

/// Whether the input is piecewise constant.
fn has_edges(u: &[f64]) -> bool {
    let changes = u.windows(2).filter(|pair| pair[0] != pair[1]).count();
    changes > 0 && (changes as f64) < RULES.most_changes * u.len() as f64
}

/// Time since the last rise (or fall) of the input; NaN before the first.
pub(super) fn since_edge(u: &[f64], rising: bool, period: f64) -> Vec<f64> {
    let mut before = 0.0;
    let mut last = None;
    let mut since = Vec::with_capacity(u.len());
    for (k, now) in u.iter().enumerate() {
        if (rising && *now > before) || (!rising && *now < before) {
            last = Some(k);
        }
        before = *now;
        since.push(last.map_or(f64::NAN, |edge| (k - edge) as f64 * period));
    }
    since
}

/// ln of the samples between the last rise (or fall) of the input and the edge
/// before it; 0 before the first.
fn dwell_before_edge(u: &[f64], rising: bool) -> Vec<f64> {
    let (mut before, mut edge, mut dwell) = (0.0, 0, 0.0);
    u.iter()
        .enumerate()
        .map(|(k, now)| {
            if *now != before {
                if (*now > before) == rising {
                    dwell = f64::ln((k - edge).max(1) as f64);
                }
                edge = k;
            }
            before = *now;
            dwell
        })
        .collect()
}

/// Moving average of the input over `samples`; the input before the record is 0.
fn moving_mean(u: &[f64], samples: usize) -> Vec<f64> {
    let mut sum = 0.0;
    u.iter()
        .enumerate()
        .map(|(k, now)| {
            sum += now;
            if let Some(old) = k.checked_sub(samples) {
                sum -= u[old];
            }
            sum / samples as f64
        })
        .collect()
}

/// Number of the pulse that acts on the flow, from 1; NaN before the first.
fn pulse_number(u: &[f64], delay: usize) -> Vec<f64> {
    let mut before = 0.0;
    let mut count = 0.0;
    let mut numbers = vec![f64::NAN; delay.min(u.len())];
    for now in u {
        if *now > before {
            count += 1.0;
        }
        before = *now;
        numbers.push(if count > 0.0 { count } else { f64::NAN });
    }
    numbers.truncate(u.len());
    numbers
}

fn modulo(source: &Source<'_>, numbers: &[Vec<f64>], cycle: usize) -> Binned {
    let class = |number: &f64| {
        number
            .is_finite()
            .then(|| (*number as usize % cycle) as u16)
    };
    let mut bin: Vec<Vec<Option<u16>>> = numbers
        .iter()
        .map(|record| record.iter().map(class).collect())
        .collect();
    blank(&mut bin, source.records);
    Binned {
        coordinate: FailureCoordinate::PulseInCycle { cycle },
        folds: Folds::Blocks,
        bin,
        ranges: (0..cycle).map(|c| (c as f64, c as f64)).collect(),
        dwell: None,
    }
}

fn blank(bin: &mut [Vec<Option<u16>>], records: &[&Record]) {
    for (bins, record) in bin.iter_mut().zip(records) {
        bins.iter_mut().take(record.lead).for_each(|b| *b = None);
    }
}

/// Removes bins that only one record reaches: they would identify the record, not the coordinate.
fn keep_shared(bin: &mut [Vec<Option<u16>>], bins: usize) {
    let mut reached = vec![0; bins];
    for record in bin.iter() {
        let mut here = vec![false; bins];
        for b in record.iter().flatten() {
            here[usize::from(*b)] = true;
        }
        for (count, here) in reached.iter_mut().zip(here) {
            *count += usize::from(here);
        }
    }
    for b in bin.iter_mut().flatten() {
        *b = b.filter(|b| reached[usize::from(*b)] > 1);
    }
}

/// Bins with about equal numbers of samples; `None` for a constant coordinate.
fn binned(
    source: &Source<'_>,
    coordinate: FailureCoordinate,
    folds: Folds,
    values: &[Vec<f64>],
) -> Option<Binned> {
    let mut sorted: Vec<f64> = values
        .iter()
        .zip(source.records)
        .flat_map(|(values, record)| values.iter().skip(record.lead))
        .copied()
        .filter(|v| v.is_finite())
        .collect();
    sorted.sort_by(f64::total_cmp);
    let (low, high) = (*sorted.first()?, *sorted.last()?);
    if high - low <= 1e-12 * high.abs().max(low.abs()) {
        return None;
    }
    // Bin limits are rounded, for readable sentences and axes.
    let step = 10f64.powf(((high - low) / 500.0).log10().floor());
    let tidy = |value: f64| (value / step).round() * step;
    let mut limits: Vec<f64> = (1..RULES.bins)
        .filter_map(|i| sorted.get(i * sorted.len() / RULES.bins))
        .map(|value| tidy(*value))
        .filter(|limit| *limit > low && *limit < high)
        .collect();
    limits.dedup_by(|a, b| (*a - *b).abs() < 0.5 * step);
    let edges: Vec<f64> = [&[low][..], &limits, &[high]].concat();
    let ranges: Vec<(f64, f64)> = edges.windows(2).map(|pair| (pair[0], pair[1])).collect();
    let place = |value: &f64| {
        value
            .is_finite()
            .then(|| limits.partition_point(|limit| limit <= value) as u16)
    };
    let mut bin: Vec<Vec<Option<u16>>> = values
        .iter()
        .map(|record| record.iter().map(place).collect())
        .collect();
    blank(&mut bin, source.records);
    if folds == Folds::Records {
        keep_shared(&mut bin, ranges.len());
    }
    (ranges.len() > 1).then_some(Binned {
        coordinate,
        folds,
        bin,
        ranges,
        dwell: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    #[test]
    fn time_since_edges_pulse_numbers_and_past_blowing() {
        let u = [0.0, 1.0, 1.0, 0.0, 0.0, 1.0];
        let rising = since_edge(&u, true, 0.5);
        assert!(rising[0].is_nan());
        assert_eq!(rising[1..], [0.0, 0.5, 1.0, 1.5, 0.0]);
        let falling = since_edge(&u, false, 0.5);
        assert!(falling[..3].iter().all(|t| t.is_nan()));
        assert_eq!(falling[3..], [0.0, 0.5, 1.0]);
        let felt = pulse_number(&u, 1);
        assert!(felt[..2].iter().all(|n| n.is_nan()));
        assert_eq!(felt[2..], [1.0, 1.0, 1.0, 1.0]);
        assert_eq!(moving_mean(&u, 2), [0.0, 0.5, 1.0, 0.5, 0.0, 0.5]);
    }

    #[test]
    fn bins_hold_about_equally_many_samples_and_cover_the_range() {
        let u: Vec<f64> = (0..4000).map(|k| f64::from((k / 50) % 2)).collect();
        let record = Record::new("r", Use::Validate, 0.001, u, vec![0.0; 4000]);
        let simulated: Vec<f64> = (0..4000).map(|k| (f64::from(k) * 0.1).sin()).collect();
        let source = Source {
            records: &[&record],
            simulated: &[simulated],
            delay: 3,
        };
        let all = coordinates(&source);
        let level = FailureCoordinate::LevelOfY;
        let level = all.iter().find(|b| b.coordinate == level).unwrap();
        assert_eq!(level.ranges.len(), RULES.bins);
        for bin in 0..RULES.bins {
            let count = level.bin[0]
                .iter()
                .filter(|b| **b == Some(bin as u16))
                .count();
            assert!((80..220).contains(&count), "{count}");
        }
        assert!(level.ranges.windows(2).all(|pair| pair[0].1 == pair[1].0));
        let long = FailureCoordinate::Blowing { window_s: 4.0 };
        assert!(all.iter().all(|b| b.coordinate != long), "too short");
    }
}
