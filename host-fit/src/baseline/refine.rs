//! Damped Gauss–Newton refinement of time constants and dead time on the free-run error, with level, gain and
//! initial states eliminated.

use super::projection::{Projection, project};
use super::response::{Response, Shape};
use super::series::Series;
use super::starts::Start;
use crate::order;
use numerics::linalg::{dot, solve_symmetric};

/// Largest number of Gauss–Newton steps.
const STEPS: usize = 20;
/// The iteration ends after a step that lowers the cost by less than this share.
const CONVERGED: f64 = 1e-7;
/// Change of a logarithm for a difference quotient.
const NUDGE: f64 = 1e-5;
/// Change of the dead time for a difference quotient, samples.
const DEAD_TIME_NUDGE: f64 = 1e-4;

/// A process fitted to records, in samples and scaled units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fitted {
    pub(super) at: Start,
    pub(super) projection: Projection,
}

/// Records to fit, and bounds of the process.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refiner<'a> {
    pub(super) series: &'a [Series],
    pub(super) longest_dead_time: f64,
    /// Largest time constant, samples.
    pub(super) slowest: f64,
}

/// Logarithms of the shape's parameters, then the dead time.
fn point(start: Start) -> Vec<f64> {
    match start.shape {
        Shape::First { time_constant } => vec![time_constant.ln(), start.dead_time],
        Shape::Second { frequency, damping } => {
            vec![frequency.ln(), damping.ln(), start.dead_time]
        }
    }
}

impl Refiner<'_> {
    fn start(&self, point: &[f64]) -> Start {
        let bounded = |log: f64, low: f64, high: f64| log.clamp(low.ln(), high.ln()).exp();
        let (shape, dead_time) = match *point {
            [time, dead] => {
                let time_constant = bounded(time, 0.05, self.slowest);
                (Shape::First { time_constant }, dead)
            }
            [frequency, damping, dead] => {
                let frequency = bounded(frequency, 1.0 / self.slowest, 20.0);
                let damping = bounded(damping, 0.005, 1e4);
                (Shape::Second { frequency, damping }, dead)
            }
            _ => (Shape::First { time_constant: 1.0 }, 0.0),
        };
        Start {
            shape,
            dead_time: dead_time.clamp(0.0, self.longest_dead_time),
        }
    }

    /// The best level and gain of a process.
    pub(super) fn judge(&self, at: Start) -> Fitted {
        let response = Response::new(at.shape, at.dead_time);
        Fitted {
            at,
            projection: project(&response, self.series, None),
        }
    }

    fn errors(&self, point: &[f64], into: &mut Vec<f64>) {
        let at = self.start(point);
        let response = Response::new(at.shape, at.dead_time);
        project(&response, self.series, Some(into));
    }

    /// At most `steps` damped Gauss–Newton steps from `start`.
    pub(super) fn descend(&self, start: Start, steps: usize) -> Fitted {
        let mut best = self.judge(self.start(&point(start)));
        let mut damping = 1e-3;
        let (mut errors, mut nudged) = (Vec::new(), Vec::new());
        for _ in 0..steps {
            let here = point(best.at);
            self.errors(&here, &mut errors);
            let mut slopes: Vec<Vec<f64>> = Vec::new();
            for i in 0..here.len() {
                let last = i + 1 == here.len();
                let nudge = if last { DEAD_TIME_NUDGE } else { NUDGE };
                let mut there = here.clone();
                if let Some(value) = there.get_mut(i) {
                    *value += nudge;
                }
                self.errors(&there, &mut nudged);
                let slope = nudged.iter().zip(&errors);
                slopes.push(slope.map(|(there, here)| (there - here) / nudge).collect());
            }
            let before = best.projection.cost;
            if !self.step(&here, &errors, &slopes, &mut damping, &mut best) {
                break;
            }
            if before - best.projection.cost <= CONVERGED * before {
                break;
            }
        }
        best
    }

    /// One step that lowers the cost; false if no such step exists.
    fn step(
        &self,
        here: &[f64],
        errors: &[f64],
        slopes: &[Vec<f64>],
        damping: &mut f64,
        best: &mut Fitted,
    ) -> bool {
        let n = here.len();
        let products = |a: &Vec<f64>| slopes.iter().map(|b| dot(a, b)).collect::<Vec<f64>>();
        let curvature: Vec<f64> = slopes.iter().flat_map(products).collect();
        let pull: Vec<f64> = slopes.iter().map(|slope| -dot(slope, errors)).collect();
        let largest = (0..n).filter_map(|i| curvature.get(i * n + i));
        let largest = largest.fold(0.0, |most: f64, value| most.max(*value));
        for _ in 0..6 {
            let mut damped = curvature.clone();
            for i in 0..n {
                if let Some(value) = damped.get_mut(i * n + i) {
                    *value += *damping * *value + 1e-12 * largest;
                }
            }
            if let Some(mut change) = solve_symmetric(&damped, &pull) {
                let dead = here.last().copied().unwrap_or(0.0);
                let last = change.len().saturating_sub(1);
                for (i, value) in change.iter_mut().enumerate() {
                    let most = if i == last { 2.0 + 0.3 * dead } else { 1.0 };
                    *value = value.clamp(-most, most);
                }
                let there: Vec<f64> = here.iter().zip(&change).map(|(a, b)| a + b).collect();
                let next = self.judge(self.start(&there));
                if next.projection.cost < best.projection.cost {
                    *best = next;
                    *damping = (*damping / 5.0).max(1e-9);
                    return true;
                }
            }
            *damping *= 8.0;
        }
        *damping = 1e-2;
        false
    }

    /// The best of several descents. The cost has kinks where the dead time passes a sample, at which a
    /// descent may stop too early: neighbouring dead times are tried as new starts.
    pub(super) fn best(&self, starts: &[Start], descents: usize) -> Option<Fitted> {
        let by_cost = |a: &Fitted, b: &Fitted| a.projection.cost.total_cmp(&b.projection.cost);
        let mut judged: Vec<Fitted> = starts.iter().map(|start| self.judge(*start)).collect();
        judged.retain(|fitted| fitted.projection.cost.is_finite());
        order::ascending(&mut judged, |fitted| fitted.projection.cost);
        let some = judged.into_iter().take(descents);
        let mut best = some
            .map(|fitted| self.descend(fitted.at, STEPS))
            .min_by(by_cost)?;
        for _ in 0..3 {
            let before = best.projection.cost;
            for change in [4.0, 1.0, 0.5, 0.2] {
                for sign in [-1.0, 1.0] {
                    let dead_time = best.at.dead_time + sign * change;
                    if (0.0..=self.longest_dead_time).contains(&dead_time) {
                        let near = Start {
                            dead_time,
                            ..best.at
                        };
                        let next = self.descend(near, 1);
                        if next.projection.cost < best.projection.cost {
                            best = next;
                        }
                    }
                }
            }
            if before - best.projection.cost <= 1e-5 * before {
                break;
            }
            best = self.descend(best.at, STEPS);
        }
        Some(best)
    }
}
