//! The continuous-time forms (5)–(7) of the paper: a bilinear delay-differential equation, integrated.
//!
//! ```text
//! T·ẏ(t) = −y(t) + Σ a_i y(t − τ_i T) + Σ_l [ b_l + Σ_j c_jl y(t − τ̄_j T) ] u(t − h_l T)
//! ```
//!
//! with constant h_l (5) or h_l = f_l·(p0 + p1·exp(−p2·ỹ(t))) (6), ỹ the mean of y over the last W·T (7).
//!
//! **How it relates to the sampled models.** Explicit Euler with step T turns (5) into (3) term by term when
//! the delays are whole samples: the models identified from data *are* this equation sampled that
//! coarsely. The exact solution is another trajectory. Steady states agree exactly, and slow motion agrees to
//! first order in T over the time constant; but the leading term −y + a₁·y(t − T) relaxes within one
//! sample, far too fast for Euler at that step, so the modes near half the sampling rate (z ≈ −1 in
//! the literal reading of the lags) exist in (3) only. On Table II with fixed delay and on/off input the two
//! trajectories stay within 0.003 in y of each other (tested below); models whose steps the sampled
//! form barely damps may differ more. (4) also rounds its delay to whole samples, (6) does not.

use std::collections::VecDeque;

use thiserror::Error;

use crate::plant::Plant;

/// Why an equation cannot be integrated.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DdeError {
    /// A delay is negative or not a number.
    #[error("{what} is {value} samples; delays are 0 or positive")]
    BadDelay {
        /// Which delay.
        what: &'static str,
        /// Its value (samples).
        value: f64,
    },
    /// The step is longer than a delay, so the past it needs is not computed yet.
    #[error(
        "the lag of {lag} samples is shorter than a step of 1/{steps} sample; use more steps per sample"
    )]
    StepTooLong {
        /// The lag (samples).
        lag: f64,
        /// Steps per sample.
        steps: usize,
    },
    /// No steps.
    #[error("0 steps per sample cannot advance time; use at least 1")]
    NoSteps,
}

/// How long the input travels (in sample periods).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InputDelay {
    /// h.
    Fixed(f64),
    /// f·(p0 + p1·exp(−p2·ỹ)), ỹ the mean over `window` samples.
    StateDependent {
        /// f.
        factor: f64,
        /// (p0, p1, p2): samples, samples, 1/y.
        law: (f64, f64, f64),
        /// W (samples).
        window: f64,
    },
}

impl InputDelay {
    fn at(&self, mean: f64) -> f64 {
        match *self {
            Self::Fixed(h) => h,
            Self::StateDependent {
                factor,
                law: (p0, p1, p2),
                ..
            } => factor * (p0 + p1 * (-p2 * mean).exp()),
        }
    }

    fn longest(&self) -> f64 {
        // The mean friction of a separated flow may read a little below 0; the law is clamped there.
        self.at(0.0)
    }

    fn window(&self) -> f64 {
        match *self {
            Self::Fixed(_) => 0.0,
            Self::StateDependent { window, .. } => window,
        }
    }
}

/// One input path: delay, b, and c with its lags.
#[derive(Debug, Clone, PartialEq)]
pub struct InputPath {
    /// Travel time.
    pub delay: InputDelay,
    /// b.
    pub gain: f64,
    /// (τ̄ in samples, c).
    pub products: Vec<(f64, f64)>,
}

/// The right-hand side of (5) or (6).
#[derive(Debug, Clone, PartialEq)]
pub struct BilinearDde {
    /// (τ in samples, a).
    pub state: Vec<(f64, f64)>,
    /// The input paths.
    pub inputs: Vec<InputPath>,
}

/// How time is stepped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheme {
    /// Explicit Euler: with one step per sample, the sampled model.
    Euler,
    /// Classical Runge–Kutta of order 4 with a cubic through the remembered past.
    RungeKutta4,
}

#[derive(Debug, Clone, Copy)]
struct Past {
    y: f64,
    /// Slope just before and just after: they differ where the input jumps.
    slope_before: f64,
    slope_after: f64,
    /// ∫y dt since the start.
    integral: f64,
}

/// A running solution; time is counted in steps, so nothing drifts.
///
/// The jumps of the input enter through their exact mean over each step, wherever in the step they
/// arrive.
#[derive(Debug, Clone)]
pub struct DdeSolution {
    equation: BilinearDde,
    scheme: Scheme,
    steps: usize,
    past: VecDeque<Past>,
    /// ∫u dt (in samples) at each sample boundary, and the level of the running sample.
    input: VecDeque<f64>,
    samples: usize,
    /// Step within the running sample.
    phase: usize,
    /// Where in the input's past each path stopped reading (samples).
    read: Vec<f64>,
}

