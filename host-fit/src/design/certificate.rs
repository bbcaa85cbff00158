//! Ultimate bound of the closed loop on its model, for a positive model with one constant delay.
//!
//! With an exact model the predictor knows the flow x_n at the arrival of each command, so that in arrival time
//! the loop has no delay: y_{n+1} = f_v(x_n), v = 0 or 1, with
//!
//! f_0(x) = d + Σ a_i y_{n−τ_i}, f_1(x) = d + b + Σ (a_i + c_i) y_{n−τ_i}.
//!
//! If all weights are at least 0 and their sums below 1, both maps are monotone, and every y ends between the two
//! steady levels. Let L and H be the limits inferior and superior of y. The law stays open only while its prediction
//! F_0 ≤ y*, and opens only at F_1 < y*. Both are monotone, so with the memory at L they bound the newest sample at the
//! decision from above. From there f_1 acts for at most the shortest on time, with the memory at H. A closed valve
//! never raises y above (d + Σ_{i>0} a_i H)/(1 − a_0). The largest of these is a new bound of H; the mirrored statement
//! bounds L. Iteration from the steady levels gives a decreasing sequence of intervals, each of which is valid.
//!
//! Max-type functionals of positive delay systems: H. R. Feyzmahdavian, T. Charalambous, M. Johansson, IEEE TAC
//! 59(6):1594, 2014. Theory 3.4.

use crate::model::{Added, Delay, Model, Track};
use model_core::effect::Place;
use model_core::recursion::Grading;
use serde::Serialize;

/// Ultimate bound: the interval in which y ends when the law controls its model. Serialises to `certificate` of
/// `design --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Certificate {
    /// The bound, valid from any start.
    Bound(Bound),
    /// The model has no bound.
    None {
        /// The condition that fails.
        reason: String,
    },
}

/// An interval around the target, y.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// Largest distance below the target after the transient.
    pub below: f64,
    /// Largest distance above the target after the transient.
    pub above: f64,
    /// Prediction error for which the distances are stated a second time: 1 % of the reachable interval.
    pub error: f64,
    /// Largest distance below the target if the prediction is wrong by up to `error`.
    pub below_with_error: f64,
    /// Largest distance above the target if the prediction is wrong by up to `error`.
    pub above_with_error: f64,
}

impl Certificate {
    /// The certificate with levels multiplied by `y`.
    pub(crate) fn scaled(self, y: f64) -> Self {
        match self {
            Self::Bound(bound) => Self::Bound(Bound {
                below: bound.below * y,
                above: bound.above * y,
                error: bound.error * y,
                below_with_error: bound.below_with_error * y,
                above_with_error: bound.above_with_error * y,
            }),
            none @ Self::None { .. } => none,
        }
    }
}

/// The prediction error with which the bound is stated a second time, as a share of the reachable interval.
const ERROR: f64 = 0.01;
/// The iteration ends when the interval shrinks by less than this share. Each step is a valid bound.
const SHRINKS: f64 = 1e-6;
/// Largest number of steps of the iteration.
const MOST: usize = 2000;

/// The certificate of `law` on `model`.
#[must_use]
pub fn certificate(model: &Model, law: &Track) -> Certificate {
    let none = |reason: &str| Certificate::None {
        reason: reason.to_owned(),
    };
    let positive = match Positive::of(model, law) {
        Ok(positive) => positive,
        Err(reason) => return none(reason),
    };
    let target = law.reference;
    let levels = positive.levels();
    if !(levels[0] < target && target < levels[1]) {
        return none("the target is not between the steady levels of the model");
    }
    let error = ERROR * (levels[1] - levels[0]);
    let (exact, wide) = (positive.ends(target, 0.0), positive.ends(target, error));
    // A bound that is the steady level itself says nothing about the law.
    if exact[0] <= levels[0] || exact[1] >= levels[1] {
        return none("the bound of this model is the whole reachable interval");
    }
    Certificate::Bound(Bound {
        below: target - exact[0],
        above: exact[1] - target,
        error,
        below_with_error: target - wide[0],
        above_with_error: wide[1] - target,
    })
}

