//! Prediction of the free run of a changed model without running it.
//!
//! Around an incumbent with coefficients θ the simulated output changes to first order by Σ_i Δθ_i s_i. The
//! sensitivity s_i is the incumbent's recursion driven by regressor i at the simulated output (the exact
//! Gauss–Newton direction), which is defined for unused lags as well (θ = 0). With the inner products of all
//! sensitivities in a table, ε of any exchange of lags is a quadratic form in the least-squares coefficients
//! of the candidate, computed in microseconds.

use super::arrival::FitSignals;
use super::coefficients::Coefficients;
use super::free_runner::Trajectory;
use super::lagged_products::ONE;
use super::layout::{Column, Delays, Layout};
use super::regression::Regression;
use numerics::linalg;

/// Decimation of the samples in the products. It is odd, so that patterns of period two are sampled.
const STRIDE: usize = 41;

/// Sensitivities that are computed in parallel.
const LANES: usize = 32;

/// One record of the run that is linearised.
struct SensitivityRun<'a> {
    padded: &'a [f32],
    arrived: &'a [Vec<f32>],
    state: &'a [(usize, f32)],
    product: &'a [Vec<(usize, f32)>],
    rows: &'a [usize],
}

/// Runs the incumbent's recursion on `LANES` regressors from lag `first` of a
/// block on and samples the result. Block 0 are the outputs alone, block l the
/// outputs times the command that arrives through input l.
struct Filter<'a> {
    run: &'a SensitivityRun<'a>,
    lags: usize,
    first_element: usize,
    block: usize,
    first: usize,
    /// Outputs of the recursion, `LANES` per step; preceded by zeros for the longest lag.
    outputs: &'a mut [f32],
    /// The first of the columns to fill, and the distance to the next.
    sampled: &'a mut [f64],
    spacing: usize,
}

impl pulp::WithSimd for Filter<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        // Registers that hold the lanes of a step.
        match LANES / S::F32_LANES {
            2 => self.filter::<S, 2>(simd),
            4 => self.filter::<S, 4>(simd),
            8 => self.filter::<S, 8>(simd),
            _ => self.filter::<pulp::Scalar, LANES>(pulp::Scalar::new()),
        }
    }
}

impl Filter<'_> {
    #[inline(always)]
    fn filter<S: pulp::Simd, const REGISTERS: usize>(self, simd: S) {
        let &SensitivityRun {
            padded,
            arrived,
            state,
            product,
            rows,
        } = self.run;
        let reach = self.lags + 1;
        let samples = self.outputs.len() / LANES - reach;
        let gate = self.block.checked_sub(1).and_then(|l| arrived.get(l));
        let mut rows = rows.iter().enumerate().peekable();
        // The terms of the recursion, with the products at the arriving commands `at`.
        let mut terms: Vec<(usize, f32)> = state.to_vec();
        let mut at: Vec<f32> = vec![0.0; arrived.len()];
        for k in 0..samples {
            let (past, next) = self.outputs.split_at_mut((reach + k) * LANES);
            // Lane 0 is the constant 1 in a block that starts with it; the other lanes are lags in
            // ascending order.
            if let Some((at, _)) = rows.next_if(|(_, row)| **row == k) {
                let newest = past[past.len() - LANES..].iter();
                for (i, value) in newest.enumerate().take(1 + self.lags - self.first) {
                    self.sampled[i * self.spacing + at] = f64::from(*value);
                }
            }
            let drive = &mut next[..LANES];
            let gate = gate.map_or(1.0, |gate| gate[k]);
            if gate == 0.0 {
                drive.fill(0.0);
            } else {
                // Position after the newest output that any lane reads.
                let newest = LANES + reach + k + 4 - self.first - self.first_element;
                let regressors = padded[newest - LANES..newest].iter().rev();
                for (drive, y) in drive.iter_mut().zip(regressors) {
                    *drive = gate * y;
                }
                if self.first == 0 {
                    drive[0] = gate;
                }
            }
            if at.iter().zip(arrived).any(|(at, d)| *at != d[k]) {
                terms.truncate(state.len());
                for ((products, at), d) in product.iter().zip(&mut at).zip(arrived) {
                    *at = d[k];
                    if *at != 0.0 {
                        terms.extend(products.iter().map(|(m, c)| (*m, c * *at)));
                    }
                }
            }
            let drive = S::as_mut_simd_f32s(drive).0;
            let past = S::as_simd_f32s(past).0;
            let steps_back = |m: usize| &past[past.len() - (1 + m) * REGISTERS..][..REGISTERS];
            // Two sums per register, so that additions need not wait for each other.
            let mut sums = [simd.splat_f32s(0.0); REGISTERS];
            let mut others = sums;
            let pairs = terms.chunks_exact(2);
            if let [(m, weight)] = pairs.remainder() {
                let (weight, past) = (simd.splat_f32s(*weight), steps_back(*m));
                for i in 0..REGISTERS {
                    sums[i] = simd.mul_add_e_f32s(weight, past[i], sums[i]);
                }
            }
            for pair in pairs {
                let &[(m, weight), (n, other)] = pair else {
                    continue;
                };
                let (weight, past_m) = (simd.splat_f32s(weight), steps_back(m));
                let (other, past_n) = (simd.splat_f32s(other), steps_back(n));
                for i in 0..REGISTERS {
                    sums[i] = simd.mul_add_e_f32s(weight, past_m[i], sums[i]);
                    others[i] = simd.mul_add_e_f32s(other, past_n[i], others[i]);
                }
            }
            for i in 0..REGISTERS {
                drive[i] = simd.add_f32s(drive[i], simd.add_f32s(sums[i], others[i]));
            }
        }
    }
}

