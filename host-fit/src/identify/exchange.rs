//! Exchange steps for the one-step objective: the best single lag, pair of lags or input delay to replace present
//! ones, evaluated for all lags at once.
//!
//! With the other regressors factorised, the gain of a new regressor needs one forward substitution and one
//! division. This is done for a whole row of the table (all lags) at a time.

use super::arrival::Weights;
use super::lagged_products::{ONE, TARGET, Table};
use super::layout::{Column, Delays};
use super::regression::Regression;
use numerics::linalg::Cholesky;

/// A gain with a smaller share of the residual is a rounding error.
const NEGLIGIBLE: f64 = 1e-7;

/// A new regressor must keep this share of its length after projection.
const DEPENDENT: f64 = 1e-10;

/// Which list a lag belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum List {
    State,
    Product,
}

/// One position in the lists of lags.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Slot {
    pub(crate) list: List,
    pub(crate) index: usize,
}

/// The gain of every lag of a list, given a set of regressors.
struct Projected {
    /// For each input of the block and each kept regressor: the projections, one for each lag.
    rows: Vec<Vec<Vec<f64>>>,
    /// For each input: the products with the residual of the target, one for each lag.
    target: Vec<Vec<f64>>,
    /// Squared length after projection, one per lag, for blocks of one regressor.
    left: Vec<f64>,
}

/// Exchanges lags in the tables of one setting of the input delays.
pub(crate) struct Exchange<'a> {
    regression: &'a Regression,
    ticks: Vec<i64>,
    screened: usize,
}

impl<'a> Exchange<'a> {
    /// The tables at `ticks` must have been built.
    pub(crate) fn new(regression: &'a Regression, ticks: &[i64]) -> Self {
        Self {
            regression,
            ticks: ticks.to_vec(),
            screened: 0,
        }
    }

    /// Candidates judged so far.
    pub(crate) fn screened(&self) -> usize {
        self.screened
    }

    /// Squared residual norm of a candidate.
    pub(crate) fn residual(&self, delays: &Delays) -> f64 {
        self.regression.normal(delays).squared_residual()
    }

    /// Replaces one lag after the other by the best one until none improves the fit. Returns the squared residual
    /// norm.
    pub(crate) fn descend(&mut self, delays: &mut Delays) -> f64 {
        self.complete(delays);
        let mut best = self.residual(delays);
        let slots = self.slots(delays);
        let mut since = 0;
        for slot in slots.iter().cycle() {
            if since >= slots.len() {
                break;
            }
            since += 1;
            if let Some((lag, residual)) = self.best_single(delays, *slot)
                && residual < best * (1.0 - NEGLIGIBLE)
            {
                // Smooth records are badly conditioned: an update is accepted only if the recomputed residual
                // falls.
                let before = delays.clone();
                set(delays, *slot, lag);
                let reached = self.residual(delays);
                if reached < best * (1.0 - NEGLIGIBLE) {
                    best = reached;
                    since = 0;
                } else {
                    *delays = before;
                }
            }
        }
        sort(delays);
        best
    }

    /// Replaces pairs of lags by the best pair until none improves the fit or the number of sweeps is used up;
    /// single exchanges are included.
    pub(crate) fn descend_in_pairs(
        &mut self,
        delays: &mut Delays,
        mut keep_going: impl FnMut() -> bool,
    ) -> f64 {
        let mut best = self.descend(delays);
        let slots = self.slots(delays);
        let pairs: Vec<(Slot, Slot)> = slots
            .iter()
            .enumerate()
            .flat_map(|(i, a)| slots.iter().skip(i + 1).map(|b| (*a, *b)))
            .collect();
        let mut since = 0;
        for (first, second) in pairs.iter().cycle() {
            if since >= pairs.len() || !keep_going() {
                break;
            }
            since += 1;
            if let Some((lags, residual)) = self.best_pair(delays, *first, *second)
                && residual < best * (1.0 - NEGLIGIBLE)
            {
                let mut trial = delays.clone();
                set(&mut trial, *first, lags.0);
                set(&mut trial, *second, lags.1);
                let reached = self.descend(&mut trial);
                if reached < best * (1.0 - NEGLIGIBLE) {
                    *delays = trial;
                    best = reached;
                    since = 0;
                }
            }
        }
        best
    }

