//! Dense linear algebra: small systems by our own [`Cholesky`] factor, everything else by faer, which only this
//! module uses. Matrices are slices, row by row.

mod cholesky;

pub use cholesky::{Cholesky, solve_symmetric};

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatMut, MatRef, Par, Side};

/// A singular value with a smaller share of the largest one counts as zero.
const RANK_TOLERANCE: f64 = 1e-12;

/// A direction with less than this share of the information of the best one counts as not identified.
const UNKNOWN: f64 = 1e-11;
/// A coordinate belongs to a direction if its share of the direction is larger.
const TAKES_PART: f64 = 1e-6;

/// A decomposition that did not converge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "a matrix decomposition did not converge: look for values of very different size in the data"
)]
pub struct NotConverged;

/// Minimum-norm least-squares solution x = A⁺y, eq. (8).
///
/// `columns` are the columns of A, each as long as `rhs`. Dependent columns share their coefficient, as in the
/// Moore–Penrose pseudo-inverse.
///
/// # Errors
/// [`NotConverged`] when the singular value decomposition fails.
pub fn least_squares(columns: &[Vec<f64>], rhs: &[f64]) -> Result<Vec<f64>, NotConverged> {
    let matrix = Mat::from_fn(rhs.len(), columns.len(), |i, j| {
        columns
            .get(j)
            .and_then(|c| c.get(i))
            .copied()
            .unwrap_or(0.0)
    });
    if columns.is_empty() || rhs.is_empty() {
        return Ok(vec![0.0; columns.len()]);
    }
    let svd = matrix.thin_svd().map_err(|_| NotConverged)?;
    let values: Vec<f64> = svd.S().column_vector().iter().copied().collect();
    let floor = values.first().copied().unwrap_or(0.0) * RANK_TOLERANCE * (rhs.len() as f64).sqrt();
    let right = MatRef::from_column_major_slice(rhs, rhs.len(), 1);
    let mut scaled = svd.U().transpose() * right;
    for (i, value) in values.iter().enumerate() {
        scaled[(i, 0)] = if *value > floor {
            scaled[(i, 0)] / value
        } else {
            0.0
        };
    }
    let solution = svd.V() * scaled;
    Ok((0..columns.len()).map(|i| solution[(i, 0)]).collect())
}

/// Σ a_i·b_i in four partial sums, which the processor can compute in parallel; the order is fixed and the result
/// repeatable.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || {
            let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
            let mut sums = [0.0; 4];
            for (a, b) in a.iter().zip(b) {
                for lane in 0..4 {
                    sums[lane] += a[lane] * b[lane];
                }
            }
            let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
            (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
        },
    )
}

/// [`dot`] of `a` with each of `others`, four at a time, so that no sum waits for another. The values are those of
/// [`dot`].
pub fn dots<'a>(a: &[f64], others: impl IntoIterator<Item = &'a [f64]>) -> Vec<f64> {
    let mut products = Vec::new();
    let mut others = others.into_iter();
    loop {
        let four: [Option<&[f64]>; 4] = std::array::from_fn(|_| others.next());
        if let [Some(b), Some(c), Some(d), Some(e)] = four {
            products.extend(four_dots(a, [b, c, d, e]));
            continue;
        }
        products.extend(four.into_iter().flatten().map(|b| dot(a, b)));
        return products;
    }
}

/// AᵀA from the columns of A, row-major, with the values of [`dot`].
pub fn gram(columns: &[&[f64]]) -> Vec<f64> {
    let n = columns.len();
    let mut gram = vec![0.0; n * n];
    for (i, column) in columns.iter().enumerate() {
        for (j, product) in dots(column, columns[..=i].iter().copied())
            .into_iter()
            .enumerate()
        {
            gram[i * n + j] = product;
            gram[j * n + i] = product;
        }
    }
    gram
}