/// The recursion with the valve in one position: constant and weights by lag behind the newest sample.
#[derive(Clone, Debug)]
struct Map {
    constant: f64,
    weights: Vec<f64>,
}

impl Map {
    fn older(&self) -> f64 {
        self.weights.iter().skip(1).sum()
    }

    fn newest(&self) -> f64 {
        self.weights.first().copied().unwrap_or(0.0)
    }

    fn level(&self) -> f64 {
        self.constant / (1.0 - self.newest() - self.older())
    }

    fn mirrored(&self) -> Self {
        Self {
            constant: -self.constant,
            weights: self.weights.clone(),
        }
    }
}

/// A trajectory from a constant past.
struct Path {
    memory: f64,
    /// The newest sample first.
    samples: std::collections::VecDeque<f64>,
}

impl Path {
    fn new(newest: f64, memory: f64) -> Self {
        Self {
            memory,
            samples: [newest].into(),
        }
    }

    fn step(&mut self, map: &Map) -> f64 {
        let weighted = map.weights.iter().enumerate();
        let sum: f64 = weighted
            .filter(|(_, weight)| **weight != 0.0)
            .map(|(lag, weight)| weight * self.samples.get(lag).copied().unwrap_or(self.memory))
            .sum();
        let next = map.constant + sum;
        self.samples.push_front(next);
        self.samples.truncate(map.weights.len().max(1));
        next
    }
}

/// A positive model in arrival time with its law.
#[derive(Clone, Debug)]
struct Positive {
    off: Map,
    on: Map,
    /// Shortest times open and closed, samples.
    hold: [usize; 2],
    /// Samples after the arrival at which the law predicts y, with the valve open and closed; it uses the mean of two
    /// predictions.
    looks: [[usize; 2]; 2],
    /// Whether an edge may arrive between two samples, so that its first sample is a mixture.
    mixes: bool,
}

