//! The noise model of given errors, by maximum likelihood.

use super::colour::Deviations;
use super::{Colour, EFFECTS, NoiseModel, Series, offset_and_drift, woodbury_of};
use crate::parallel;
use numerics::linalg::{dot, dots};

/// Grid of shares of coloured noise.
const SHARES: [f64; 6] = [0.1, 0.25, 0.5, 0.75, 0.9, 0.98];
/// Grid of correlation times, samples; refined below.
const MEMORIES: [f64; 7] = [2.0, 5.0, 12.0, 30.0, 80.0, 200.0, 500.0];
/// Smallest step in logit share and ln correlation time, relative to the grid's.
const FINEST: f64 = 0.05;
/// The first step if the search starts from the colour of similar errors.
const NEAR: f64 = 0.25;
/// Largest number of EM iterations for the variances; the gains decrease.
const ROUNDS: usize = 60;

/// One record, with the quantities that every colour needs.
struct Prepared<'a> {
    series: &'a Series,
    deviations: Deviations,
    offset: Vec<f64>,
    drift: Vec<f64>,
}

/// Sufficient statistics of one record under one colour.
struct Summary {
    samples: f64,
    /// ln det of the covariance of ε.
    log_determinant: f64,
    /// r·r, Zᵀr and ZᵀZ of the whitened series.
    square: f64,
    products: [f64; EFFECTS],
    gram: [[f64; EFFECTS]; EFFECTS],
}

/// Gain in log-likelihood that a parameter must exceed to be kept, nats.
#[derive(Clone, Copy)]
struct Price {
    colour: f64,
    random_effect: f64,
}

/// A likelihood and the variances at its maximum.
#[derive(Clone, Copy)]
struct Best {
    log_likelihood: f64,
    scale: f64,
    variances: [f64; EFFECTS],
}

impl NoiseModel {
    /// The noise model of the `errors` of a good model. With `measured`, the variances are known and the scale of ε
    /// is at least 1; otherwise only their ratios are known. Colour and random effects are kept if they improve
    /// BIC.
    #[must_use]
    pub fn of(errors: &[Series], measured: bool) -> Self {
        let samples: f64 = errors.iter().map(|e| e.residual.len() as f64).sum();
        let price = Price {
            // The two parameters of the colour must increase the log-likelihood by ln n.
            colour: samples.max(1.0).ln(),
            random_effect: 0.5 * (errors.len().max(1) as f64).ln().max(1.0),
        };
        Self::estimated(errors, measured, price, None)
    }

    /// The maximum-likelihood noise model of `errors` with all its parameters, without penalties. Its colour is
    /// searched around that of a `similar` model's errors, if there is one.
    #[must_use]
    pub fn most_likely(errors: &[Series], measured: bool, similar: Option<&Self>) -> Self {
        let free = Price {
            colour: 0.0,
            random_effect: 0.0,
        };
        let near = similar.map(|noise| noise.colour);
        Self::estimated(errors, measured, free, near)
    }

    fn estimated(errors: &[Series], measured: bool, price: Price, near: Option<Colour>) -> Self {
        let least = if measured { 1.0 } else { 0.0 };
        let white = Colour::WHITE;
        let errors: Vec<Prepared<'_>> = errors.iter().map(Prepared::of).collect();
        let errors = errors.as_slice();
        let (mut colour, mut best) = (white, likelihood(errors, white, least, price));
        let coloured = coloured(errors, least, price, near);
        if coloured.1.log_likelihood > best.log_likelihood + price.colour {
            (colour, best) = coloured;
        }
        let [offset, drift, level] = best.variances;
        Self {
            scale: best.scale,
            colour,
            offset,
            drift,
            level,
        }
    }
}