fn four_dots(a: &[f64], others: [&[f64]; 4]) -> [f64; 4] {
    let n = a.len();
    if others.iter().any(|b| b.len() < n) {
        return others.map(|b| dot(a, b));
    }
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || {
            let (a, a_rest) = a.as_chunks::<4>();
            let [b, c, d, e] = others.map(|b| b[..n].as_chunks::<4>().0);
            let mut sums = [[0.0; 4]; 4];
            for ((((a, b), c), d), e) in a.iter().zip(b).zip(c).zip(d).zip(e) {
                for lane in 0..4 {
                    sums[0][lane] += a[lane] * b[lane];
                    sums[1][lane] += a[lane] * c[lane];
                    sums[2][lane] += a[lane] * d[lane];
                    sums[3][lane] += a[lane] * e[lane];
                }
            }
            let mut products = [0.0; 4];
            for ((product, sum), b) in products.iter_mut().zip(sums).zip(others) {
                let b_rest = &b[n - a_rest.len()..n];
                let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
                *product = (sum[0] + sum[1]) + (sum[2] + sum[3]) + rest;
            }
            products
        },
    )
}

/// The inverse of an information matrix (symmetric, row-major, `n` × `n`) in its identified directions, and the
/// coordinates that belong to the other directions. `None` if the decomposition fails.
pub fn inverse_where_known(a: &[f64], n: usize) -> Option<(Vec<f64>, Vec<bool>)> {
    let size = |i: usize| a.get(i * n + i).filter(|d| **d > 0.0).map(|d| d.sqrt());
    let sizes: Vec<f64> = (0..n).map(|i| size(i).unwrap_or(1.0)).collect();
    let scaled = Mat::from_fn(n, n, |i, j| a[i * n + j] / (sizes[i] * sizes[j]));
    let eigen = scaled.self_adjoint_eigen(Side::Lower).ok()?;
    let values: Vec<f64> = eigen.S().column_vector().iter().copied().collect();
    let floor = values.iter().fold(0.0, |m: f64, v| m.max(*v)) * UNKNOWN;
    let vectors = eigen.U();
    let known = |k: usize| values[k] > floor;
    let inverse = (0..n * n).map(|cell| {
        let (i, j) = (cell / n, cell % n);
        let terms = (0..n).filter(|k| known(*k));
        let sum: f64 = terms
            .map(|k| vectors[(i, k)] * vectors[(j, k)] / values[k])
            .sum();
        sum / (sizes[i] * sizes[j])
    });
    let takes_part = |i: usize| -> bool {
        let unknown = (0..n).filter(|k| !known(*k));
        unknown.map(|k| vectors[(i, k)].powi(2)).sum::<f64>() > TAKES_PART
    };
    Some((inverse.collect(), (0..n).map(takes_part).collect()))
}

/// Eigenvalues of a symmetric matrix (row-major, `n` × `n`). `None` if the decomposition fails.
pub fn symmetric_eigenvalues(a: &[f64], n: usize) -> Option<Vec<f64>> {
    let matrix = Mat::from_fn(n, n, |i, j| a[i * n + j]);
    matrix.self_adjoint_eigenvalues(Side::Lower).ok()
}

/// Adds AᵀB to `out`; A and B are `rows` × `size`, column by column, `out` is `size` × `size`, column by column.
/// Slices of other lengths are ignored.
pub fn add_cross_products(out: &mut [f64], a: &[f64], b: &[f64], rows: usize, size: usize) {
    if out.len() != size * size || a.len() != rows * size || b.len() != rows * size {
        return;
    }
    matmul(
        MatMut::from_column_major_slice_mut(out, size, size),
        Accum::Add,
        MatRef::from_column_major_slice(a, rows, size).transpose(),
        MatRef::from_column_major_slice(b, rows, size),
        1.0,
        Par::Seq,
    );
}

