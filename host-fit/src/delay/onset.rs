//! When y starts to respond to an edge of the command.
//!
//! A response is a *kink* in y: y continues its previous motion until the response arrives, and then changes
//! course. A threshold on y would depend on its level and on the noise. Therefore the kink is located by least
//! squares of
//!
//!    y(t) = c0 + c1·l(t) + A·r(t − a),   l(t) = exp(−t/τ_l) or t,   r(s) = 1 − exp(−s/τ_r) or s for s > 0, else 0
//!
//! over the arrival a (to ¼ sample) and the shapes τ_l, τ_r from a grid, around the front of the response (see
//! `front.rs`) and between the arrivals of the neighbouring edges. A must have the sign of the edge. The first two
//! terms continue the previous motion of y; the third term is the response. The delay h of (3) is a minus the
//! sample of the edge: y_{k+1} is the first sample that u_{k−h} can change.
//!
//! The standard error comes from the profile of the residual sum of squares over a (where it has risen by the noise
//! variance), inflated for the autocorrelation of the residuals. It does not include noise slower than `reach`,
//! which bends y like a response. An edge is not measured, with a reason, in three cases: its response is less than
//! 5 standard deviations above the noise, the response is cut off, or its standard error exceeds the worst one of
//! [`super::Rules`].

use super::edge::Edge;
use super::front::{Expectation, expect, level_filter, own_front};
use super::rules::RULES;
use super::spread::mean;
use numerics::linalg::dot;

/// Why the delay of an edge could not be measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unmeasured {
    /// The next edge, or the end of the record, comes before the response is visible.
    CutOff,
    /// No response in the direction of the edge is significant.
    BelowNoise,
    /// There is a response, but its start is uncertain by more than a few samples.
    Blurred,
}

impl Unmeasured {
    /// The reason in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::CutOff => "cut off by the next edge or the end of the record",
            Self::BelowNoise => "no response above the noise",
            Self::Blurred => "start of the response too uncertain because of the noise",
        }
    }
}

/// The start of a response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onset {
    /// Samples from the edge of the command to the start of the response.
    pub delay: f64,
    /// Standard error of `delay`, samples.
    pub standard_error: f64,
    /// Samples from the edge to half of the response, if y reaches it. Half is between y at the start of the
    /// response and the level when the next response arrives, or after [`Rules::response`](super::Rules).
    pub half_response: Option<f64>,
}

/// The part of a record in which one response is visible, with the arrivals to try.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    from: usize,
    to: usize,
    first_arrival: f64,
    last_arrival: f64,
}

/// One edge with its surroundings.
struct Neighbourhood<'a> {
    y: &'a [f64],
    edge: Edge,
    expected: &'a Expectation,
    /// The samples between the responses to the previous and to the next edge: the first one, and
    /// one past the last.
    earliest: usize,
    latest: usize,
}

impl<'a> Neighbourhood<'a> {
    fn of(
        y: &'a [f64],
        edges: &[Edge],
        index: usize,
        expected: &'a Expectation,
    ) -> Result<Self, Unmeasured> {
        // This is a margin for neighbouring responses that are late or early.
        let room = (expected.reach / 4).max(2);
        let start = |e: &Edge| e.sample + expected.of(*e).onset;
        Ok(Self {
            y,
            edge: *edges.get(index).ok_or(Unmeasured::CutOff)?,
            expected,
            earliest: index
                .checked_sub(1)
                .and_then(|i| edges.get(i))
                .map_or(0, |e| start(e) + room),
            latest: edges
                .get(index + 1)
                .map_or(y.len(), |e| start(e).saturating_sub(room))
                .min(y.len()),
        })
    }

    fn stretch(
        &self,
        from: usize,
        to: usize,
        first: f64,
        last: f64,
    ) -> Result<Stretch, Unmeasured> {
        let (from, to) = (from.max(self.earliest), to.min(self.latest));
        // Before a record that starts with an edge, all signals are 0.
        let left = if from == 0 { 0 } else { RULES.least_side };
        let stretch = Stretch {
            from,
            to,
            first_arrival: first.max((from + left) as f64).max(self.edge.sample as f64),
            last_arrival: last
                .min(to as f64 - 1.0 - RULES.least_side as f64)
                .min((self.edge.sample + self.expected.max_delay) as f64),
        };
        let room =
            to >= from + 2 * RULES.least_side + 4 && stretch.last_arrival > stretch.first_arrival;
        room.then_some(stretch).ok_or(Unmeasured::CutOff)
    }

