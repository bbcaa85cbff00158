//! The linear regression for any delays, from tables of lagged products.

use std::collections::BTreeMap;

use super::arrival::{FitSignals, Weights, difference};
use super::lagged_products::{LaggedOutputs, TARGET, Table};
use super::layout::{Column, Delays, Layout};
use super::structure::{Series, Structure};
use crate::data::memory::{self, TooMuch};
use numerics::linalg::{self, Cholesky};

/// Number of cached tables; the least recently used is dropped. One of 500 lags takes 2 MB.
const TABLES_KEPT: usize = 48;
/// Tables in memory in addition to the cached ones: the unweighted table, and two matrices needed to build a table.
const TABLES_BESIDE: u64 = 3;

/// Bytes of one table.
fn table_bytes(longest: usize) -> u64 {
    (longest as u64 + 3).pow(2) * 8
}

/// Tables that a candidate of `inputs` inputs needs.
fn tables_needed(inputs: usize) -> usize {
    (inputs * (inputs + 3) / 2).max(1)
}

/// Whether there is memory for the tables that candidates of `structure` need.
///
/// # Errors
/// [`TooMuch`] with the memory that they need.
pub(crate) fn fits_in_memory(structure: &Structure) -> Result<(), TooMuch> {
    let tables = tables_needed(structure.inputs) as u64 + TABLES_BESIDE;
    let needed = tables * table_bytes(structure.longest_lag.into());
    let what = format!("a search over lags up to {} samples", structure.longest_lag);
    memory::allow(needed, &what, "give a smaller --max-lag or --n3")
}

/// A table is reused for a neighbouring input delay if at most about this many samples differ.
const SAMPLES_PATCHED: usize = 3000;

/// The weights of a table: the arriving command of one input or the product of two, by the inputs' ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Which {
    /// Weight 1.
    Plain,
    /// The arriving command of one input.
    Single(i64),
    /// The product of the arriving commands of two inputs, or the square of one.
    Product(i64, i64),
}

impl Which {
    fn distance(self, other: Self) -> Option<u64> {
        match (self, other) {
            (Self::Plain, Self::Plain) => Some(0),
            (Self::Single(a), Self::Single(b)) => Some(a.abs_diff(b)),
            (Self::Product(a, b), Self::Product(c, d)) => Some(a.abs_diff(c) + b.abs_diff(d)),
            _ => None,
        }
    }
}

#[derive(Debug)]
struct Kept {
    table: Table,
    weights: Weights,
    last_used: u64,
}

/// Normal equations of one candidate.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    pub(crate) n: usize,
    /// Gram matrix of the regressors, row by row.
    pub(crate) gram: Vec<f64>,
    /// Products of the regressors with the target.
    pub(crate) rhs: Vec<f64>,
    /// Σ y_{k+1}².
    pub(crate) target: f64,
}

impl Normal {
    /// Coefficients, zero for dependent columns, and the squared residual norm.
    pub(crate) fn solve(&self) -> (Vec<f64>, f64) {
        let factor = Cholesky::new(&self.gram, self.n);
        let w = factor.forward(&self.rhs);
        let explained: f64 = w.iter().map(|w| w * w).sum();
        (factor.backward(w), (self.target - explained).max(0.0))
    }

    /// Squared residual norm.
    pub(crate) fn squared_residual(&self) -> f64 {
        let w = Cholesky::new(&self.gram, self.n).forward(&self.rhs);
        (self.target - w.iter().map(|w| w * w).sum::<f64>()).max(0.0)
    }
}

/// The data of a fit and its tables.
#[derive(Debug)]
pub(crate) struct Regression {
    pub(crate) layout: Layout,
    pub(crate) signals: FitSignals,
    pub(crate) lagged: LaggedOutputs,
    plain: Table,
    kept: BTreeMap<Which, Kept>,
    /// Largest number of tables that are kept.
    most: usize,
    clock: u64,
    /// Change of an input delay, in ticks, that changes the arriving command at about [`SAMPLES_PATCHED`] samples.
    reach: u64,
    binary: bool,
}