/// The best colour: from the grid, or from `near` in smaller steps, with refinement.
fn coloured(
    errors: &[Prepared<'_>],
    least: f64,
    price: Price,
    near: Option<Colour>,
) -> (Colour, Best) {
    // The search steps are equal in the logit of the share and in ln of the correlation time.
    let logit = |share: f64| (share / (1.0 - share)).ln();
    let colour = |[share, memory]: [f64; 2]| Colour {
        share: 1.0 / (1.0 + (-share).exp()),
        pole: (-1.0 / memory.exp()).exp(),
    };
    let evaluate = |points: Vec<[f64; 2]>| -> Vec<([f64; 2], Best)> {
        parallel::each(&points, |&point| {
            (point, likelihood(errors, colour(point), least, price))
        })
    };
    let better = |a: &([f64; 2], Best), b: &([f64; 2], Best)| {
        a.1.log_likelihood.total_cmp(&b.1.log_likelihood)
    };
    let near = near.map(|near| [logit(near.share), (-1.0 / near.pole.ln()).ln()]);
    let (points, mut step) = match near.filter(|point| point.iter().all(|x| x.is_finite())) {
        Some(point) => (vec![point], NEAR),
        None => {
            let times = MEMORIES.map(f64::ln);
            let of = |share| times.map(|memory| [logit(share), memory]);
            (SHARES.into_iter().flat_map(of).collect(), 1.0)
        }
    };
    let Some(mut best) = evaluate(points).into_iter().max_by(better) else {
        return (
            Colour::WHITE,
            likelihood(errors, Colour::WHITE, least, price),
        );
    };
    while step > FINEST {
        // The likelihood has a ridge, because share and correlation time are correlated. Diagonal
        // neighbours are therefore tried too.
        let around = (0..9).filter(|at| *at != 4);
        let next = around.map(|at| [f64::from(at / 3) - 1.0, f64::from(at % 3) - 1.0]);
        let next = next.map(|[s, m]| [best.0[0] + s * step, best.0[1] + m * step]);
        match evaluate(next.collect()).into_iter().max_by(better) {
            Some(found) if found.1.log_likelihood > best.1.log_likelihood => best = found,
            _ => step *= 0.5,
        }
    }
    let (point, best) = best;
    (colour(point), best)
}

/// The log-likelihood under a colour, maximised over the scale and the variances of the random effects.
/// Variances that gain less than half of ln(number of records) are set to 0.
fn likelihood(errors: &[Prepared<'_>], colour: Colour, least: f64, price: Price) -> Best {
    let summaries: Vec<Summary> = errors.iter().map(|e| Summary::of(e, colour)).collect();
    let mut kept = [false; EFFECTS];
    let mut best = maximised(&summaries, kept, least);
    loop {
        let tried = (0..EFFECTS).filter(|i| !kept[*i]).map(|i| {
            let mut more = kept;
            more[i] = true;
            (more, maximised(&summaries, more, least))
        });
        let leader = tried.max_by(|a, b| a.1.log_likelihood.total_cmp(&b.1.log_likelihood));
        match leader {
            Some((more, better))
                if better.log_likelihood > best.log_likelihood + price.random_effect =>
            {
                (kept, best) = (more, better);
            }
            _ => return best,
        }
    }
}

/// Scale and variances by expectation maximisation: each variance is the mean over records of the squared
/// posterior mean plus the posterior variance.
fn maximised(summaries: &[Summary], kept: [bool; EFFECTS], least: f64) -> Best {
    let samples: f64 = summaries.iter().map(|s| s.samples).sum();
    let records = summaries.len().max(1) as f64;
    let square: f64 = summaries.iter().map(|s| s.square).sum();
    let floor = |scale: f64| scale.max(least).max(f64::MIN_POSITIVE);
    let mut scale = floor(square / samples.max(1.0));
    // Initially, each random effect is estimated separately.
    let mut variances: [f64; EFFECTS] = std::array::from_fn(|i| {
        let each = summaries.iter().filter(|s| s.gram[i][i] > 0.0);
        let shown: f64 = each.map(|s| (s.products[i] / s.gram[i][i]).powi(2)).sum();
        if kept[i] { shown / records } else { 0.0 }
    });
    if kept.contains(&true) {
        for _ in 0..ROUNDS {
            let (mut next, mut left) = ([0.0; EFFECTS], 0.0);
            for summary in summaries {
                let (mean, spread, rest) = summary.posterior(scale, variances);
                for i in 0..EFFECTS {
                    next[i] += (mean[i] * mean[i] + spread[i]) / records;
                }
                left += rest;
            }
            variances = std::array::from_fn(|i| if kept[i] { next[i] } else { 0.0 });
            scale = floor(left / samples.max(1.0));
        }
    }
    let log_likelihood = summaries
        .iter()
        .map(|s| s.log_likelihood(scale, variances))
        .sum();
    Best {
        log_likelihood,
        scale,
        variances,
    }
}

impl<'a> Prepared<'a> {
    fn of(series: &'a Series) -> Self {
        let [offset, drift] = offset_and_drift(series.run.len());
        Self {
            deviations: Deviations::of(&series.variance),
            series,
            offset,
            drift,
        }
    }
}

impl Summary {
    fn of(error: &Prepared<'_>, colour: Colour) -> Self {
        let filter = colour.filter_of(&error.deviations);
        let series = [
            &error.offset,
            &error.drift,
            &error.series.run,
            &error.series.residual,
        ];
        let [offset, drift, level, whitened] = filter.whiten_all(series.map(Vec::as_slice));
        let columns = [&offset, &drift, &level, &whitened];
        let rows = [&offset, &drift, &level];
        let rows = rows.map(|row| dots(row, columns.map(Vec::as_slice)));
        Self {
            samples: whitened.len() as f64,
            log_determinant: filter.log_determinant(),
            square: dot(&whitened, &whitened),
            products: std::array::from_fn(|i| rows[i][EFFECTS]),
            gram: std::array::from_fn(|i| std::array::from_fn(|j| rows[i][j])),
        }
    }

    fn log_likelihood(&self, scale: f64, variances: [f64; EFFECTS]) -> f64 {
        let (factor, log_determinant) = woodbury_of(&self.gram, variances.map(|v| v / scale));
        let along: f64 = (0..EFFECTS)
            .map(|j| {
                let one: f64 = (0..EFFECTS).map(|i| factor[i][j] * self.products[i]).sum();
                one * one
            })
            .sum();
        let covariance = self.samples * scale.ln() + self.log_determinant + log_determinant;
        -0.5 * ((self.square - along) / scale + covariance)
    }

    /// Posterior mean and variance of the record's random effects, and the expected sum of squares of the
    /// whitened ε.
    #[allow(clippy::needless_range_loop, reason = "indices as in the equations")]
    fn posterior(
        &self,
        scale: f64,
        variances: [f64; EFFECTS],
    ) -> ([f64; EFFECTS], [f64; EFFECTS], f64) {
        // Posterior covariance scale·L·Lᵀ of the effects.
        let (factor, _) = woodbury_of(&self.gram, variances.map(|v| v / scale));
        let (mut cell, mut mean) = ([[0.0; EFFECTS]; EFFECTS], [0.0; EFFECTS]);
        for i in 0..EFFECTS {
            for j in 0..EFFECTS {
                for k in 0..EFFECTS {
                    cell[i][j] += factor[i][k] * factor[j][k];
                }
                mean[i] += cell[i][j] * self.products[j];
            }
        }
        let spread = [scale * cell[0][0], scale * cell[1][1], scale * cell[2][2]];
        let mut rest = self.square;
        for i in 0..EFFECTS {
            rest -= 2.0 * mean[i] * self.products[i];
            for j in 0..EFFECTS {
                rest += self.gram[i][j] * (mean[i] * mean[j] + scale * cell[i][j]);
            }
        }
        (mean, spread, rest)
    }
}
