//! Frequency responses from the command to y: of a linearised model, and estimated from records.

use super::Residuals;
use super::response::small_step;
use super::spectrum::Segments;
use crate::model::Model;
use numerics::fourier::{Complex, Fourier};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A frequency response at one frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrequencyPoint {
    /// Frequency, Hz.
    pub hz: f64,
    /// Magnitude: amplitude of y per full jet; above 0.
    pub gain: f64,
    /// Phase of y relative to the command, degrees; negative if y lags. Continuous over frequency, dead time included.
    pub phase: f64,
}

impl FrequencyPoint {
    /// Frequency (Hz), magnitude (y) and phase (degrees).
    #[must_use]
    pub fn values(&self) -> [f64; 3] {
        [self.hz, self.gain, self.phase]
    }
}

/// Frequency response of a model, linearised about a constant command.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrequencyResponse {
    /// Magnitude and phase, equally spaced on a logarithmic axis as far as the transform is fine enough.
    pub points: Vec<FrequencyPoint>,
    /// Samples from a change of the command to the first change of y.
    pub dead_time: usize,
}

/// Frequency response estimated from records at one frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Estimate from the measured y.
    pub measured: FrequencyPoint,
    /// Lower and upper 95 % limit of the measured magnitude, y per full jet; above 0.
    pub gain: [f64; 2],
    /// Lower and upper 95 % limit of the measured phase, degrees.
    pub phase: [f64; 2],
    /// The same estimate from the y of the model's free run.
    pub run: FrequencyPoint,
}

/// Points per decade of a model's frequency response.
const PER_DECADE: f64 = 60.0;
/// Bands per decade of an estimate.
const BANDS_PER_DECADE: f64 = 12.0;
/// Longest transform, samples.
const LONGEST: usize = 1 << 20;
/// Squared correlation of half overlapping segments under a Hann window.
const OVERLAPPING: f64 = 1.0 / 36.0;
/// Squared correlations of a line with its first and second neighbour under a Hann window.
const NEIGHBOURS: [f64; 2] = [4.0 / 9.0, 1.0 / 36.0];
/// Share of the largest density of the command below which it does not count as excitation.
const EXCITED: f64 = 1e-9;

/// The frequency response of `model`, linearised at a level of the step response
/// ([`step_response`](super::step_response)): at rest (`command` 0), or in the steady blown state (`command` 1). The
/// effects of the model are included. The frequencies go from 1/`longest_s` (or the inverse of the settling time, if
/// that is longer) to half the sampling rate.
///
/// None if there is no step response, or if the model is not linear for small changes at this level.
#[must_use]
pub fn frequency_response(model: &Model, command: u8, longest_s: f64) -> Option<FrequencyResponse> {
    let step = small_step(model, command)?;
    let before = std::iter::once(&0.0).chain(&step);
    let impulse: Vec<f64> = step.iter().zip(before).map(|(y, last)| y - last).collect();
    let most = impulse.iter().fold(0.0, |most: f64, g| most.max(g.abs()));
    let dead_time = impulse.iter().position(|g| g.abs() > 1e-9 * most)?;
    let period = model.sample_period_s;
    let wanted = (longest_s / period).min(LONGEST as f64 / 4.0) as usize;
    // The transform is four times as long as the response, so that the phase turns by less than 90°
    // from line to line.
    let length = 4 * impulse.len().max(wanted);
    let length = length.next_power_of_two();
    // The response is transformed without its dead time, which is added to the phase afterwards.
    let input = impulse.get(dead_time..)?.to_vec();
    let lines = Fourier::new(length).lines(input);
    let finest = 1.0 / (length as f64 * period);
    let mut last = 0.0;
    let all = lines.iter().enumerate().map(|(line, value)| {
        let hz = line as f64 * finest;
        last = nearest(degrees(*value), last);
        FrequencyPoint {
            hz,
            gain: value.norm(),
            phase: last - turned(hz, dead_time, period),
        }
    });
    let lowest = 1.0 / longest_s;
    let mut next = 0.0;
    let points = all.filter(|point| {
        let kept = point.hz > 0.0 && point.hz >= 0.999 * lowest && point.hz >= next;
        if kept {
            next = point.hz * 10f64.powf(1.0 / PER_DECADE);
        }
        kept && point.gain > 0.0
    });
    Some(FrequencyResponse {
        points: points.collect(),
        dead_time,
    })
}

