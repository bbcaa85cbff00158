//! The delay law (2): h̃(ỹ) = p0 + p1·exp(−p2·ỹ), by nonlinear least squares.
//!
//! p0 and p1 are linear, so for every p2 they follow from linear least squares (variable projection). Only p2 is
//! searched: on a logarithmic grid, then by golden section. Outliers (5 robust standard deviations of a Huber fit)
//! are first excluded and reported. Intervals are t-intervals from the Jacobian at the optimum; a test checks their
//! coverage.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::rules::RULES;
use super::verdict::DelayVerdict;
use numerics::linalg;

/// A point of the law: averaged output (1) at the response, delay in samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayPoint {
    /// ỹ when the response starts.
    pub mean_output: f64,
    /// Measured delay, samples.
    pub delay: f64,
    /// Whether the command rose.
    pub rising: bool,
}

/// An estimate with its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Standard error.
    pub standard_error: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// The fitted law (2).
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct DelayLawFit {
    /// Delay of the attached flow, samples.
    pub p0: Estimate,
    /// Further delay of the separated flow (ỹ = 0), samples.
    pub p1: Estimate,
    /// Rate at which the further delay vanishes, 1/y.
    pub p2: Estimate,
    /// Standard deviation of the measured delays around the law, samples (n − 3 degrees of freedom).
    pub residual_sd: f64,
    /// Share of the variance of the delays that the law explains, 0–1.
    pub explained: f64,
    /// Edges in the fit.
    pub edges: usize,
    /// Indices (into the given points) of edges that are excluded as outliers.
    pub outliers: Vec<usize>,
    /// Smallest and largest ỹ in the fit: outside, the law is an extrapolation.
    pub range: (f64, f64),
    /// Covariance of p0, p1 and ln p2, row by row.
    #[serde(skip)]
    covariance: [[f64; 3]; 3],
    /// Student's t for 95 %.
    #[serde(skip)]
    quantile: f64,
}

impl DelayLawFit {
    /// h̃(ỹ), samples (not rounded).
    #[must_use]
    pub fn at(&self, mean_output: f64) -> f64 {
        self.p0.value + self.p1.value * (-self.p2.value * mean_output).exp()
    }

    /// The 95 % confidence band of the law at ỹ, samples: (low, high). Infinite where the data do not determine it.
    #[must_use]
    pub fn band(&self, mean_output: f64) -> (f64, f64) {
        let gradient = gradient(self.p1.value, self.p2.value, mean_output);
        let variance: f64 = self
            .covariance
            .iter()
            .zip(&gradient)
            .flat_map(|(row, a)| row.iter().zip(&gradient).map(move |(c, b)| a * b * c))
            .sum();
        let half = self.quantile * variance.max(0.0).sqrt();
        let middle = self.at(mean_output);
        if half.is_finite() {
            (middle - half, middle + half)
        } else {
            (f64::NEG_INFINITY, f64::INFINITY)
        }
    }
}

impl DelayLawFit {
    /// h̃ at the lowest ỹ of the fit minus h̃ at the highest, samples, with its standard error. ỹ below 0 counts as
    /// 0.
    #[must_use]
    pub fn change(&self) -> (f64, f64) {
        let (low, high) = (self.range.0.max(0.0), self.range.1.max(0.0));
        let ends = [low, high].map(|y| gradient(self.p1.value, self.p2.value, y));
        let slope: Vec<f64> = ends[0].iter().zip(&ends[1]).map(|(a, b)| a - b).collect();
        let variance: f64 = self
            .covariance
            .iter()
            .zip(&slope)
            .flat_map(|(row, a)| row.iter().zip(&slope).map(move |(c, b)| a * b * c))
            .filter(|term| !term.is_nan())
            .sum();
        (self.at(low) - self.at(high), variance.max(0.0).sqrt())
    }

