//! The free-run objective ε, eq. (9): least squares for the coefficients, then
//! a simulation of every record.

use super::coefficients::Coefficients;
use super::free_runner::{FreeRunner, RunOutcome, Trajectory};
use super::layout::Delays;
use super::linearised::Linearised;
use super::regression::Regression;
use crate::search::{Evaluation, Point, Problem, Variable};

/// ε of the free run as a function of the delays.
pub(crate) struct FreeRun {
    pub(crate) regression: Regression,
    pub(crate) runner: FreeRunner,
}

impl FreeRun {
    /// ε of a candidate; the run may stop with a value ≥ `give_up_at`.
    pub(crate) fn epsilon(&self, delays: &Delays, give_up_at: f64) -> Evaluation {
        let (solution, _) = self.regression.normal(delays).solve();
        let coefficients = Coefficients::new(&solution, delays);
        let limit = give_up_at * give_up_at;
        match self
            .runner
            .run(&self.regression.signals, delays, &coefficients, limit, None)
        {
            RunOutcome::Squared(sum) => Evaluation::Value(sum.sqrt()),
            RunOutcome::AtLeast(_) => Evaluation::AtLeast(give_up_at),
            // The later a run diverges, the lower its value, down to half of the largest. A search can thus
            // leave the unstable region.
            RunOutcome::Diverged(done) => {
                Evaluation::Value(self.runner.diverged * (1.0 - 0.5 * done))
            }
        }
    }

    /// The free run linearised at a candidate, if it does not diverge.
    pub(crate) fn linearise(&self, delays: &Delays) -> Option<Linearised> {
        let (solution, _) = self.regression.normal(delays).solve();
        let coefficients = Coefficients::new(&solution, delays);
        let mut trajectory = Trajectory::default();
        let signals = &self.regression.signals;
        let outcome = self.runner.run(
            signals,
            delays,
            &coefficients,
            f64::INFINITY,
            Some(&mut trajectory),
        );
        matches!(outcome, RunOutcome::Squared(_)).then(|| {
            Linearised::new(
                signals,
                &self.regression.layout,
                delays,
                &solution,
                &trajectory,
            )
        })
    }
}

impl Problem for FreeRun {
    fn variables(&self) -> &[Variable] {
        &self.regression.layout.variables
    }

    fn canonical(&self, point: &[i64]) -> Point {
        self.regression.layout.canonical(point)
    }

    fn groups(&self) -> Vec<Vec<usize>> {
        self.regression.layout.groups()
    }

    fn prepare(&mut self, points: &[&Point]) {
        for point in points {
            let delays = self.regression.layout.delays(point);
            self.regression.tabulate_near(&delays.ticks);
        }
    }

    fn evaluate(&self, point: &Point, give_up_at: f64) -> Evaluation {
        self.epsilon(&self.regression.layout.delays(point), give_up_at)
    }
}
