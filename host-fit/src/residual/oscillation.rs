//! A steady oscillation of the readings that does not follow the command: mains hum, vibration, an oscillation of the
//! flow that the jets do not influence.

use super::rules::RULES;
use crate::data::Record;
use crate::picture::significant;
use numerics::fourier::Fourier;
use std::fmt;

/// Halvings of the distance of spectral lines when the frequency is refined.
const REFINEMENTS: usize = 7;
/// The longest transform.
const LONGEST: usize = 1 << 16;

/// A steady oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillation {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Mean square, y².
    pub mean_square: f64,
    /// Share of the variance of the residual, 0–1.
    pub share: f64,
}

impl Oscillation {
    /// The amplitude, in y.
    #[must_use]
    pub fn amplitude(&self) -> f64 {
        (2.0 * self.mean_square).sqrt()
    }

    /// The frequency of the mains of which it is one of the first four harmonics, Hz.
    #[must_use]
    pub fn mains_hz(&self) -> Option<f64> {
        let is_of = |mains: f64| {
            let order = (self.frequency_hz / mains).round();
            (1.0..=4.0).contains(&order)
                && (self.frequency_hz - order * mains).abs() < 0.005 * self.frequency_hz
        };
        [50.0, 60.0].into_iter().find(|mains| is_of(*mains))
    }

    /// Adds it to noise variances that were estimated from third differences, which contain little of it.
    pub(super) fn join(&self, noise: &mut [Vec<f64>], period_s: f64) {
        let gain = (2.0 * (std::f64::consts::PI * self.frequency_hz * period_s).sin()).powi(6);
        let seen = self.mean_square * gain / 20.0;
        for variance in noise.iter_mut().flatten() {
            *variance += self.mean_square - seen.min(*variance);
        }
    }
}

impl fmt::Display for Oscillation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cause = match self.mains_hz() {
            Some(mains) => {
                format!("hum of the mains ({mains} Hz), which shielding or a filter removes")
            }
            None => "vibration, or an oscillation of the plant that the command does not influence"
                .to_owned(),
        };
        write!(
            f,
            "{:.0} % of the residual's variance is a steady oscillation at {} Hz with an amplitude of {}, \
             whatever the command, which is noise to the model. Possible cause: {cause}.",
            100.0 * self.share,
            significant(self.frequency_hz, 3),
            significant(self.amplitude(), 3)
        )
    }
}

/// The spectral line of one record.
struct Line {
    hz: f64,
    mean_square: f64,
    /// Variance of the series, y².
    all: f64,
    /// Distance of the spectral lines, Hz.
    apart: f64,
}

/// The steady oscillation that most of the series, one per record, have in common.
pub(super) fn steady(records: &[&Record], series: &[Vec<f64>]) -> Option<Oscillation> {
    let each = records.iter().zip(series);
    let lines: Vec<Line> = each.filter_map(|(record, e)| line(record, e)).collect();
    let mut by_frequency: Vec<&Line> = lines.iter().collect();
    by_frequency.sort_by(|a, b| a.hz.total_cmp(&b.hz));
    let middle = by_frequency.get(by_frequency.len() / 2)?.hz;
    let width = RULES.oscillation[0] as f64;
    let alike = |line: &&Line| (line.hz - middle).abs() <= width * line.apart;
    let alike: Vec<&Line> = lines.iter().filter(alike).collect();
    let n = alike.len() as f64;
    if n < RULES.agreeing_records * records.len() as f64 {
        return None;
    }
    let mean = |of: fn(&Line) -> f64| alike.iter().map(|line| of(line)).sum::<f64>() / n;
    let found = Oscillation {
        frequency_hz: mean(|line| line.hz),
        mean_square: mean(|line| line.mean_square),
        share: mean(|line| line.mean_square / line.all),
    };
    (found.share >= RULES.worth_saying).then_some(found)
}

