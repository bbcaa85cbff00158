//! Search steps: anything that may find a better point before the poll does.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::evaluator::{Evaluator, Success};
use super::mads::descend;
use super::mesh::{Mesh, moved};
use super::problem::Problem;
use super::settings::Settings;
use super::stop::StopReason;

/// Where the search stands when a step is asked for a better point.
pub struct Around<'a> {
    /// The incumbent.
    pub point: &'a [i64],
    /// Its value.
    pub value: f64,
    /// The mesh around it.
    pub mesh: &'a Mesh,
    /// Displacement of the last success, in ticks.
    pub last_step: Option<&'a [i64]>,
    /// Whether the mesh is at one tick and every neighbour is known to be no better.
    pub locally_optimal: bool,
    /// The search's source of randomness.
    pub rng: &'a mut ChaCha8Rng,
}

/// A search step of MADS.
///
/// Generic steps are [`Speculative`] and [`Shake`]; a problem brings its own for
/// what only it knows.
pub trait SearchStep<P: Problem> {
    /// Looks for a point better than the incumbent.
    ///
    /// # Errors
    /// The reason to stop the whole search, handed on from the evaluator.
    fn search(
        &mut self,
        evaluator: &mut Evaluator<'_, P>,
        around: &mut Around<'_>,
    ) -> Result<Option<Success>, StopReason>;

    /// Whether nothing more is to be expected of this step at a locally optimal
    /// incumbent. The search ends when all steps have given up.
    fn has_given_up(&self) -> bool {
        true
    }

    /// Points that the step judged by a closed form of its own, without evaluating them.
    fn screened(&self) -> usize {
        0
    }
}

/// After a success, tries four times the same displacement.
#[derive(Debug, Default)]
pub struct Speculative {
    tried_from: Option<(Vec<i64>, Vec<i64>)>,
}

/// How much further the speculative point lies (NOMAD's default).
const SPECULATIVE_FACTOR: f64 = 4.0;

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
            .map(|s| (SPECULATIVE_FACTOR - 1.0) * *s as f64)
            .collect();
        let point = moved(
            evaluator.problem().variables(),
            around.point,
            &around.mesh.round(&far),
        );
        evaluator.first_better(&[point], around.value)
    }
}

/// Variable neighbourhood search: from a local optimum, a kick and a descent.
///
/// Each fruitless kick is larger than the one before; a success starts again
/// with small ones. Audet, Béchard, Le Digabel, J. Glob. Optim. 41, 2008.
#[derive(Debug)]
pub struct Shake {
    patience: usize,
    fruitless: usize,
}

impl Shake {
    /// Gives up after `patience` kicks in a row without a success.
    pub fn new(patience: usize) -> Self {
        Self {
            patience,
            fruitless: 0,
        }
    }
}

impl<P: Problem> SearchStep<P> for Shake {
    fn search(
        &mut self,
        evaluator: &mut Evaluator<'_, P>,
        around: &mut Around<'_>,
    ) -> Result<Option<Success>, StopReason> {
        if !around.locally_optimal || self.fruitless >= self.patience {
            return Ok(None);
        }
        self.fruitless += 1;
        let variables = evaluator.problem().variables().to_vec();
        // The kick grows from 2 % to 30 % of the range over the allowed tries,
        // and moves a random share of the variables.
        let share = 0.02 + 0.28 * self.fruitless as f64 / self.patience as f64;
        let moving: f64 = around.rng.random_range(0.2..1.0);
        let step: Vec<i64> = variables
            .iter()
            .map(|v| {
                let kick: f64 = StandardNormal.sample(around.rng);
                let moves = around.rng.random_bool(moving);
                if moves {
                    (kick * (share * v.range() as f64).max(1.0)).round() as i64
                } else {
                    0
                }
            })
            .collect();
        let point = moved(&variables, around.point, &step);
        let value = evaluator.value(&point)?;
        let start = Success { point, value };
        let mesh = Mesh::with_frame_share(&variables, share);
        let settings = Settings::default();
        let end = descend(evaluator, &mut [], start, mesh, &settings, around.rng)?;
        if end.value < around.value {
            self.fruitless = 0;
            return Ok(Some(end));
        }
        Ok(None)
    }

    fn has_given_up(&self) -> bool {
        self.fruitless >= self.patience
    }
}
