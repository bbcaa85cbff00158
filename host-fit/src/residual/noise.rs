//! The noise level with which a residual is compared.

use super::explained::Errors;
use super::rules::RULES;
use crate::data::{Record, rounding_variance};

/// Where the noise level comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseSource {
    /// The standard error `y_sd` of the recordings.
    Measured,
    /// Estimated from repeats: the scatter of y between periods of the same command.
    Repeats,
    /// Estimated from sample-to-sample scatter; slow noise is not included.
    Scatter,
}

/// σ² of the noise per record and sample, and its source. If one record lacks `y_sd`, all are estimated.
pub(super) fn floor(records: &[&Record], residual: &[Vec<f64>]) -> (Vec<Vec<f64>>, NoiseSource) {
    let measured: Option<Vec<Vec<f64>>> = records
        .iter()
        .map(|r| Some(r.y_sd.as_ref()?.iter().map(|sd| sd * sd).collect()))
        .collect();
    if let Some(measured) = measured {
        return (measured, NoiseSource::Measured);
    }
    // If readings are rounded to equal values, the noise below the resolution shows neither from sample to sample nor
    // between repeats.
    let rounding = rounding_variance(records.iter().map(|record| record.y.as_slice()));
    let repeats: Vec<f64> = records.iter().filter_map(|r| by_repeats(r)).collect();
    let (variance, source) = if repeats.is_empty() {
        let each = residual
            .iter()
            .zip(records)
            .map(|(e, record)| by_scatter(e.get(record.lead..).unwrap_or(&[])));
        // The rounding error of a coarse reading changes slowly where the noise is smaller than a step.
        let scatter = each.sum::<f64>() / residual.len().max(1) as f64;
        (scatter + rounding, NoiseSource::Scatter)
    } else {
        let mean = repeats.iter().sum::<f64>() / repeats.len() as f64;
        (mean.max(rounding), NoiseSource::Repeats)
    };
    let constant = residual.iter().map(|e| vec![variance; e.len()]).collect();
    (constant, source)
}

/// Half the mean square difference between samples whole command periods apart; the least over the number of
/// periods.
fn by_repeats(record: &Record) -> Option<f64> {
    let period = command_period(&record.u)?;
    let history = RULES.history;
    let mut least: Option<f64> = None;
    for periods in 1..=RULES.periods_back {
        let shift = periods * period;
        let (mut same, mut pairs, mut sum) = (0, 0.0, 0.0);
        for k in shift..record.len() {
            // Number of samples for which the command has been equal to itself `shift` samples earlier.
            same = if record.u[k] == record.u[k - shift] {
                same + 1
            } else {
                0
            };
            // Long rests repeat as well, but contain no information about the flow.
            if same > history + period {
                let difference = record.y[k] - record.y[k - shift];
                sum += difference * difference;
                pairs += 1.0;
            }
        }
        if pairs >= RULES.fewest_histories * history as f64 {
            let variance = 0.5 * sum / pairs;
            least = Some(least.map_or(variance, |l: f64| l.min(variance)));
        }
    }
    least
}

/// The most frequent time between rising edges, if most are within a sample of it.
fn command_period(u: &[f64]) -> Option<usize> {
    let rises: Vec<usize> = u
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| pair[1] > pair[0])
        .map(|(k, _)| k)
        .collect();
    let mut between: Vec<usize> = rises.windows(2).map(|pair| pair[1] - pair[0]).collect();
    between.sort_unstable();
    let middle = *between.get(between.len() / 2)?;
    let alike = between.iter().filter(|b| b.abs_diff(middle) <= 1).count();
    let periodic = between.len() >= RULES.fewest_periods
        && alike as f64 >= RULES.alike_periods * between.len() as f64;
    periodic.then_some(middle)
}

/// σ² of white noise from third differences, in which smooth motion is small: from the mean size of the middle of
/// their distribution, which edges do not affect. Readings with a coarse resolution give a few sizes only, of which the
/// median would be one.
fn by_scatter(e: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = e
        .windows(4)
        .map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs())
        .collect();
    sizes.sort_by(f64::total_cmp);
    let (first, last) = (sizes.len() * 3 / 10, sizes.len() * 7 / 10);
    let middle = &sizes[first..last.max(first + 1).min(sizes.len())];
    let mean = middle.iter().sum::<f64>() / middle.len().max(1) as f64;
    // The mean size of a normal variable between the 30th and the 70th percentile of its size is 0.6862 σ; the third
    // difference of white noise has √20 times its σ.
    (mean / 0.6862).powi(2) / 20.0
}

