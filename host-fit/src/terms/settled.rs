//! Mesh adaptive direct search over the lags and delays of a chosen structure, on the free-run error.

use super::RULES;
use super::judge::{Judge, Judged};
use crate::data::Record;
use crate::fit::{FitOptions, fit};
use crate::model::{Delay, Model};
use crate::search::{
    Evaluation, Point, Problem, Progress, SearchReport, SearchStep, Settings, Speculative,
    StopReason, Variable, minimise,
};
use std::sync::atomic::AtomicBool;

/// The quantity that a search variable moves.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Moves {
    /// A lag of y, by its index.
    State(usize),
    /// A lag of a product, by its index.
    Product(usize),
    /// A fixed input delay, by its index.
    Input(usize),
    /// A shift of a whole delay law, samples.
    Later,
}

/// The free-run error as a function of lags and delays; coefficients are refitted at each point.
struct Delays<'a> {
    model: &'a Model,
    learning: Vec<&'a Record>,
    options: FitOptions,
    variables: Vec<Variable>,
    moves: Vec<Moves>,
}

/// The result of the search.
#[derive(Clone, Debug)]
pub(super) struct Settled {
    /// The refitted model with the best delays, or the unchanged model if none are better.
    pub(super) judged: Judged,
    /// Evaluations of the objective.
    pub(super) evaluations: usize,
    /// Why the search ended.
    pub(super) stop: StopReason,
}

/// Moves lags (all but the newest) and delays of `judged` to the least free-run error on the estimation
/// records. The move is kept if the validation error does not rise.
pub(super) fn settled(
    judge: &Judge,
    judged: Judged,
    settings: &Settings,
    progress: &dyn Progress,
    interrupt: &AtomicBool,
) -> Settled {
    let model = judged.model().clone();
    let mut problem = Delays::of(judge, &model);
    let start = problem.point();
    let budget = settings.evaluations.min(RULES.settling);
    let settings = Settings {
        evaluations: budget,
        initial_frame: RULES.settling_frame,
        ..settings.clone()
    };
    let mut steps: Vec<Box<dyn SearchStep<Delays<'_>>>> = vec![Box::new(Speculative::default())];
    let SearchReport {
        best,
        evaluations,
        stop,
        ..
    } = minimise(
        &mut problem,
        std::slice::from_ref(&start),
        &mut steps,
        &settings,
        progress,
        interrupt,
    );
    let moved = best.filter(|best| best.point != start);
    let better = moved.and_then(|best| {
        let judged_anew = judge.refitted(&problem.at(&best.point)?).ok()?;
        let learned = |judged: &Judged| judged.fits[0].mean_square();
        let gains = learned(&judged_anew) < learned(&judged);
        (gains && judged_anew.rmse() <= judged.rmse()).then_some(judged_anew)
    });
    Settled {
        judged: better.unwrap_or(judged),
        evaluations,
        stop,
    }
}

impl<'a> Delays<'a> {
    fn of(judge: &'a Judge, model: &'a Model) -> Self {
        let learning = judge.learning(0);
        let shortest = learning.iter().map(|r| r.len()).min().unwrap_or(0);
        let longest = i64::try_from(shortest / 4)
            .unwrap_or(i64::MAX)
            .clamp(1, 20_000);
        let reach = |at: u16, least: i64| {
            let at = i64::from(at);
            let wide = (RULES.settling_reach * at as f64).ceil() as i64;
            let wide = wide.max(RULES.settling_least as i64);
            ((at - wide).max(least), (at + wide).min(longest.max(at)))
        };
        let (mut variables, mut moves) = (Vec::new(), Vec::new());
        let mut add = |name: String, (low, high): (i64, i64), what: Moves| {
            variables.push(Variable::integer(name, low, high));
            moves.push(what);
        };
        for (i, lag) in model
            .state_lags
            .iter()
            .enumerate()
            .filter(|(_, lag)| **lag > 1)
        {
            add(format!("state lag {i}"), reach(*lag, 2), Moves::State(i));
        }
        let has_products = model.c.iter().any(|c| *c != 0.0);
        for (i, lag) in model.product_lags.iter().enumerate() {
            if *lag > 1 && has_products {
                add(
                    format!("product lag {i}"),
                    reach(*lag, 2),
                    Moves::Product(i),
                );
            }
        }
        match &model.delay {
            Delay::Fixed { delays } => {
                for (i, delay) in delays.iter().enumerate() {
                    add(format!("delay {i}"), reach(*delay, 0), Moves::Input(i));
                }
            }
            Delay::Law(_) => {
                let wide = RULES.settling_least as i64;
                add("delay".to_owned(), (-wide, wide), Moves::Later);
            }
        }
        Self {
            options: FitOptions {
                iterations: RULES.settling_iterations,
                ..judge.options_for(model)
            },
            model,
            learning,
            variables,
            moves,
        }
    }

