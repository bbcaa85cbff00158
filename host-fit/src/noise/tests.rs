use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random_range(-0.5..0.5)).sum()
}

/// Disturbances of one synthetic record.
#[derive(Clone, Copy, Default)]
struct Disturbed {
    share: f64,
    memory: f64,
    offset: f64,
    drift: f64,
    level: f64,
    /// Standard deviation of the noise relative to the stated standard errors.
    louder: f64,
}

fn records(rng: &mut ChaCha8Rng, count: usize, n: usize, how: Disturbed) -> Vec<Series> {
    let pole = if how.share > 0.0 {
        (-1.0 / how.memory).exp()
    } else {
        0.0
    };
    let mut record = || {
        let [offset, drift, level] = [how.offset, how.drift, how.level].map(|d| d * normal(rng));
        let mut slow = how.share.sqrt() * normal(rng);
        let (mut series, mut run, mut variance) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..n {
            // The standard error depends on the level, as on a real rig.
            let y = 0.5 + 0.5 * (k as f64 / 130.0).sin();
            let sd = 0.01 * (1.0 + 0.4 * y);
            slow = pole * slow + (how.share * (1.0 - pole * pole)).sqrt() * normal(rng);
            let noise = slow + (1.0 - how.share).sqrt() * normal(rng);
            let along = k as f64 / n as f64 - 0.5;
            series.push(how.louder * sd * noise + offset + drift * along + level * y);
            variance.push(sd * sd);
            run.push(y);
        }
        Series {
            residual: series,
            variance,
            run,
        }
    };
    (0..count).map(|_| record()).collect()
}

/// Mean square of whitened errors, and the largest correlation over lags 1 to 40 in units of its standard error.
fn whiteness(model: &NoiseModel, records: &[Series]) -> (f64, f64) {
    let mut whitened = Vec::new();
    for record in records {
        let metric = model.metric(&record.variance, &record.run);
        whitened.push(metric.whiten(&record.residual).series);
    }
    let n: f64 = whitened.iter().map(|w| w.len() as f64).sum();
    let square: f64 = whitened.iter().map(|w| dot(w, w)).sum();
    let worst = (1..=40).map(|lag| {
        let each = whitened.iter().map(|w| dot(&w[lag..], &w[..w.len() - lag]));
        (each.sum::<f64>() / square).abs() * n.sqrt()
    });
    (square / n, worst.fold(0.0, f64::max))
}

const STILL: Disturbed = Disturbed {
    share: 0.0,
    memory: 0.0,
    offset: 0.0,
    drift: 0.0,
    level: 0.0,
    louder: 1.0,
};

#[test]
fn whitened_errors_are_white_and_of_variance_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for (share, memory) in [(0.0, 0.0), (0.5, 8.0), (0.8, 30.0), (0.97, 100.0)] {
        let how = Disturbed {
            share,
            memory,
            ..STILL
        };
        let errors = records(&mut rng, 5, 6000, how);
        let model = NoiseModel::of(&errors, true);
        let (variance, worst) = whiteness(&model, &records(&mut rng, 5, 6000, how));
        assert!(
            (variance - 1.0).abs() < 0.04,
            "{share}: {variance} {model:?}"
        );
        // The limit allows for the largest of forty normal numbers.
        assert!(worst < 4.5, "{share}: {worst} {model:?}");
        assert!(
            (model.colour.share - share).abs() < 0.05,
            "{share}: {model:?}"
        );
    }
}

#[test]
fn a_record_that_is_no_noise_of_this_model_is_noticed() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let slow = Disturbed {
        share: 0.8,
        memory: 30.0,
        ..STILL
    };
    let white = NoiseModel::of(&records(&mut rng, 5, 6000, STILL), true);
    let (_, worst) = whiteness(&white, &records(&mut rng, 5, 6000, slow));
    assert!(worst > 20.0, "{worst}");
}

