//! ARX(2,2): y_k = a₁·y_{k−1} + a₂·y_{k−2} + b₁·u_{k−nk} + b₂·u_{k−nk−1} + c by plain least squares.

use super::initial::InitialState;
use super::response::Shape;
use super::series::{Scaling, Series, command_before};
use crate::data::Record;
use numerics::linalg::Cholesky;
use serde::Serialize;

/// Delays that are tried first, in addition to those near a known dead time.
const DELAYS: usize = 24;

/// An ARX(2,2) model: y_k = a₁·y_{k−1} + a₂·y_{k−2} + b₁·u_{k−nk} + b₂·u_{k−nk−1} + c.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Arx {
    /// a₁ and a₂.
    pub a: [f64; 2],
    /// b₁ and b₂, y per unit of u.
    pub b: [f64; 2],
    /// c, in y.
    pub c: f64,
    /// nk, samples; 0 if y_k depends on u_k, 1 if it depends on u_{k−1}.
    pub delay: usize,
}

/// Complex logarithm of a pole: decay rate and angle per sample.
fn logarithms(a: [f64; 2]) -> Option<[(f64, f64); 2]> {
    let [a1, a2] = a;
    let inside = a1 * a1 / 4.0 + a2;
    if inside >= 0.0 {
        let root = inside.sqrt();
        // The larger root is computed first and the other from the product, so that neither loses digits.
        let large = a1 / 2.0 + root.copysign(if a1 == 0.0 { 1.0 } else { a1 });
        let small = if large == 0.0 { 0.0 } else { -a2 / large };
        let of = |pole: f64| {
            let angle = if pole < 0.0 {
                std::f64::consts::PI
            } else {
                0.0
            };
            (pole.abs().ln(), angle)
        };
        Some([of(large), of(small)])
    } else {
        let rate = 0.5 * (-a2).ln();
        let angle = (-inside).sqrt().atan2(a1 / 2.0);
        angle.is_finite().then_some([(rate, angle), (rate, -angle)])
    }
}

impl Arx {
    /// Magnitude of the largest pole.
    #[must_use]
    pub fn largest_pole(&self) -> f64 {
        let poles = logarithms(self.a);
        poles.map_or(f64::NAN, |poles| {
            poles.iter().map(|p| p.0.exp()).fold(0.0, f64::max)
        })
    }

    fn is_stable(&self) -> bool {
        let numbers = [self.a[0], self.a[1], self.b[0], self.b[1], self.c];
        numbers.iter().all(|number| number.is_finite()) && self.largest_pole() < 1.0
    }

    /// The free run over `u`, with `first` before it and the initial state estimated from `y`.
    fn run(&self, u: &[f64], first: f64, y: &[f64]) -> Vec<f64> {
        let at = |k: usize, lag: usize| {
            let index = k.checked_sub(lag);
            index.and_then(|i| u.get(i)).copied().unwrap_or(first)
        };
        let level = y.first().copied().unwrap_or(0.0);
        let mut out = Vec::with_capacity(u.len());
        let (mut last, mut before) = (level, level);
        for k in 0..u.len() {
            let now = self.a[0] * last
                + self.a[1] * before
                + self.b[0] * at(k, self.delay)
                + self.b[1] * at(k, self.delay + 1)
                + self.c;
            out.push(now);
            (before, last) = (last, now);
        }
        let poles = logarithms(self.a).unwrap_or([(0.0, 0.0); 2]);
        let speed = poles.iter().map(|(rate, angle)| rate.hypot(*angle));
        let fastest = 1.0 / speed.fold(1e-9, f64::max);
        InitialState::new(self.free(u.len()), u.len(), fastest).added_to(&out, y)
    }

    /// Free responses to a unit in each of the two values before the record.
    fn free(&self, samples: usize) -> Vec<Vec<f64>> {
        let column = |mut last: f64, mut before: f64| {
            let mut out = Vec::new();
            while out.len() < samples && last.abs() + before.abs() > 1e-12 {
                let now = self.a[0] * last + self.a[1] * before;
                out.push(now);
                (before, last) = (last, now);
            }
            out
        };
        // Sum and difference of the two states are nearly orthogonal at a high sampling rate.
        vec![column(1.0, 1.0), column(0.5, -0.5)]
    }

