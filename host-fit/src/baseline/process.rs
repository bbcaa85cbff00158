//! First and second order with dead time in the user's units.

use super::initial::InitialState;
use super::refine::{Fitted, Refiner};
use super::response::{Response, Shape};
use super::series::{Scaling, Series, command_before};
use super::starts::{Start, starts};
use crate::data::Record;
use crate::picture::readable_time;
use serde::Serialize;
use std::fmt;

/// Longest time constant, as a multiple of the longest record.
const SLOWEST: f64 = 30.0;
/// Starting points from which a descent is made.
const DESCENTS: usize = 3;

/// Time constants below this, in samples, are not visible in a sampled response.
const NO_TIME: f64 = 0.05;

/// T·y′ + y = level + gain·u(t − dead time).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FirstOrder {
    /// Static gain, y per unit of u.
    pub gain: f64,
    /// y in steady state at u = 0.
    pub level: f64,
    /// T, s.
    pub time_constant_s: f64,
    /// Dead time, s, ≥ 0, in addition to the one sample of a sampled command: 0 means that y_{k+1} depends on
    /// u_k.
    pub dead_time_s: f64,
}

/// y″/ω² + 2ζ·y′/ω + y = level + gain·u(t − dead time).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SecondOrder {
    /// Static gain, y per unit of u.
    pub gain: f64,
    /// y in steady state at u = 0.
    pub level: f64,
    /// ω, rad/s.
    pub natural_frequency_rad_s: f64,
    /// ζ, above 0; below 1 the step response overshoots.
    pub damping: f64,
    /// The two time constants, s, the slow one first; `None` for ζ < 1.
    pub time_constants_s: Option<[f64; 2]>,
    /// Dead time, s, as in [`FirstOrder`].
    pub dead_time_s: f64,
}

/// y_{k+1} = Σ a_i·y_{k−i} + Σ b_j·u_{k−delay−j} + c, i and j from 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Recursion {
    /// a_0, and a_1 of a second order.
    pub a: Vec<f64>,
    /// Coefficients of the two inputs of a first order or the three inputs of a second order, y per unit of u.
    pub b: Vec<f64>,
    /// c, in y.
    pub constant: f64,
    /// Whole samples of the dead time; its fraction is in b.
    pub delay: usize,
}

impl Recursion {
    fn of(shape: Shape, dead_time: f64, level: f64, gain: f64) -> Self {
        let (a, mut b, delay) = Response::new(shape, dead_time).recursion();
        // A dead time of whole samples needs one coefficient fewer.
        while b.len() > 1 && b.last() == Some(&0.0) {
            b.pop();
        }
        Self {
            constant: level * (1.0 - a.iter().sum::<f64>()),
            b: b.into_iter().map(|b| gain * b).collect(),
            a,
            delay,
        }
    }
}

/// Fits first and second order to scaled records.
pub(super) fn fit(series: &[Series], longest_dead_time: usize) -> (Option<Fitted>, Option<Fitted>) {
    let longest = series.iter().map(Series::len).max().unwrap_or(0);
    let refiner = Refiner {
        series,
        longest_dead_time: longest_dead_time as f64,
        slowest: SLOWEST * longest as f64,
    };
    let starts = starts(series, longest_dead_time);
    let first = refiner.best(&starts.first, DESCENTS);
    // A second order contains the first order as a limit, and fits at least as well.
    let mut limits = Vec::new();
    if let Some(Fitted { at, .. }) = first
        && let Shape::First { time_constant } = at.shape
    {
        let shares = [0.2, 0.02].map(|share| share * time_constant);
        for fast in shares.into_iter().chain([NO_TIME]) {
            limits.push(Start {
                shape: Shape::of_time_constants(time_constant, fast),
                dead_time: (at.dead_time - fast).max(0.0),
            });
        }
    }
    let free = refiner.best(&starts.second, DESCENTS);
    let limit = refiner.best(&limits, 1);
    let both = free.into_iter().chain(limit);
    let second = both.min_by(|a, b| a.projection.cost.total_cmp(&b.projection.cost));
    (first, second)
}

/// Level and gain in the user's units.
fn static_part(fitted: &Fitted, scaling: &Scaling) -> (f64, f64) {
    let gain = fitted.projection.gain * scaling.y_scale / scaling.u_scale;
    let level = scaling.y_mean + scaling.y_scale * fitted.projection.level - gain * scaling.u_mean;
    (level, gain)
}