impl Positive {
    fn of(model: &Model, law: &Track) -> Result<Self, &'static str> {
        let [drive] = model.b.as_slice() else {
            return Err("the model has more than one input delay");
        };
        let mixes = match &model.delay {
            Delay::Fixed { .. } => false,
            delay @ Delay::Law(_) if delay.follows_y() => {
                return Err("the delay is not constant");
            }
            Delay::Law(_) => true,
        };
        if mixes && model.grading != Grading::Proportional {
            return Err(
                "the delay is not a whole number of samples, and the jet response is not proportional",
            );
        }
        let is_sensor = |added: &Added| {
            let spec = model.spec(&added.name);
            spec.is_some_and(|spec| spec.place == Place::Sensor)
        };
        if !model.effects.iter().all(is_sensor) {
            return Err("the model has an effect at the jets or in the flow");
        }
        if law.switches.is_some() || law.air.is_some() {
            return Err("the law has a budget of switches or air");
        }
        let behind = |lag: &u16| model.convention.behind_newest(*lag);
        let lags = model.state_lags.iter().chain(&model.product_lags);
        let memory = 1 + lags.map(behind).max().unwrap_or(0);
        let mut off = Map {
            constant: model.constant,
            weights: vec![0.0; memory],
        };
        let add = |map: &mut Map, lags: &[u16], values: &[f64]| {
            for (lag, value) in lags.iter().zip(values) {
                if let Some(weight) = map.weights.get_mut(behind(lag)) {
                    *weight += value;
                }
            }
        };
        add(&mut off, &model.state_lags, &model.a);
        let mut on = off.clone();
        on.constant += drive;
        add(&mut on, &model.product_lags, &model.c);
        for map in [&off, &on] {
            if map.weights.iter().any(|weight| *weight < 0.0) {
                return Err(
                    "a past sample has a negative coefficient, so the model is not monotone",
                );
            }
            if map.newest() <= 0.0 {
                return Err("the newest sample has no positive weight");
            }
            if map.newest() + map.older() >= 1.0 {
                return Err("the model has no stable steady level");
            }
        }
        let anticipation = law.anticipation();
        let looks = |valve: u16, halves: u32| {
            let (valve, halves) = (usize::from(valve), halves as usize);
            [valve + halves / 2, valve + halves.div_ceil(2)]
        };
        Ok(Self {
            off,
            on,
            hold: [law.hold.of(true), law.hold.of(false)].map(|hold| hold as usize),
            looks: [
                looks(law.opening, anticipation.on),
                looks(law.closing, anticipation.off),
            ],
            mixes,
        })
    }

    /// Steady levels with the valve closed and open.
    fn levels(&self) -> [f64; 2] {
        [self.off.level(), self.on.level()]
    }

    /// The loop for −y: opening becomes closing.
    fn mirrored(&self) -> Self {
        let [open, closed] = self.hold;
        let [looks_open, looks_closed] = self.looks;
        Self {
            off: self.on.mirrored(),
            on: self.off.mirrored(),
            hold: [closed, open],
            looks: [looks_closed, looks_open],
            mixes: self.mixes,
        }
    }

    /// The interval in which y ends, for a prediction in error by up to `error`.
    fn ends(&self, target: f64, error: f64) -> [f64; 2] {
        let mirrored = self.mirrored();
        let [mut low, mut high] = self.levels();
        for _ in 0..MOST {
            let above = self.above(target + error, [low, high]);
            let below = -mirrored.above(-target + error, [-high, -low]);
            let (lower, upper) = (low.max(below), high.min(above));
            let shrunk = (high - low) - (upper - lower);
            (low, high) = (lower, upper);
            if shrunk <= SHRINKS * (high - low) {
                break;
            }
        }
        [low, high]
    }

    /// Upper bound of the limit superior of y, given an interval that contains its limit inferior
    /// and its limit superior.
    fn above(&self, target: f64, [low, high]: [f64; 2]) -> f64 {
        let [open, closed] = self.looks;
        let mixed = usize::from(self.mixes);
        // With a closed valve, y_{n+1} is at most the larger of y_n and `closing`.
        let closing = (self.off.constant + self.off.older() * high) / (1.0 - self.off.newest());
        // If the open valve may close but stays open, the prediction with the closed valve is at most the
        // target.
        let stays = newest_at(&self.off, &self.off, closed, target, low);
        // If the valve opens, the prediction with the open valve is below the target. The first sample of this
        // prediction may still have the closed valve.
        let first = if self.mixes { &self.off } else { &self.on };
        let opens = newest_at(first, &self.on, open, target, low);
        let [shortest, _] = self.hold;
        [(stays, 1 + mixed), (opens, shortest + mixed)]
            .into_iter()
            .map(|(newest, samples)| {
                let mut path = Path::new(newest.min(high), high);
                (0..samples)
                    .map(|_| path.step(&self.on))
                    .fold(f64::NEG_INFINITY, f64::max)
            })
            .fold(closing, f64::max)
    }
}

/// The newest sample for which the prediction equals `target`, while all older samples are `memory`. The prediction
/// uses `first` for one sample and then `map`, and is the mean of the samples at `looks`. It is affine in the newest
/// sample.
fn newest_at(first: &Map, map: &Map, looks: [usize; 2], target: f64, memory: f64) -> f64 {
    let foreseen = |newest: f64| {
        let mut path = Path::new(newest, memory);
        let mut at = vec![newest];
        for step in 0..looks[1] {
            at.push(path.step(if step == 0 { first } else { map }));
        }
        looks.iter().filter_map(|look| at.get(*look)).sum::<f64>() / 2.0
    };
    let (origin, slope) = (foreseen(0.0), foreseen(1.0) - foreseen(0.0));
    (target - origin) / slope
}

#[cfg(test)]
mod tests {
    use super::super::proof::run_law;
    use super::super::tracking::tests::paper_state_dependent;
    use super::super::tracking::{TrackRequest, track};
    use super::*;
    use closed_loop::Controlled;
    use model_core::recursion::LagConvention;
    use std::collections::VecDeque;

