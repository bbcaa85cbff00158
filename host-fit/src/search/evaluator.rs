//! Evaluation of trial points: cache, order, threads, budget, interrupt.
//!
//! Points are tried in order until one is better than the incumbent. With several threads points are
//! evaluated ahead; results after the first success in order are discarded, so that cache, count and decision
//! equal those of one thread.

use crate::parallel;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};

use super::problem::{Evaluation, Problem};
use super::stop::StopReason;
use super::variable::Point;

/// Points evaluated ahead at a time. Fixed, so that [`Problem::prepare`] sees
/// the same blocks whatever the number of threads.
const BLOCK: usize = 8;

/// State of a running search, as shown to the user.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// Evaluations so far.
    pub evaluations: usize,
    /// Largest number of evaluations allowed.
    pub budget: usize,
    /// Best value so far; infinite before the first finite value.
    pub best: f64,
}

/// Receives the state of a running search.
pub trait Progress: Sync {
    /// Called after each block of evaluations and each improvement, on the searching thread.
    fn report(&self, snapshot: &Snapshot);
    /// The best point so far, after each improvement.
    fn best(&self, _point: &Point) {}
}

/// No progress wanted.
impl Progress for () {
    fn report(&self, _: &Snapshot) {}
}

/// A point with a lower value than the one compared with.
#[derive(Debug, Clone, PartialEq)]
pub struct Success {
    /// The better point.
    pub point: Point,
    /// Value of the objective at the better point.
    pub value: f64,
}

/// Evaluates points of a problem for a search.
pub struct Evaluator<'a, P: Problem> {
    problem: &'a mut P,
    cache: HashMap<Point, Evaluation>,
    budget: usize,
    evaluations: usize,
    cache_hits: usize,
    best: Option<Success>,
    history: Vec<(usize, f64)>,
    pool: Option<rayon::ThreadPool>,
    progress: &'a dyn Progress,
    interrupt: &'a AtomicBool,
}

impl<'a, P: Problem> Evaluator<'a, P> {
    pub(crate) fn new(
        problem: &'a mut P,
        budget: usize,
        threads: usize,
        progress: &'a dyn Progress,
        interrupt: &'a AtomicBool,
    ) -> Self {
        // If no thread pool can be created, the search runs on the caller's thread.
        let pool = (threads > 1)
            .then(|| {
                rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .ok()
            })
            .flatten();
        Self {
            problem,
            cache: HashMap::new(),
            budget,
            evaluations: 0,
            cache_hits: 0,
            best: None,
            history: Vec::new(),
            pool,
            progress,
            interrupt,
        }
    }

    /// The problem being minimised.
    pub fn problem(&self) -> &P {
        self.problem
    }

    /// The problem being minimised, for a search step that builds tables in it.
    pub fn problem_mut(&mut self) -> &mut P {
        self.problem
    }

    /// Number of objective evaluations so far, without repeated points.
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// Number of times a point was answered from the cache.
    pub fn cache_hits(&self) -> usize {
        self.cache_hits
    }

    /// Best point of the whole run.
    pub fn best(&self) -> Option<&Success> {
        self.best.as_ref()
    }

    pub(crate) fn history(&self) -> &[(usize, f64)] {
        &self.history
    }