impl Errors {
    /// Noise level on the scored samples, rms.
    pub(super) fn noise_rmse(&self) -> f64 {
        let each = self.noise.iter().zip(&self.lead);
        let judged = each.flat_map(|(n, lead)| n.iter().skip(*lead));
        let (sum, count) = judged.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
        f64::sqrt(sum / f64::max(count, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Uniform noise of standard deviation 0.1 on a periodic response, every
    /// third pulse of which is missing.
    fn record(periodic: bool) -> Record {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let u: Vec<f64> = (0..10_000)
            .map(|k| {
                let period = if periodic { 200 } else { 90 + (k / 700) * 17 };
                f64::from(k % period < period / 2)
            })
            .collect();
        let mut state = 0.0;
        let y = u
            .iter()
            .enumerate()
            .map(|(k, u)| {
                let missing = periodic && (k / 200) % 3 == 0;
                let jet = if missing { 0.0 } else { *u };
                state += 0.02 * (jet - state);
                let half: f64 = 0.1 * f64::sqrt(3.0);
                state + rng.random_range(-half..half)
            })
            .collect();
        Record::new("r", Use::Validate, 0.001, u, y)
    }

    #[test]
    fn repeats_give_the_noise_even_when_every_third_pulse_is_missing() {
        let variance = by_repeats(&record(true)).unwrap();
        assert!((variance.sqrt() / 0.1 - 1.0).abs() < 0.05, "{variance}");
        assert_eq!(by_repeats(&record(false)), None);
    }

    #[test]
    fn sample_to_sample_scatter_gives_white_noise() {
        let sd = by_scatter(&record(false).y).sqrt();
        assert!((sd / 0.1 - 1.0).abs() < 0.06, "{sd}");
        assert_eq!(by_scatter(&[]), 0.0);
        assert_eq!(
            by_scatter(&[1.0, 2.0, 4.0, 8.0]),
            (1.0 / 0.6862_f64).powi(2) / 20.0
        );
    }

    /// A logger that rounds to once or twice the noise. The median of the differences would be 5 % too small and 30 % too
    /// large.
    #[test]
    fn a_coarse_resolution_does_not_change_the_noise_level() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for resolution in [1.0, 1.5, 2.0] {
            let (mut e, mut sum) = (Vec::new(), 0.0);
            for k in 0..20_000 {
                // The sum of twelve uniform numbers is almost normal.
                let noise: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
                let smooth = 30.0 * (f64::from(k) / 97.0).sin();
                let read = ((smooth + noise) / resolution).round() * resolution;
                e.push(read - smooth);
                sum += (read - smooth).powi(2);
            }
            let ratio = (by_scatter(&e) / (sum / e.len() as f64)).sqrt();
            assert!((ratio - 1.0).abs() < 0.03, "{resolution}: {ratio}");
        }
    }

    /// A converter with steps of three times the noise: between its steps the rounding error changes as slowly as y.
    #[test]
    fn rounding_beyond_the_noise_adds_to_it() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let (mut y, mut e) = (Vec::new(), Vec::new());
        for k in 0..4000 {
            let noise: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
            let smooth = 20.0 * (f64::from(k) / 300.0).sin();
            let read = ((smooth + noise) / 3.0).round() * 3.0;
            y.push(read);
            e.push(read - smooth);
        }
        let total = e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64;
        let u = (0..4000).map(|k| f64::from((k / 900) % 2)).collect();
        let record = Record::new("r", Use::Identify, 1.0, u, y);
        let scatter = (by_scatter(&e) / total).sqrt();
        assert!(scatter < 0.7, "{scatter}");
        let (noise, source) = floor(&[&record], &[e]);
        assert_eq!(source, NoiseSource::Scatter);
        let ratio = (noise[0][0] / total).sqrt();
        assert!((0.9..1.3).contains(&ratio), "{ratio} {scatter}");
    }
}