/// The highest line in the spectrum of `e`, if it is a line and the command has none there.
fn line(record: &Record, e: &[f64]) -> Option<Line> {
    let (e, u) = (e.get(record.lead..)?, record.u.get(record.lead..)?);
    let [width, around] = RULES.oscillation;
    let length = e.len().min(LONGEST);
    let (e, u) = (&e[..length], u.get(..length)?);
    let transform = Fourier::new(length);
    let power = |x: &[f64]| -> Vec<f64> {
        let mean = x.iter().sum::<f64>() / length as f64;
        let lines = transform.lines(x.iter().map(|x| x - mean).collect());
        let half = lines.iter().take(length / 2);
        half.map(|line| 2.0 * line.norm_sqr() / (length as f64).powi(2))
            .collect()
    };
    let (own, command) = (power(e), power(u));
    let inner = around..own.len().checked_sub(around)?;
    let peak = inner.max_by(|a, b| own[*a].total_cmp(&own[*b]))?;
    let sum = |of: &[f64], within: usize| of[peak - within..=peak + within].iter().sum::<f64>();
    // Most of the energy of a stretch of the spectrum is in a line.
    let is_line = |of: &[f64]| 2.0 * sum(of, width) > sum(of, around);
    if !is_line(&own) || is_line(&command) {
        return None;
    }
    let apart = 1.0 / length as f64;
    let (cycles, mean_square) = refined(e, peak as f64 * apart, apart);
    Some(Line {
        hz: cycles / record.sample_period_s,
        mean_square,
        all: own.iter().sum::<f64>().max(f64::MIN_POSITIVE),
        apart: apart / record.sample_period_s,
    })
}

/// The frequency of the highest sine within `width` of `near`, in cycles per sample, and its mean square.
fn refined(e: &[f64], near: f64, width: f64) -> (f64, f64) {
    let mean_square = |cycles: f64| {
        let turn = std::f64::consts::TAU * cycles;
        let (sine, cosine) = e.iter().enumerate().fold((0.0, 0.0), |(s, c), (k, e)| {
            let (sin, cos) = (turn * k as f64).sin_cos();
            (s + e * sin, c + e * cos)
        });
        2.0 * (sine * sine + cosine * cosine) / (e.len() as f64).powi(2)
    };
    let mut best = (near, mean_square(near));
    let mut step = width;
    for _ in 0..REFINEMENTS {
        step *= 0.5;
        for cycles in [best.0 - step, best.0 + step] {
            let found = mean_square(cycles);
            if found > best.1 {
                best = (cycles, found);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 0.001;

    fn record(u: impl Fn(usize) -> f64) -> Record {
        let u = (0..6000).map(u).collect();
        Record::new("r", Use::Identify, PERIOD_S, u, vec![0.0; 6000])
    }

    fn noise(rng: &mut ChaCha8Rng, of: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..6000)
            .map(|k| of(k) + rng.random_range(-0.1..0.1))
            .collect()
    }

    #[test]
    fn hum_is_found_with_its_frequency_and_amplitude() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let record = record(|k| f64::from(u8::from(k % 274 < 137)));
        let hum = |k: usize| 0.07 * (TAU * 50.02 * PERIOD_S * k as f64 + 1.0).sin();
        let series = [noise(&mut rng, hum), noise(&mut rng, hum)];
        let found = steady(&[&record, &record], &series).expect("hum");
        assert!((found.frequency_hz - 50.02).abs() < 0.02, "{found:?}");
        assert!((found.amplitude() / 0.07 - 1.0).abs() < 0.05, "{found:?}");
        assert_eq!(found.mains_hz(), Some(50.0));
        assert!((found.share - 0.42).abs() < 0.05, "{found:?}");
    }

    /// White noise, a response to a periodic command, and an oscillation that edges excite are none.
    #[test]
    fn what_is_no_steady_oscillation_is_none() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let u = |k: usize| f64::from(u8::from(k % 50 < 25));
        let periodic = record(u);
        assert_eq!(steady(&[&periodic], &[noise(&mut rng, |_| 0.0)]), None);
        let misfit = noise(&mut rng, |k| 0.5 * u(k));
        assert_eq!(steady(&[&periodic], &[misfit]), None);
        let edges = record(|k| f64::from(u8::from((k * k / 90_000).is_multiple_of(2))));
        let mut since = 0;
        let rings: Vec<f64> = (0..6000)
            .map(|k| {
                since = match k > 0 && edges.u[k] != edges.u[k - 1] {
                    true => 0,
                    false => since + 1,
                };
                let t = f64::from(since) * PERIOD_S;
                (TAU * 40.0 * t).sin() * (-0.05 * TAU * 40.0 * t).exp()
            })
            .collect();
        assert_eq!(steady(&[&edges], &[noise(&mut rng, |k| rings[k])]), None);
    }
}