    /// The point of the present model.
    fn point(&self) -> Point {
        let of = |what: &Moves| match (what, &self.model.delay) {
            (Moves::State(i), _) => i64::from(self.model.state_lags[*i]),
            (Moves::Product(i), _) => i64::from(self.model.product_lags[*i]),
            (Moves::Input(i), Delay::Fixed { delays }) => i64::from(delays[*i]),
            (Moves::Input(_) | Moves::Later, _) => 0,
        };
        self.moves.iter().map(of).collect()
    }

    /// The model with its lags and delays at a point; `None` if two lags or two delays coincide.
    fn at(&self, point: &[i64]) -> Option<Model> {
        let mut model = self.model.clone();
        for (what, at) in self.moves.iter().zip(point) {
            let samples = u16::try_from(*at).unwrap_or(0);
            match (what, &mut model.delay) {
                (Moves::State(i), _) => model.state_lags[*i] = samples,
                (Moves::Product(i), _) => model.product_lags[*i] = samples,
                (Moves::Input(i), Delay::Fixed { delays }) => delays[*i] = samples,
                (Moves::Input(_), Delay::Law(_)) => {}
                (Moves::Later, _) => model.delay_later(*at as f64),
            }
        }
        let distinct = |lags: &[u16]| {
            let mut sorted = lags.to_vec();
            sorted.sort_unstable();
            sorted.windows(2).all(|pair| pair[0] != pair[1])
        };
        let inputs = match &model.delay {
            Delay::Fixed { delays } => distinct(delays),
            Delay::Law(_) => true,
        };
        (inputs && distinct(&model.state_lags) && distinct(&model.product_lags)).then_some(model)
    }
}

impl Problem for Delays<'_> {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn evaluate(&self, point: &Point, _give_up_at: f64) -> Evaluation {
        let fitted = self
            .at(point)
            .and_then(|model| fit(&model, &self.learning, &self.options).ok());
        Evaluation::Value(fitted.map_or(f64::INFINITY, |fit| fit.sum_of_squares.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use crate::terms::Bench;

    /// A record of y_{k+1} = 0.9 y_k + 0.06 y_{k−30} + 0.05 u_{k−23}.
    fn record(name: &str, role: Use, period: usize) -> Record {
        let n = 2500;
        let u: Vec<f64> = (0..n)
            .map(|k| f64::from(u8::from((k / period) % 2 == 1)))
            .collect();
        let mut y = vec![0.0; n];
        for k in 0..n - 1 {
            let at = |series: &[f64], lag: usize| k.checked_sub(lag).map_or(0.0, |k| series[k]);
            y[k + 1] = 0.9 * y[k] + 0.06 * at(&y, 30) + 0.05 * at(&u, 23);
        }
        Record::new(name, role, 0.001, u, y)
    }

    #[test]
    fn delays_go_where_the_free_run_errs_least() {
        let records = [
            record("a", Use::Identify, 150),
            record("b", Use::Validate, 210),
        ];
        let model = Model {
            state_lags: vec![1, 36],
            a: vec![0.9, 0.06],
            b: vec![0.05],
            c: vec![0.0],
            delay: Delay::Fixed { delays: vec![19] },
            ..Model::default()
        };
        let bench = Bench::of(&model, &records).expect("records");
        let judged = bench.judge.refitted(&bench.given).expect("stable");
        let before = judged.rmse();
        let settings = Settings::default();
        let found = settled(
            &bench.judge,
            judged,
            &settings,
            &(),
            &AtomicBool::new(false),
        );
        assert_eq!(found.stop, StopReason::LocallyOptimal);
        assert!(found.evaluations > 5);
        let end = found.judged.model();
        assert_eq!(end.delay, Delay::Fixed { delays: vec![23] });
        assert!(
            found.judged.rmse() < 0.2 * before,
            "{before} {}",
            found.judged.rmse()
        );
    }
}
