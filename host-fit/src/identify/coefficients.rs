//! The solution of a regression, sorted.

use super::layout::Delays;

/// Coefficients of a candidate, in the order of eq. (3).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Coefficients {
    pub(crate) a: Vec<f64>,
    pub(crate) b: Vec<f64>,
    /// The N2 coefficients of input 1 first.
    pub(crate) c: Vec<f64>,
    pub(crate) constant: f64,
}

impl Coefficients {
    /// Sorts the solution of a regression, in the order of its columns.
    pub(crate) fn new(solution: &[f64], delays: &Delays) -> Self {
        let mut rest = solution.iter().copied();
        let mut next = || rest.next().unwrap_or(0.0);
        let a = delays.state.iter().map(|_| next()).collect();
        let (mut b, mut c) = (Vec::new(), Vec::new());
        for _ in &delays.ticks {
            b.push(next());
            c.extend(delays.product.iter().map(|_| next()));
        }
        Self {
            a,
            b,
            c,
            constant: next(),
        }
    }
}