    /// The free run over a record; `None` if it does not stay finite.
    #[must_use]
    pub fn simulate(&self, record: &Record) -> Option<Vec<f64>> {
        let run = self.run(&record.u, command_before(record), &record.y);
        run.iter().all(|y| y.is_finite()).then_some(run)
    }

    /// The model in the unscaled units of y and u.
    fn unscaled(&self, scaling: &Scaling) -> Self {
        let per_u = scaling.y_scale / scaling.u_scale;
        let b = self.b.map(|b| b * per_u);
        let static_part = (1.0 - self.a[0] - self.a[1]) * scaling.y_mean;
        Self {
            a: self.a,
            b,
            c: scaling.y_scale * self.c + static_part - (b[0] + b[1]) * scaling.u_mean,
            delay: self.delay,
        }
    }
}

/// Least squares of one delay over scaled records.
fn least_squares(series: &[Series], delay: usize) -> Option<Arx> {
    const N: usize = 6;
    let mut gram = [0.0; N * N];
    for stretch in series {
        let first = stretch.before;
        let at = |k: usize, lag: usize| {
            let index = k.checked_sub(lag);
            index
                .and_then(|i| stretch.u.get(i))
                .copied()
                .unwrap_or(first)
        };
        let judged = stretch.lead.saturating_sub(2);
        for (k, y) in stretch.y.windows(3).enumerate().skip(judged) {
            let &[before, last, now] = y else { continue };
            let (new, old) = (at(k + 2, delay), at(k + 2, delay + 1));
            // Differences are used, because neighbouring samples are nearly equal. For the same reason y
            // is taken relative to the last y.
            let row = [last, last - before, new, new - old, 1.0, now - last];
            for i in 0..N {
                for j in 0..=i {
                    gram[i * N + j] += row[i] * row[j];
                }
            }
        }
    }
    let n = N - 1;
    let normal: Vec<f64> = (0..n * n)
        .map(|cell| gram[(cell / n).max(cell % n) * N + (cell / n).min(cell % n)])
        .collect();
    let pull: Vec<f64> = (0..n).map(|i| gram[n * N + i]).collect();
    let factor = Cholesky::new(&normal, n);
    let solution = factor.backward(factor.forward(&pull));
    let &[level, slope, gain, edge, c] = solution.as_slice() else {
        return None;
    };
    let arx = Arx {
        a: [1.0 + level + slope, -slope],
        b: [gain + edge, -edge],
        c,
        delay,
    };
    arx.is_stable().then_some(arx)
}

/// Second-order shapes with the poles of an ARX(2,2) model, one for each of a few delays.
pub(super) fn shapes(series: &[Series]) -> Vec<Shape> {
    let mut shapes = Vec::new();
    for delay in [0, 1, 3, 8, 20] {
        let Some(arx) = least_squares(series, delay) else {
            continue;
        };
        let Some([(rate, angle), (other, other_angle)]) = logarithms(arx.a) else {
            continue;
        };
        let frequency = (rate.hypot(angle) * other.hypot(other_angle)).sqrt();
        let damping = -(rate + other) / (2.0 * frequency);
        let sensible = (1e-6..10.0).contains(&frequency) && (0.005..100.0).contains(&damping);
        if sensible {
            shapes.push(Shape::Second { frequency, damping });
        }
    }
    shapes
}

/// The ARX(2,2) of one delay, if it is stable.
#[cfg(test)]
pub(super) fn of_delay(series: &[Series], scaling: &Scaling, delay: usize) -> Option<Arx> {
    Some(least_squares(series, delay)?.unscaled(scaling))
}

