//! How long a model remembers.

use super::Model;
use crate::linalg::{NotConverged, pole_magnitudes};

impl Model {
    /// The largest pole magnitude of the recursion with all jets off, or all on:
    /// what is left of an effect on y after another sample, once all else is
    /// forgotten; 0 without state lags.
    ///
    /// # Errors
    /// [`NotConverged`] when the eigenvalue iteration fails.
    pub(crate) fn largest_pole(&self, on: bool) -> Result<f64, NotConverged> {
        let mut weights = vec![0.0; self.longest_lag() + 1];
        let mut add = |lag: &u16, weight: &f64| {
            if let Some(place) = weights.get_mut(self.convention.behind_newest(*lag)) {
                *place += weight;
            }
        };
        let own = self.state_lags.iter().zip(&self.a);
        own.for_each(|(lag, a)| add(lag, a));
        if on {
            let products = self.product_lags.iter().cycle().zip(&self.c);
            products.for_each(|(lag, c)| add(lag, c));
        }
        Ok(pole_magnitudes(&weights)?.first().copied().unwrap_or(0.0))
    }
}
