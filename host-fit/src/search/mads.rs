//! Mesh adaptive direct search: the loop of search steps, poll and mesh update.

use std::sync::atomic::AtomicBool;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::evaluator::{Evaluator, Progress, Success};
use super::mesh::Mesh;
use super::poll;
use super::problem::Problem;
use super::settings::Settings;
use super::step::{Around, SearchStep};
use super::stop::StopReason;
use super::variable::Point;

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchReport {
    /// Best point found; `None` only with [`StopReason::NoFiniteValue`] or when
    /// stopped before the first finite value.
    pub best: Option<Success>,
    /// Evaluations of the objective.
    pub evaluations: usize,
    /// Points answered from the cache.
    pub cache_hits: usize,
    /// Points that search steps evaluated in closed form.
    pub screened: usize,
    /// Every improvement: number of evaluations and value.
    pub history: Vec<(usize, f64)>,
    /// Why the search ended.
    pub stop: StopReason,
}

/// Minimises a problem from the given starting points.
///
/// The best of the starts is the first incumbent; without any, the middle of
/// the bounds. The same seed gives the same result, bit for bit, with any
/// number of threads.
pub fn minimise<P: Problem>(
    problem: &mut P,
    starts: &[Point],
    steps: &mut [Box<dyn SearchStep<P>>],
    settings: &Settings,
    progress: &dyn Progress,
    interrupt: &AtomicBool,
) -> SearchReport {
    let mesh = Mesh::with_frame_share(problem.variables(), settings.initial_frame);
    let fixed = problem.variables().iter().all(|v| v.range() <= 0);
    let middle: Point = problem
        .variables()
        .iter()
        .map(|v| v.lower + v.range() / 2)
        .collect();
    let starts = if starts.is_empty() {
        std::slice::from_ref(&middle)
    } else {
        starts
    };
    let clamped: Vec<Point> = starts
        .iter()
        .map(|s| {
            problem
                .variables()
                .iter()
                .zip(s)
                .map(|(v, x)| v.clamp(*x))
                .collect()
        })
        .collect();
    let mut evaluator = Evaluator::new(
        problem,
        settings.evaluations,
        settings.threads,
        progress,
        interrupt,
    );
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let run = || -> Result<StopReason, StopReason> {
        let mut start: Option<Success> = None;
        for point in &clamped {
            let value = evaluator.value(point)?;
            if start.as_ref().is_none_or(|s| value < s.value) {
                start = Some(Success {
                    point: point.clone(),
                    value,
                });
            }
        }
        match start {
            Some(_) if fixed => Ok(StopReason::NothingToSearch),
            Some(start) => {
                descend(&mut evaluator, steps, start, mesh, settings, &mut rng)?;
                Ok(StopReason::LocallyOptimal)
            }
            None => Ok(StopReason::NoFiniteValue),
        }
    };
    let stop = run().unwrap_or_else(|reason| reason);
    let best = evaluator.best().cloned();
    let stop = if best.is_none() && stop == StopReason::LocallyOptimal {
        StopReason::NoFiniteValue
    } else {
        stop
    };
    SearchReport {
        evaluations: evaluator.evaluations(),
        cache_hits: evaluator.cache_hits(),
        screened: steps.iter().map(|s| s.screened()).sum(),
        history: evaluator.history().to_vec(),
        best,
        stop,
    }
}

