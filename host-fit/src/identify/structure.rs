//! The structure to be identified: sizes, delays and conventions of a model.

use model_core::recursion::LagConvention;

use super::rules::RULES;
use crate::model::Start;

/// Step in which factors f are searched.
pub(crate) const FACTOR_STEP: f64 = 1e-4;

/// The three numbers of the delay law h̃(ỹ) = p0 + p1·exp(−p2·ỹ), eq. (2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExponentialDelay {
    /// p0, samples: delay of the attached flow.
    pub floor: f64,
    /// p1, samples: additional delay of the separated flow.
    pub rise: f64,
    /// p2, 1/y: how quickly the delay shortens as the flow attaches.
    pub rate: f64,
}

impl ExponentialDelay {
    /// The law published in the paper, for its rig.
    pub const PAPER: Self = Self {
        floor: 47.35,
        rise: 12.69,
        rate: 20.18,
    };

    /// Initial values of a search for the law.
    pub const USUAL: Self = Self {
        floor: 40.0,
        rise: 10.0,
        rate: 8.0,
    };

    /// The longest delay of the law over ỹ ≥ 0, samples.
    pub fn longest(&self) -> f64 {
        self.floor + self.rise.max(0.0)
    }
}

/// Where the input delays come from.
#[derive(Debug, Clone, PartialEq)]
pub enum InputDelay {
    /// h_l constant, eq. (3).
    Fixed {
        /// Given delays in samples, one per input, or `None` to search them.
        delays: Option<Vec<u32>>,
    },
    /// h_l = round(f_l·h̃), eq. (4).
    StateDependent {
        /// The law h̃.
        law: ExponentialDelay,
        /// Given factors f_l, one per input, or `None` to search them in steps of 10⁻⁴.
        factors: Option<Vec<f64>>,
    },
}

/// Sizes and conventions of the model to identify.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// N1, number of state lags τ, at least 1.
    pub state_lags: usize,
    /// N2, number of product lags τ̄; 0 for a linear model.
    pub product_lags: usize,
    /// N3, number of input delays; 0 for a model without input.
    pub inputs: usize,
    /// Longest lag, samples, at least 1. Lags run from 1 to this value, and searched input delays do not exceed it.
    pub longest_lag: u16,
    /// Convention of the lags.
    pub convention: LagConvention,
    /// Where the input delays come from.
    pub delay: InputDelay,
    /// Whether the model is of the averaged signals, eqs. (14) and (15).
    pub averaged: bool,
    /// Whether the recursion has a constant term.
    pub constant: bool,
    /// How records begin. With [`Start::Measured`] the rows whose past is not
    /// recorded are left out.
    pub start: Start,
}

impl Default for Structure {
    /// The full model of the paper's Table II, state-dependent, law given and f = 1.
    fn default() -> Self {
        Self {
            state_lags: 5,
            product_lags: 10,
            inputs: 1,
            longest_lag: RULES.longest_lag,
            convention: LagConvention::OneStep,
            delay: InputDelay::StateDependent {
                law: ExponentialDelay::PAPER,
                factors: Some(vec![1.0]),
            },
            averaged: false,
            constant: false,
            start: Start::Rest,
        }
    }
}

impl Structure {
    /// Coefficients that the least squares estimate: N1 + N3·(1 + N2) and the constant.
    #[must_use]
    pub fn coefficients(&self) -> usize {
        self.state_lags + self.inputs * (1 + self.product_lags) + usize::from(self.constant)
    }

    /// Rows at a record's start that have no recorded past.
    pub(crate) fn skipped(&self) -> usize {
        let longest_delay = match &self.delay {
            InputDelay::Fixed { delays: Some(h) } => h.iter().copied().max().unwrap_or(0) as usize,
            InputDelay::StateDependent {
                law,
                factors: Some(f),
            } => {
                let factor = f.iter().fold(0.0f64, |m, f| m.max(*f));
                (factor * law.longest()).ceil() as usize
            }
            _ => usize::from(self.longest_lag),
        };
        match self.start {
            Start::Rest => 0,
            Start::Measured => longest_delay.max(self.longest_lag.into()) + 1,
        }
    }

    /// Ticks for given input delays.
    pub(crate) fn given_ticks(&self) -> Option<Vec<i64>> {
        match &self.delay {
            InputDelay::Fixed { delays } => delays
                .as_ref()
                .map(|h| h.iter().map(|h| i64::from(*h)).collect()),
            InputDelay::StateDependent { factors, .. } => factors
                .as_ref()
                .map(|f| f.iter().map(|f| (f / FACTOR_STEP).round() as i64).collect()),
        }
    }
}

/// One recording: command and response, equally long.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Series<'a> {
    /// u_k: 0 or 1 for on/off, any real otherwise.
    pub(crate) u: &'a [f64],
    /// y_k.
    pub(crate) y: &'a [f64],
}