    /// Location to one sample, around the front.
    fn roughly(&self, levels: &[f64]) -> Result<Located, Unmeasured> {
        let reach = self.expected.reach;
        let front = own_front(levels, self.edge, self.expected);
        // The front is the middle of the rise, 0 to `reach` samples after its start.
        let stretch = self.stretch(
            front.saturating_sub(2 * reach),
            front + reach,
            front as f64 - 1.5 * reach as f64,
            front as f64 + reach as f64 / 3.0,
        )?;
        // An arrival before the interval begins is hidden by the response to the previous edge.
        let expected = self.edge.sample + self.expected.of(self.edge).onset;
        if ((expected + 2) as f64) < stretch.first_arrival {
            return Err(Unmeasured::CutOff);
        }
        let coarse = &RULES.response_shapes[..RULES.coarse_shapes];
        let direction = self.expected.direction(self.edge);
        profile(self.y, stretch, coarse, 1.0, direction).ok_or(Unmeasured::BelowNoise)
    }

    /// Location to a fraction of a sample.
    fn exactly(&self, levels: &[f64]) -> Result<Onset, Unmeasured> {
        let rough = self.roughly(levels)?;
        let reach = self.expected.reach;
        let near = rough.arrival.round().max(0.0) as usize;
        let stretch = self.stretch(
            near.saturating_sub(reach + reach / 2),
            near + reach + reach / 2,
            rough.arrival - reach as f64 / 2.0,
            rough.arrival + reach as f64 / 2.0,
        )?;
        let direction = self.expected.direction(self.edge);
        let best = profile(
            self.y,
            stretch,
            &RULES.response_shapes,
            RULES.resolution,
            direction,
        )
        .ok_or(Unmeasured::BelowNoise)?;
        let best = best.checked()?;
        if best.arrival >= stretch.last_arrival - 0.5 {
            return Err(Unmeasured::CutOff);
        }
        let edge = self.edge.sample as f64;
        Ok(Onset {
            delay: best.arrival - edge,
            standard_error: best.standard_error,
            half_response: half_response(
                self.y,
                best.arrival,
                best.level,
                self.latest.min(near + RULES.response * reach),
            )
            .map(|t| t - edge),
        })
    }
}

/// The responses to all edges of some records of one rig, in the order of the edges.
///
/// Two passes: in the first, the starts of neighbouring responses are known only roughly.
pub(crate) fn measure_all(
    series: &[(&[f64], Vec<Edge>)],
    max_delay: usize,
    reach: usize,
) -> Vec<Vec<Result<Onset, Unmeasured>>> {
    let levels: Vec<Vec<f64>> = series.iter().map(|(y, _)| level_filter(y, reach)).collect();
    let Some(mut expected) = expect(series, &levels, max_delay, reach) else {
        return series.iter().map(|_| Vec::new()).collect();
    };
    let mut delays: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for ((y, edges), levels) in series.iter().zip(&levels) {
        for (i, edge) in edges.iter().enumerate() {
            let rough = Neighbourhood::of(y, edges, i, &expected).and_then(|n| n.roughly(levels));
            if let Ok(rough) = rough.and_then(|r| r.checked()) {
                delays[usize::from(edge.rising)].push(rough.arrival - edge.sample as f64);
            }
        }
    }
    for (rising, delays) in [false, true].into_iter().zip(&mut delays) {
        let middle = delays.len() / 2;
        if middle < delays.len() {
            let median = *delays.select_nth_unstable_by(middle, f64::total_cmp).1;
            expected.set_onset(rising, median.round().max(0.0) as usize);
        }
    }
    series
        .iter()
        .zip(&levels)
        .map(|((y, edges), levels)| {
            (0..edges.len())
                .map(|i| Neighbourhood::of(y, edges, i, &expected)?.exactly(levels))
                .collect()
        })
        .collect()
}