impl DdeSolution {
    /// Starts at y = 0 with a past of zeros, `steps` steps per sample period.
    ///
    /// # Errors
    /// [`DdeError`] naming the delay that does not fit.
    pub fn new(equation: BilinearDde, scheme: Scheme, steps: usize) -> Result<Self, DdeError> {
        if steps == 0 {
            return Err(DdeError::NoSteps);
        }
        let mut longest = 1.0_f64;
        let products = equation.inputs.iter().flat_map(|p| &p.products);
        for &(lag, _) in equation.state.iter().chain(products) {
            if !(lag >= 0.0 && lag.is_finite()) {
                return Err(DdeError::BadDelay {
                    what: "a lag of y",
                    value: lag,
                });
            }
            if lag > 0.0 && lag * (steps as f64) < 1.0 {
                return Err(DdeError::StepTooLong { lag, steps });
            }
            longest = longest.max(lag);
        }
        let mut travel = 1.0_f64;
        for path in &equation.inputs {
            let h = path.delay.longest();
            let window = path.delay.window();
            for (what, value) in [("an input delay", h), ("an averaging window", window)] {
                if !(value >= 0.0 && value.is_finite()) {
                    return Err(DdeError::BadDelay { what, value });
                }
            }
            travel = travel.max(h);
            longest = longest.max(window);
        }
        let rest = Past {
            y: 0.0,
            slope_before: 0.0,
            slope_after: 0.0,
            integral: 0.0,
        };
        let remembered = (longest.ceil() as usize + 1) * steps + 2;
        let read = equation.inputs.iter().map(|p| -p.delay.at(0.0)).collect();
        Ok(Self {
            equation,
            scheme,
            steps,
            past: VecDeque::from(vec![rest; remembered]),
            input: VecDeque::from(vec![0.0; travel.ceil() as usize + 3]),
            samples: 0,
            phase: 0,
            read,
        })
    }

    /// y now.
    pub fn output(&self) -> f64 {
        self.past.back().map_or(0.0, |p| p.y)
    }

    /// Holds the input at `level` for one sample period and returns y at its end.
    pub fn advance_sample(&mut self, level: f64) -> f64 {
        let before = self.input.back().copied().unwrap_or(0.0);
        self.input.pop_front();
        self.input.push_back(before + level);
        self.samples += 1;
        for phase in 0..self.steps {
            self.phase = phase;
            self.step();
        }
        self.output()
    }

    /// Plays one level per sample; the k-th value is y when the k-th level is set.
    pub fn play(&mut self, levels: &[f64]) -> Vec<f64> {
        levels
            .iter()
            .map(|u| {
                let y = self.output();
                self.advance_sample(*u);
                y
            })
            .collect()
    }

    /// ∫u dt up to time `t` (both in samples).
    fn input_integral(&self, t: f64) -> f64 {
        // The last entry belongs to time `samples`.
        let newest = self.input.len() as f64 - 1.0;
        let place = (t - self.samples as f64 + newest).clamp(0.0, newest);
        let i = place.floor() as usize;
        let get = |i: usize| self.input.get(i).copied().unwrap_or(0.0);
        let next = (i + 1).min(self.input.len() - 1);
        get(i) + (get(next) - get(i)) * (place - i as f64)
    }

    /// y `lag` samples before a point `ahead` steps past the newest known one, `now` being y there.
    fn past(&self, lag: f64, ahead: f64, now: f64) -> f64 {
        if lag == 0.0 {
            return now;
        }
        let newest = self.past.len() as f64 - 1.0;
        let place = (newest + ahead - lag * self.steps as f64).clamp(0.0, newest);
        let i = place.floor() as usize;
        let share = place - i as f64;
        match (self.past.get(i), self.past.get(i + 1)) {
            (Some(a), _) if share == 0.0 => a.y,
            (Some(a), Some(b)) => {
                let dt = 1.0 / self.steps as f64;
                let (s, s1) = (share, 1.0 - share);
                s1 * s1 * (1.0 + 2.0 * s) * a.y
                    + s * s * (3.0 - 2.0 * s) * b.y
                    + dt * s * s1 * (s1 * a.slope_after - s * b.slope_before)
            }
            (Some(a), None) => a.y,
            (None, _) => now,
        }
    }

    /// Mean of y over the last `window` samples and its slope per sample.
    fn mean(&self, window: f64) -> (f64, f64) {
        let back = (window * self.steps as f64).round() as usize;
        let old = self
            .past
            .len()
            .checked_sub(back + 1)
            .and_then(|i| self.past.get(i));
        match (old, self.past.back()) {
            (Some(old), Some(new)) if back > 0 => (
                (new.integral - old.integral) / window,
                (new.y - old.y) / window,
            ),
            _ => (0.0, 0.0),
        }
    }