/// The free run linearised at an incumbent.
#[derive(Debug)]
pub(crate) struct Linearised {
    /// Columns: one for each regressor and, last, the incumbent's error.
    size: usize,
    rows: usize,
    /// The sensitivities at the sampled rows of all records, column by column.
    sampled: Vec<f64>,
    /// Products of a column with all others; computed on demand.
    products: Vec<Option<Vec<f64>>>,
    /// Squared lengths of the columns.
    squared: Vec<f64>,
    incumbent: Vec<(usize, f64)>,
    lags: usize,
    first_element: usize,
}

impl Linearised {
    /// Linearises at `delays` and their regression's solution; `simulated` is their free run.
    pub(crate) fn new(
        signals: &FitSignals,
        layout: &Layout,
        delays: &Delays,
        solution: &[f64],
        trajectory: &Trajectory,
    ) -> Self {
        let lags = usize::from(layout.longest_lag);
        let inputs = delays.ticks.len();
        let size = (1 + inputs) * (1 + lags) + 1;
        let sampled_rows = |measured: &Vec<f64>| (signals.skipped..measured.len()).step_by(STRIDE);
        let all_rows = signals.y.iter().map(|y| sampled_rows(y).len()).sum();
        let mut linearised = Self {
            size,
            rows: all_rows,
            sampled: vec![0.0; size * all_rows],
            products: vec![None; size],
            squared: Vec::new(),
            incumbent: Vec::new(),
            lags,
            first_element: layout.element(1),
        };
        let columns = layout.columns(delays);
        linearised.incumbent = columns
            .iter()
            .zip(solution)
            .map(|(column, theta)| (linearised.index(column), *theta))
            .collect();
        let coefficients = Coefficients::new(solution, delays);
        let behind = |lag: &u16| layout.element(*lag) - 2;
        // Single precision is enough to rank candidates and runs twice as fast.
        let state: Vec<(usize, f32)> = delays
            .state
            .iter()
            .map(behind)
            .zip(coefficients.a.iter().map(|a| *a as f32))
            .collect();
        let product: Vec<Vec<(usize, f32)>> = (0..inputs)
            .map(|l| {
                let c = coefficients.c.iter().skip(l * delays.product.len());
                delays
                    .product
                    .iter()
                    .map(behind)
                    .zip(c.map(|c| *c as f32))
                    .collect()
            })
            .collect();
        let mut first_row = 0;
        for (record, measured) in signals.y.iter().enumerate() {
            let simulated = &trajectory.simulated[record];
            let arrived: Vec<Vec<f32>> = trajectory.arrived[record]
                .iter()
                .map(|d| d.iter().map(|d| *d as f32).collect())
                .collect();
            let rows: Vec<usize> = sampled_rows(measured).collect();
            // Zeros before the record and room for lanes beyond the longest lag.
            let mut padded = vec![0.0f32; lags + 1 + LANES];
            padded.extend(simulated.iter().map(|y| *y as f32));
            padded.push(0.0);
            let run = SensitivityRun {
                padded: &padded,
                arrived: &arrived,
                state: &state,
                product: &product,
                rows: &rows,
            };
            let mut outputs = vec![0.0f32; (lags + 1 + measured.len()) * LANES];
            for block in 0..=inputs {
                for first in (0..=lags).step_by(LANES) {
                    let column = block * (1 + lags) + first;
                    pulp::Arch::new().dispatch(Filter {
                        run: &run,
                        lags,
                        first_element: linearised.first_element,
                        block,
                        first,
                        outputs: &mut outputs,
                        sampled: &mut linearised.sampled[column * all_rows + first_row..],
                        spacing: all_rows,
                    });
                }
            }
            let error = &mut linearised.sampled[(size - 1) * all_rows + first_row..];
            for (e, k) in error.iter_mut().zip(&rows) {
                *e = measured[*k] - simulated[*k];
            }
            first_row += rows.len();
        }
        linearised.squared = linearised
            .sampled
            .chunks_exact(all_rows.max(1))
            .map(|column| column.iter().map(|s| s * s).sum())
            .collect();
        linearised.multiply(
            (0..columns.len())
                .map(|i| linearised.incumbent[i].0)
                .chain([size - 1])
                .collect(),
        );
        linearised
    }

