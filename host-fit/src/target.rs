//! What a model's free run is compared with.
//!
//! A full model imitates y; an averaged model imitates y_avg, eq. (12). The
//! command stays as recorded: an averaged model forms u_avg, eq. (13), itself.

use crate::data::Record;
use crate::model::Model;

/// Moving mean of the last `window` values (i = 0..W−1), eq. (12).
///
/// Before the series every value was 0, or, with `held`, the first one.
#[must_use]
pub fn moving_average(series: &[f64], window: u32, held: bool) -> Vec<f64> {
    let window = window.max(1) as usize;
    let before = if held {
        series.first().copied().unwrap_or(0.0)
    } else {
        0.0
    };
    // Each mean is summed from the nearest multiple of the window, so that
    // rounding does not build up along the record.
    let mut prefix = vec![0.0; series.len()];
    for (k, value) in series.iter().enumerate() {
        let carried = if k % window == 0 { 0.0 } else { prefix[k - 1] };
        prefix[k] = carried + value;
    }
    let mean = |k: usize| {
        let sum = match k.checked_sub(window) {
            None => {
                let missing = (window - 1 - k) as f64;
                prefix[k] + missing * before
            }
            // The block of the oldest sample, less what lies before it, and the rest.
            Some(last_outside) => {
                let end = (last_outside / window + 1) * window - 1;
                let tail = prefix[end] - prefix[last_outside];
                if k == end {
                    prefix[k]
                } else {
                    tail + prefix[k]
                }
            }
        };
        sum / window as f64
    };
    (0..series.len()).map(mean).collect()
}

impl Model {
    /// The records as this model sees them: as they are for a full model, with
    /// y_avg in place of y for an averaged one.
    ///
    /// The averages of `y_sd` and of the envelope are left out: how much an
    /// average scatters depends on how the scatter is correlated in time,
    /// which a standard error per sample does not say.
    #[must_use]
    pub fn targets(&self, records: &[Record]) -> Vec<Record> {
        if !self.averaging.averaged_model {
            return records.to_vec();
        }
        let held = self.start == crate::model::Start::Measured;
        let average = |record: &Record| Record {
            y: moving_average(&record.y, self.averaging.window, held),
            y_sd: None,
            y_min: None,
            y_max: None,
            ..record.clone()
        };
        records.iter().map(average).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_that_of_the_last_w_samples() {
        let series: Vec<f64> = (0..37).map(|k| f64::from(k * k % 11)).collect();
        for window in [1_u32, 2, 5, 40] {
            for held in [false, true] {
                let found = moving_average(&series, window, held);
                for (k, found) in found.iter().enumerate() {
                    let w = i64::from(window);
                    let value = |i: i64| match usize::try_from(i) {
                        Ok(i) => series[i],
                        Err(_) if held => series[0],
                        Err(_) => 0.0,
                    };
                    let k = k as i64;
                    let sum: f64 = (k - w + 1..=k).map(value).sum();
                    let expected = sum / f64::from(window);
                    assert!((found - expected).abs() < 1e-12, "{k} {window} {held}");
                }
            }
        }
    }
}