    /// The reason why a fitted law must not be used, if there is one. `data` are the smallest and largest ỹ of all
    /// samples, `longest` is the longest delay that was searched.
    pub(crate) fn objection(
        &self,
        verdict: DelayVerdict,
        data: (f64, f64),
        longest: f64,
    ) -> Option<String> {
        let ends = [self.at(data.0), self.at(data.1)];
        let least = ends[0].min(ends[1]);
        let most = ends[0].max(ends[1]);
        let (change, standard_error) = self.change();
        let range = format!("ỹ from {:.3} to {:.3}", self.range.0, self.range.1);
        if least.is_nan() || least < 0.0 {
            return Some(
                "it is negative for some ỹ within these data, but a delay cannot be negative"
                    .to_owned(),
            );
        }
        if most > longest {
            return Some(format!(
                "for some ỹ within these data it is longer than {longest:.0} samples, the longest delay that was \
                    searched"
            ));
        }
        let error = self.quantile * standard_error;
        if error.is_nan() || change.abs() <= error {
            let change = change.abs();
            return Some(if standard_error.is_finite() {
                format!("it changes by {change:.1} ± {standard_error:.1} samples over {range}")
            } else {
                format!("its change of {change:.1} samples over {range} is not identifiable")
            });
        }
        match verdict {
            DelayVerdict::StateDependent | DelayVerdict::EdgeAndStateDependent => None,
            DelayVerdict::Fixed => Some(format!(
                "a constant delay fits equally well over {range} (permutation test)"
            )),
            DelayVerdict::EdgeDependent => {
                Some("one delay per edge direction fits equally well".to_owned())
            }
            DelayVerdict::TooFewEdges => Some(format!(
                "{} edges are too few to test it against a constant",
                self.edges
            )),
        }
    }
}

/// ∂h̃/∂(p0, p1, ln p2).
fn gradient(p1: f64, p2: f64, mean_output: f64) -> [f64; 3] {
    let e = (-p2 * mean_output).exp();
    [1.0, e, -p1 * p2 * mean_output * e]
}

/// Least-squares fit at a fixed p2.
#[derive(Debug, Clone)]
pub(crate) struct AtRate {
    /// p0, p1 and, with an additional column, the coefficient of that column.
    pub(crate) linear: Vec<f64>,
    pub(crate) rss: f64,
}

/// Weighted least squares of the delays on 1, exp(−rate·ỹ) and, if wanted, ±½ for the direction of the edge.
pub(crate) fn at_rate(
    points: &[DelayPoint],
    weights: Option<&[f64]>,
    rate: f64,
    direction: bool,
) -> Option<AtRate> {
    let size = if direction { 3 } else { 2 };
    let row = |p: &DelayPoint| -> [f64; 3] {
        let side = if !direction {
            0.0
        } else if p.rising {
            0.5
        } else {
            -0.5
        };
        [1.0, (-rate * p.mean_output).exp(), side]
    };
    let weight = |i: usize| weights.and_then(|w| w.get(i)).copied().unwrap_or(1.0);
    let mut normal = vec![0.0; size * size];
    let mut right = vec![0.0; size];
    for (i, p) in points.iter().enumerate() {
        let x = row(p);
        for (a, target) in normal.chunks_exact_mut(size).enumerate() {
            for (target, xb) in target.iter_mut().zip(&x) {
                *target += weight(i) * x.get(a)? * xb;
            }
            *right.get_mut(a)? += weight(i) * x.get(a)? * p.delay;
        }
    }
    let linear = linalg::solve_symmetric(&normal, &right)?;
    let rss = points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let fitted: f64 = row(p).iter().zip(&linear).map(|(x, c)| x * c).sum();
            weight(i) * (p.delay - fitted).powi(2)
        })
        .sum();
    Some(AtRate { linear, rss })
}

/// The rates that are tried first, for points of this range of ỹ.
pub(crate) fn rate_grid(points: &[DelayPoint]) -> Vec<f64> {
    let (low, high) = range(points);
    let span = high - low;
    if span.is_nan() || span <= 0.0 {
        return Vec::new();
    }
    let (slowest, fastest) = (RULES.slowest_rate, RULES.fastest_rate);
    let ratio = (fastest / slowest).ln() / (RULES.rates - 1) as f64;
    (0..RULES.rates)
        .map(|i| slowest * (ratio * i as f64).exp() / span)
        .collect()
}

fn range(points: &[DelayPoint]) -> (f64, f64) {
    points
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| {
            (l.min(p.mean_output), h.max(p.mean_output))
        })
}