/// Estimates Σ U*Y / Σ |U|² of the frequency response of measured y and of the model's free run, in bands of frequency;
/// sums over segments ([Welch](super::spectrum())) and over the lines of a band. Only bands in which u and y are
/// coherent at the 5 % level are given.
///
/// For a plant that is not linear this is its best linear approximation under the command of the records; the remainder
/// counts as noise. Limits are those of the random error, s.d. of ln |G| and of the phase √((1 − γ²)/(2 (n − 1) γ²))
/// with the coherence γ² and n independent averages (Bendat and Piersol, Random Data, 4th ed., §9.2), with Student's t.
/// `full` is the change of u for a full jet. The phase of `dead_time` (samples) is removed before a band is averaged,
/// because a phase that varies within the band would lower the magnitude, and is added again afterwards.
#[must_use]
pub fn estimated_response(residuals: &Residuals, full: f64, dead_time: usize) -> Vec<Estimate> {
    let Some(segments) = Segments::of(residuals) else {
        return Vec::new();
    };
    let half = segments.length / 2;
    let finest = 1.0 / (segments.length as f64 * residuals.period_s);
    let mut sums = vec![Sums::default(); half + 1];
    let mut count = 0.0;
    let records = residuals.u.iter().zip(&residuals.y).zip(&residuals.e);
    for ((u, y), e) in records {
        let run: Vec<f64> = y.iter().zip(e).map(|(y, e)| y - e).collect();
        let pairs = segments.lines(u).zip(segments.lines(y));
        for ((u, y), run) in pairs.zip(segments.lines(&run)) {
            for (sum, ((u, y), run)) in sums.iter_mut().zip(u.iter().zip(&y).zip(&run)) {
                sum.add(*u, *y, *run);
            }
            count += 1.0;
        }
    }
    let segments_averaged = count / (1.0 + 2.0 * OVERLAPPING);
    let strongest = sums.iter().map(|sum| sum.uu).fold(0.0, f64::max);
    let mut found: Vec<Estimate> = Vec::new();
    let mut from = 1;
    while from <= half {
        let to = ((from as f64 * 10f64.powf(1.0 / BANDS_PER_DECADE)) as usize).clamp(from, half);
        let mut band = Sums::default();
        let mut weighted = 0.0;
        for (line, sum) in sums.iter().enumerate().take(to + 1).skip(from) {
            let hz = line as f64 * finest;
            let turn = turned(hz, dead_time, residuals.period_s).to_radians();
            band.include(sum, Complex::from_polar(1.0, turn));
            weighted += hz * sum.uu;
        }
        let width = (to + 1 - from) as f64;
        from = to + 1;
        if band.uu <= EXCITED * strongest * width {
            continue;
        }
        let n = segments_averaged * independent(width);
        let hz = weighted / band.uu;
        let back = turned(hz, dead_time, residuals.period_s);
        let last = found.last().map_or(0.0, |last| {
            last.measured.phase + turned(last.measured.hz, dead_time, residuals.period_s)
        });
        found.extend(band.estimate(n, (hz, back), full, last));
    }
    found
}

/// Sums of |U|², |Y|² and U*Y.
#[derive(Clone, Copy, Default)]
struct Sums {
    uu: f64,
    yy: f64,
    uy: Complex<f64>,
    /// U* times the transform of the model's free run.
    run: Complex<f64>,
}

impl Sums {
    fn add(&mut self, u: Complex<f64>, y: Complex<f64>, run: Complex<f64>) {
        self.uu += u.norm_sqr();
        self.yy += y.norm_sqr();
        self.uy += u.conj() * y;
        self.run += u.conj() * run;
    }

    /// Adds `other`, whose phase of y is changed by `turn`.
    fn include(&mut self, other: &Self, turn: Complex<f64>) {
        self.uu += other.uu;
        self.yy += other.yy;
        self.uy += other.uy * turn;
        self.run += other.run * turn;
    }