    /// Forms the products of these columns with all others, once.
    fn multiply(&mut self, mut columns: Vec<usize>) {
        columns.retain(|i| self.products[*i].is_none());
        let chosen: Vec<f64> = columns
            .iter()
            .flat_map(|i| &self.sampled[i * self.rows..(i + 1) * self.rows])
            .copied()
            .collect();
        let products = linalg::cross_products(&self.sampled, &chosen, self.rows);
        for (i, products) in columns.iter().zip(products.chunks_exact(self.size)) {
            self.products[*i] = Some(products.to_vec());
        }
    }

    fn product(&self, i: usize, j: usize) -> f64 {
        match (&self.products[i], &self.products[j]) {
            (Some(products), _) => products[j],
            (None, Some(products)) => products[i],
            (None, None) if i == j => self.squared[i],
            (None, None) => {
                let column = |i: usize| &self.sampled[i * self.rows..(i + 1) * self.rows];
                column(i).iter().zip(column(j)).map(|(x, y)| x * y).sum()
            }
        }
    }

    /// Prepares fast predictions for neighbours of a candidate.
    pub(crate) fn include(&mut self, layout: &Layout, delays: &Delays) {
        let columns = layout.columns(delays);
        self.multiply(columns.iter().map(|c| self.index(c)).collect());
    }

    /// Place of a regressor's sensitivity.
    fn index(&self, column: &Column) -> usize {
        let within = if column.element == ONE {
            0
        } else {
            column.element + 1 - self.first_element
        };
        column.input * (1 + self.lags) + within
    }

    /// Predicted ε² of a candidate with the incumbent's input delays.
    pub(crate) fn predict(&self, regression: &Regression, delays: &Delays) -> f64 {
        let (solution, _) = regression.normal(delays).solve();
        let mut change: Vec<(usize, f64)> = Vec::with_capacity(2 * solution.len() + 1);
        for (column, theta) in regression.layout.columns(delays).iter().zip(&solution) {
            change.push((self.index(column), -theta));
        }
        for (index, theta) in &self.incumbent {
            match change.iter_mut().find(|(i, _)| i == index) {
                Some((_, delta)) => *delta += theta,
                None => change.push((*index, *theta)),
            }
        }
        change.push((self.size - 1, 1.0));
        let mut sum = 0.0;
        for (n, (i, x)) in change.iter().enumerate() {
            let mut part = 0.5 * self.product(*i, *i) * x;
            for (j, y) in &change[..n] {
                part += self.product(*j, *i) * y;
            }
            sum += 2.0 * x * part;
        }
        sum * STRIDE as f64
    }
}