    /// Fills lists shortened by repeated lags with lags not yet used.
    fn complete(&self, delays: &mut Delays) {
        let layout = &self.regression.layout;
        for (list, count) in [
            (&mut delays.state, layout.state_lags),
            (&mut delays.product, layout.product_lags),
        ] {
            for lag in 1..=layout.longest_lag {
                if list.len() >= count {
                    break;
                }
                if !list.contains(&lag) {
                    list.push(lag);
                }
            }
        }
        sort(delays);
    }

    /// All slots that can hold a lag.
    ///
    /// Equal lags are merged in the list; the freed slots follow it, so that they can be filled again.
    pub(crate) fn slots(&self, delays: &Delays) -> Vec<Slot> {
        let layout = &self.regression.layout;
        let slots = |list: List, lags: usize, wanted: usize| {
            (0..lags.max(wanted)).map(move |index| Slot { list, index })
        };
        slots(List::State, delays.state.len(), layout.state_lags)
            .chain(slots(
                List::Product,
                delays.product.len(),
                layout.product_lags,
            ))
            .collect()
    }

    /// The lag of this slot with the smallest residual, and that residual.
    pub(crate) fn best_single(&mut self, delays: &Delays, slot: Slot) -> Option<(u16, f64)> {
        let kept = self.kept(delays, &[slot]);
        let (factor, w) = self.factorise(&kept);
        let rest = self.rest(&w);
        let inputs = self.inputs(slot.list);
        let projected = self.project(&kept, &factor, &w, &inputs)?;
        let used = used(delays, slot.list, &[slot]);
        let mut best: Option<(u16, f64)> = None;
        for c in 0..usize::from(self.regression.layout.longest_lag) {
            let lag = c as u16 + 1;
            if used.contains(&lag) {
                continue;
            }
            let gain = if inputs.len() == 1 {
                gain(projected.target[0][c], projected.left[c])
            } else {
                self.block_gain(&projected, &inputs, c)?
            };
            let residual = rest - gain;
            if best.is_none_or(|(_, b)| residual < b) {
                best = Some((lag, residual));
            }
        }
        self.screened += usize::from(self.regression.layout.longest_lag);
        best.map(|(lag, residual)| (lag, residual.max(0.0)))
    }

    /// The pair of lags that leaves the smallest residual in two slots, where a
    /// lag is one regressor (a single input).
    pub(crate) fn best_pair(
        &mut self,
        delays: &Delays,
        first: Slot,
        second: Slot,
    ) -> Option<((u16, u16), f64)> {
        let (one, two) = (self.inputs(first.list), self.inputs(second.list));
        if one.len() != 1 || two.len() != 1 {
            return None;
        }
        let kept = self.kept(delays, &[first, second]);
        let (factor, w) = self.factorise(&kept);
        let rest = self.rest(&w);
        let a = self.project(&kept, &factor, &w, &one)?;
        let b = self.project(&kept, &factor, &w, &two)?;
        let table = self.table(one[0], two[0])?;
        let (used_one, used_two) = (
            used(delays, first.list, &[first, second]),
            used(delays, second.list, &[first, second]),
        );
        let lags = usize::from(self.regression.layout.longest_lag);
        let same = first.list == second.list;
        let mut best: Option<((u16, u16), f64)> = None;
        let mut best_gain = 0.0;
        let mut cross = vec![0.0; lags];
        for c in 0..lags {
            if used_one.contains(&(c as u16 + 1)) || a.left[c] <= 0.0 {
                continue;
            }
            let element = self.regression.layout.element(c as u16 + 1);
            cross.copy_from_slice(self.lag_range(table.row(element)));
            for (ra, rb) in a.rows[0].iter().zip(&b.rows[0]) {
                let factor = ra[c];
                cross.iter_mut().zip(rb).for_each(|(x, r)| *x -= factor * r);
            }
            let (left, target) = (a.left[c], a.target[0][c]);
            let alone = gain(target, left);
            for d in if same { c + 1..lags } else { 0..lags } {
                // The additional gain of the second lag, given the first.
                let share = cross[d] / left;
                let left_d = b.left[d] - share * cross[d];
                let target_d = b.target[0][d] - share * target;
                if left_d > DEPENDENT.sqrt() * b.left[d] {
                    let both = alone + target_d * target_d / left_d;
                    if both > best_gain && !used_two.contains(&(d as u16 + 1)) {
                        best_gain = both;
                        best = Some(((c as u16 + 1, d as u16 + 1), rest - both));
                    }
                }
            }
        }
        self.screened += if same {
            lags * (lags - 1) / 2
        } else {
            lags * lags
        };
        best
    }

