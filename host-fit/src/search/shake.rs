//! Kicks out of a local optimum.

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use super::evaluator::{Evaluator, Success};
use super::mads::descend;
use super::mesh::{Mesh, moved};
use super::problem::Problem;
use super::rules::RULES;
use super::settings::Settings;
use super::step::{Around, SearchStep};
use super::stop::StopReason;

/// Variable neighbourhood search: from a local optimum, a kick and a descent.
///
/// Kicks grow while they are unsuccessful and restart small after a success. Audet, Béchard, Le Digabel, J.
/// Glob. Optim. 41, 2008.
#[derive(Debug)]
pub struct Shake {
    patience: usize,
    fruitless: usize,
}

impl Shake {
    /// Ends after `patience` consecutive kicks without a success.
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
        // The size of the perturbation grows over the allowed attempts; it moves a random subset of the variables.
        let growth = RULES.largest_kick - RULES.least_kick;
        let share = RULES.least_kick + growth * self.fruitless as f64 / self.patience as f64;
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
