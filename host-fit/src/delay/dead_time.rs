//! The dead time of one linear plant with an interval that covers the choice of its order.
//!
//! A dead time and a second time constant have similar effects: h falls by about T₂ when T₂ is allowed. Therefore h
//! is not that of the best order but an average over all orders. For each ratio b of a grid around the best, and
//! for the first order (b = 0), the fit over h and S gives a normal distribution of h with the weight
//!
//!    w_b ∝ prior(b)·√det Cov(h, ln S)·exp(−RSS_b / 2σ²ν)
//!
//! with σ² the residual variance and ν its inflation by autocorrelation, (1 + ρ)/(1 − ρ). A third lag also shortens
//! h, so it is one more order: T₃ takes some values in proportion to S, and b and its covariance are integrated
//! too. The prior is one half for the first order and a quarter each for the second and the third. The interval is
//! that of the mixture, from 2.5 to 97.5 %.

use super::linear::{Evaluation, Free, LARGEST_RATIO, Refined, Series, refine};
use super::plant::Plant;
use super::rules::RULES;
use super::spread::spread;
use numerics::linalg::dot;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// An estimate of a dead time.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct DeadTime {
    /// Dead time, samples: the first sample that u_k can change is y_{k+1+h}.
    pub samples: f64,
    /// Standard error of the dead time, samples.
    pub standard_error: f64,
    /// Lower end of the 95 % interval, samples.
    pub low: f64,
    /// Upper end of the 95 % interval, samples.
    pub high: f64,
}

impl DeadTime {
    /// Mean of several edges; `common` is the error that all edges share: order, settings and clock.
    pub(crate) fn of_edges(edges: &[(f64, f64)], common: f64) -> Option<Self> {
        let n = edges.len();
        if n == 0 {
            return None;
        }
        let delays: Vec<f64> = edges.iter().map(|e| e.0).collect();
        let spread = spread(&delays);
        let own = edges.iter().map(|e| e.1 * e.1).sum::<f64>().sqrt() / n as f64;
        let scatter = spread.sd / (n as f64).sqrt();
        let upper = 0.5 + 0.5 * RULES.confidence;
        let normal = Normal::standard().inverse_cdf(upper);
        // A single edge has no scatter; its own error is used.
        let student = match n {
            1 => normal,
            _ => StudentsT::new(0.0, 1.0, n as f64 - 1.0).map_or(normal, |t| t.inverse_cdf(upper)),
        };
        let half = (normal * own).max(student * scatter).hypot(normal * common);
        Some(Self {
            samples: spread.mean,
            standard_error: own.max(scatter).hypot(common),
            low: (spread.mean - half).max(0.0),
            high: spread.mean + half,
        })
    }

    /// The dead time in another unit, multiplied by `factor`: seconds if that is the sampling period.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            samples: self.samples * factor,
            standard_error: self.standard_error * factor,
            low: self.low * factor,
            high: self.high * factor,
        }
    }
}

/// One component of the mixture for h.
#[derive(Debug, Clone, Copy)]
struct Component {
    log_weight: f64,
    mean: f64,
    sd: f64,
}

/// Autocorrelation of neighbouring residuals, from 0 to the largest that is corrected for.
pub(crate) fn correlation_of_neighbours(at: &Evaluation) -> f64 {
    let pairs = at.residuals.iter().flat_map(|r| r.windows(2));
    let lagged: f64 = pairs.map(|w| w[0] * w[1]).sum();
    let square: f64 = at.residuals.iter().map(|r| dot(r, r)).sum();
    if square > 0.0 {
        (lagged / square).clamp(0.0, RULES.slowest_disturbance)
    } else {
        0.0
    }
}

/// The variance of the residual, inflated for its autocorrelation.
pub(crate) fn widened_variance(at: &Evaluation) -> f64 {
    let samples: usize = at.residuals.iter().map(Vec::len).sum();
    let free = samples.saturating_sub(3 + 3 * at.residuals.len()).max(1) as f64;
    let rho = correlation_of_neighbours(at);
    // Data without noise still have rounding errors.
    at.rss / free * (1.0 + rho) / (1.0 - rho) + f64::MIN_POSITIVE
}