impl Regression {
    pub(crate) fn new(records: &[Series<'_>], structure: &Structure) -> Self {
        let layout = Layout::new(structure);
        let signals = FitSignals::new(records, structure);
        let longest = structure.convention.behind_newest(structure.longest_lag);
        // The tables may use half of the memory limit, or what one candidate needs if that is more.
        let fitting =
            usize::try_from(memory::limit() / 2 / table_bytes(longest)).unwrap_or(TABLES_KEPT);
        let most = fitting.clamp(
            tables_needed(structure.inputs).min(TABLES_KEPT),
            TABLES_KEPT,
        );
        let lagged = LaggedOutputs::new(&signals.y, longest);
        let plain = lagged.table(&signals.everywhere());
        let at_zero = signals.arrived(0);
        let edges: usize = match &at_zero {
            Weights::Intervals(records) => 2 * records.iter().map(Vec::len).sum::<usize>(),
            Weights::Samples(_) => 0,
        };
        let samples = (SAMPLES_PATCHED / edges.max(1)).max(1);
        let reach = (samples as f64 * signals.ticks_per_sample()) as u64;
        Self {
            layout,
            signals,
            lagged,
            plain,
            kept: BTreeMap::new(),
            most,
            clock: 0,
            reach,
            binary: at_zero.is_binary(),
        }
    }

    /// Whether the arriving commands are only 0 and 1.
    pub(crate) fn is_binary(&self) -> bool {
        self.binary
    }

    /// Weights between a column of input `l` and one of input `m`.
    pub(crate) fn which(&self, l: usize, m: usize, ticks: &[i64]) -> Which {
        let tick = |l: usize| ticks.get(l - 1).copied().unwrap_or(0);
        match (l, m) {
            (0, 0) => Which::Plain,
            (0, l) | (l, 0) => Which::Single(tick(l)),
            // For an on/off command d² = d.
            (l, m) if self.binary && tick(l) == tick(m) => Which::Single(tick(l)),
            (l, m) => Which::Product(tick(l).min(tick(m)), tick(l).max(tick(m))),
        }
    }

    fn weights(&self, which: Which) -> Weights {
        match which {
            Which::Plain => self.signals.everywhere(),
            Which::Single(tick) => self.signals.arrived(tick),
            Which::Product(a, b) => self.signals.arrived(a).product(&self.signals.arrived(b)),
        }
    }

    /// Weights of all tables that candidates with these input delays need.
    fn needed(&self, ticks: &[i64]) -> Vec<Which> {
        let mut needed = Vec::new();
        for l in 1..=ticks.len() {
            for m in 0..=l {
                let which = self.which(l, m, ticks);
                if !needed.contains(&which) {
                    needed.push(which);
                }
            }
        }
        needed
    }

    fn nearest(&self, which: Which) -> Option<(&Kept, u64)> {
        self.kept
            .iter()
            .filter_map(|(key, kept)| Some((kept, which.distance(*key)?)))
            .min_by_key(|(_, distance)| *distance)
    }

    /// Builds the tables at exactly these input delays.
    pub(crate) fn tabulate(&mut self, ticks: &[i64]) {
        for which in self.needed(ticks) {
            self.keep(which);
        }
    }

    /// Builds tables near these input delays, where evaluation will need them.
    pub(crate) fn tabulate_near(&mut self, ticks: &[i64]) {
        if !self.binary {
            return;
        }
        for which in self.needed(ticks) {
            if self
                .nearest(which)
                .is_none_or(|(_, distance)| distance > self.reach)
            {
                self.keep(which);
            }
        }
    }

    fn keep(&mut self, which: Which) {
        self.clock += 1;
        if let Some(kept) = self.kept.get_mut(&which) {
            kept.last_used = self.clock;
            return;
        }
        if self.kept.len() >= self.most {
            let oldest = self
                .kept
                .iter()
                .min_by_key(|(_, k)| k.last_used)
                .map(|(key, _)| *key);
            oldest.and_then(|key| self.kept.remove(&key));
        }
        let weights = self.weights(which);
        let table = self.lagged.table(&weights);
        self.kept.insert(
            which,
            Kept {
                table,
                weights,
                last_used: self.clock,
            },
        );
    }

    /// The table for exactly these weights, if it was built.
    pub(crate) fn table(&self, which: Which) -> Option<&Table> {
        match which {
            Which::Plain => Some(&self.plain),
            _ => self.kept.get(&which).map(|k| &k.table),
        }
    }

    /// Normal equations of a candidate, from look-ups. If no table is exact for it, corrections or direct sums over
    /// the samples are used.
    pub(crate) fn normal(&self, delays: &Delays) -> Normal {
        let columns = self.layout.columns(delays);
        let n = columns.len();
        let mut normal = Normal {
            n,
            gram: vec![0.0; n * n],
            rhs: vec![0.0; n],
            target: self.plain.at(TARGET, TARGET),
        };
        self.fill(
            &mut normal,
            &columns,
            &delays.ticks,
            Which::Plain,
            &self.plain,
        );
        for which in self.needed(&delays.ticks) {
            match self.nearest(which) {
                Some((kept, 0)) => {
                    self.fill(&mut normal, &columns, &delays.ticks, which, &kept.table)
                }
                Some((kept, distance)) if distance <= self.reach && self.binary => {
                    self.fill(&mut normal, &columns, &delays.ticks, which, &kept.table);
                    let to = self.weights(which);
                    self.correct(
                        &mut normal,
                        &columns,
                        &delays.ticks,
                        which,
                        Some(&kept.weights),
                        &to,
                    );
                }
                _ => {
                    let to = self.weights(which);
                    self.correct(&mut normal, &columns, &delays.ticks, which, None, &to);
                }
            }
        }
        normal
    }

    fn fill(
        &self,
        normal: &mut Normal,
        columns: &[Column],
        ticks: &[i64],
        which: Which,
        table: &Table,
    ) {
        for (p, a) in columns.iter().enumerate() {
            for (q, b) in columns.iter().enumerate().take(p + 1) {
                if self.which(a.input, b.input, ticks) == which {
                    let value = table.at(a.element, b.element);
                    normal.gram[p * normal.n + q] = value;
                    normal.gram[q * normal.n + p] = value;
                }
            }
            if self.which(a.input, 0, ticks) == which {
                normal.rhs[p] = table.at(a.element, TARGET);
            }
        }
    }

    /// Adds the samples by which `to` differs from `from` (all samples of `to` if `from` is not
    /// given).
    fn correct(
        &self,
        normal: &mut Normal,
        columns: &[Column],
        ticks: &[i64],
        which: Which,
        from: Option<&Weights>,
        to: &Weights,
    ) {
        let n = normal.n;
        let mut pairs = Vec::new();
        for (p, a) in columns.iter().enumerate() {
            pairs.extend(
                (0..=p)
                    .filter(|q| self.which(a.input, columns[*q].input, ticks) == which)
                    .map(|q| (p, q)),
            );
        }
        let targets: Vec<usize> = (0..n)
            .filter(|p| self.which(columns[*p].input, 0, ticks) == which)
            .collect();
        let mut values = vec![0.0; n];
        let mut add = |record: usize, k: usize, weight: f64| {
            for (value, column) in values.iter_mut().zip(columns) {
                *value = self.lagged.value(record, k, column.element);
            }
            for &(p, q) in &pairs {
                normal.gram[p * n + q] += weight * values[p] * values[q];
            }
            let target = weight * self.lagged.value(record, k, TARGET);
            for &p in &targets {
                normal.rhs[p] += target * values[p];
            }
        };
        match (from, to) {
            (Some(Weights::Intervals(from)), Weights::Intervals(to)) => {
                for (record, (from, to)) in from.iter().zip(to).enumerate() {
                    for (start, end, sign) in difference(from, to) {
                        (start..end).for_each(|k| add(record, k, sign));
                    }
                }
            }
            (_, Weights::Intervals(to)) => {
                for (record, intervals) in to.iter().enumerate() {
                    for &(start, end) in intervals {
                        (start..end).for_each(|k| add(record, k, 1.0));
                    }
                }
            }
            (_, Weights::Samples(to)) => {
                for (record, samples) in to.iter().enumerate() {
                    for (k, weight) in samples.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                        add(record, k, *weight);
                    }
                }
            }
        }
        for &(p, q) in &pairs {
            normal.gram[q * n + p] = normal.gram[p * n + q];
        }
    }