/// The best arrival in an interval.
#[derive(Debug, Clone, Copy)]
struct Located {
    arrival: f64,
    standard_error: f64,
    /// Reduction of the residual sum of squares by the response, in noise variances.
    evidence: f64,
    /// Fitted y at the arrival.
    level: f64,
}

impl Located {
    /// The result, if it is significant and precise enough.
    fn checked(self) -> Result<Self, Unmeasured> {
        if self.evidence < RULES.detection {
            Err(Unmeasured::BelowNoise)
        } else if self.standard_error > RULES.worst_error {
            Err(Unmeasured::Blurred)
        } else {
            Ok(self)
        }
    }
}

/// A regressor with its mean removed, and its products.
#[derive(Debug, Clone)]
struct Column {
    values: Vec<f64>,
    square: f64,
    with_y: f64,
}

impl Column {
    fn new(mut values: Vec<f64>, y: &[f64]) -> Self {
        let mean = mean(&values);
        values.iter_mut().for_each(|v| *v -= mean);
        Self {
            square: dot(&values, &values),
            with_y: dot(&values, y),
            values,
        }
    }
}

/// The response from `arrival` on (in samples of the interval), written into `out`.
fn write_response(out: &mut [f64], arrival: f64, tau: f64) {
    let n = out.len() as f64;
    let first = arrival.max(0.0).ceil();
    let mut decay = (-(first - arrival) / tau).exp();
    let factor = (-1.0 / tau).exp();
    for (i, r) in out.iter_mut().enumerate() {
        let t = i as f64;
        *r = if t < first {
            0.0
        } else if tau == 0.0 {
            (t - arrival) / n
        } else {
            let value = 1.0 - decay;
            decay *= factor;
            value
        };
    }
}

/// Least squares over all arrivals and shapes in an interval.
fn profile(
    y: &[f64],
    stretch: Stretch,
    shapes: &[f64],
    resolution: f64,
    direction: f64,
) -> Option<Located> {
    let raw = y.get(stretch.from..stretch.to)?;
    let n = raw.len();
    let level = mean(raw);
    let data: Vec<f64> = raw.iter().map(|v| v - level).collect();
    let total = dot(&data, &data);
    let befores: Vec<Column> = RULES
        .before_shapes
        .iter()
        .map(|&tau| {
            let course = (0..n).map(|i| {
                let t = i as f64;
                if tau == 0.0 {
                    t / n as f64
                } else {
                    (-t / tau).exp()
                }
            });
            Column::new(course.collect(), &data)
        })
        .collect();
    let steps = ((stretch.last_arrival - stretch.first_arrival) / resolution).floor() as usize;
    let mut rss_of_arrival = Vec::with_capacity(steps + 1);
    let mut best: Option<Best> = None;
    let mut response = vec![0.0; n];
    for step in 0..=steps {
        let arrival = stretch.first_arrival - stretch.from as f64 + step as f64 * resolution;
        let mut least = f64::INFINITY;
        for &tau in shapes {
            write_response(&mut response, arrival, tau);
            let r_mean = mean(&response);
            let rr = dot(&response, &response) - n as f64 * r_mean * r_mean;
            let ry = dot(&response, &data);
            for (before, b) in befores.iter().enumerate() {
                let rb = dot(&response, &b.values);
                let determinant = b.square * rr - rb * rb;
                if determinant <= 1e-9 * b.square * rr {
                    continue;
                }
                let gain = (ry * b.square - b.with_y * rb) / determinant;
                if gain * direction <= 0.0 {
                    continue;
                }
                let course = (b.with_y * rr - ry * rb) / determinant;
                let rss = (total - course * b.with_y - gain * ry).max(0.0);
                least = least.min(rss);
                if best.as_ref().is_none_or(|b| rss < b.rss) {
                    best = Some(Best {
                        rss,
                        step,
                        arrival,
                        tau,
                        before,
                        course,
                        gain,
                        r_mean,
                    });
                }
            }
        }
        rss_of_arrival.push(least);
    }
    let best = best?;
    let before = befores.get(best.before)?;
    write_response(&mut response, best.arrival, best.tau);
    let residual: Vec<f64> = data
        .iter()
        .zip(&before.values)
        .zip(&response)
        .map(|((y, b), r)| y - best.course * b - best.gain * (r - best.r_mean))
        .collect();
    let free = n.saturating_sub(6).max(1) as f64;
    // Data without noise still have rounding errors, which limit the precision.
    let variance = best.rss / free + 1e-18 * (level * level + total / n as f64) + f64::MIN_POSITIVE;
    let widened = variance * widening(&residual);
    let rss_without = befores
        .iter()
        .filter(|b| b.square > 0.0)
        .map(|b| total - b.with_y * b.with_y / b.square)
        .fold(total, f64::min);
    let later = rss_of_arrival.iter().skip(best.step + 1);
    let sooner = rss_of_arrival.iter().take(best.step).rev();
    let half_width = (reach_of_limit(later, best.rss, best.rss + widened)
        + reach_of_limit(sooner, best.rss, best.rss + widened))
        / 2.0;
    let near = (best.arrival.round().max(0.0) as usize).min(n - 1);
    let fitted = before.values.get(near).copied().unwrap_or(0.0);
    Some(Located {
        arrival: best.arrival + stretch.from as f64,
        standard_error: half_width * resolution,
        evidence: (rss_without - best.rss) / widened,
        level: level + best.course * fitted - best.gain * best.r_mean,
    })
}