/// The natural logarithm of the determinant of a small positive definite matrix, row by row. A pivot is at least the
/// smallest positive number.
fn log_determinant(matrix: &[f64], size: usize) -> f64 {
    let mut left = matrix.to_vec();
    let mut sum = 0.0;
    for pivot in 0..size {
        let diagonal = left[pivot * size + pivot].max(f64::MIN_POSITIVE);
        sum += diagonal.ln();
        for row in pivot + 1..size {
            let factor = left[row * size + pivot] / diagonal;
            for column in pivot..size {
                left[row * size + column] -= factor * left[pivot * size + column];
            }
        }
    }
    sum
}

/// Density of the prior of b if there is a second time constant (probability ½); it favours plants that do not ring.
fn prior(ratio: f64) -> f64 {
    if ratio <= 0.25 {
        1.6
    } else {
        0.1 / ratio / 3.0
    }
}

/// The smallest b that is tried: `usual`, or less if S is so long (an integrator) that the second lag b·S would exceed
/// a fifth of a sample.
fn least_ratio(usual: f64, plant: &Plant) -> f64 {
    usual.min(0.2 / plant.mean_sum().max(1.0))
}

/// Third lags that are tried, as shares of the sum of the first two time constants. The smallest of three time
/// constants is at most half the sum of the others.
const THIRDS: [f64; 5] = [0.06, 0.12, 0.2, 0.3, 0.45];

/// The best fit with each third lag behind the plant `second`.
fn with_third(series: &[Series], second: Plant, free: Free, max_delay: f64) -> Vec<Refined> {
    let mut at = second;
    let fit = |share: f64| {
        let third = share * second.mean_sum();
        // The third lag is subtracted from the dead time and from the sum.
        let more = third - at.third;
        let from = Plant {
            delay: at.delay.map(|h| (h - more / 2.0).max(0.0)),
            sum: at.sum.map(|s| (s - more / 2.0).max(0.5 * s)),
            third,
            ratio: at.ratio.max(0.02),
        };
        let fit = refine(series, from, free.with_order(true), max_delay)?;
        at = fit.at.plant;
        Some(fit)
    };
    // A lag far below a sample has no effect.
    let shares = THIRDS.into_iter();
    shares
        .filter(|share| share * second.mean_sum() >= 0.5)
        .map_while(fit)
        .collect()
}

