//! Unexplained variance by frequency band.

use super::coordinate::FailureCoordinate;
use super::explained::Errors;
use super::rules::RULES;
use super::{Interval, Where};
use crate::picture::FailureBin;
use numerics::fourier::Fourier;

/// Energies of one segment in each band.
struct Piece {
    error: Vec<f64>,
    /// Energy of y_sim about its mean.
    model: Vec<f64>,
    noise: f64,
}

/// How the error above the noise differs in its spectrum from y. An error with the spectrum of y is at no particular
/// frequency.
pub(super) fn by_frequency(errors: &Errors, excess: f64) -> Option<Where> {
    let length = 1 << RULES.piece.clamp(64, 4096).ilog2();
    let mut limits = vec![0.5];
    while *limits.last()? < length as f64 / 2.0 {
        limits.push((limits.last()? * 2.0).min(length as f64 / 2.0));
    }
    let bands = limits.len() - 1;
    let transform = Fourier::new(length);
    let mut pieces = Vec::new();
    for (record, e) in errors.residual.iter().enumerate() {
        let (simulated, noise) = (&errors.simulated[record], &errors.noise[record]);
        let mut from = errors.lead[record];
        while from + length <= e.len() {
            let span = from..from + length;
            pieces.push(Piece {
                error: energies(&transform, &e[span.clone()], &limits),
                model: energies(&transform, &simulated[span.clone()], &limits),
                noise: noise[span].iter().sum(),
            });
            from += length;
        }
    }
    if pieces.len() < RULES.fewest_pieces {
        return None;
    }
    let sum = |of: &dyn Fn(&Piece) -> f64| pieces.iter().map(of).sum::<f64>();
    // The noise is modelled as white at the level of the highest octave plus first-order coloured noise in
    // the lowest bands.
    let noise = sum(&|p| p.noise);
    let lines = |band: usize| limits[band + 1].floor() - limits[band].ceil() + 1.0;
    let all_lines: f64 = (0..bands).map(lines).sum();
    let white = (sum(&|p| p.error[bands - 1]) / lines(bands - 1) * all_lines).min(noise);
    let floor: Vec<f64> = (0..bands)
        .map(|b| white * lines(b) / all_lines + (noise - white) / bands as f64)
        .collect();
    let model_total = sum(&|p| p.model.iter().sum()).max(f64::MIN_POSITIVE);
    let reference: Vec<f64> = (0..bands)
        .map(|b| sum(&|p| p.model[b]) / model_total)
        .collect();
    let above = |pieces: &mut dyn Iterator<Item = &Piece>, band: usize| {
        let (mut energy, mut n) = (0.0, 0.0);
        for piece in pieces {
            energy += piece.error[band];
            n += 1.0;
        }
        energy - floor[band] * n / sum(&|_| 1.0)
    };
    let mut gains = vec![0.0; pieces.len()];
    for half in 0..2 {
        // Every second segment is for estimation, the others are for the test.
        let rich: Vec<usize> = (0..bands)
            .filter(|b| {
                let mut learning = pieces.iter().skip(half).step_by(2);
                above(&mut learning, *b) > reference[*b] * excess / 2.0
            })
            .collect();
        for (piece, gain) in pieces.iter().zip(&mut gains).skip(1 - half).step_by(2) {
            *gain = rich
                .iter()
                .map(|b| {
                    let n = sum(&|_| 1.0);
                    piece.error[*b] - floor[*b] / n - reference[*b] * excess / n
                })
                .sum();
        }
    }
    // y_sd does not give the colour of the noise: a band's share counts only in proportion to the unexplained
    // variance.
    let known = excess / (excess + noise);
    let fraction = known * super::explained::beyond_chance(&gains, RULES.band_level) / excess;
    let hz = |line: f64| line / (length as f64 * errors.period_s);
    let n = (pieces.len() * length) as f64;
    let bins: Vec<FailureBin> = (0..bands)
        .map(|b| FailureBin {
            from: hz(limits[b]),
            to: hz(limits[b + 1]),
            rmse: (sum(&|p| p.error[b]) / n).sqrt(),
            noise_rmse: (floor[b] / n).max(0.0).sqrt(),
        })
        .collect();
    let surplus = |b: &usize| sum(&|p| p.error[*b]) - floor[*b] - reference[*b] * excess;
    let worst = (0..bands).max_by(|a, b| surplus(a).total_cmp(&surplus(b)))?;
    let share = (sum(&|p| p.error[worst]) - floor[worst]) / excess;
    Some(Where {
        coordinate: FailureCoordinate::FrequencyBand,
        explained_fraction: fraction.min(1.0),
        worst_from: bins[worst].from,
        worst_to: bins[worst].to,
        worst_rmse: bins[worst].rmse,
        bias: 0.0,
        dependence: None,
        concentration: Some(Interval {
            from: bins[worst].from,
            to: bins[worst].to,
            share: share.clamp(0.0, 1.0),
            of_samples: reference[worst],
        }),
        trend: None,
        bins,
    })
}

/// Energy of the spectral lines in each band, scaled so that all bands sum to Σ x² without the mean.
fn energies(transform: &Fourier, x: &[f64], limits: &[f64]) -> Vec<f64> {
    let n = x.len();
    let mean = x.iter().sum::<f64>() / n as f64;
    let lines = transform.lines(x.iter().map(|x| x - mean).collect());
    let band = |band: &[f64]| {
        let within = (band[0].floor() as usize + 1)..=(band[1] as usize);
        let energy = within.map(|i| {
            let twice = if 2 * i == n { 1.0 } else { 2.0 };
            twice * lines[i].norm_sqr() / n as f64
        });
        energy.sum()
    };
    limits.windows(2).map(band).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn bands_add_up_to_the_energy_and_a_tone_is_in_its_band() {
        let x: Vec<f64> = (0..1024)
            .map(|k| (TAU * 15.0 * f64::from(k) / 1024.0).sin() + 0.2 * f64::from(k % 2))
            .collect();
        let limits = [
            0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0,
        ];
        let transform = Fourier::new(x.len());
        let bands = energies(&transform, &x, &limits);
        let mean = x.iter().sum::<f64>() / 1024.0;
        let energy: f64 = x.iter().map(|x| (x - mean) * (x - mean)).sum();
        assert!((bands.iter().sum::<f64>() / energy - 1.0).abs() < 1e-12);
        assert!((bands[4] / 512.0 - 1.0).abs() < 1e-9, "8 to 16 cycles");
        assert!(
            (bands[9] / (1024.0 * 0.01) - 1.0).abs() < 1e-9,
            "half the rate"
        );
    }
}