/// AᵀSA for a matrix A, column by column, with as many rows as there are `signs`, the diagonal of S. The result is
/// column by column; only its lower half is filled.
pub fn signed_products(a: &[f64], signs: &[f64]) -> Vec<f64> {
    let rows = signs.len();
    if rows == 0 {
        return Vec::new();
    }
    let columns = a.len() / rows;
    let a = &a[..rows * columns];
    let signed = a.chunks_exact(rows).flat_map(|column| {
        let each = column.iter().zip(signs);
        each.map(|(value, sign)| value * sign)
    });
    let signed: Vec<f64> = signed.collect();
    let mut out = vec![0.0; columns * columns];
    triangular::matmul(
        MatMut::from_column_major_slice_mut(&mut out, columns, columns),
        BlockStructure::TriangularLower,
        Accum::Replace,
        MatRef::from_column_major_slice(a, rows, columns).transpose(),
        BlockStructure::Rectangular,
        MatRef::from_column_major_slice(&signed, rows, columns),
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
    out
}

/// AᵀB for A and B of `rows` rows. A, B and the result are stored column by column. Incomplete columns are ignored.
pub fn cross_products(a: &[f64], b: &[f64], rows: usize) -> Vec<f64> {
    if rows == 0 {
        return Vec::new();
    }
    let (columns_a, columns_b) = (a.len() / rows, b.len() / rows);
    let mut out = vec![0.0; columns_a * columns_b];
    matmul(
        MatMut::from_column_major_slice_mut(&mut out, columns_a, columns_b),
        Accum::Replace,
        MatRef::from_column_major_slice(&a[..rows * columns_a], rows, columns_a).transpose(),
        MatRef::from_column_major_slice(&b[..rows * columns_b], rows, columns_b),
        1.0,
        Par::Seq,
    );
    out
}

/// Longest recursion whose poles are computed as eigenvalues. That takes n³ operations and n² numbers: here 1 s and
/// 5 MB.
const DENSE: usize = 800;

/// The largest magnitude of the poles of x_{k+1} = Σ_i w_i x_{k+1−i}, with `weights[i − 1]` = w_i; 0 without
/// weights. For a long recursion it is the growth rate of its free motion.
///
/// # Errors
/// [`NotConverged`] when the eigenvalue iteration fails.
pub fn largest_pole(weights: &[f64]) -> Result<f64, NotConverged> {
    if weights.iter().rposition(|w| *w != 0.0) >= Some(DENSE) {
        return Ok(growth(weights));
    }
    Ok(pole_magnitudes(weights)?.first().copied().unwrap_or(0.0))
}

/// Growth factor of the free motion of a recursion per sample, in the long run. The largest value within 20 lengths
/// of the recursion is compared with that of the interval before, so that beats do not count.
fn growth(weights: &[f64]) -> f64 {
    let own: Vec<(usize, f64)> = (weights.iter().copied().enumerate())
        .filter(|(_, w)| *w != 0.0)
        .collect();
    let n = weights.len();
    let span = 20 * n;
    let mut past = vec![0.0; n];
    past[n - 1] = 1.0;
    // The newest value is at `at − 1`; the logarithms of the normalisation and of the largest value of each
    // interval.
    let (mut scaled, mut largest, mut before) = (0.0_f64, 0.0_f64, 0.0_f64);
    for k in 0..3 * span {
        let at = k % n;
        let next: f64 = own
            .iter()
            .map(|(i, w)| w * past[(at + n - 1 - i) % n])
            .sum();
        past[at] = next;
        largest = largest.max(next.abs());
        if (k + 1) % n == 0 {
            let size = past.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            if !(size > 0.0 && size.is_finite()) {
                return if size > 0.0 { f64::INFINITY } else { 0.0 };
            }
            past.iter_mut().for_each(|x| *x /= size);
            scaled += size.ln();
            largest /= size;
        }
        if k + 1 == 2 * span {
            before = scaled + largest.ln();
            largest = 0.0;
        } else if k + 1 == span {
            largest = 0.0;
        }
    }
    ((scaled + largest.ln() - before) / span as f64).exp()
}

/// Magnitudes of the roots of zⁿ − Σ_i w_i z^(n−i), largest first: the poles of
/// x_{k+1} = Σ_i w_i x_{k+1−i}, with `weights[i − 1]` = w_i.
///
/// # Errors
/// [`NotConverged`] when the eigenvalue iteration fails.
fn pole_magnitudes(weights: &[f64]) -> Result<Vec<f64>, NotConverged> {
    let poles = companion_eigenvalues(weights)?;
    Ok(poles.iter().map(|(re, im)| re.hypot(*im)).collect())
}

/// The poles of x_{k+1} = Σ_i w_i x_{k+1−i} in the z plane, real and imaginary part, the largest modulus first.
/// `None` for a recursion so long that the iteration would take more than a second.
///
/// # Errors
/// [`NotConverged`] when the eigenvalue iteration fails.
pub fn poles(weights: &[f64]) -> Result<Vec<(f64, f64)>, NotConverged> {
    if weights.iter().rposition(|w| *w != 0.0) >= Some(DENSE) {
        return Ok(Vec::new());
    }
    companion_eigenvalues(weights)
}

fn companion_eigenvalues(weights: &[f64]) -> Result<Vec<(f64, f64)>, NotConverged> {
    let n = weights.len() - weights.iter().rev().take_while(|w| **w == 0.0).count();
    if n == 0 {
        return Ok(Vec::new());
    }
    let companion = Mat::from_fn(n, n, |i, j| match i {
        0 => weights.get(j).copied().unwrap_or(0.0),
        _ => f64::from(u8::from(i == j + 1)),
    });
    let poles = companion.eigenvalues().map_err(|_| NotConverged)?;
    let mut poles: Vec<(f64, f64)> = poles.iter().map(|z| (z.re, z.im)).collect();
    poles.sort_by(|a, b| b.0.hypot(b.1).total_cmp(&a.0.hypot(a.1)));
    Ok(poles)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: &[f64], b: &[f64], tolerance: f64) {
        assert_eq!(a.len(), b.len());
        for (x, y) in a.iter().zip(b) {
            assert!((x - y).abs() < tolerance, "{a:?} and {b:?}");
        }
    }

    /// Two coordinates of which only the sum is identified, and one that is identified, of very different size.
    #[test]
    fn what_is_unknown_does_not_spoil_what_is_known() {
        let a = [4.0, 4e3, 0.0, 4e3, 4e6, 0.0, 0.0, 0.0, 1e-8];
        let (inverse, unknown) = inverse_where_known(&a, 3).expect("a decomposition");
        assert_eq!(unknown, [true, true, false]);
        assert!((inverse[8] * 1e-8 - 1.0).abs() < 1e-9, "{inverse:?}");
        assert_eq!(solve_symmetric(&a, &[1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn products_four_at_a_time_are_the_same() {
        let series = |seed: u64| -> Vec<f64> {
            let each = (0..23_u64).map(|i| ((seed * 31 + i) as f64 * 0.7).sin());
            each.collect()
        };
        let others: Vec<Vec<f64>> = (1..8).map(series).collect();
        let a = series(0);
        let products = dots(&a, others.iter().map(Vec::as_slice));
        let one_by_one: Vec<f64> = others.iter().map(|b| dot(&a, b)).collect();
        assert_eq!(products, one_by_one);
        let columns: Vec<&[f64]> = others.iter().map(Vec::as_slice).collect();
        for (cell, product) in gram(&columns).into_iter().enumerate() {
            assert_eq!(product, dot(columns[cell / 7], columns[cell % 7]));
        }
    }

    #[test]
    fn least_squares_of_a_line() {
        let t: Vec<f64> = (0..50).map(f64::from).collect();
        let y: Vec<f64> = t.iter().map(|t| 3.0 - 0.5 * t).collect();
        close(
            &least_squares(&[vec![1.0; 50], t], &y).expect("converges"),
            &[3.0, -0.5],
            1e-12,
        );
    }

    #[test]
    fn dependent_columns_share_the_coefficient() {
        let t: Vec<f64> = (1..50).map(f64::from).collect();
        let y: Vec<f64> = t.iter().map(|t| 4.0 * t).collect();
        let x = least_squares(&[t.clone(), t.clone()], &y).expect("converges");
        close(&x, &[2.0, 2.0], 1e-12);
    }

    #[test]
    fn cross_products_are_added() {
        let (a, b) = ([1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]);
        let mut out = vec![1.0; 4];
        add_cross_products(&mut out, &a, &b, 2, 2);
        close(&out, &[18.0, 40.0, 24.0, 54.0], 1e-12);
    }

    #[test]
    fn signed_products_fill_the_lower_half() {
        let out = signed_products(&[1.0, 2.0, 3.0, 4.0], &[1.0, -1.0]);
        close(&[out[0], out[1], out[3]], &[-3.0, -5.0, -7.0], 1e-12);
        assert!(signed_products(&[], &[]).is_empty());
    }

    #[test]
    fn cross_products_of_unequal_widths() {
        let (a, b) = ([1.0, 2.0, 3.0, 4.0], [5.0, 6.0]);
        close(&cross_products(&a, &b, 2), &[17.0, 39.0], 1e-12);
        close(&cross_products(&b, &a, 2), &[17.0, 39.0], 1e-12);
        assert!(cross_products(&a, &b, 0).is_empty());
    }

    #[test]
    fn poles_of_known_recursions() {
        close(&pole_magnitudes(&[0.9]).expect("converges"), &[0.9], 1e-12);
        // (z − 0.5)(z + 0.8) z
        close(
            &pole_magnitudes(&[-0.3, 0.4, 0.0]).expect("converges"),
            &[0.8, 0.5],
            1e-12,
        );
        let mut circle = vec![0.0; 10];
        circle[9] = 0.5;
        close(
            &pole_magnitudes(&circle).expect("converges"),
            &[0.5f64.powf(0.1); 10],
            1e-12,
        );
        assert!(pole_magnitudes(&[0.0]).expect("converges").is_empty());
    }

    #[test]
    fn the_growth_of_a_recursion_is_its_largest_pole() {
        for own in [
            &[(0, 0.96)][..],
            &[(0, 0.95), (59, 0.03)],
            &[(0, 1.2), (1, -0.5), (39, 0.1)],
            &[(0, 0.9), (99, 0.2)],
        ] {
            let mut weights = vec![0.0; 300];
            own.iter().for_each(|(i, w)| weights[*i] = *w);
            let exact = largest_pole(&weights).unwrap();
            let grown = growth(&weights);
            assert!((grown - exact).abs() < 1e-4, "{own:?}: {grown} {exact}");
        }
        // 65 535 lags are more than the largest order that is solved by a companion matrix.
        let mut weights = vec![0.0; 65_535];
        (weights[0], weights[65_534]) = (0.96, 0.01);
        let pole = largest_pole(&weights).unwrap();
        assert!((0.9998..1.0).contains(&pole), "{pole}");
    }

    #[test]
    fn eigenvalues_of_a_known_matrix() {
        // The eigenvalues of second differences are 2 − 2 cos(iπ/(n + 1)).
        let n = 8;
        let mut a = vec![0.0; n * n];
        for i in 0..n {
            a[i * n + i] = 2.0;
            if i + 1 < n {
                a[i * n + i + 1] = -1.0;
                a[(i + 1) * n + i] = -1.0;
            }
        }
        let mut found = symmetric_eigenvalues(&a, n).unwrap();
        found.sort_by(f64::total_cmp);
        for (i, value) in found.iter().enumerate() {
            let exact = 2.0 - 2.0 * ((i + 1) as f64 * std::f64::consts::PI / (n + 1) as f64).cos();
            assert!((value - exact).abs() < 1e-12);
        }
    }
}