/// The dead time over all orders, from the fits of [`super::linear::fit`], and the index of the fit whose order is
/// chosen. `clock` is the standard error of the clock, samples.
pub(crate) fn dead_time(
    series: &[Series],
    fits: &[Refined],
    free: Free,
    max_delay: f64,
    clock: f64,
) -> Option<(DeadTime, usize)> {
    let thirds = fits.get(1).map_or_else(Vec::new, |second| {
        with_third(series, second.at.plant, free, max_delay)
    });
    let of_least_error = |fits: &[&Refined]| -> Option<usize> {
        let places = 0..fits.len();
        places.min_by(|&a, &b| fits[a].at.rss.total_cmp(&fits[b].at.rss))
    };
    let all: Vec<&Refined> = fits.iter().chain(&thirds).collect();
    let best = all[of_least_error(&all)?];
    let noise = widened_variance(&best.at);
    // The parameters that are integrated: h, ln S and the further ones of an order.
    let component = |fit: &Refined, integrated: usize, log_prior: f64| -> Option<Component> {
        let covariance = fit.covariance(noise)?;
        let stride = covariance.len().isqrt();
        let size = 2 + integrated;
        let block: Option<Vec<f64>> = (0..size * size)
            .map(|i| covariance.get(i / size * stride + i % size).copied())
            .collect();
        let block = block?;
        let log_volume = 0.5 * log_determinant(&block, size)
            + 0.5 * integrated as f64 * std::f64::consts::TAU.ln();
        Some(Component {
            log_weight: log_prior + log_volume - (fit.at.rss - best.at.rss) / (2.0 * noise),
            mean: fit.at.plant.mean_delay(),
            sd: block.first()?.sqrt(),
        })
    };
    let first = fits.first()?;
    let mut components: Vec<Component> = component(first, 0, 0.5f64.ln()).into_iter().collect();
    for fit in &thirds {
        let log_prior = (prior(fit.at.plant.ratio) / thirds.len() as f64).ln();
        components.extend(component(fit, 1, log_prior - 2f64.ln()));
    }
    let second = fits.get(1);
    let (centre, step) = match second {
        Some(second) => {
            let ratio = second
                .at
                .plant
                .ratio
                .max(least_ratio(0.005, &second.at.plant));
            let covariance = second.covariance(noise).unwrap_or_default();
            let stride = covariance.len().isqrt();
            let variance = covariance.get(2 * stride + 2);
            let sd = variance.map_or(f64::INFINITY, |v| v.sqrt());
            (ratio, (0.75 * sd / ratio).clamp(0.004, 0.3))
        }
        None => (0.01, 0.3),
    };
    let start = second.unwrap_or(first).at.plant;
    // Without third lags, the second order has half of the prior. With them, the second and the third order have a
    // quarter each.
    let of_second = if thirds.is_empty() { 1.0 } else { 2.0 };
    for direction in [1.0, -1.0] {
        let mut at = start;
        for i in usize::from(direction < 0.0)..=RULES.ratios {
            let ratio = centre * (direction * step * i as f64).exp();
            if !(least_ratio(0.002, &start)..=LARGEST_RATIO).contains(&ratio) {
                break;
            }
            let from = Plant { ratio, ..at };
            let Some(fit) = refine(series, from, free.with_order(false), max_delay) else {
                break;
            };
            at = fit.at.plant;
            components.extend(component(
                &fit,
                0,
                (prior(ratio) * ratio * step / of_second).ln(),
            ));
            if fit.at.rss - best.at.rss > 14.0 * noise {
                break;
            }
        }
    }
    // The value comes from the order chosen by BIC, the interval from all orders.
    let samples: usize = best.at.residuals.iter().map(Vec::len).sum();
    let residual = best.at.rss / samples.max(1) as f64;
    let independent = (samples as f64 * residual / noise).max(2.0);
    let earns =
        |more: &Refined, less: &Refined| less.at.rss - more.at.rss > independent.ln() * noise;
    let better = second.is_some_and(|second| earns(second, first));
    let chosen = second.filter(|_| better).unwrap_or(first);
    let thirds: Vec<&Refined> = thirds.iter().collect();
    let third = of_least_error(&thirds).map(|place| thirds[place]);
    let chosen = third
        .filter(|third| better && earns(third, chosen))
        .unwrap_or(chosen);
    let mixed = mixture(&components, max_delay, clock)?;
    let samples = chosen.at.plant.mean_delay();
    let estimate = DeadTime {
        samples,
        low: mixed.low.min(samples),
        high: mixed.high.max(samples),
        ..mixed
    };
    Some((estimate, usize::from(better)))
}

/// Mean, standard deviation and interval of a mixture of normal distributions, each widened by the standard
/// error of the clock.
fn mixture(components: &[Component], max_delay: f64, clock: f64) -> Option<DeadTime> {
    let largest = components
        .iter()
        .map(|c| c.log_weight)
        .fold(f64::NEG_INFINITY, f64::max);
    let known: Vec<(f64, f64, f64)> = components
        .iter()
        .filter(|c| c.log_weight.is_finite() && c.sd.is_finite())
        .map(|c| ((c.log_weight - largest).exp(), c.mean, c.sd.hypot(clock)))
        .collect();
    let total: f64 = known.iter().map(|c| c.0).sum();
    if total <= 0.0 {
        return None;
    }
    let middle = known.iter().map(|(w, m, _)| w * m).sum::<f64>() / total;
    let variance = known
        .iter()
        .map(|(w, m, s)| w * (s * s + (m - middle).powi(2)))
        .sum::<f64>()
        / total;
    let share_below = |h: f64| -> f64 {
        known
            .iter()
            .map(|(w, m, s)| w * normal_share((h - m) / s))
            .sum::<f64>()
            / total
    };
    let quantile = |p: f64| -> f64 {
        let (mut low, mut high) = known.iter().fold((middle, middle), |(l, h), (_, m, s)| {
            (l.min(m - 8.0 * s), h.max(m + 8.0 * s))
        });
        for _ in 0..80 {
            let half = f64::midpoint(low, high);
            if share_below(half) < p {
                low = half;
            } else {
                high = half;
            }
        }
        f64::midpoint(low, high)
    };
    let tail = 0.5 - 0.5 * RULES.confidence;
    Some(DeadTime {
        samples: middle.clamp(0.0, max_delay),
        standard_error: variance.sqrt(),
        low: quantile(tail).max(0.0),
        high: quantile(1.0 - tail).max(0.0),
    })
}

/// Standard normal distribution function.
fn normal_share(z: f64) -> f64 {
    0.5 * statrs::function::erf::erfc(-z / std::f64::consts::SQRT_2)
}