    /// The flag that requests the search to stop; long steps should check it.
    pub fn interrupt(&self) -> &'a AtomicBool {
        self.interrupt
    }

    /// Whether the search was requested to stop.
    pub fn is_interrupted(&self) -> bool {
        self.interrupt.load(Ordering::Relaxed)
    }

    /// The cached evaluation of a point, if any.
    pub fn remembered(&self, point: &[i64]) -> Option<Evaluation> {
        self.cache.get(&self.problem.canonical(point)).copied()
    }

    /// Tries the points in order and returns the first with a value below `incumbent`.
    ///
    /// # Errors
    /// The reason to stop the search: budget used up or interrupted.
    pub fn first_better(
        &mut self,
        points: &[Point],
        incumbent: f64,
    ) -> Result<Option<Success>, StopReason> {
        let mut rest = points;
        while !rest.is_empty() {
            // A block is the next few points that are not in the cache.
            let mut block: Vec<(&Point, Point)> = Vec::with_capacity(BLOCK);
            let mut taken = 0;
            let mut known = None;
            for point in rest {
                if block.len() == BLOCK {
                    break;
                }
                taken += 1;
                let key = self.problem.canonical(point);
                match self.cache.get(&key) {
                    Some(Evaluation::Value(value)) => {
                        self.cache_hits += 1;
                        if *value < incumbent {
                            known = Some(Success {
                                point: point.clone(),
                                value: *value,
                            });
                            break;
                        }
                    }
                    Some(Evaluation::AtLeast(value)) if *value >= incumbent => self.cache_hits += 1,
                    _ if block.iter().any(|(_, k)| *k == key) => self.cache_hits += 1,
                    _ => block.push((point, key)),
                }
            }
            rest = rest.get(taken..).unwrap_or_default();
            if let Some(success) = self.evaluate_block(&block, incumbent)? {
                return Ok(Some(success));
            }
            if known.is_some() {
                return Ok(known);
            }
        }
        Ok(None)
    }

    /// Value of one point, from the cache where possible.
    ///
    /// # Errors
    /// The reason to stop the search: budget used up or interrupted.
    pub fn value(&mut self, point: &Point) -> Result<f64, StopReason> {
        if let Some(Evaluation::Value(value)) = self.remembered(point) {
            self.cache_hits += 1;
            return Ok(value);
        }
        let key = self.problem.canonical(point);
        self.evaluate_block(&[(point, key)], f64::INFINITY)?;
        match self.remembered(point) {
            Some(Evaluation::Value(value)) => Ok(value),
            _ => Ok(f64::INFINITY),
        }
    }

    fn evaluate_block(
        &mut self,
        block: &[(&Point, Point)],
        incumbent: f64,
    ) -> Result<Option<Success>, StopReason> {
        if block.is_empty() {
            return Ok(None);
        }
        let points: Vec<&Point> = block.iter().map(|(point, _)| *point).collect();
        self.problem.prepare(&points);
        let problem: &P = self.problem;
        let ahead: Option<Vec<Evaluation>> =
            self.pool.as_ref().filter(|_| block.len() > 1).map(|pool| {
                pool.install(|| parallel::each(&points, |point| problem.evaluate(point, incumbent)))
            });
        let mut found = None;
        for (i, (point, key)) in block.iter().enumerate() {
            if self.is_interrupted() {
                return Err(StopReason::Interrupted);
            }
            if self.evaluations >= self.budget {
                return Err(StopReason::EvaluationBudget);
            }
            let evaluation = match ahead.as_ref().and_then(|a| a.get(i)) {
                Some(evaluation) => *evaluation,
                None => self.problem.evaluate(point, incumbent),
            };
            let evaluation = match evaluation {
                Evaluation::Value(v) if v.is_nan() => Evaluation::Value(f64::INFINITY),
                other => other,
            };
            self.evaluations += 1;
            self.cache.insert(key.clone(), evaluation);
            if let Evaluation::Value(value) = evaluation {
                if value < self.best.as_ref().map_or(f64::INFINITY, |b| b.value) {
                    self.best = Some(Success {
                        point: (*point).clone(),
                        value,
                    });
                    self.history.push((self.evaluations, value));
                }
                if value < incumbent {
                    found = Some(Success {
                        point: (*point).clone(),
                        value,
                    });
                    break;
                }
            }
        }
        self.progress.report(&Snapshot {
            evaluations: self.evaluations,
            budget: self.budget,
            best: self.best.as_ref().map_or(f64::INFINITY, |b| b.value),
        });
        if let Some(best) = &self.best {
            self.progress.best(&best.point);
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::super::variable::Variable;
    use super::*;

    struct Sorted(Vec<Variable>);

    impl Problem for Sorted {
        fn variables(&self) -> &[Variable] {
            &self.0
        }
        fn canonical(&self, point: &[i64]) -> Point {
            let mut key = point.to_vec();
            key.sort_unstable();
            key.dedup();
            key
        }
        fn evaluate(&self, point: &Point, _: f64) -> Evaluation {
            Evaluation::Value(self.canonical(point).iter().sum::<i64>() as f64)
        }
    }

    fn run(threads: usize) -> (Option<Success>, usize, usize) {
        let mut problem = Sorted(vec![
            Variable::integer("a", 0, 99),
            Variable::integer("b", 0, 99),
        ]);
        let stop = AtomicBool::new(false);
        let mut evaluator = Evaluator::new(&mut problem, 100, threads, &(), &stop);
        let points: Vec<Point> = [[9, 8], [8, 9], [7, 7], [7, 7], [1, 2], [0, 1]]
            .map(Vec::from)
            .to_vec();
        let success = evaluator.first_better(&points, 5.0).expect("within budget");
        (success, evaluator.evaluations(), evaluator.cache_hits())
    }

    #[test]
    fn permuted_points_are_one_and_the_first_success_ends_the_list() {
        // [8,9] and the second [7,7] are in the cache; [0,1] comes after the success and is not
        // evaluated.
        let expected = (
            Some(Success {
                point: vec![1, 2],
                value: 3.0,
            }),
            3,
            2,
        );
        let (success, evaluations, _) = run(1);
        assert_eq!((success, evaluations), (expected.0, expected.1));
    }

    #[test]
    fn threads_change_nothing() {
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn budget_and_interrupt_stop_with_the_best_kept() {
        let mut problem = Sorted(vec![Variable::integer("a", 0, 99)]);
        let stop = AtomicBool::new(false);
        let mut evaluator = Evaluator::new(&mut problem, 1, 1, &(), &stop);
        assert_eq!(evaluator.value(&vec![4]), Ok(4.0));
        assert_eq!(evaluator.value(&vec![4]), Ok(4.0));
        assert_eq!(evaluator.value(&vec![3]), Err(StopReason::EvaluationBudget));
        stop.store(true, Ordering::Relaxed);
        let mut evaluator = Evaluator::new(&mut problem, 9, 1, &(), &stop);
        assert_eq!(
            evaluator.first_better(&[vec![3]], 9.0),
            Err(StopReason::Interrupted)
        );
    }
}
