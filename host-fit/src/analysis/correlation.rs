//! Residual autocorrelation and cross-correlation with the command.

use super::Residuals;

/// Correlation coefficients at equally spaced lags, with the 95 % band under the null hypothesis (white
/// residuals; residuals independent of the command).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Correlation {
    /// Lag, s, and correlation coefficient, −1 to 1.
    pub points: Vec<(f64, f64)>,
    /// Half width of the 95 % band.
    pub band: f64,
    /// Share of the lags (except lag 0 of the autocorrelation) outside the band, 0 to 1.
    pub outside: f64,
}

/// Largest number of samples used; more samples do not change the picture visibly.
const MOST_SAMPLES: usize = 100_000;
/// Largest number of lags.
const MOST_LAGS: usize = 250;
/// 97.5 % quantile of the normal distribution.
const QUANTILE: f64 = 1.96;

/// Autocorrelation r_ee(τ) of the residuals for τ ≥ 0, and cross-correlation r_ue(τ) = corr(u_k, e_{k+τ}) for both signs
/// of τ. Records are pooled; no product spans two records.
///
/// Bands: ±1.96/√N for r_ee (white residuals); ±1.96·√(Σ_k r_ee(k)·r_uu(k) / N) for r_ue, which allows for coloured
/// residuals and a coloured command (Bartlett's formula; Ljung, System Identification, 2nd ed., §16.6).
#[must_use]
pub fn correlations(residuals: &Residuals) -> (Correlation, Correlation) {
    let mut taken = 0;
    let mut e: Vec<Vec<f64>> = Vec::new();
    let mut u: Vec<Vec<f64>> = Vec::new();
    for (own, command) in residuals.e.iter().zip(&residuals.u) {
        let n = own.len().min(MOST_SAMPLES - taken);
        e.push(own.iter().take(n).copied().collect());
        u.push(command.iter().take(n).copied().collect());
        taken += n;
    }
    let shortest = e.iter().map(Vec::len).filter(|n| *n > 0).min().unwrap_or(0);
    let lags = MOST_LAGS.min(shortest / 4);
    if lags == 0 {
        return Default::default();
    }
    centre(&mut e);
    centre(&mut u);
    let (energy_e, energy_u) = (product(&e, &e, 0), product(&u, &u, 0));
    let n = taken as f64;
    let share = |value: f64, scale: f64| if scale > 0.0 { value / scale } else { 0.0 };
    let auto: Vec<f64> = (0..=lags)
        .map(|lag| share(product(&e, &e, lag), energy_e))
        .collect();
    let command: Vec<f64> = (0..=lags)
        .map(|lag| share(product(&u, &u, lag), energy_u))
        .collect();
    let both = (energy_e * energy_u).sqrt();
    let cross: Vec<f64> = (0..=2 * lags)
        .map(|i| match i.checked_sub(lags) {
            Some(later) => share(product(&u, &e, later), both),
            None => share(product(&e, &u, lags - i), both),
        })
        .collect();
    let white = QUANTILE / n.sqrt();
    let pairs = auto.iter().zip(&command).skip(1);
    let spread = 1.0 + 2.0 * pairs.map(|(a, b)| a * b).sum::<f64>();
    let coloured = QUANTILE * (spread.max(1.0) / n).sqrt();
    let seconds = |lag: f64| lag * residuals.period_s;
    let points = |values: Vec<f64>, first: f64| {
        let each = values.into_iter().enumerate();
        each.map(|(i, r)| (seconds(first + i as f64), r)).collect()
    };
    (
        judged(points(auto, 0.0), white, true),
        judged(points(cross, -(lags as f64)), coloured, false),
    )
}

fn judged(points: Vec<(f64, f64)>, band: f64, skip_zero: bool) -> Correlation {
    let tested = points.iter().filter(|(lag, _)| !skip_zero || *lag > 0.0);
    let beyond = tested.clone().filter(|(_, r)| r.abs() > band).count();
    let outside = beyond as f64 / tested.count().max(1) as f64;
    Correlation {
        points,
        band,
        outside,
    }
}

/// Subtracts the mean over all records.
fn centre(records: &mut [Vec<f64>]) {
    let n: usize = records.iter().map(Vec::len).sum();
    let mean = records.iter().flatten().sum::<f64>() / n.max(1) as f64;
    records.iter_mut().flatten().for_each(|v| *v -= mean);
}

/// Σ a_k·b_{k+lag} within records.
fn product(a: &[Vec<f64>], b: &[Vec<f64>], lag: usize) -> f64 {
    let of = |(a, b): (&Vec<f64>, &Vec<f64>)| -> f64 {
        let later = b.iter().skip(lag);
        a.iter().zip(later).map(|(a, b)| a * b).sum()
    };
    a.iter().zip(b).map(of).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Approximately white numbers, equal on every machine.
    fn white(seed: u64, n: usize) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut uniform = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..n)
            .map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0)
            .collect()
    }

    fn first_order(e: &[f64], a: f64) -> Vec<f64> {
        let mut last = 0.0;
        e.iter()
            .map(|e| {
                last = a * last + e;
                last
            })
            .collect()
    }

    #[test]
    fn one_lag_in_twenty_lies_outside_the_band_where_the_hypothesis_is_true() {
        let (mut auto, mut cross) = (0.0, 0.0);
        const RUNS: u64 = 60;
        for seed in 0..RUNS {
            let residuals = Residuals {
                period_s: 0.001,
                e: vec![white(2 * seed + 1, 4000)],
                u: vec![first_order(&white(2 * seed + 2, 4000), 0.9)],
                ..Residuals::default()
            };
            let (a, c) = correlations(&residuals);
            auto += a.outside / RUNS as f64;
            cross += c.outside / RUNS as f64;
        }
        assert!((0.035..0.065).contains(&auto), "{auto}");
        assert!((0.03..0.07).contains(&cross), "{cross}");
    }

    #[test]
    fn the_cross_correlation_band_allows_for_coloured_residuals() {
        let mut outside = 0.0;
        const RUNS: u64 = 60;
        for seed in 0..RUNS {
            let residuals = Residuals {
                period_s: 0.001,
                e: vec![first_order(&white(2 * seed + 1, 4000), 0.9)],
                u: vec![first_order(&white(2 * seed + 2, 4000), 0.9)],
                ..Residuals::default()
            };
            outside += correlations(&residuals).1.outside / RUNS as f64;
        }
        assert!((0.02..0.09).contains(&outside), "{outside}");
    }

    #[test]
    fn a_delayed_command_in_the_residual_shows_at_its_lag() {
        let u = white(3, 3000);
        let mut e = white(4, 3000);
        for k in 40..3000 {
            e[k] += u[k - 40];
        }
        let (_, cross) = correlations(&Residuals {
            period_s: 0.001,
            e: vec![e],
            u: vec![u],
            ..Residuals::default()
        });
        let largest = cross.points.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let (lag, r) = largest.copied().unwrap();
        assert!((lag - 0.040).abs() < 1e-9 && r > 0.6, "{lag} {r}");
        assert_eq!(correlations(&Residuals::default()), Default::default());
    }
}