    fn inputs(&self, list: List) -> Vec<usize> {
        match list {
            List::State => vec![0],
            List::Product => (1..=self.ticks.len()).collect(),
        }
    }

    fn table(&self, l: usize, m: usize) -> Option<&'a Table> {
        self.regression
            .table(self.regression.which(l, m, &self.ticks))
    }

    fn lag_range<'r>(&self, row: &'r [f64]) -> &'r [f64] {
        let first = self.regression.layout.element(1);
        &row[first..first + usize::from(self.regression.layout.longest_lag)]
    }

    /// The columns of all regressors except those of some slots.
    fn kept(&self, delays: &Delays, without: &[Slot]) -> Vec<Column> {
        let layout = &self.regression.layout;
        let keep = |list: List, index: usize| !without.contains(&Slot { list, index });
        let mut kept: Vec<Column> = Vec::new();
        for (index, lag) in delays.state.iter().enumerate() {
            if keep(List::State, index) {
                kept.push(Column {
                    input: 0,
                    element: layout.element(*lag),
                });
            }
        }
        for input in 1..=self.ticks.len() {
            kept.push(Column {
                input,
                element: ONE,
            });
            for (index, lag) in delays.product.iter().enumerate() {
                if keep(List::Product, index) {
                    kept.push(Column {
                        input,
                        element: layout.element(*lag),
                    });
                }
            }
        }
        if layout.constant {
            kept.push(Column {
                input: 0,
                element: ONE,
            });
        }
        kept
    }

    fn entry(&self, a: Column, b: Column) -> f64 {
        self.table(a.input, b.input)
            .map_or(0.0, |t| t.at(a.element, b.element))
    }

    fn factorise(&self, kept: &[Column]) -> (Cholesky, Vec<f64>) {
        let n = kept.len();
        let mut gram = vec![0.0; n * n];
        for (p, a) in kept.iter().enumerate() {
            for (q, b) in kept.iter().enumerate() {
                gram[p * n + q] = self.entry(*a, *b);
            }
        }
        let factor = Cholesky::new(&gram, n);
        let target = Column {
            input: 0,
            element: TARGET,
        };
        let rhs: Vec<f64> = kept.iter().map(|c| self.entry(*c, target)).collect();
        let w = factor.forward(&rhs);
        (factor, w)
    }

    fn rest(&self, w: &[f64]) -> f64 {
        let target = Column {
            input: 0,
            element: TARGET,
        };
        self.entry(target, target) - w.iter().map(|w| w * w).sum::<f64>()
    }

    fn project(
        &self,
        kept: &[Column],
        factor: &Cholesky,
        w: &[f64],
        inputs: &[usize],
    ) -> Option<Projected> {
        let lags = usize::from(self.regression.layout.longest_lag);
        let mut projected = Projected {
            rows: Vec::new(),
            target: Vec::new(),
            left: vec![0.0; lags],
        };
        for &input in inputs {
            let mut rows: Vec<Vec<f64>> = Vec::with_capacity(kept.len());
            let mut target = self.lag_range(self.table(input, 0)?.row(TARGET)).to_vec();
            for (i, column) in kept.iter().enumerate() {
                let mut row = self
                    .lag_range(self.table(input, column.input)?.row(column.element))
                    .to_vec();
                for (j, before) in rows.iter().enumerate() {
                    let l = factor.below(i, j);
                    row.iter_mut().zip(before).for_each(|(x, b)| *x -= l * b);
                }
                let inverse = factor.inverse(i);
                row.iter_mut().for_each(|x| *x *= inverse);
                target
                    .iter_mut()
                    .zip(&row)
                    .for_each(|(t, x)| *t -= w[i] * x);
                rows.push(row);
            }
            if inputs.len() == 1 {
                let table = self.table(input, input)?;
                for (c, left) in projected.left.iter_mut().enumerate() {
                    let element = self.regression.layout.element(c as u16 + 1);
                    *left = table.at(element, element);
                }
                let whole = projected.left.clone();
                for row in &rows {
                    projected
                        .left
                        .iter_mut()
                        .zip(row)
                        .for_each(|(l, x)| *l -= x * x);
                }
                for (left, whole) in projected.left.iter_mut().zip(whole) {
                    if *left <= DEPENDENT * whole {
                        *left = 0.0;
                    }
                }
            }
            projected.rows.push(rows);
            projected.target.push(target);
        }
        Some(projected)
    }

    /// The gain of one lag through all inputs together.
    fn block_gain(&self, projected: &Projected, inputs: &[usize], c: usize) -> Option<f64> {
        let q = inputs.len();
        let element = self.regression.layout.element(c as u16 + 1);
        let mut left = vec![0.0; q * q];
        for i in 0..q {
            for j in 0..=i {
                let mut value = self.table(inputs[i], inputs[j])?.at(element, element);
                for (a, b) in projected.rows[i].iter().zip(&projected.rows[j]) {
                    value -= a[c] * b[c];
                }
                left[i * q + j] = value;
                left[j * q + i] = value;
            }
        }
        let target: Vec<f64> = projected.target.iter().map(|t| t[c]).collect();
        Some(
            Cholesky::new(&left, q)
                .forward(&target)
                .iter()
                .map(|w| w * w)
                .sum(),
        )
    }
}

