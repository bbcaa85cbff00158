//! The best level and gain for a given response: linear least squares (variable projection).

use super::initial::{InitialState, inner};
use super::response::Response;
use super::series::Series;
use numerics::linalg::{Cholesky, dot};

/// Sums of products of the columns 1, x and y.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gram {
    one_one: f64,
    one_x: f64,
    x_x: f64,
    one_y: f64,
    x_y: f64,
    y_y: f64,
}

/// Level and gain with the remaining cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Projection {
    /// Sum of squared errors.
    pub(super) cost: f64,
    pub(super) level: f64,
    pub(super) gain: f64,
}

/// The columns 1 and y of an interval after projection on the orthogonal complement of the free responses.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    initial: InitialState,
    one: Vec<f64>,
    y: Vec<f64>,
    one_one: f64,
    one_y: f64,
    y_y: f64,
}

impl Stretch {
    /// The projected columns for the scored samples `y` of a process.
    pub(super) fn new(response: &Response, y: &[f64]) -> Self {
        let free = response.free(y.len());
        let initial = InitialState::new(free, y.len(), response.fastest());
        let (mut one, mut y) = (vec![1.0; y.len()], y.to_vec());
        initial.remove_from(&mut one);
        initial.remove_from(&mut y);
        Self {
            one_one: dot(&one, &one),
            one_y: dot(&one, &y),
            y_y: dot(&y, &y),
            initial,
            one,
            y,
        }
    }

    /// The sums with the response `x`, from which its initial state is removed.
    pub(super) fn gram(&self, x: &mut [f64]) -> Gram {
        self.initial.remove_from(x);
        Gram {
            one_one: self.one_one,
            one_x: inner(&self.one, x),
            x_x: dot(x, x),
            one_y: self.one_y,
            x_y: inner(x, &self.y),
            y_y: self.y_y,
        }
    }
}

impl Gram {
    pub(super) fn add(&mut self, other: &Self) {
        self.one_one += other.one_one;
        self.one_x += other.one_x;
        self.x_x += other.x_x;
        self.one_y += other.one_y;
        self.x_y += other.x_y;
        self.y_y += other.y_y;
    }

    /// Least squares over level and gain.
    pub(super) fn solve(&self) -> Projection {
        let factor = Cholesky::new(&[self.one_one, self.one_x, self.one_x, self.x_x], 2);
        let forward = factor.forward(&[self.one_y, self.x_y]);
        let explained = dot(&forward, &forward);
        let solution = factor.backward(forward);
        let at = |i: usize| solution.get(i).copied().unwrap_or(0.0);
        Projection {
            cost: (self.y_y - explained).max(0.0),
            level: at(0),
            gain: at(1),
        }
    }
}

/// Level and gain of a response over all of `series`, and the remaining errors if `errors` is given.
pub(super) fn project(
    response: &Response,
    series: &[Series],
    errors: Option<&mut Vec<f64>>,
) -> Projection {
    let mut all = Gram::default();
    let mut kept = Vec::new();
    for one in series {
        let mut x = response
            .forced(&one.u, one.before)
            .split_off(one.lead.min(one.len()));
        let stretch = Stretch::new(response, one.y.get(one.lead..).unwrap_or_default());
        all.add(&stretch.gram(&mut x));
        if errors.is_some() {
            kept.push((x, stretch));
        }
    }
    let found = all.solve();
    if let Some(errors) = errors {
        errors.clear();
        for (x, stretch) in &kept {
            let columns = stretch.y.iter().zip(&stretch.one).zip(x);
            errors.extend(columns.map(|((y, one), x)| y - found.level * one - found.gain * x));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::response::Shape;
    use super::*;

    /// Two records that begin anywhere: level and gain are exact at the right parameters, and the errors are zero.
    #[test]
    fn level_gain_and_initial_states_are_separated() {
        let response = Response::new(
            Shape::First {
                time_constant: 20.0,
            },
            4.5,
        );
        let stretch = |period: usize, start: f64| {
            let u: Vec<f64> = (0..400)
                .map(|k| f64::from(u8::from((k / period) % 2 == 1)))
                .collect();
            let free = response.free(400);
            let run = response.forced(&u, 0.0);
            let decay = |k: usize| free[0].get(k).copied().unwrap_or(0.0);
            let y = run.iter().enumerate();
            let y = y.map(|(k, x)| 0.7 - 1.3 * x + start * decay(k)).collect();
            Series {
                u,
                y,
                ..Series::default()
            }
        };
        let series = [stretch(60, 2.0), stretch(35, -5.0)];
        let mut errors = Vec::new();
        let found = project(&response, &series, Some(&mut errors));
        assert!((found.level - 0.7).abs() < 1e-9 && (found.gain + 1.3).abs() < 1e-9);
        assert!(found.cost < 1e-9 && errors.len() == 800);
        assert!(errors.iter().all(|error| error.abs() < 1e-7));
        let wrong = Response::new(
            Shape::First {
                time_constant: 15.0,
            },
            4.5,
        );
        let wrong = project(&wrong, &series, Some(&mut errors));
        let sum: f64 = errors.iter().map(|e| e * e).sum();
        assert!((wrong.cost / sum - 1.0).abs() < 1e-6 && sum > 1e-3);
    }
}
