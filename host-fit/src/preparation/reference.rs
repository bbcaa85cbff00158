//! The first-order response with dead time that describes the records best. It serves to distinguish rest from
//! motion and to estimate when the response to an edge begins.

use super::RULES;
use crate::data::Record;
use crate::parallel;

/// y = level + gain·x with x_{k+1} = x_k + (1 − e^{−1/T})(u_{k−θ} − x_k), plus an initial state for each record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrder {
    /// θ, samples, ≥ 0.
    pub dead_time: f64,
    /// T, samples, above 0.
    pub time_constant: f64,
    /// Change of y for each unit of u.
    pub gain: f64,
    /// y under u = 0.
    pub level: f64,
    /// Share of the variance of y that is explained, up to 1.
    pub explained: f64,
    /// Residual of the reference response, y rms.
    pub left_rms: f64,
    /// Residual without the part that is constant within a record, y rms.
    pub varying_rms: f64,
}

/// A record with neighbouring samples averaged.
struct Thinned {
    u: Vec<f64>,
    y: Vec<f64>,
    before: f64,
}

impl Thinned {
    fn of(record: &Record, stride: usize) -> Self {
        let mean = |series: &[f64]| {
            let chunks = series.chunks(stride);
            chunks
                .map(|c| c.iter().sum::<f64>() / c.len() as f64)
                .collect()
        };
        Self {
            u: mean(&record.u),
            y: mean(&record.y),
            before: record.u_before.or(record.u.first().copied()).unwrap_or(0.0),
        }
    }
}

/// Sums of products of 1, x and y, after projecting out an initial state.
#[derive(Clone, Copy, Default)]
struct Moments {
    one: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Moments {
    /// Σ x·x, Σ x·y and Σ y·y after projecting out a constant as well.
    fn without_level(&self) -> [f64; 3] {
        [
            self.xx - self.x * self.x / self.one,
            self.xy - self.x * self.y / self.one,
            self.yy - self.y * self.y / self.one,
        ]
    }
}

/// The level of a record under u = 0, in a first-order response with a level for each record.
pub(super) struct OwnLevel {
    /// The level, y.
    pub(super) level: f64,
    /// Residual of the response, y.
    pub(super) deviations: Vec<f64>,
    /// Number of samples that determine the level: fewer than the record has, because an initial state is fitted too.
    pub(super) samples: usize,
}

impl FirstOrder {
    /// Fits the response to `records` by least squares over a refined grid; `None` if y does not follow u.
    #[must_use]
    pub fn fitted(records: &[Record]) -> Option<Self> {
        let (thinned, stride) = thinned(records);
        let whole = whole_spread(&thinned);
        if !(whole > 0.0 && whole.is_finite()) {
            return None;
        }
        let (left, delay, time) =
            searched(&thinned, |delay, time| residual(&thinned, delay, time).0)?;
        let explained = 1.0 - left / whole;
        let (_, level, gain) = residual(&thinned, delay, time);
        let scale = stride as f64;
        let varying = records.iter().map(|record| {
            let of = moments(&Thinned::of(record, 1), delay * scale, time * scale);
            let (sum, square) = (
                of.y - gain * of.x,
                of.yy - 2.0 * gain * of.xy + gain * gain * of.xx,
            );
            square - sum * sum / of.one
        });
        let rms = |squares: f64, samples: usize| (squares.max(0.0) / samples.max(1) as f64).sqrt();
        let usable = gain.is_finite() && level.is_finite() && explained > RULES.related;
        usable.then_some(Self {
            dead_time: delay * scale,
            time_constant: time * scale,
            gain,
            level,
            explained,
            left_rms: rms(left, thinned.iter().map(|r| r.y.len()).sum()),
            varying_rms: rms(varying.sum(), records.iter().map(Record::len).sum()),
        })
    }