fn gain(target: f64, left: f64) -> f64 {
    if left > 0.0 {
        target * target / left
    } else {
        0.0
    }
}

fn used(delays: &Delays, list: List, without: &[Slot]) -> Vec<u16> {
    let lags = match list {
        List::State => &delays.state,
        List::Product => &delays.product,
    };
    lags.iter()
        .enumerate()
        .filter(|(index, _)| {
            !without.contains(&Slot {
                list,
                index: *index,
            })
        })
        .map(|(_, lag)| *lag)
        .collect()
}

pub(crate) fn set(delays: &mut Delays, slot: Slot, lag: u16) {
    let list = match slot.list {
        List::State => &mut delays.state,
        List::Product => &mut delays.product,
    };
    match list.get_mut(slot.index) {
        Some(place) => *place = lag,
        // The slot is free because its lag had become equal to another lag.
        None => list.push(lag),
    }
}

fn sort(delays: &mut Delays) {
    delays.state.sort_unstable();
    delays.product.sort_unstable();
}

/// Best delay of one input with unchanged lags: a scan in steps of half a sample, then finer around the best.
/// Returns the tick and the squared residual norm, and adds to `screened`.
pub(crate) fn best_input(
    regression: &Regression,
    delays: &Delays,
    input: usize,
    bounds: (i64, i64),
    screened: &mut usize,
) -> Option<(i64, f64)> {
    let per_sample = regression.signals.ticks_per_sample();
    // Without on/off edges each point of a scan sums over all samples, so whole samples are scanned first.
    let graded = matches!(regression.signals.arrived(0), Weights::Samples(_));
    let mut stride = (per_sample * if graded { 8.0 } else { 0.5 }).max(1.0) as i64;
    let (mut low, mut high) = bounds;
    let mut best: Option<(i64, f64)> = None;
    loop {
        let ticks: Vec<i64> = (0..)
            .map(|i| low + i * stride)
            .take_while(|t| *t <= high)
            .collect();
        *screened += ticks.len();
        for (tick, residual) in ticks
            .iter()
            .zip(regression.scan_input(delays, input, &ticks))
        {
            if best.is_none_or(|(_, b)| residual < b) {
                best = Some((*tick, residual));
            }
        }
        if stride == 1 {
            return best;
        }
        let centre = best?.0;
        (low, high) = (
            (centre - stride).max(bounds.0),
            (centre + stride).min(bounds.1),
        );
        stride = (stride / 8).max(1);
    }
}

#[cfg(test)]
mod tests {
    use super::super::structure::{InputDelay, Series, Structure};
    use super::*;

