//! Search steps: heuristics that may find a better point before the poll.

use rand_chacha::ChaCha8Rng;

use super::evaluator::{Evaluator, Success};
use super::mesh::{Mesh, moved};
use super::problem::Problem;
use super::rules::RULES;
use super::stop::StopReason;
use super::variable::Point;

/// State of the search when a step is called.
pub struct Around<'a> {
    /// The incumbent.
    pub point: &'a [i64],
    /// Value of the objective at the incumbent.
    pub value: f64,
    /// The mesh around the incumbent.
    pub mesh: &'a Mesh,
    /// Displacement of the last success, in ticks.
    pub last_step: Option<&'a [i64]>,
    /// Whether the mesh is at one tick and every neighbour is known to be no better.
    pub locally_optimal: bool,
    /// Random generator of the search.
    pub rng: &'a mut ChaCha8Rng,
}

/// A search step of MADS.
///
/// Generic steps are [`Speculative`] and [`Shake`](super::Shake); a problem can add its own.
pub trait SearchStep<P: Problem> {
    /// Looks for a point better than the incumbent.
    ///
    /// # Errors
    /// The reason to stop the whole search, passed on from the evaluator.
    fn search(
        &mut self,
        evaluator: &mut Evaluator<'_, P>,
        around: &mut Around<'_>,
    ) -> Result<Option<Success>, StopReason>;

    /// Whether the step cannot improve a locally optimal incumbent any more. The search ends when this is true of all
    /// steps.
    fn has_given_up(&self) -> bool {
        true
    }

    /// Points that the step evaluated in closed form, without the objective.
    fn screened(&self) -> usize {
        0
    }
}

/// After a success, tries a multiple of the same displacement.
#[derive(Debug, Default)]
pub struct Speculative {
    tried_from: Option<(Vec<i64>, Vec<i64>)>,
}

impl<P: Problem> SearchStep<P> for Speculative {
    fn search(
        &mut self,
        evaluator: &mut Evaluator<'_, P>,
        around: &mut Around<'_>,
    ) -> Result<Option<Success>, StopReason> {
        let Some(last) = around.last_step else {
            return Ok(None);
        };
        let here = (around.point.to_vec(), last.to_vec());
        if self.tried_from.as_ref() == Some(&here) {
            return Ok(None);
        }
        self.tried_from = Some(here);
        let far: Vec<f64> = last
            .iter()
            .map(|s| (RULES.speculative - 1.0) * *s as f64)
            .collect();
        let point = moved(
            evaluator.problem().variables(),
            around.point,
            &around.mesh.round(&far),
        );
        evaluator.first_better(&[point], around.value)
    }
}

/// The improvement that a [`Settle`] applies. It starts from the incumbent and returns its end point and, if this
/// is better, the success. It also counts the points screened.
pub type Improve<P> = fn(
    &mut Evaluator<'_, P>,
    &Around<'_>,
    &mut usize,
) -> Result<(Point, Option<Success>), StopReason>;

/// An improvement that depends only on the incumbent: it is applied once to each incumbent, and not to its own results.
pub struct Settle<P: Problem> {
    improve: Improve<P>,
    settled_at: Option<Point>,
    screened: usize,
}

impl<P: Problem> Settle<P> {
    /// A step that applies `improve`.
    pub fn new(improve: Improve<P>) -> Self {
        Self {
            improve,
            settled_at: None,
            screened: 0,
        }
    }
}

impl<P: Problem> SearchStep<P> for Settle<P> {
    fn search(
        &mut self,
        evaluator: &mut Evaluator<'_, P>,
        around: &mut Around<'_>,
    ) -> Result<Option<Success>, StopReason> {
        if self.settled_at.as_deref() == Some(around.point) {
            return Ok(None);
        }
        let (point, success) = (self.improve)(evaluator, around, &mut self.screened)?;
        self.settled_at = Some(point);
        Ok(success)
    }

    fn screened(&self) -> usize {
        self.screened
    }
}