#[test]
fn offsets_drifts_and_levels_of_records_are_found_with_their_variance() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let how = Disturbed {
        offset: 0.02,
        drift: 0.03,
        level: 0.04,
        ..STILL
    };
    let model = NoiseModel::of(&records(&mut rng, 60, 2000, how), true);
    // From 60 draws a standard deviation is estimated to 9 %.
    for (found, true_) in [
        (model.offset, how.offset),
        (model.drift, how.drift),
        (model.level, how.level),
    ] {
        assert!((found.sqrt() / true_ - 1.0).abs() < 0.3, "{model:?}");
    }
    let none = NoiseModel::of(&records(&mut rng, 8, 2000, STILL), true);
    assert_eq!([none.offset, none.drift, none.level], [0.0; 3]);
}

/// A search that starts from another colour reaches the same likelihood as the grid.
#[test]
fn a_search_from_a_similar_colour_ends_where_the_grid_does() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for (share, memory) in [(0.3, 4.0), (0.6, 40.0), (0.9, 15.0)] {
        let how = Disturbed {
            share,
            memory,
            louder: 1.0,
            ..STILL
        };
        let errors = records(&mut rng, 4, 3000, how);
        let grid = NoiseModel::most_likely(&errors, false, None);
        assert!((grid.colour.share - share).abs() < 0.1, "{:?}", grid.colour);
        let elsewhere = NoiseModel {
            colour: Colour {
                share: 0.5,
                pole: (-1.0_f64 / 12.0).exp(),
            },
            ..grid.clone()
        };
        for similar in [
            elsewhere,
            NoiseModel {
                colour: Colour::WHITE,
                ..grid.clone()
            },
        ] {
            let near = NoiseModel::most_likely(&errors, false, Some(&similar));
            let gap = grid.log_likelihood(&errors) - near.log_likelihood(&errors);
            assert!(gap.abs() < 0.1, "{share}, {memory}: {gap}");
        }
    }
}

#[test]
fn noise_above_its_standard_errors_counts_and_noise_below_them_does_not() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let scale = |rng: &mut ChaCha8Rng, louder: f64, measured: bool| {
        let how = Disturbed { louder, ..STILL };
        NoiseModel::of(&records(rng, 4, 4000, how), measured).scale
    };
    assert!((scale(&mut rng, 1.5, true) / 2.25 - 1.0).abs() < 0.05);
    assert_eq!(scale(&mut rng, 0.5, true), 1.0);
    assert!((scale(&mut rng, 0.5, false) / 0.25 - 1.0).abs() < 0.05);
}

/// The likelihood of a short record equals the Gaussian density with its full covariance matrix.
#[test]
fn the_likelihood_is_that_of_the_covariance() {
    let n = 6;
    let variance: Vec<f64> = (0..n).map(|k| 0.5 + 0.1 * k as f64).collect();
    let run: Vec<f64> = (0..n).map(|k| (k as f64).cos()).collect();
    let residual: Vec<f64> = (0..n).map(|k| 0.3 * (1.7 * k as f64).sin()).collect();
    let model = NoiseModel {
        scale: 1.3,
        colour: Colour {
            share: 0.6,
            pole: 0.8,
        },
        offset: 0.2,
        drift: 0.7,
        level: 0.1,
    };
    let cell = |i: usize, j: usize| {
        let white = if i == j {
            1.0 - model.colour.share
        } else {
            0.0
        };
        let slow = model.colour.share * model.colour.pole.powi(i.abs_diff(j) as i32);
        let ramp = |k: usize| k as f64 / (n - 1) as f64 - 0.5;
        model.scale * (variance[i] * variance[j]).sqrt() * (white + slow)
            + model.offset
            + model.drift * ramp(i) * ramp(j)
            + model.level * run[i] * run[j]
    };
    let covariance: Vec<f64> = (0..n * n).map(|at| cell(at / n, at % n)).collect();
    let solved = numerics::linalg::solve_symmetric(&covariance, &residual).expect("positive");
    let eigenvalues = numerics::linalg::symmetric_eigenvalues(&covariance, n).expect("symmetric");
    let log_determinant: f64 = eigenvalues.iter().map(|e| e.ln()).sum();
    let expected = -0.5 * (dot(&residual, &solved) + log_determinant);
    let found = model.metric(&variance, &run).log_likelihood(&residual);
    assert!((found - expected).abs() < 1e-9, "{found} {expected}");
}