    /// The estimate from `n` independent averages at a frequency, Hz, whose dead time turns the phase by `back` degrees; `last`
    /// is the phase of the next lower band without dead time. None if u and y are not coherent.
    fn estimate(&self, n: f64, (hz, back): (f64, f64), full: f64, last: f64) -> Option<Estimate> {
        let degrees_of_freedom = 2.0 * (n - 1.0);
        let coherence = self.uy.norm_sqr() / (self.uu * self.yy);
        let by_chance = 1.0 - 0.05_f64.powf(1.0 / (n - 1.0));
        if degrees_of_freedom < 1.0 || coherence.is_nan() || coherence <= by_chance {
            return None;
        }
        let quantile = StudentsT::new(0.0, 1.0, degrees_of_freedom).ok()?;
        let spread = ((1.0 - coherence).max(0.0) / (degrees_of_freedom * coherence)).sqrt();
        let within = quantile.inverse_cdf(0.975) * spread;
        let point = |cross: Complex<f64>, near: f64| {
            let value = cross * full / self.uu;
            FrequencyPoint {
                hz,
                gain: value.norm(),
                phase: nearest(degrees(value), near) - back,
            }
        };
        let measured = point(self.uy, last);
        let turn = within.to_degrees().min(180.0);
        Some(Estimate {
            measured,
            gain: [(-within).exp(), within.exp()].map(|times| measured.gain * times),
            phase: [measured.phase - turn, measured.phase + turn],
            run: point(self.run, measured.phase + back),
        })
    }
}

/// Number of independent lines among `width` neighbouring lines under a Hann window.
fn independent(width: f64) -> f64 {
    let each = [1.0, 2.0].into_iter().zip(NEIGHBOURS);
    let shared = each.map(|(apart, squared)| f64::max(width - apart, 0.0) / width * squared);
    width / (1.0 + 2.0 * shared.sum::<f64>())
}

/// Phase lag of a dead time, degrees.
fn turned(hz: f64, dead_time: usize, period_s: f64) -> f64 {
    360.0 * hz * dead_time as f64 * period_s
}

fn degrees(value: Complex<f64>) -> f64 {
    value.arg().to_degrees()
}