    /// A flow in closed form: it relaxes to 1.1 with 90 ms under blowing and to 0.1 with 140 ms without, after a
    /// dead time. It shares nothing with the model.
    #[derive(Clone)]
    struct Flow {
        y: f64,
        /// Factor of the two levels.
        gain: f64,
        line: VecDeque<bool>,
    }

    const ATTACHES_S: f64 = 0.09;
    const SEPARATES_S: f64 = 0.14;
    const LEVELS: [f64; 2] = [0.1, 1.1];

    impl Flow {
        fn new(y: f64, dead_time: usize) -> Self {
            Self {
                y,
                gain: 1.0,
                line: std::iter::repeat_n(false, dead_time).collect(),
            }
        }
    }

    impl Controlled for Flow {
        fn sample_period_s(&self) -> f64 {
            0.001
        }
        fn step(&mut self, command: bool) -> Option<f64> {
            self.line.push_back(command);
            let (level, time_s) = match self.line.pop_front() {
                Some(true) => (LEVELS[1], ATTACHES_S),
                _ => (LEVELS[0], SEPARATES_S),
            };
            let level = self.gain * level;
            self.y = level + (self.y - level) * (-0.001 / time_s).exp();
            Some(self.y)
        }
        fn friction(&self) -> f64 {
            self.y
        }
    }

    const DEAD_TIME: u16 = 40;

    /// The model of the flow in closed form.
    fn model() -> Model {
        let [closed, open] = [SEPARATES_S, ATTACHES_S].map(|time_s| (-0.001_f64 / time_s).exp());
        let constant = LEVELS[0] * (1.0 - closed);
        Model {
            convention: LagConvention::OneStep,
            constant,
            state_lags: vec![1],
            a: vec![closed],
            product_lags: vec![1],
            b: vec![LEVELS[1] * (1.0 - open) - constant],
            c: vec![open - closed],
            delay: Delay::Fixed {
                delays: vec![DEAD_TIME],
            },
            ..Model::default()
        }
    }

    fn law(model: &Model, target: f64, [on, off]: [f64; 2]) -> Track {
        let request = TrackRequest {
            min_on_s: on,
            min_off_s: off,
            ..TrackRequest::holding(target)
        };
        // The law has no corrections, because the bound assumes an exact prediction.
        Track {
            integral_rate: 0.0,
            bias_rate: 0.0,
            ..track(model, &request).unwrap().law
        }
    }

