//! Linear algebra: the one place that knows faer.

use faer::linalg::solvers::Solve;

/// Solves A·x = b for a symmetric positive definite A (row-major); `None` if it
/// is not.
pub(crate) fn solve_symmetric(a: &[f64], b: &[f64]) -> Option<Vec<f64>> {
    let n = b.len();
    let a = faer::MatRef::from_row_major_slice(a, n, n);
    let factor = a.llt(faer::Side::Lower).ok()?;
    let x = factor.solve(faer::ColRef::from_slice(b));
    Some(x.iter().copied().collect())
}