/// The best fit in an interval.
#[derive(Debug, Clone, Copy)]
struct Best {
    rss: f64,
    step: usize,
    arrival: f64,
    tau: f64,
    before: usize,
    course: f64,
    gain: f64,
    r_mean: f64,
}

/// Number of steps (with fraction) after which a profile exceeds a limit.
fn reach_of_limit<'a>(values: impl Iterator<Item = &'a f64>, start: f64, limit: f64) -> f64 {
    let mut last = start;
    let mut steps = 0.0;
    for &value in values {
        if value > limit {
            let share = if value.is_finite() {
                (limit - last) / (value - last)
            } else {
                1.0
            };
            return steps + share.clamp(0.0, 1.0);
        }
        last = value;
        steps += 1.0;
    }
    steps
}

/// Variance inflation by autocorrelation: (1 + ρ)/(1 − ρ) of a first-order process, at most 10.
fn widening(residual: &[f64]) -> f64 {
    let square = dot(residual, residual);
    let lagged: f64 = residual.windows(2).map(|w| w[0] * w[1]).sum();
    if square <= 0.0 {
        return 1.0;
    }
    let rho = (lagged / square).clamp(0.0, RULES.most_correlation);
    (1.0 + rho) / (1.0 - rho)
}

/// Time at which y (mean of 5 samples) first passes the middle between the level at the arrival and the level
/// before `end`.
pub(crate) fn half_response(y: &[f64], arrival: f64, level: f64, end: usize) -> Option<f64> {
    let start = arrival.round().max(0.0) as usize;
    let end = end.min(y.len());
    let tail = y.get(start + (end.saturating_sub(start)) * 2 / 3..end)?;
    if tail.len() < RULES.least_side {
        return None;
    }
    let half = f64::midpoint(level, mean(tail));
    let upward = mean(tail) > level;
    let smooth = |k: usize| y.get(k.saturating_sub(2)..k + 3).map(mean);
    let mut last = smooth(start)?;
    for k in start + 1..end {
        let now = smooth(k)?;
        if (now >= half) == upward && (last >= half) != upward {
            return Some(k as f64 - (now - half) / (now - last));
        }
        last = now;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// ẏ = (u(t − h) − y)/τ, sampled exactly; the delay need not be a whole number of samples.
    fn first_order(edges: &[Edge], delay: f64, tau: f64, n: usize) -> Vec<f64> {
        let mut y = vec![0.0; n];
        let mut value: f64 = 0.0;
        let mut input = 0.0;
        let mut time = 0.0;
        let mut arrivals = edges
            .iter()
            .map(|e| (e.sample as f64 + delay, f64::from(u8::from(e.rising))))
            .peekable();
        for (k, out) in y.iter_mut().enumerate() {
            while let Some((at, level)) = arrivals.next_if(|(at, _)| *at <= k as f64) {
                value = input + (value - input) * (-(at - time) / tau).exp();
                (time, input) = (at, level);
            }
            *out = input + (value - input) * (-(k as f64 - time) / tau).exp();
        }
        y
    }

    fn square(period: usize, on: usize, n: usize) -> Vec<Edge> {
        (0..n / period)
            .flat_map(|i| [(i * period + 200, true), (i * period + 200 + on, false)])
            .filter(|e| e.0 + 200 < n)
            .map(|(sample, rising)| Edge { sample, rising })
            .collect()
    }

    fn measure(y: &[f64], edges: &[Edge]) -> Vec<Result<Onset, Unmeasured>> {
        measure_all(&[(y, edges.to_vec())], 250, 30).remove(0)
    }

    #[test]
    fn without_noise_the_delay_is_exact_for_slow_and_fast_responses() {
        for (period, on) in [(250, 125), (125, 63), (1000, 300), (250, 200)] {
            for tau in [15.0, 60.0, 200.0] {
                for (delay, sign) in [(48.0, 1.0), (31.37, -1.0)] {
                    let edges = square(period, on, 3000);
                    let y: Vec<f64> = first_order(&edges, delay, tau, 3000)
                        .iter()
                        .map(|y| sign * y)
                        .collect();
                    for (i, onset) in measure(&y, &edges).into_iter().enumerate() {
                        let found = onset
                            .unwrap_or_else(|e| panic!("{e:?}: {period} {tau} {delay} edge {i}"));
                        assert!(
                            (found.delay - delay).abs() <= 1.25,
                            "{period} {tau} {delay} edge {i}: {found:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn with_noise_the_error_is_the_one_stated() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let edges = square(250, 125, 20_000);
        let clean = first_order(&edges, 40.0, 60.0, 20_000);
        let mut coloured = 0.0;
        let y: Vec<f64> = clean
            .iter()
            .map(|y| {
                let (a, b): (f64, f64) = (
                    StandardNormal.sample(&mut rng),
                    StandardNormal.sample(&mut rng),
                );
                // Noise of an average over 20 repeats: white with s.d. 0.03, and coloured with s.d.
                // 0.035 and a correlation time of 20 ms.
                coloured = coloured * (-1.0f64 / 20.0).exp()
                    + a * 0.035 / 20f64.sqrt() * (1.0 - (-0.1f64).exp()).sqrt();
                y + coloured + b * 0.03 / 20f64.sqrt()
            })
            .collect();
        let found: Vec<Onset> = measure(&y, &edges).into_iter().flatten().collect();
        assert!(
            found.len() * 10 >= edges.len() * 9,
            "{} of {}",
            found.len(),
            edges.len()
        );
        let n = found.len() as f64;
        let bias = found.iter().map(|o| o.delay - 40.0).sum::<f64>() / n;
        let rms = (found.iter().map(|o| (o.delay - 40.0).powi(2)).sum::<f64>() / n).sqrt();
        let stated = (found.iter().map(|o| o.standard_error.powi(2)).sum::<f64>() / n).sqrt();
        assert!(bias.abs() < 0.5, "bias {bias}");
        assert!(rms < 2.0, "rms {rms}");
        assert!(
            stated > 0.3 * rms && stated < 2.0 * rms,
            "stated {stated}, rms {rms}"
        );
    }

    #[test]
    fn what_cannot_be_measured_says_why() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let edges = square(250, 125, 3000);
        let noise: Vec<f64> = (0..3000).map(|_| StandardNormal.sample(&mut rng)).collect();
        let found = measure(&noise, &edges);
        let seen = found.iter().filter(|o| o.is_ok()).count();
        assert!(seen <= 1, "{seen} of {}: {found:?}", found.len());
        // The last response lies beyond the end of the record.
        let mut y = first_order(&edges, 40.0, 30.0, 3000);
        y.truncate(edges[edges.len() - 1].sample + 45);
        let last = measure(&y, &edges).pop().unwrap();
        assert!(
            matches!(
                last,
                Err(Unmeasured::CutOff | Unmeasured::BelowNoise | Unmeasured::Blurred)
            ),
            "{last:?}"
        );
    }
}