    /// Lowest and highest y after the transient.
    fn range(model: &Model, law: &Track, mut flow: Flow) -> [f64; 2] {
        let trace = run_law(
            model,
            law,
            &mut flow,
            std::iter::repeat_n(law.reference, 8000),
        );
        let late = trace
            .samples
            .iter()
            .skip(4000)
            .map(|sample| sample.friction);
        late.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], y| {
            [low.min(y), high.max(y)]
        })
    }

    fn bound(model: &Model, law: &Track) -> Bound {
        match certificate(model, law) {
            Certificate::Bound(bound) => bound,
            Certificate::None { reason } => panic!("{reason}"),
        }
    }

    #[test]
    fn a_flow_in_closed_form_stays_within_the_bound_and_comes_close_to_it() {
        let model = model();
        let mut none = 0;
        for target in [0.25, 0.5, 0.8, 1.0] {
            for hold in [
                [0.001, 0.001],
                [0.010, 0.010],
                [0.011, 0.030],
                [0.040, 0.005],
            ] {
                let law = law(&model, target, hold);
                // At a target of 0.25, an opening of 40 ms from the level without blowing overshoots the target, so
                // the valve stays closed.
                let Certificate::Bound(bound) = certificate(&model, &law) else {
                    none += 1;
                    continue;
                };
                let place = format!("{target} {hold:?} {bound:?}");
                for start in [0.1, 0.6, 1.1] {
                    let [low, high] = range(&model, &law, Flow::new(start, DEAD_TIME.into()));
                    // f32 of the law.
                    let digits = 1e-5;
                    assert!(target - low <= bound.below + digits, "{place}: {low}");
                    assert!(high - target <= bound.above + digits, "{place}: {high}");
                    let share = (high - low) / (bound.below + bound.above);
                    // With hold times of one sample the worst cases of the bound cannot occur one after the
                    // other, so the bound is less tight.
                    let least = if hold[0] > 0.001 { 0.4 } else { 0.15 };
                    assert!(share > least, "{place}: {share}");
                }
                assert!(bound.above_with_error > bound.above && bound.error > 0.0);
            }
        }
        assert!(none <= 2, "{none} of 16 without a bound");
    }

    /// The bound holds only for the model. Without corrections, a flow with other levels leaves it.
    #[test]
    fn another_flow_is_outside_the_certificate() {
        let model = model();
        let law = Track {
            observer: 0.0,
            ..law(&model, 0.6, [0.005, 0.005])
        };
        let bound = bound(&model, &law);
        let [low, high] = range(
            &model,
            &law,
            Flow {
                gain: 1.2,
                ..Flow::new(0.1, DEAD_TIME.into())
            },
        );
        assert!(0.6 - low > bound.below || high - 0.6 > bound.above);
    }

    #[test]
    fn positive_models_with_memory_have_one_that_holds() {
        let mut held = 0;
        for k in 0..40_u32 {
            let share = |n: u32| f64::from(k.wrapping_mul(7 + 6 * n) % 11) / 11.0;
            let memory = 0.01 + 0.02 * share(0);
            let model = Model {
                state_lags: vec![1, 20 + 3 * (k as u16)],
                a: vec![0.98 - memory - 0.01 * share(1), memory],
                product_lags: vec![1],
                c: vec![-0.02 * share(2)],
                b: vec![0.02 + 0.02 * share(3)],
                constant: 0.0,
                ..self::model()
            };
            let any = law(&self::model(), 0.5, [0.01; 2]);
            let levels = Positive::of(&model, &any).unwrap().levels();
            let target = levels[0] + (0.3 + 0.4 * share(4)) * (levels[1] - levels[0]);
            let law = law(&model, target, [0.008, 0.012]);
            let Certificate::Bound(bound) = certificate(&model, &law) else {
                continue;
            };
            held += 1;
            let bench = super::super::bench::Player::<f64>::of(&model);
            let mut flow = closed_loop::ModelFlow::new(
                &bench.prepared,
                bench.at_rest(),
                bench.channels.clone(),
                bench.period_s,
            );
            let trace = run_law(&model, &law, &mut flow, std::iter::repeat_n(target, 12_000));
            for sample in trace.samples.iter().skip(8000) {
                let off = sample.friction - target;
                assert!(
                    -bound.below - 1e-5 <= off && off <= bound.above + 1e-5,
                    "{k}: {off} {bound:?}"
                );
            }
        }
        assert!(held >= 20, "{held}");
    }

    #[test]
    fn the_papers_models_have_none_and_the_reason_is_given() {
        let reason = |model: &Model, target: f64| {
            let design = track(model, &TrackRequest::holding(target)).unwrap();
            match certificate(model, &design.law) {
                Certificate::None { reason } => reason,
                Certificate::Bound(bound) => panic!("{bound:?}"),
            }
        };
        let state_dependent = paper_state_dependent(LagConvention::OneStep);
        assert!(reason(&state_dependent, 0.8).contains("delay"));
        let fixed = Model {
            delay: Delay::Fixed { delays: vec![49] },
            ..state_dependent
        };
        assert!(reason(&fixed, 0.8).contains("negative"));
        let thrifty = Track {
            air: Some([900, 1000]),
            ..law(&model(), 0.5, [0.01; 2])
        };
        assert!(matches!(
            certificate(&model(), &thrifty),
            Certificate::None { .. }
        ));
    }
}