    /// The level of each record in a response with a level for each record; `None` if there is no such response.
    pub(super) fn own_levels(records: &[Record]) -> Option<Vec<OwnLevel>> {
        let (thinned, stride) = thinned(records);
        let of = |records: &[Thinned], delay: f64, time: f64| -> Vec<Moments> {
            records
                .iter()
                .map(|record| moments(record, delay, time))
                .collect()
        };
        let gain = |all: &[Moments]| {
            let within = all.iter().map(Moments::without_level);
            let [xx, xy, yy] = within.fold([0.0; 3], |sums, own| {
                [sums[0] + own[0], sums[1] + own[1], sums[2] + own[2]]
            });
            (xy / xx, yy - xy * xy / xx)
        };
        let left = |delay: f64, time: f64| {
            let left = gain(&of(&thinned, delay, time)).1;
            if left.is_finite() {
                left.max(0.0)
            } else {
                f64::INFINITY
            }
        };
        let (_, delay, time) = searched(&thinned, left)?;
        let (delay, time) = (delay * stride as f64, time * stride as f64);
        let whole: Vec<Thinned> = records.iter().map(|r| Thinned::of(r, 1)).collect();
        let all = of(&whole, delay, time);
        let gain = gain(&all).0;
        let each = whole.iter().zip(&all).map(|(record, own)| {
            let level = (own.y - gain * own.x) / own.one;
            let x = response(record, delay, time);
            let left = record.y.iter().zip(x);
            let mut left: Vec<f64> = left.map(|(y, x)| y - level - gain * x).collect();
            let fading = |k: usize| (-(k as f64) / time).exp();
            let along: f64 = left
                .iter()
                .enumerate()
                .map(|(k, left)| left * fading(k))
                .sum();
            let initial = along / (0..left.len()).map(|k| fading(k).powi(2)).sum::<f64>();
            for (k, left) in left.iter_mut().enumerate() {
                *left -= initial * fading(k);
            }
            OwnLevel {
                level,
                deviations: left,
                samples: own.one as usize,
            }
        });
        Some(each.collect())
    }