/// The angle nearest to `near` among `phase` and its sums with multiples of 360°, degrees.
fn nearest(phase: f64, near: f64) -> f64 {
    phase + 360.0 * ((near - phase) / 360.0).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{CommandRange, Delay};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::TAU;

    /// A pole at 1/(2π·0.1 s), gain 2, dead time 30 samples of 1 ms and one of the recursion.
    fn lag() -> Model {
        let a = (-0.01_f64).exp();
        Model {
            sample_period_s: 0.001,
            state_lags: vec![1],
            a: vec![a],
            product_lags: vec![1],
            b: vec![2.0 * (1.0 - a)],
            c: vec![0.0],
            delay: Delay::Fixed { delays: vec![30] },
            ..Model::default()
        }
    }

    #[test]
    fn a_first_order_lag_has_its_gain_corner_and_phase() {
        let found = frequency_response(&lag(), 0, 60.0).unwrap();
        assert_eq!(found.dead_time, 31);
        let first = found.points[0];
        assert!((1.0 / 60.0..1.2 / 60.0).contains(&first.hz), "{first:?}");
        assert!((first.gain / 2.0 - 1.0).abs() < 1e-3, "{first:?}");
        let corner = 1.0 / (TAU * 0.1);
        let at = |hz: f64| {
            let far = |point: &FrequencyPoint| (point.hz / hz).ln().abs();
            let near = found.points.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
            *near.unwrap()
        };
        for hz in [0.1, corner, 10.0, 100.0, 450.0] {
            let point = at(hz);
            let z = Complex::from_polar(1.0, -TAU * point.hz * 0.001);
            let a = (-0.01_f64).exp();
            let exact = z.powu(31) * 2.0 * (1.0 - a) / (1.0 - a * z);
            assert!((point.gain / exact.norm() - 1.0).abs() < 2e-3, "{point:?}");
            let lag = degrees(Complex::from(1.0) / (1.0 - a * z)) - 360.0 * point.hz * 0.031;
            assert!((point.phase - lag).abs() < 0.5, "{point:?} {lag}");
        }
        let there = at(corner);
        let down = 20.0 * (there.gain / first.gain).log10();
        assert!((down + 3.01).abs() < 0.2, "{down} dB at {} Hz", there.hz);
        let last = found.points.last().unwrap();
        assert!(last.hz > 480.0 && last.hz <= 500.0, "{last:?}");
    }

    #[test]
    fn a_bilinear_model_is_faster_and_flatter_with_the_command_on() {
        let model = Model {
            c: vec![-0.02],
            command: CommandRange {
                off: 2.0,
                full: 7.0,
            },
            ..lag()
        };
        let (a, b) = (model.a[0], model.b[0]);
        let steady = b / (1.0 - a + 0.02);
        let gains = [b / (1.0 - a), (b - 0.02 * steady) / (1.0 - a + 0.02)];
        for (command, gain) in [0, 1].into_iter().zip(gains) {
            let found = frequency_response(&model, command, 60.0).unwrap().points[0];
            assert!((found.gain / gain - 1.0).abs() < 5e-3, "{found:?} {gain}");
        }
        let needs_nothing = Model {
            sample_period_s: f64::NAN,
            ..lag()
        };
        assert_eq!(frequency_response(&needs_nothing, 0, 60.0), None);
    }

    /// Records of `lag` under a random telegraph signal with white noise.
    fn residuals(rng: &mut ChaCha8Rng, noise: f64) -> Residuals {
        let mut normal = |_| (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
        let mut on = 0.0;
        let u: Vec<f64> = (0..20_000)
            .map(|k| {
                if k % 20 == 0 {
                    on = f64::from(u8::from(normal(k) > 0.0));
                }
                on
            })
            .collect();
        let y = lag()
            .run_free(&crate::simulate::Signals::commanded(&lag(), &u))
            .unwrap();
        let e: Vec<f64> = (0..u.len()).map(|k| noise * normal(k)).collect();
        Residuals {
            period_s: 0.001,
            y: vec![y.iter().zip(&e).map(|(y, e)| y + e).collect()],
            e: vec![e],
            u: vec![u],
            noise_variance: None,
        }
    }

    #[test]
    fn nineteen_in_twenty_limits_of_an_estimate_hold_the_truth() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut gain, mut phase, mut all) = (0.0, 0.0, 0.0);
        for _ in 0..60 {
            let found = estimated_response(&residuals(&mut rng, 1.0), 1.0, 31);
            // Bands below 2.5 Hz are coherent whatever the noise is; the others appear only if the
            // noise happens to add to the coherence.
            for point in found.iter().filter(|point| point.measured.hz < 2.5) {
                // The same estimate without noise is the truth apart from the resolution.
                let exact = point.run;
                gain += f64::from(u8::from(
                    (point.gain[0]..=point.gain[1]).contains(&exact.gain),
                ));
                phase += f64::from(u8::from(
                    (point.phase[0]..=point.phase[1]).contains(&exact.phase),
                ));
                all += 1.0;
            }
        }
        let (gain, phase) = (gain / all, phase / all);
        assert!((0.93..0.975).contains(&gain), "{gain} of {all}");
        assert!((0.93..0.975).contains(&phase), "{phase} of {all}");
    }

    #[test]
    fn the_estimate_of_a_linear_plant_is_its_frequency_response() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let a = (-0.01_f64).exp();
        let found = estimated_response(&residuals(&mut rng, 0.0), 5.0, 31);
        for point in found
            .iter()
            .filter(|p| (0.8..40.0).contains(&p.measured.hz))
        {
            let z = Complex::from_polar(1.0, -TAU * point.measured.hz * 0.001);
            let lag = 2.0 * (1.0 - a) / (1.0 - a * z);
            let phase = degrees(lag) - 360.0 * point.measured.hz * 0.031;
            assert!(
                (point.measured.gain / 5.0 / lag.norm() - 1.0).abs() < 0.1,
                "{point:?}"
            );
            assert!(
                (point.measured.phase - phase).abs() < 6.0,
                "{point:?} {phase}"
            );
            assert_eq!(point.measured, point.run);
        }
        assert!(estimated_response(&Residuals::default(), 1.0, 0).is_empty());
    }
}
