//! The mapping between a point of the search and the delays of a model.

use model_core::recursion::LagConvention;

use super::lagged_products::{Element, behind_newest};
use super::structure::{FACTOR_STEP, InputDelay, Structure};
use crate::search::{Point, Variable};

/// The delays of one candidate model, each list sorted and without repeats.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Delays {
    /// τ, samples.
    pub(crate) state: Vec<u16>,
    /// τ̄, samples.
    pub(crate) product: Vec<u16>,
    /// h in samples or f in steps of [`FACTOR_STEP`], one per input.
    pub(crate) ticks: Vec<i64>,
}

/// A regressor: an element alone (`input` 0) or times the arriving command of
/// an input (from 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Column {
    pub(crate) input: usize,
    pub(crate) element: Element,
}

/// The variables of a search and their meaning.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) variables: Vec<Variable>,
    pub(crate) state_lags: usize,
    pub(crate) product_lags: usize,
    pub(crate) longest_lag: u16,
    pub(crate) constant: bool,
    convention: LagConvention,
    given: Option<Vec<i64>>,
}

impl Layout {
    pub(crate) fn new(structure: &Structure) -> Self {
        let longest = i64::from(structure.longest_lag);
        let mut variables: Vec<Variable> = (1..=structure.state_lags)
            .map(|i| Variable::integer(format!("state lag {i}"), 1, longest))
            .collect();
        variables.extend(
            (1..=structure.product_lags)
                .map(|j| Variable::integer(format!("product lag {j}"), 1, longest)),
        );
        let given = structure.given_ticks();
        let input = match &structure.delay {
            InputDelay::Fixed { .. } => Variable::integer("", 0, longest),
            InputDelay::StateDependent { law, .. } => Variable::granular(
                "",
                0.0,
                longest as f64 / law.longest().max(1.0),
                FACTOR_STEP,
            ),
        };
        if given.is_none() {
            variables.extend((1..=structure.inputs).map(|l| Variable {
                name: format!("input delay {l}"),
                ..input.clone()
            }));
        }
        Self {
            variables,
            state_lags: structure.state_lags,
            product_lags: structure.product_lags,
            longest_lag: structure.longest_lag,
            constant: structure.constant,
            convention: structure.convention,
            given,
        }
    }

    /// Bounds in ticks of the input delays that are searched.
    pub(crate) fn input_bounds(&self) -> Vec<(i64, i64)> {
        self.variables
            .iter()
            .skip(self.state_lags + self.product_lags)
            .map(|v| (v.lower, v.upper))
            .collect()
    }

    /// The variables that are lags, and those that are input delays.
    pub(crate) fn groups(&self) -> Vec<Vec<usize>> {
        let lags = self.state_lags + self.product_lags;
        vec![(0..lags).collect(), (lags..self.variables.len()).collect()]
    }

    /// The delays a point stands for.
    pub(crate) fn delays(&self, point: &[i64]) -> Delays {
        let lags = |from: usize, count: usize| {
            let mut lags: Vec<u16> = point
                .iter()
                .skip(from)
                .take(count)
                .map(|x| *x as u16)
                .collect();
            lags.sort_unstable();
            lags.dedup();
            lags
        };
        let product_from = self.state_lags;
        let inputs_from = self.state_lags + self.product_lags;
        let mut ticks = match &self.given {
            Some(given) => given.clone(),
            None => point.iter().skip(inputs_from).copied().collect(),
        };
        ticks.sort_unstable();
        ticks.dedup();
        Delays {
            state: lags(0, self.state_lags),
            product: lags(product_from, self.product_lags),
            ticks,
        }
    }

    /// A point for the delays; lists that are too short repeat their last entry.
    pub(crate) fn point(&self, delays: &Delays) -> Point {
        let fill = |list: Vec<i64>, count: usize, default: i64| {
            let last = list.last().copied().unwrap_or(default);
            list.into_iter()
                .chain(std::iter::repeat(last))
                .take(count)
                .collect::<Vec<i64>>()
        };
        let mut point = fill(
            delays.state.iter().map(|x| i64::from(*x)).collect(),
            self.state_lags,
            1,
        );
        point.extend(fill(
            delays.product.iter().map(|x| i64::from(*x)).collect(),
            self.product_lags,
            1,
        ));
        let inputs = self.variables.len() - point.len();
        point.extend(fill(delays.ticks.clone(), inputs, 0));
        point
    }

    /// The canonical one of all points with the same delays.
    pub(crate) fn canonical(&self, point: &[i64]) -> Point {
        let delays = self.delays(point);
        let mut key: Point = delays.state.iter().map(|x| i64::from(*x)).collect();
        key.push(-1);
        key.extend(delays.product.iter().map(|x| i64::from(*x)));
        key.push(-1);
        key.extend(&delays.ticks);
        key
    }

    /// The element that a lag reads.
    pub(crate) fn element(&self, lag: u16) -> Element {
        behind_newest(self.convention.behind_newest(lag))
    }

    /// The regressors of a candidate: a_1 …, then per input b_l, c_1l …, then the constant.
    pub(crate) fn columns(&self, delays: &Delays) -> Vec<Column> {
        let mut columns: Vec<Column> = delays
            .state
            .iter()
            .map(|lag| Column {
                input: 0,
                element: self.element(*lag),
            })
            .collect();
        for input in 1..=delays.ticks.len() {
            columns.push(Column {
                input,
                element: super::lagged_products::ONE,
            });
            columns.extend(delays.product.iter().map(|lag| Column {
                input,
                element: self.element(*lag),
            }));
        }
        if self.constant {
            columns.push(Column {
                input: 0,
                element: super::lagged_products::ONE,
            });
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutations_and_repeats_are_one_candidate() {
        let structure = Structure {
            state_lags: 2,
            product_lags: 3,
            delay: InputDelay::Fixed { delays: None },
            ..Structure::default()
        };
        let layout = Layout::new(&structure);
        assert_eq!(layout.variables.len(), 6);
        let key = layout.canonical(&[7, 1, 30, 20, 20, 49]);
        assert_eq!(key, layout.canonical(&[1, 7, 20, 30, 30, 49]));
        assert_ne!(key, layout.canonical(&[1, 7, 20, 30, 31, 49]));
        assert_ne!(key, layout.canonical(&[1, 20, 7, 30, 30, 49]));
        let delays = layout.delays(&[7, 1, 30, 20, 20, 49]);
        assert_eq!(layout.delays(&layout.point(&delays)), delays);
        assert_eq!(layout.columns(&delays).len(), 2 + 1 + 2);
    }
}