    /// T·ẏ at `ahead` steps past the newest point, where y is `now` and the paths carry `inputs`.
    fn slope(&self, ahead: f64, now: f64, inputs: &[f64]) -> f64 {
        let lagged = |terms: &[(f64, f64)]| -> f64 {
            terms
                .iter()
                .map(|(lag, k)| k * self.past(*lag, ahead, now))
                .sum()
        };
        let driven: f64 = self
            .equation
            .inputs
            .iter()
            .zip(inputs)
            .map(|(path, u)| (path.gain + lagged(&path.products)) * u)
            .sum();
        lagged(&self.equation.state) + driven - now
    }

    /// Mean of each path's input over the coming step.
    fn arriving(&mut self) -> Vec<f64> {
        let dt = 1.0 / self.steps as f64;
        // `samples` has been counted up when the running sample began.
        let end = (self.samples - 1) as f64 + (self.phase + 1) as f64 * dt;
        let mut read = std::mem::take(&mut self.read);
        let inputs = self
            .equation
            .inputs
            .iter()
            .zip(&mut read)
            .map(|(path, from)| {
                let (mean, slope) = self.mean(path.delay.window());
                let to = end - path.delay.at((mean + slope * dt).max(0.0));
                let (a, b) = (from.min(to), from.max(to));
                *from = to;
                // A delay that grows as fast as time shows one instant for the whole step.
                let width = (b - a).max(1e-9);
                (self.input_integral(a + width) - self.input_integral(a)) / width
            })
            .collect();
        self.read = read;
        inputs
    }

    fn step(&mut self) {
        let dt = 1.0 / self.steps as f64;
        let u = self.arriving();
        let y = self.output();
        let k1 = self.slope(0.0, y, &u);
        let (next, area) = match self.scheme {
            Scheme::Euler => (y + dt * k1, dt * y),
            Scheme::RungeKutta4 => {
                let k2 = self.slope(0.5, y + 0.5 * dt * k1, &u);
                let k3 = self.slope(0.5, y + 0.5 * dt * k2, &u);
                let k4 = self.slope(1.0, y + dt * k3, &u);
                let next = y + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
                (next, 0.5 * dt * (y + next))
            }
        };
        if let Some(now) = self.past.back_mut() {
            now.slope_after = k1;
        }
        let integral = self.past.back().map_or(0.0, |p| p.integral) + area;
        let slope = self.slope(1.0, next, &u);
        self.past.pop_front();
        self.past.push_back(Past {
            y: next,
            slope_before: slope,
            slope_after: slope,
            integral,
        });
    }
}

