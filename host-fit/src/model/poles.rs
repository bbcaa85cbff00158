//! Memory length of a model.

use super::Model;
use numerics::linalg::{NotConverged, largest_pole};

impl Model {
    /// The largest pole modulus of the recursion with all jets off, or on: the factor by which a disturbance
    /// of y decays per sample in the long run; 0 without state lags.
    ///
    /// # Errors
    /// [`NotConverged`] when the eigenvalue iteration fails.
    pub(crate) fn largest_pole(&self, on: bool) -> Result<f64, NotConverged> {
        largest_pole(&self.recursion(on))
    }

    /// The weights w_i of y_{k+1} = Σ_i w_i y_{k+1−i} with all jets off, or all on.
    pub(crate) fn recursion(&self, on: bool) -> Vec<f64> {
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
        weights
    }

    /// Time constant of the flow without jets, s: one Newton step from a pole of 1, accurate for a slow flow.
    /// Infinite for an integrator.
    pub(crate) fn time_constant(&self) -> f64 {
        let reach = |lag: &u16| (self.convention.behind_newest(*lag) + 1) as f64;
        let own = || self.state_lags.iter().zip(&self.a);
        let forgotten = 1.0 - own().map(|(_, a)| a).sum::<f64>();
        let held: f64 = own().map(|(lag, a)| a * reach(lag)).sum();
        if forgotten > 0.0 {
            self.sample_period_s * held.max(0.0) / forgotten
        } else {
            f64::INFINITY
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_constants_are_those_of_slow_poles() {
        let flow = |lags: &[u16], a: &[f64]| Model {
            state_lags: lags.to_vec(),
            a: a.to_vec(),
            ..Model::default()
        };
        let first_order = flow(&[1], &[(-0.01_f64).exp()]).time_constant();
        assert!((first_order - 0.1).abs() < 1e-3, "{first_order}");
        // Half of the relaxation acts 20 ms later, and the time constant includes this delay.
        let lagged = flow(&[1, 21], &[0.988, 0.010]);
        let pole = lagged.largest_pole(false).expect("a pole");
        let slow = -0.001 / pole.ln();
        let found = lagged.time_constant();
        assert!((found / slow - 1.0).abs() < 0.05, "{found} {slow}");
        assert_eq!(flow(&[1], &[1.0]).time_constant(), f64::INFINITY);
    }
}