    /// Squared residual norms with one input's delay at each of `ticks`. These should be neighbours, because each
    /// norm is computed by correcting the previous one.
    pub(crate) fn scan_input(&self, delays: &Delays, input: usize, ticks: &[i64]) -> Vec<f64> {
        let mut current: Option<(Normal, Vec<Weights>)> = None;
        let mut residuals = Vec::with_capacity(ticks.len());
        for &tick in ticks {
            let mut moved = delays.clone();
            // The ticks are not sorted here, because the columns of the inputs are in the order of
            // `delays`.
            moved.ticks[input] = tick;
            let columns = self.layout.columns(&moved);
            let weights: Vec<Weights> = (0..=moved.ticks.len())
                .map(|m| self.weights(self.which(input + 1, m, &moved.ticks)))
                .collect();
            let distinct = (1..moved.ticks.len() + 1)
                .filter(|m| *m != input + 1)
                .all(|m| moved.ticks[m - 1] != tick);
            let normal = match current.take() {
                Some((mut normal, old)) if self.binary && distinct => {
                    let mut done = Vec::new();
                    for (m, (from, to)) in old.iter().zip(&weights).enumerate() {
                        let which = self.which(input + 1, m, &moved.ticks);
                        if !done.contains(&which) {
                            done.push(which);
                            self.correct(
                                &mut normal,
                                &columns,
                                &moved.ticks,
                                which,
                                Some(from),
                                to,
                            );
                        }
                    }
                    normal
                }
                _ => self.normal(&moved),
            };
            residuals.push(normal.squared_residual());
            current = distinct.then_some((normal, weights));
        }
        residuals
    }