impl Plant for DdeSolution {
    fn step(&mut self, command: bool) -> f64 {
        self.advance_sample(f64::from(u8::from(command)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table II, fixed delay.
    fn table_two_fixed() -> BilinearDde {
        let tau = [1.0, 48.0, 352.0, 371.0, 496.0];
        let a = [0.9744, 0.0171, -0.0028, 0.0040, 0.0009];
        let bar = [1., 66., 242., 249., 260., 276., 300., 409., 475., 491.];
        let c = [
            -0.0116, 0.0070, 0.0483, 0.0253, -0.0455, -0.0243, -0.0038, -0.0014, -0.0074, 0.0138,
        ];
        BilinearDde {
            state: tau.into_iter().zip(a).collect(),
            inputs: vec![InputPath {
                delay: InputDelay::Fixed(49.0),
                gain: 0.0063,
                products: bar.into_iter().zip(c).collect(),
            }],
        }
    }

    /// (3), literal reading, written as the sum it is.
    fn recursion(e: &BilinearDde, u: &[f64], h: usize) -> Vec<f64> {
        let mut y = vec![0.0];
        for k in 0..u.len() - 1 {
            let at = |x: &[f64], lag: usize| if lag > k { 0.0 } else { x[k - lag] };
            let sum = |terms: &[(f64, f64)]| -> f64 {
                terms.iter().map(|(lag, g)| g * at(&y, *lag as usize)).sum()
            };
            let next = sum(&e.state) + (e.inputs[0].gain + sum(&e.inputs[0].products)) * at(u, h);
            y.push(next);
        }
        y
    }

    fn switching(samples: usize) -> Vec<f64> {
        (0..samples)
            .map(|k| f64::from(u8::from(k < samples * 7 / 10 && (k / 125) % 3 != 2)))
            .collect()
    }

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        a.iter()
            .zip(b)
            .map(|(x, y)| (x - y).abs())
            .fold(0.0, f64::max)
    }

    fn play(e: &BilinearDde, scheme: Scheme, steps: usize, u: &[f64]) -> Vec<f64> {
        DdeSolution::new(e.clone(), scheme, steps).unwrap().play(u)
    }

    #[test]
    fn euler_with_the_sample_period_is_the_sampled_model() {
        let e = table_two_fixed();
        let u = switching(8000);
        let difference =
            largest_difference(&play(&e, Scheme::Euler, 1, &u), &recursion(&e, &u, 49));
        assert!(difference < 1e-12, "{difference}");
    }

    #[test]
    fn finer_steps_converge_to_a_trajectory_near_the_sampled_one() {
        let e = table_two_fixed();
        let u = switching(4000);
        let exact = play(&e, Scheme::RungeKutta4, 16, &u);
        let euler: Vec<f64> = [4, 8, 16]
            .iter()
            .map(|m| largest_difference(&play(&e, Scheme::Euler, *m, &u), &exact))
            .collect();
        // First order: halving the step halves the distance.
        assert!((euler[0] / euler[1] - 2.0).abs() < 0.2, "{euler:?}");
        assert!((euler[1] / euler[2] - 2.0).abs() < 0.1, "{euler:?}");
        let finer = play(&e, Scheme::RungeKutta4, 32, &u);
        let rest = largest_difference(&finer, &exact);
        assert!(rest < 1e-6, "{rest}");
        // The sampled model is near, not equal.
        let apart = largest_difference(&recursion(&e, &u, 49), &exact);
        assert!(apart > 1e-4 && apart < 0.03, "{apart}");
    }

    #[test]
    fn a_scalar_delay_equation_follows_its_solution_by_steps() {
        // ẏ = −y + 0.5·y(t − 1) + u, u on at 0: y = 1 − e^(−t) until t = 1.
        let e = BilinearDde {
            state: vec![(1.0, 0.5)],
            inputs: vec![InputPath {
                delay: InputDelay::Fixed(0.0),
                gain: 1.0,
                products: vec![],
            }],
        };
        let mut solution = DdeSolution::new(e, Scheme::RungeKutta4, 200).unwrap();
        let first = solution.advance_sample(1.0);
        assert!((first - (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
        // y(2): with s = t − 1, ẏ = −y + 1.5 − 0.5·e^(−s) gives y = 1.5 + (y(1) − 1.5)·e^(−s) − 0.5·s·e^(−s).
        let second = solution.advance_sample(1.0);
        let expected = 1.5 + (first - 1.5) * (-1.0_f64).exp() - 0.5 * (-1.0_f64).exp();
        assert!((second - expected).abs() < 1e-8);
        for _ in 0..100 {
            solution.advance_sample(1.0);
        }
        assert!(
            (solution.output() - 2.0).abs() < 1e-9,
            "steady state b/(1 − a)"
        );
    }

    #[test]
    fn the_state_dependent_delay_is_read_at_the_arrival_without_rounding() {
        let delay = InputDelay::StateDependent {
            factor: 1.0,
            law: (47.35, 12.69, 20.18),
            window: 250.0,
        };
        let e = BilinearDde {
            state: vec![(0.0, 0.97)],
            inputs: vec![InputPath {
                delay,
                gain: 0.03,
                products: vec![],
            }],
        };
        // T·ẏ = −0.03·(y − u): the edge of rest arrives at 60.04 samples.
        let u = vec![1.0; 4000];
        let y = play(&e, Scheme::RungeKutta4, 20, &u);
        assert_eq!(y[60], 0.0);
        let expected = 1.0 - (-0.03 * (61.0 - 60.04_f64)).exp();
        assert!((y[61] - expected).abs() < 2e-4, "{} {expected}", y[61]);
        assert!((y[3999] - 1.0).abs() < 1e-9);
    }

    #[test]
    fn delays_that_cannot_be_integrated_are_refused() {
        let mut e = table_two_fixed();
        e.state[0].0 = 0.25;
        assert!(matches!(
            DdeSolution::new(e.clone(), Scheme::Euler, 2),
            Err(DdeError::StepTooLong { .. })
        ));
        assert!(DdeSolution::new(e.clone(), Scheme::Euler, 4).is_ok());
        e.state[0].0 = -1.0;
        assert!(matches!(
            DdeSolution::new(e.clone(), Scheme::Euler, 4),
            Err(DdeError::BadDelay { .. })
        ));
        assert_eq!(
            DdeSolution::new(table_two_fixed(), Scheme::Euler, 0).unwrap_err(),
            DdeError::NoSteps
        );
    }
}