    /// y at rest under a command of `u`.
    #[must_use]
    pub fn at_rest(&self, u: f64) -> f64 {
        self.level + self.gain * u
    }
}

/// The records with neighbouring samples averaged so that few enough remain, and the number averaged.
fn thinned(records: &[Record]) -> (Vec<Thinned>, usize) {
    let total: usize = records.iter().map(Record::len).sum();
    let stride = total.div_ceil(RULES.reference_samples).max(1);
    let each = records.iter().map(|r| Thinned::of(r, stride));
    (each.collect(), stride)
}

/// The delay and the time constant with the least residual over a refined grid, and that residual.
fn searched(
    thinned: &[Thinned],
    residual: impl Fn(f64, f64) -> f64 + Sync,
) -> Option<(f64, f64, f64)> {
    let longest = thinned.iter().map(|r| r.y.len()).max()? as f64;
    let shortest = thinned.iter().map(|r| r.y.len()).min()? as f64;
    let times: Vec<f64> = grid(RULES.shortest_time, longest, 1.5);
    let mut delays: Vec<f64> = vec![0.0];
    delays.extend(grid(1.0, (shortest / 3.0).max(1.0), 1.3));
    let points: Vec<(f64, f64)> = times
        .iter()
        .flat_map(|time| delays.iter().map(|delay| (*delay, *time)))
        .collect();
    let least = |points: Vec<(f64, f64)>| {
        let all = parallel::each(&points, |&(delay, time)| {
            (residual(delay, time), delay, time)
        });
        all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let (mut left, mut delay, mut time) = least(points)?;
    let (mut wide, mut factor) = ((0.3 * delay).max(1.0), 1.3_f64);
    for _ in 0..RULES.refinements {
        let near = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let around = near.iter().flat_map(|i| {
            let delay = (delay + i * wide).max(0.0);
            near.map(|j| (delay, (time * factor.powf(j)).max(RULES.shortest_time)))
        });
        let best = least(around.collect())?;
        if best.0 <= left {
            (left, delay, time) = best;
        }
        wide *= 0.5;
        factor = factor.sqrt();
    }
    Some((left, delay, time))
}

/// Numbers from `low` to `high`, each a factor above the one before.
fn grid(low: f64, high: f64, factor: f64) -> Vec<f64> {
    let grow = std::iter::successors(Some(low), |x| Some(x * factor));
    grow.take_while(|x| *x <= high.max(low)).collect()
}

/// Σ (y − ȳ)² with the mean of all records.
fn whole_spread(records: &[Thinned]) -> f64 {
    let all = || records.iter().flat_map(|r| r.y.iter());
    let count = all().count().max(1) as f64;
    let mean = all().sum::<f64>() / count;
    all().map(|y| (y - mean).powi(2)).sum()
}

/// Residual sum of squares of the response, with its level and gain.
fn residual(records: &[Thinned], delay: f64, time: f64) -> (f64, f64, f64) {
    let mut sums = Moments::default();
    for record in records {
        let own = moments(record, delay, time);
        sums.one += own.one;
        sums.x += own.x;
        sums.y += own.y;
        sums.xx += own.xx;
        sums.xy += own.xy;
        sums.yy += own.yy;
    }
    let determinant = sums.one * sums.xx - sums.x * sums.x;
    if determinant <= 1e-12 * sums.one * sums.xx {
        return (f64::INFINITY, 0.0, 0.0);
    }
    let level = (sums.xx * sums.y - sums.x * sums.xy) / determinant;
    let gain = (sums.one * sums.xy - sums.x * sums.y) / determinant;
    let left = sums.yy - level * sums.y - gain * sums.xy;
    (left.max(0.0), level, gain)
}

/// The response x of a record: dead time, then a first-order lag.
fn response(record: &Thinned, delay: f64, time: f64) -> impl Iterator<Item = f64> {
    let whole = delay.floor();
    let (fraction, lag) = (delay - whole, whole as usize);
    let kept = (-1.0 / time).exp();
    let at = move |k: usize, lag: usize| k.checked_sub(lag).map_or(record.before, |k| record.u[k]);
    let mut x = record.before;
    (0..record.y.len()).map(move |k| {
        let now = x;
        let u = at(k, lag) + fraction * (at(k, lag + 1) - at(k, lag));
        x += (1.0 - kept) * (u - x);
        now
    })
}

/// The moments of a record, after projecting out a decaying initial state.
fn moments(record: &Thinned, delay: f64, time: f64) -> Moments {
    let kept = (-1.0 / time).exp();
    let mut state = 1.0;
    let mut sums = Moments::default();
    let (mut e_one, mut e_x, mut e_y, mut e_e) = (0.0, 0.0, 0.0, 0.0);
    for (x, y) in response(record, delay, time).zip(&record.y) {
        sums.one += 1.0;
        sums.x += x;
        sums.y += y;
        sums.xx += x * x;
        sums.xy += x * y;
        sums.yy += y * y;
        e_one += state;
        e_x += state * x;
        e_y += state * y;
        e_e += state * state;
        state *= kept;
    }
    sums.one -= e_one * e_one / e_e;
    sums.x -= e_one * e_x / e_e;
    sums.y -= e_one * e_y / e_e;
    sums.xx -= e_x * e_x / e_e;
    sums.xy -= e_x * e_y / e_e;
    sums.yy -= e_y * e_y / e_e;
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    /// A first-order plant with dead time that begins at `start`, at a level of 20.
    fn record(dead_time: usize, time: f64, start: f64, samples: usize) -> Record {
        let u: Vec<f64> = (0..samples)
            .map(|k| f64::from(u8::from(k / 90 % 2 == 1)))
            .collect();
        let mut y = start;
        let series = (0..samples).map(|k| {
            let now = y;
            let arriving = k.checked_sub(dead_time).map_or(u[0], |k| u[k]);
            y += (20.0 + 30.0 * arriving - y) * (1.0 - (-1.0 / time).exp());
            now
        });
        let series = series.collect();
        Record::new("r", Use::Identify, 1.0, u, series)
    }

    #[test]
    fn a_first_order_is_found_from_rest_and_from_mid_run() {
        for (dead_time, time, start) in [(15, 40.0, 20.0), (0, 6.0, 20.0), (30, 80.0, 43.0)] {
            let found = FirstOrder::fitted(&[record(dead_time, time, start, 900)]);
            let found = found.expect("y follows u");
            assert!(
                (found.dead_time - dead_time as f64).abs() < 0.6,
                "{found:?}"
            );
            assert!((found.time_constant / time - 1.0).abs() < 0.05, "{found:?}");
            assert!((found.at_rest(0.0) - 20.0).abs() < 0.2, "{found:?}");
            assert!((found.at_rest(1.0) - 50.0).abs() < 0.5, "{found:?}");
        }
    }

    #[test]
    fn noise_follows_nothing() {
        let mut record = record(0, 5.0, 20.0, 900);
        for (k, y) in record.y.iter_mut().enumerate() {
            *y = f64::from((k as u32).wrapping_mul(2_654_435_761) >> 8);
        }
        assert_eq!(FirstOrder::fitted(&[record]), None);
    }
}