    /// Coefficients by the pseudo-inverse and the residual norm by direct summation, both from the samples
    /// themselves. These values are reported.
    ///
    /// # Errors
    /// [`linalg::NotConverged`] when the decomposition fails.
    pub(crate) fn exact(&self, delays: &Delays) -> Result<(Vec<f64>, f64), linalg::NotConverged> {
        let target = self.lagged.column(TARGET);
        let columns: Vec<Vec<f64>> = self
            .layout
            .columns(delays)
            .iter()
            .map(|c| self.column(c, &delays.ticks))
            .collect();
        let coefficients = linalg::least_squares(&columns, &target)?;
        let mut residual = target;
        for (coefficient, column) in coefficients.iter().zip(&columns) {
            residual
                .iter_mut()
                .zip(column)
                .for_each(|(r, x)| *r -= coefficient * x);
        }
        Ok((
            coefficients,
            residual.iter().map(|r| r * r).sum::<f64>().sqrt(),
        ))
    }

    fn column(&self, column: &Column, ticks: &[i64]) -> Vec<f64> {
        let mut values = self.lagged.column(column.element);
        if column.input > 0 {
            let arrived = self.signals.arrived(ticks[column.input - 1]);
            let strength: Vec<f64> = match arrived {
                Weights::Samples(records) => records.concat(),
                Weights::Intervals(records) => records
                    .iter()
                    .enumerate()
                    .flat_map(|(r, on)| {
                        let mut samples = vec![0.0; self.lagged.rows(r)];
                        on.iter().for_each(|&(s, e)| samples[s..e].fill(1.0));
                        samples
                    })
                    .collect(),
            };
            values.iter_mut().zip(strength).for_each(|(v, d)| *v *= d);
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::super::structure::{ExponentialDelay, InputDelay};
    use super::*;

    fn records(graded: bool) -> Vec<(Vec<f64>, Vec<f64>)> {
        [(57, 1400), (91, 1100)]
            .map(|(period, n)| {
                let u: Vec<f64> = (0..n)
                    .map(|k| {
                        if (k / period) % 2 == 0 {
                            0.0
                        } else if graded {
                            0.3 + 0.001 * k as f64
                        } else {
                            1.0
                        }
                    })
                    .collect();
                let mut y = vec![0.0f64; n];
                let mut noise = 1u32;
                for k in 1..n {
                    noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let w = f64::from(noise >> 8) / f64::from(1 << 24) - 0.5;
                    let drive = if k > 30 { u[k - 30] } else { 0.0 };
                    y[k] = 0.95 * y[k - 1] + (0.06 - 0.01 * y[k - 1]) * drive + 0.02 * w;
                }
                (u, y)
            })
            .to_vec()
    }

    fn regression(data: &[(Vec<f64>, Vec<f64>)], delay: InputDelay, inputs: usize) -> Regression {
        let series: Vec<Series<'_>> = data.iter().map(|(u, y)| Series { u, y }).collect();
        let structure = Structure {
            state_lags: 2,
            product_lags: 3,
            inputs,
            longest_lag: 60,
            delay,
            constant: true,
            ..Structure::default()
        };
        Regression::new(&series, &structure)
    }

    #[test]
    fn tables_corrections_and_direct_sums_agree_with_the_exact_fit() {
        let law = ExponentialDelay {
            floor: 20.0,
            rise: 15.0,
            rate: 2.0,
        };
        let laws = [
            (InputDelay::Fixed { delays: None }, vec![28, 41]),
            (
                InputDelay::StateDependent { law, factors: None },
                vec![9_000, 12_345],
            ),
        ];
        for graded in [false, true] {
            let data = records(graded);
            for (law, ticks) in &laws {
                let mut regression = regression(&data, law.clone(), 2);
                let delays = Delays {
                    state: vec![1, 17],
                    product: vec![1, 9, 33],
                    ticks: ticks.clone(),
                };
                let (_, exact) = regression.exact(&delays).expect("converges");
                let close = |squared: f64, how: &str| {
                    assert!(
                        (squared.sqrt() - exact).abs() < 1e-9,
                        "{how}: {squared} {exact}"
                    );
                };
                close(regression.normal(&delays).squared_residual(), "direct");
                regression.tabulate(&[ticks[0] + 1, ticks[1] + 2]);
                close(regression.normal(&delays).squared_residual(), "corrected");
                regression.tabulate(ticks);
                close(regression.normal(&delays).squared_residual(), "tabulated");
                let around: Vec<i64> = (-3..=3).map(|i| ticks[1] + i).collect();
                let scan = regression.scan_input(&delays, 1, &around);
                close(scan[3], "scanned");
                let first = Delays {
                    ticks: vec![ticks[0], around[6]],
                    ..delays.clone()
                };
                let (_, expected) = regression.exact(&first).expect("converges");
                assert!((scan[6].sqrt() - expected).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn memory_for_tables_is_bounded() {
        let data = records(false);
        let mut regression = regression(&data, InputDelay::Fixed { delays: None }, 1);
        for h in 0..60 {
            regression.tabulate(&[h]);
        }
        assert_eq!(regression.kept.len(), TABLES_KEPT);
        assert!(regression.table(Which::Single(59)).is_some());
        assert!(regression.table(Which::Single(0)).is_none());
    }
}
