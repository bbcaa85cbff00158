//! Cholesky factors of small symmetric matrices, the innermost loop of the search.

/// A pivot below this share of its diagonal entry marks a dependent column. The column is left out, and the
/// residual is that of the pseudo-inverse.
const PIVOT_TOLERANCE: f64 = 1e-12;

/// Lower factor of a positive semi-definite matrix, row by row.
#[derive(Debug, Clone, Default)]
pub struct Cholesky {
    n: usize,
    lower: Vec<f64>,
    inverse_diagonal: Vec<f64>,
}

impl Cholesky {
    /// Factorises an n × n matrix stored row by row.
    pub fn new(gram: &[f64], n: usize) -> Self {
        let mut lower = gram.to_vec();
        let mut inverse_diagonal = vec![0.0; n];
        for i in 0..n {
            for j in 0..=i {
                let mut sum = lower[i * n + j];
                for k in 0..j {
                    sum -= lower[i * n + k] * lower[j * n + k];
                }
                if i != j {
                    lower[i * n + j] = sum * inverse_diagonal[j];
                } else if sum > PIVOT_TOLERANCE * gram[i * n + i] {
                    inverse_diagonal[i] = 1.0 / sum.sqrt();
                    lower[i * n + i] = sum.sqrt();
                }
            }
        }
        Self {
            n,
            lower,
            inverse_diagonal,
        }
    }

    /// Entry (i, j) of the factor, j < i.
    pub fn below(&self, i: usize, j: usize) -> f64 {
        self.lower[i * self.n + j]
    }

    /// 1 over diagonal entry i; 0 for a column that was left out.
    pub fn inverse(&self, i: usize) -> f64 {
        self.inverse_diagonal[i]
    }

    /// L⁻¹ r; its squared length is the part of the target that the columns explain.
    pub fn forward(&self, rhs: &[f64]) -> Vec<f64> {
        let mut w = rhs.to_vec();
        for i in 0..self.n {
            let mut sum = w[i];
            for (k, w) in w.iter().enumerate().take(i) {
                sum -= self.below(i, k) * w;
            }
            w[i] = sum * self.inverse_diagonal[i];
        }
        w
    }

    /// Solution of L Lᵀ x = r from `forward`; 0 for columns left out.
    pub fn backward(&self, mut w: Vec<f64>) -> Vec<f64> {
        for i in (0..self.n).rev() {
            w[i] *= self.inverse_diagonal[i];
            for k in 0..i {
                w[k] -= self.below(i, k) * w[i];
            }
        }
        w
    }
}

/// Solves A·x = b for a symmetric positive definite A (row-major); `None` if A is not positive definite. The unknowns
/// may differ in size by many orders.
pub fn solve_symmetric(a: &[f64], b: &[f64]) -> Option<Vec<f64>> {
    let factor = Cholesky::new(a, b.len());
    let complete = factor.inverse_diagonal.iter().all(|inverse| *inverse > 0.0);
    complete.then(|| factor.backward(factor.forward(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_and_measures_what_is_explained() {
        let gram = [4.0, 2.0, 0.4, 2.0, 5.0, 1.0, 0.4, 1.0, 3.0];
        let x = [0.5, -1.0, 2.0];
        let rhs: Vec<f64> = (0..3)
            .map(|i| (0..3).map(|j| gram[i * 3 + j] * x[j]).sum())
            .collect();
        let factor = Cholesky::new(&gram, 3);
        let w = factor.forward(&rhs);
        let explained: f64 = w.iter().map(|w| w * w).sum();
        let expected: f64 = rhs.iter().zip(x).map(|(r, x)| r * x).sum();
        assert!((explained - expected).abs() < 1e-12);
        for (solved, x) in factor.backward(w).iter().zip(x) {
            assert!((solved - x).abs() < 1e-12);
        }
    }

    #[test]
    fn a_repeated_column_is_left_out() {
        let gram = [2.0, 2.0, 1.0, 2.0, 2.0, 1.0, 1.0, 1.0, 3.0];
        let factor = Cholesky::new(&gram, 3);
        let x = factor.backward(factor.forward(&[2.0, 2.0, 1.0]));
        assert!(
            (x[0] - 1.0).abs() < 1e-12 && x[1] == 0.0 && x[2].abs() < 1e-12,
            "{x:?}"
        );
    }

    #[test]
    fn unknowns_of_very_different_size_are_solved_and_singular_systems_refused() {
        let x = solve_symmetric(&[4.0, 0.0, 0.0, 1e-12], &[8.0, 1e-12]).expect("a solution");
        assert!(
            (x[0] - 2.0).abs() < 1e-12 && (x[1] - 1.0).abs() < 1e-12,
            "{x:?}"
        );
        let x = solve_symmetric(&[4.0, 4e3, 4e3, 5e6], &[8.0, 9e3]).expect("a solution");
        assert!(
            (x[0] - 1.0).abs() < 1e-9 && (x[1] - 1e-3).abs() < 1e-12,
            "{x:?}"
        );
        assert_eq!(solve_symmetric(&[4.0, 4e3, 4e3, 4e6], &[8.0, 8e3]), None);
        assert_eq!(solve_symmetric(&[-1.0], &[1.0]), None);
    }
}