/// The free run of a process over a record.
fn run(shape: Shape, dead_time: f64, level: f64, gain: f64, record: &Record) -> Option<Vec<f64>> {
    let response = Response::new(shape, dead_time);
    // The run is computed about the mean, to avoid denormal numbers in a decaying response.
    let mean = record.u.iter().sum::<f64>() / record.len().max(1) as f64;
    let around: Vec<f64> = record.u.iter().map(|u| u - mean).collect();
    let before = command_before(record) - mean;
    let forced = response.forced(&around, before).into_iter();
    let forced: Vec<f64> = forced.map(|x| level + gain * (mean + x)).collect();
    let free = response.free(record.len());
    let known = match record.followed.len() {
        0 => 0..0,
        followed => (dead_time.ceil() as usize + 1).min(record.len() / 4)..followed,
    };
    let initial = InitialState::between(free, record.len(), response.fastest(), known);
    let run = initial.added_to(&forced, &record.y);
    run.iter().all(|y| y.is_finite()).then_some(run)
}

impl FirstOrder {
    pub(super) fn of(fitted: &Fitted, scaling: &Scaling, period_s: f64) -> Option<Self> {
        let (level, gain) = static_part(fitted, scaling);
        let Shape::First { time_constant } = fitted.at.shape else {
            return None;
        };
        let model = Self {
            gain,
            level,
            time_constant_s: time_constant * period_s,
            dead_time_s: fitted.at.dead_time * period_s,
        };
        (gain.is_finite() && level.is_finite()).then_some(model)
    }

    fn sampled(&self, period_s: f64) -> (Shape, f64) {
        let time_constant = self.time_constant_s / period_s;
        (Shape::First { time_constant }, self.dead_time_s / period_s)
    }

    /// The free run over a record with the initial state estimated from y; `None` if it does not stay finite.
    #[must_use]
    pub fn simulate(&self, record: &Record) -> Option<Vec<f64>> {
        let (shape, dead_time) = self.sampled(record.sample_period_s);
        run(shape, dead_time, self.level, self.gain, record)
    }

    /// The model as a recursion, exact for a command that is held between samples.
    #[must_use]
    pub fn recursion(&self, period_s: f64) -> Recursion {
        let (shape, dead_time) = self.sampled(period_s);
        Recursion::of(shape, dead_time, self.level, self.gain)
    }
}

impl SecondOrder {
    pub(super) fn of(fitted: &Fitted, scaling: &Scaling, period_s: f64) -> Option<Self> {
        let (level, gain) = static_part(fitted, scaling);
        let Shape::Second { frequency, damping } = fitted.at.shape else {
            return None;
        };
        let times = fitted.at.shape.time_constants();
        let model = Self {
            gain,
            level,
            natural_frequency_rad_s: frequency / period_s,
            damping,
            time_constants_s: times.map(|times| times.map(|time| time * period_s)),
            dead_time_s: fitted.at.dead_time * period_s,
        };
        (gain.is_finite() && level.is_finite()).then_some(model)
    }

    fn sampled(&self, period_s: f64) -> (Shape, f64) {
        let shape = Shape::Second {
            frequency: self.natural_frequency_rad_s * period_s,
            damping: self.damping,
        };
        (shape, self.dead_time_s / period_s)
    }

    /// The free run over a record with the initial state estimated from y; `None` if it does not stay finite.
    #[must_use]
    pub fn simulate(&self, record: &Record) -> Option<Vec<f64>> {
        let (shape, dead_time) = self.sampled(record.sample_period_s);
        run(shape, dead_time, self.level, self.gain, record)
    }

    /// The model as a recursion, exact for a command that is held between samples.
    #[must_use]
    pub fn recursion(&self, period_s: f64) -> Recursion {
        let (shape, dead_time) = self.sampled(period_s);
        Recursion::of(shape, dead_time, self.level, self.gain)
    }
}

/// A time with three digits and its unit.
struct Seconds(f64);

impl fmt::Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0.0 {
            return f.write_str("0 s");
        }
        let (value, unit) = readable_time(self.0);
        let digits = (2.0 - value.log10().floor()).clamp(0.0, 2.0) as usize;
        write!(f, "{value:.digits$} {unit}")
    }
}

impl fmt::Display for FirstOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (dead, time) = (Seconds(self.dead_time_s), Seconds(self.time_constant_s));
        write!(f, "dead time {dead}, time constant {time}")
    }
}

impl fmt::Display for SecondOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "dead time {}, ", Seconds(self.dead_time_s))?;
        match self.time_constants_s {
            Some([slow, fast]) => {
                write!(f, "time constants {} and {}", Seconds(slow), Seconds(fast))
            }
            None => {
                let period = std::f64::consts::TAU / self.natural_frequency_rad_s;
                let damping = self.damping;
                write!(f, "period {}, damping {damping:.2}", Seconds(period))
            }
        }
    }
}

impl fmt::Display for super::Arx {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "delay {} samples, largest pole {:.4}",
            self.delay,
            self.largest_pole()
        )
    }
}