/// The stable ARX(2,2) with the least free-run error on the scaled records over all delays; `near` are dead times, in
/// samples, around which every delay is tried. `None` if no delay gives a stable model.
pub(super) fn fit(
    series: &[Series],
    scaling: &Scaling,
    longest_delay: usize,
    near: &[f64],
) -> Option<Arx> {
    let cost = |delay: usize| -> Option<(f64, Arx)> {
        let arx = least_squares(series, delay)?;
        let mut sum = 0.0;
        for stretch in series {
            let run = arx.run(&stretch.u, stretch.before, &stretch.y);
            let errors = stretch.y.iter().zip(&run).skip(stretch.lead);
            sum += errors.map(|(y, x)| (y - x).powi(2)).sum::<f64>();
        }
        sum.is_finite().then_some((sum, arx))
    };
    let spaced = (0..=DELAYS).map(|i| i * longest_delay / DELAYS);
    let close = near.iter().flat_map(|dead| {
        let nearest = dead.round().max(0.0) as usize;
        nearest.saturating_sub(1)..=nearest + 3
    });
    let mut delays: Vec<usize> = (0..=4).chain(spaced).chain(close).collect();
    delays.retain(|delay| *delay <= longest_delay);
    delays.sort_unstable();
    delays.dedup();
    let less = |a: &(f64, Arx), b: &(f64, Arx)| a.0.total_cmp(&b.0);
    let mut best = delays.into_iter().filter_map(cost).min_by(less)?;
    // Descent over the delay, one sample at a time.
    for _ in 0..longest_delay.min(40) {
        let here = best.1.delay;
        let beside = [
            here.checked_sub(1),
            Some(here + 1),
            here.checked_sub(2),
            Some(here + 2),
        ];
        let beside = beside.into_iter().flatten();
        let next = beside
            .filter(|delay| *delay <= longest_delay)
            .filter_map(cost)
            .min_by(less);
        match next {
            Some(next) if next.0 < best.0 => best = next,
            _ => break,
        }
    }
    let arx = best.1.unscaled(scaling);
    arx.is_stable().then_some(arx)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    fn record(samples: usize) -> Record {
        let u: Vec<f64> = (0..samples)
            .map(|k| 2.0 + f64::from(u8::from((k * k / 37) % 5 < 2)))
            .collect();
        let truth = TRUTH;
        let mut y = vec![21.0, 20.0];
        for k in 2..samples {
            let at = |lag: usize| u[k.saturating_sub(lag)];
            let past = truth.a[0] * y[k - 1] + truth.a[1] * y[k - 2];
            y.push(past + truth.b[0] * at(4) + truth.b[1] * at(5) + truth.c);
        }
        Record::new("r", Use::Identify, 1.0, u, y)
    }

    const TRUTH: Arx = Arx {
        a: [1.5, -0.6],
        b: [0.3, -0.1],
        c: 1.7,
        delay: 4,
    };

    #[test]
    fn the_recursion_that_made_a_record_is_found_with_its_delay() {
        let record = record(600);
        let scaling = Scaling::of(&[&record]).expect("it moves");
        let series = [scaling.scaled(&record)];
        let found = fit(&series, &scaling, 200, &[]).expect("a stable one");
        assert_eq!(found.delay, 4);
        for (found, truth) in [
            (found.a[0], TRUTH.a[0]),
            (found.a[1], TRUTH.a[1]),
            (found.b[0], TRUTH.b[0]),
            (found.b[1], TRUTH.b[1]),
            (found.c, TRUTH.c),
        ] {
            assert!((found - truth).abs() < 1e-6, "{found} {truth}");
        }
        let run = found.simulate(&record).expect("finite");
        assert!(run.iter().zip(&record.y).all(|(x, y)| (x - y).abs() < 1e-5));
    }

    #[test]
    fn poles_of_known_recursions() {
        let of = |a| Arx { a, ..TRUTH }.largest_pole();
        assert!((of([1.1, -0.3]) - 0.6).abs() < 1e-12);
        assert!((of([0.0, -0.81]) - 0.9).abs() < 1e-12);
        assert!((of([-0.5, 0.0]) - 0.5).abs() < 1e-12);
        assert!(of([2.0, -1.0]) >= 1.0 && of([0.0, 0.0]) == 0.0);
    }

    #[test]
    fn what_grows_has_no_stable_recursion() {
        let u: Vec<f64> = (0..300).map(|k| f64::from(u8::from(k % 7 < 3))).collect();
        let mut y = vec![1.0];
        for k in 1..300 {
            y.push(1.05 * y[k - 1] + 0.1 * u[k - 1]);
        }
        let record = Record::new("r", Use::Identify, 1.0, u, y);
        let scaling = Scaling::of(&[&record]).expect("it moves");
        assert_eq!(fit(&[scaling.scaled(&record)], &scaling, 100, &[]), None);
    }
}
