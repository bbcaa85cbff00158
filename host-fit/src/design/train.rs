//! Pulse trains and their value on a model.

use super::bench::Player;
use super::rules::RULES;
use crate::simulate::HostState;
use model_core::control::PulseTrain;

/// A periodic on/off command.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Train {
    /// Samples.
    pub(super) period: u32,
    /// First sample and length of each.
    pub(super) pulses: Vec<(u32, u32)>,
}

impl Train {
    /// Steady blowing: the valve is always open.
    pub(super) fn steady() -> Self {
        Self {
            period: 1,
            pulses: vec![(0, 1)],
        }
    }

    /// Whether the valve is open, over one period.
    fn command(&self) -> Vec<bool> {
        let train = PulseTrain {
            period: self.period,
            pulses: &self.pulses,
        };
        (0..self.period.max(1)).map(|at| train.is_on(at)).collect()
    }

    /// The train with another period (samples) at the same duty.
    pub(super) fn stretched(&self, period: u32) -> Self {
        let scale =
            |x: u32| (f64::from(x) * f64::from(period) / f64::from(self.period)).round() as u32;
        let pulses = self
            .pulses
            .iter()
            .map(|&(first, length)| (scale(first), scale(length)));
        Self {
            period,
            pulses: pulses.collect(),
        }
    }
}

/// A pulse train with its value.
#[derive(Clone, Debug)]
pub(super) struct JudgedTrain {
    pub(super) train: Train,
    /// Mean minus price times duty.
    pub(super) value: f64,
    pub(super) mean: f64,
    pub(super) duty: f64,
    pub(super) range: [f64; 2],
}

impl JudgedTrain {
    pub(super) fn worthless(train: &Train) -> Self {
        Self {
            train: train.clone(),
            value: f64::NEG_INFINITY,
            mean: f64::NEG_INFINITY,
            duty: 0.0,
            range: [0.0; 2],
        }
    }
}

/// A train being played to the model.
pub(super) struct Played<'a> {
    bench: &'a Player<f64>,
    train: &'a Train,
    on: Vec<bool>,
    state: HostState<f64>,
    at: usize,
    grown: bool,
}

impl<'a> Played<'a> {
    pub(super) fn new(bench: &'a Player<f64>, train: &'a Train) -> Self {
        Self {
            bench,
            train,
            on: train.command(),
            state: bench.at_rest(),
            at: 0,
            grown: false,
        }
    }

    fn step(&mut self) -> (f64, bool) {
        let on = self.on[self.at];
        self.at = (self.at + 1) % self.on.len();
        let s = self.bench.step(&mut self.state, on).flow;
        self.grown |= s.abs() > RULES.grown || s.is_nan();
        (s, on)
    }

    /// Simulates `samples` samples.
    pub(super) fn pass(&mut self, samples: usize) {
        for _ in 0..samples {
            if self.grown {
                return;
            }
            self.step();
        }
    }

    /// Evaluates whole periods, at least `samples` long; `None` if the model diverges.
    pub(super) fn judge(&mut self, samples: usize, price: f64) -> Option<JudgedTrain> {
        let length = samples.div_ceil(self.on.len()) * self.on.len();
        let (mut sum, mut open) = (0.0, 0.0);
        let mut range = [f64::MAX, f64::MIN];
        for _ in 0..length {
            let (s, on) = self.step();
            if self.grown {
                return None;
            }
            sum += s;
            open += f64::from(u8::from(on));
            range = [range[0].min(s), range[1].max(s)];
        }
        let (mean, duty) = (sum / length as f64, open / length as f64);
        Some(JudgedTrain {
            train: self.train.clone(),
            value: mean - price * duty,
            mean,
            duty,
            range,
        })
    }
}

/// The first `count` of a sorted list that are distinct from all better ones.
pub(super) fn distinct(sorted: &[JudgedTrain], count: usize) -> Vec<JudgedTrain> {
    let mut kept: Vec<JudgedTrain> = Vec::new();
    for judged in sorted.iter().filter(|j| j.value.is_finite()) {
        let near = |other: &JudgedTrain| {
            let ratio = f64::from(judged.train.period) / f64::from(other.train.period);
            ratio.ln().abs() < RULES.distinct_period
                && (judged.duty - other.duty).abs() < RULES.distinct_duty
        };
        if !kept.iter().any(near) {
            kept.push(judged.clone());
            if kept.len() == count {
                break;
            }
        }
    }
    kept
}