/// Runs MADS from `start` until the point is locally optimal and no search step improves it.
pub(crate) fn descend<P: Problem>(
    evaluator: &mut Evaluator<'_, P>,
    steps: &mut [Box<dyn SearchStep<P>>],
    start: Success,
    mut mesh: Mesh,
    settings: &Settings,
    rng: &mut ChaCha8Rng,
) -> Result<Success, StopReason> {
    let variables = evaluator.problem().variables().to_vec();
    let groups = evaluator.problem().groups();
    let mut incumbent = start;
    let mut last_step: Option<Vec<i64>> = None;
    let mut locally_optimal = false;
    loop {
        let mut success = None;
        let mut polled = false;
        for step in steps.iter_mut() {
            let mut around = Around {
                point: &incumbent.point,
                value: incumbent.value,
                mesh: &mesh,
                last_step: last_step.as_deref(),
                locally_optimal,
                rng,
            };
            success = step.search(evaluator, &mut around)?;
            if success.is_some() {
                break;
            }
        }
        if success.is_none() && !locally_optimal {
            polled = true;
            let trial = poll::points(
                &variables,
                &groups,
                &incumbent.point,
                &mesh,
                settings.poll,
                last_step.as_deref(),
                rng,
            );
            success = evaluator.first_better(&trial, incumbent.value)?;
            if success.is_none() && mesh.is_finest() {
                let complete = poll::neighbours(&variables, &incumbent.point);
                success = evaluator.first_better(&complete, incumbent.value)?;
                locally_optimal = success.is_none();
            }
        }
        match success {
            Some(better) => {
                let step: Vec<i64> = better
                    .point
                    .iter()
                    .zip(&incumbent.point)
                    .map(|(a, b)| a - b)
                    .collect();
                if polled {
                    mesh.enlarge(&step);
                }
                last_step = Some(step);
                incumbent = better;
                locally_optimal = false;
            }
            None if locally_optimal => {
                if steps.iter().all(|s| s.has_given_up()) {
                    return Ok(incumbent);
                }
            }
            None => mesh.refine(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::super::problem::Evaluation;
    use super::super::settings::PollKind;
    use super::super::shake::Shake;
    use super::super::step::Speculative;
    use super::super::variable::Variable;
    use super::*;

    struct Function {
        variables: Vec<Variable>,
        f: fn(&[f64]) -> f64,
        sorted: bool,
        calls: AtomicUsize,
    }

    impl Function {
        fn new(variables: Vec<Variable>, f: fn(&[f64]) -> f64) -> Self {
            Self {
                variables,
                f,
                sorted: false,
                calls: AtomicUsize::new(0),
            }
        }
    }

    impl Problem for Function {
        fn variables(&self) -> &[Variable] {
            &self.variables
        }
        fn canonical(&self, point: &[i64]) -> Point {
            let mut key = point.to_vec();
            if self.sorted {
                key.sort_unstable();
            }
            key
        }
        fn evaluate(&self, point: &Point, _: f64) -> Evaluation {
            self.calls.fetch_add(1, Ordering::Relaxed);
            let x: Vec<f64> = self
                .variables
                .iter()
                .zip(point)
                .map(|(v, t)| v.value(*t))
                .collect();
            Evaluation::Value((self.f)(&x))
        }
    }

    fn solve(problem: &mut Function, settings: &Settings, patience: usize) -> SearchReport {
        let mut steps: Vec<Box<dyn SearchStep<Function>>> = vec![
            Box::new(Speculative::default()),
            Box::new(Shake::new(patience)),
        ];
        let start: Point = problem.variables.iter().map(|v| v.lower).collect();
        minimise(
            problem,
            &[start],
            &mut steps,
            settings,
            &(),
            &AtomicBool::new(false),
        )
    }

    fn rosenbrock(x: &[f64]) -> f64 {
        (1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2)
    }

    #[test]
    fn rosenbrock_with_one_integer_and_one_granular_variable() {
        for seed in 0..5 {
            let variables = vec![
                Variable::integer("i", -20, 20),
                Variable::granular("r", -50.0, 50.0, 1e-3),
            ];
            let mut problem = Function::new(variables, rosenbrock);
            let report = solve(
                &mut problem,
                &Settings {
                    seed,
                    ..Settings::default()
                },
                20,
            );
            let best = report.best.expect("finite everywhere");
            assert_eq!(
                (best.point, best.value),
                (vec![1, 1000], 0.0),
                "seed {seed}"
            );
            assert_eq!(report.stop, StopReason::LocallyOptimal);
        }
    }

    #[test]
    fn separable_integers_end_at_the_known_minimum_with_both_polls() {
        for poll in [PollKind::Ortho2N, PollKind::OrthoNPlus1] {
            let variables = (0..16)
                .map(|i| Variable::integer(format!("d{i}"), 0, 500))
                .collect();
            let mut problem = Function::new(variables, |x| {
                x.iter()
                    .enumerate()
                    .map(|(i, v)| (v - 30.0 * i as f64 - 7.0).abs().sqrt())
                    .sum()
            });
            let report = solve(
                &mut problem,
                &Settings {
                    poll,
                    ..Settings::default()
                },
                0,
            );
            let best = report.best.expect("finite everywhere");
            let expected: Point = (0..16).map(|i| 30 * i + 7).collect();
            assert_eq!((best.point, best.value), (expected, 0.0), "{poll:?}");
        }
    }

    #[test]
    fn a_staircase_with_ripples_needs_the_kicks() {
        // The function is a staircase with steps three wide and a ripple of local minima; its global
        // minimum is at (60, 60).
        fn staircase(x: &[f64]) -> f64 {
            x.iter()
                .map(|v| ((v - 60.0) / 3.0).trunc().abs() + 3.0 * (1.0 - ((v - 60.0) * 0.7).cos()))
                .sum()
        }
        let variables = || {
            vec![
                Variable::integer("a", 0, 400),
                Variable::integer("b", 0, 400),
            ]
        };
        for seed in 0..5 {
            let mut problem = Function::new(variables(), staircase);
            let report = solve(
                &mut problem,
                &Settings {
                    seed,
                    ..Settings::default()
                },
                60,
            );
            assert_eq!(report.best.expect("finite").value, 0.0, "seed {seed}");
        }
    }

    #[test]
    fn it_stops_only_when_every_neighbour_is_worse() {
        // The function has a narrow diagonal valley, in which most random polls at one tick do not
        // contain ±1 along a single axis.
        let variables = (0..8)
            .map(|i| Variable::integer(format!("d{i}"), -100, 100))
            .collect();
        let f = |x: &[f64]| {
            let sum: f64 = x.iter().sum();
            x.iter().map(|v| (v - 5.0).powi(2)).sum::<f64>() + 40.0 * (sum - 40.0).abs()
        };
        let mut problem = Function::new(variables, f);
        let report = solve(&mut problem, &Settings::default(), 0);
        let best = report.best.expect("finite everywhere");
        for neighbour in poll::neighbours(&problem.variables, &best.point) {
            let x: Vec<f64> = neighbour.iter().map(|t| *t as f64).collect();
            assert!(f(&x) >= best.value);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_run_with_any_number_of_threads() {
        let run = |threads| {
            let variables = (0..6)
                .map(|i| Variable::integer(format!("d{i}"), 0, 300))
                .collect();
            let mut problem = Function::new(variables, |x| {
                x.windows(2)
                    .map(|w| (w[1] - w[0] - 17.0).abs() + (w[0] * 0.3).sin())
                    .sum()
            });
            problem.sorted = true;
            solve(
                &mut problem,
                &Settings {
                    threads,
                    seed: 9,
                    ..Settings::default()
                },
                10,
            )
        };
        assert_eq!(run(1), run(2));
        assert_eq!(run(1), run(1));
    }

    #[test]
    fn the_budget_is_kept_and_the_cache_spares_calls() {
        let variables = (0..4)
            .map(|i| Variable::integer(format!("d{i}"), 0, 500))
            .collect();
        let mut problem = Function::new(variables, |x| x.iter().map(|v| (v - 250.5).powi(2)).sum());
        let report = solve(
            &mut problem,
            &Settings {
                evaluations: 150,
                ..Settings::default()
            },
            50,
        );
        assert_eq!(report.stop, StopReason::EvaluationBudget);
        assert_eq!(report.evaluations, 150);
        assert_eq!(problem.calls.load(Ordering::Relaxed), 150);
        assert!(report.best.is_some());
        assert!(
            report
                .history
                .windows(2)
                .all(|w| w[1].1 < w[0].1 && w[1].0 > w[0].0)
        );
    }

    #[test]
    fn degenerate_searches_say_so() {
        let mut fixed = Function::new(vec![Variable::integer("d", 3, 3)], |x| x[0]);
        let report = solve(&mut fixed, &Settings::default(), 3);
        assert_eq!(report.stop, StopReason::NothingToSearch);
        assert_eq!(report.best.map(|b| b.value), Some(3.0));
        let mut nan = Function::new(vec![Variable::integer("d", 0, 9)], |_| f64::NAN);
        let report = solve(&mut nan, &Settings::default(), 2);
        assert_eq!(
            (report.stop, report.best),
            (StopReason::NoFiniteValue, None)
        );
    }
}