/// The best rate and its fit: grid, then golden section in ln p2 around the best of the grid.
pub(crate) fn best_rate(
    points: &[DelayPoint],
    weights: Option<&[f64]>,
    direction: bool,
) -> Option<(f64, AtRate)> {
    let rss = |rate: f64| at_rate(points, weights, rate, direction);
    let grid = rate_grid(points);
    let (best, _) = grid
        .iter()
        .enumerate()
        .filter_map(|(i, &rate)| Some((i, rss(rate)?.rss)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let end = |i: usize| grid.get(i).copied().map(f64::ln);
    let mut low = end(best.saturating_sub(1))?;
    let mut high = end((best + 1).min(grid.len() - 1))?;
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let value = |x: f64| rss(x.exp()).map_or(f64::INFINITY, |f| f.rss);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut fa, mut fb) = (value(a), value(b));
    for _ in 0..60 {
        if fa <= fb {
            high = b;
            (b, fb) = (a, fa);
            a = high - golden * (high - low);
            fa = value(a);
        } else {
            low = a;
            (a, fa) = (b, fb);
            b = low + golden * (high - low);
            fb = value(b);
        }
    }
    let rate = ((low + high) / 2.0).exp();
    Some((rate, rss(rate)?))
}

/// Indices of the outliers of a robust (Huber) fit.
fn outliers(points: &[DelayPoint]) -> Vec<usize> {
    let mut weights = vec![1.0; points.len()];
    let mut found = Vec::new();
    for _ in 0..8 {
        let Some((rate, fit)) = best_rate(points, Some(&weights), false) else {
            return Vec::new();
        };
        let [p0, p1] = fit.linear[..] else {
            return Vec::new();
        };
        let residual: Vec<f64> = points
            .iter()
            .map(|p| p.delay - p0 - p1 * (-rate * p.mean_output).exp())
            .collect();
        let mut size: Vec<f64> = residual.iter().map(|r| r.abs()).collect();
        let middle = size.len() / 2;
        let Some((_, median, _)) =
            (middle < size.len()).then(|| size.select_nth_unstable_by(middle, f64::total_cmp))
        else {
            return Vec::new();
        };
        // The median of |normal deviates| is σ/1.4826.
        let scale = (1.4826 * *median).max(RULES.known_to);
        for (w, r) in weights.iter_mut().zip(&residual) {
            *w = (RULES.robust * scale / r.abs().max(f64::MIN_POSITIVE)).min(1.0);
        }
        found = residual
            .iter()
            .enumerate()
            .filter(|(_, r)| r.abs() > RULES.outlier * scale)
            .map(|(i, _)| i)
            .collect();
    }
    found
}

/// Fits law (2). `None` with fewer than 5 edges, or when all have the same ỹ.
#[must_use]
pub fn fit_delay_law(points: &[DelayPoint]) -> Option<DelayLawFit> {
    if points.len() < RULES.law_edges {
        return None;
    }
    let outliers = outliers(points);
    let kept: Vec<DelayPoint> = points
        .iter()
        .enumerate()
        .filter(|(i, _)| !outliers.contains(i))
        .map(|(_, p)| *p)
        .collect();
    if kept.len() < RULES.law_edges {
        return None;
    }
    let (p2, fit) = best_rate(&kept, None, false)?;
    let [p0, p1] = fit.linear[..] else {
        return None;
    };
    let n = kept.len();
    let free = (n - 3) as f64;
    let variance = fit.rss / free;
    let mean = kept.iter().map(|p| p.delay).sum::<f64>() / n as f64;
    let total: f64 = kept.iter().map(|p| (p.delay - mean).powi(2)).sum();
    // (JᵀJ)⁻¹, column by column; ln p2 in place of p2 keeps the matrix well conditioned.
    let mut information = vec![0.0; 9];
    for p in &kept {
        let j = gradient(p1, p2, p.mean_output);
        for (row, ja) in information.chunks_exact_mut(3).zip(&j) {
            for (target, jb) in row.iter_mut().zip(&j) {
                *target += ja * jb;
            }
        }
    }
    // An undetermined direction has an infinite error.
    let mut covariance = [[f64::INFINITY; 3]; 3];
    for (axis, row) in covariance.iter_mut().enumerate() {
        let unit: Vec<f64> = (0..3).map(|i| f64::from(u8::from(i == axis))).collect();
        if let Some(column) = linalg::solve_symmetric(&information, &unit) {
            for (target, value) in row.iter_mut().zip(column) {
                *target = variance * value;
            }
        }
    }
    let quantile = StudentsT::new(0.0, 1.0, free)
        .ok()?
        .inverse_cdf(0.5 + 0.5 * RULES.confidence);
    let estimate = |value: f64, axis: usize, scale: f64| {
        let variance = covariance
            .get(axis)
            .and_then(|row| row.get(axis))
            .copied()
            .filter(|v| *v >= 0.0)
            .unwrap_or(f64::INFINITY);
        let standard_error = variance.sqrt() * scale;
        Estimate {
            value,
            standard_error,
            low: value - quantile * standard_error,
            high: value + quantile * standard_error,
        }
    };
    Some(DelayLawFit {
        p0: estimate(p0, 0, 1.0),
        p1: estimate(p1, 1, 1.0),
        p2: estimate(p2, 2, p2),
        residual_sd: variance.sqrt(),
        explained: if total > 0.0 {
            1.0 - fit.rss / total
        } else {
            0.0
        },
        edges: n,
        outliers,
        range: range(&kept),
        covariance,
        quantile,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// The law as published: p0 = 47.35, p1 = 12.69, p2 = 20.18.
    fn points(n: usize, noise: f64, seed: u64) -> Vec<DelayPoint> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..n)
            .map(|i| {
                let y: f64 = rng.random_range(0.0..0.4);
                let z: f64 = StandardNormal.sample(&mut rng);
                DelayPoint {
                    mean_output: y,
                    delay: 47.35 + 12.69 * (-20.18 * y).exp() + noise * z,
                    rising: i % 2 == 0,
                }
            })
            .collect()
    }

    #[test]
    fn published_law_is_recovered() {
        let fit = fit_delay_law(&points(60, 0.0, 1)).unwrap();
        for (e, truth) in [(fit.p0, 47.35), (fit.p1, 12.69), (fit.p2, 20.18)] {
            assert!((e.value / truth - 1.0).abs() < 1e-5, "{e:?}");
        }
        assert!(fit.explained > 0.999_999 && fit.outliers.is_empty());
        assert!((fit.at(0.1) - (47.35 + 12.69 * (-2.018f64).exp())).abs() < 1e-4);
    }

    #[test]
    fn intervals_cover_the_truth_as_often_as_they_say() {
        let mut covered = [0; 4];
        let runs = 400;
        for seed in 0..runs {
            let fit = fit_delay_law(&points(100, 1.0, seed)).unwrap();
            for (count, (e, truth)) in
                covered
                    .iter_mut()
                    .zip([(fit.p0, 47.35), (fit.p1, 12.69), (fit.p2, 20.18)])
            {
                *count += u32::from(e.low <= truth && truth <= e.high);
            }
            let (low, high) = fit.band(0.1);
            let truth = 47.35 + 12.69 * (-2.018f64).exp();
            covered[3] += u32::from(low <= truth && truth <= high);
        }
        for count in covered {
            let share = f64::from(count) / runs as f64;
            // The tolerance of 0.03 is 2.75 standard deviations.
            assert!((share - 0.95).abs() < 0.03, "{covered:?} of {runs}");
        }
    }

    #[test]
    fn wild_edges_are_set_aside_and_named() {
        let mut wild = points(60, 0.5, 2);
        let clean = fit_delay_law(&wild).unwrap();
        for (i, delay) in [(3, 90.0), (17, 5.0), (40, 110.0)] {
            wild[i].delay = delay;
        }
        let fit = fit_delay_law(&wild).unwrap();
        assert_eq!(fit.outliers, [3, 17, 40]);
        assert!((fit.p1.value - clean.p1.value).abs() < clean.p1.standard_error);
    }

    #[test]
    fn too_little_to_go_on_gives_no_law() {
        assert!(fit_delay_law(&points(4, 0.1, 3)).is_none());
        let mut same = points(20, 0.1, 3);
        same.iter_mut().for_each(|p| p.mean_output = 0.2);
        assert!(fit_delay_law(&same).is_none());
    }
}