    fn regression(inputs: usize) -> Regression {
        let n = 1500;
        let u: Vec<f64> = (0..n)
            .map(|k| f64::from(u8::from((k / 83) % 2 == 1 && k % 7 != 3)))
            .collect();
        let mut y = vec![0.0f64; n];
        let mut noise = 7u32;
        for k in 1..n {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let w = f64::from(noise >> 8) / f64::from(1 << 24) - 0.5;
            let at = |lag: usize| if k > lag { y[k - 1 - lag] } else { 0.0 };
            let on = if k > 12 { u[k - 1 - 11] } else { 0.0 };
            y[k] = 0.9 * at(0) + 0.05 * at(20) + on * (0.08 - 0.03 * at(5)) + 0.03 * w;
        }
        let structure = Structure {
            state_lags: 2,
            product_lags: 2,
            inputs,
            longest_lag: 30,
            delay: InputDelay::Fixed { delays: None },
            ..Structure::default()
        };
        Regression::new(&[Series { u: &u, y: &y }], &structure)
    }

    /// The exchange formulas agree with the evaluation of every candidate.
    #[test]
    fn singles_and_pairs_equal_trying_every_lag() {
        for (inputs, ticks) in [(1, vec![11]), (2, vec![5, 11])] {
            let mut regression = regression(inputs);
            regression.tabulate(&ticks);
            let delays = Delays {
                state: vec![2, 9],
                product: vec![3, 14],
                ticks: ticks.clone(),
            };
            let mut exchange = Exchange::new(&regression, &ticks);
            let slots = exchange.slots(&delays);
            let residual = |slot_lags: &[(Slot, u16)]| {
                let mut trial = delays.clone();
                slot_lags
                    .iter()
                    .for_each(|(slot, lag)| set(&mut trial, *slot, *lag));
                if trial.state[0] == trial.state[1] || trial.product[0] == trial.product[1] {
                    return f64::INFINITY;
                }
                regression.normal(&trial).squared_residual()
            };
            for slot in &slots {
                let (lag, found) = exchange
                    .best_single(&delays, *slot)
                    .expect("tables are built");
                let best = (1..=30)
                    .map(|lag| residual(&[(*slot, lag)]))
                    .fold(f64::INFINITY, f64::min);
                assert!(
                    (found - best).abs() < 1e-9 && (residual(&[(*slot, lag)]) - best).abs() < 1e-9
                );
            }
            for (first, second) in [(0, 1), (0, 2), (2, 3)] {
                let (first, second) = (slots[first], slots[second]);
                let Some((lags, found)) = exchange.best_pair(&delays, first, second) else {
                    assert_eq!(inputs, 2);
                    continue;
                };
                let best = (1..=30)
                    .flat_map(|a| (1..=30).map(move |b| (a, b)))
                    .map(|(a, b)| residual(&[(first, a), (second, b)]))
                    .fold(f64::INFINITY, f64::min);
                assert!((found - best).abs() < 1e-9);
                assert!((residual(&[(first, lags.0), (second, lags.1)]) - best).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_slot_left_empty_by_equal_lags_is_filled_again() {
        let mut regression = regression(1);
        regression.tabulate(&[11]);
        let mut delays = Delays {
            state: vec![1],
            product: vec![5],
            ticks: vec![11],
        };
        Exchange::new(&regression, &[11]).descend(&mut delays);
        assert_eq!((delays.state.len(), delays.product.len()), (2, 2));
        assert!(delays.state.contains(&21), "{delays:?}");
    }

    #[test]
    fn descent_and_input_scan_find_the_truth() {
        let mut regression = regression(1);
        regression.tabulate(&[20]);
        let mut delays = Delays {
            state: vec![4, 4],
            product: vec![9, 17],
            ticks: vec![20],
        };
        let mut screened = 0;
        for _ in 0..3 {
            let ticks = delays.ticks.clone();
            regression.tabulate(&ticks);
            Exchange::new(&regression, &ticks).descend_in_pairs(&mut delays, || true);
            let (tick, _) =
                best_input(&regression, &delays, 0, (0, 30), &mut screened).expect("30 delays");
            delays.ticks = vec![tick];
        }
        assert_eq!(delays.ticks, [11]);
        assert_eq!(delays.state, [1, 21]);
        assert!((4..=8).contains(&delays.product[0]), "{delays:?}");
    }
}
