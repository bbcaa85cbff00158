//! A fit of one plant with a dead time to whole records.
//!
//! Every record is described by y = level + initial state + K·(response to u, delayed by h): the plant of [`Plant`],
//! one gain K for all records, a level and a free initial state (one value for each order) per record. Gain, levels and
//! initial states are linear and eliminated exactly (variable projection); h, S and b are searched, on a grid over
//! decimated records first, then by Levenberg–Marquardt on all samples. h is real, so its resolution is not that of the
//! clock.

use super::plant::{Plant, Switching};
use super::spread::mean;
use crate::data::Record;
use crate::noise::without_outliers;
use crate::order;
use numerics::linalg::{dot, dots, gram, solve_symmetric};

/// Largest number of samples for the grid search; longer records are decimated.
const COARSE_SAMPLES: usize = 2_000;
/// Sums of time constants that the grid search tries, in steps of this factor.
const COARSE_STEP: f64 = 1.5;
/// Ratios b of the grid search: first order, and nearly equal time constants.
const COARSE_RATIOS: [f64; 2] = [0.0, 0.2];
/// Number of grid minima, over the time constants, that are refined.
const COARSE_STARTS: usize = 3;
/// Time constant of a response within one sample, in samples, and number of delays that the grid search
/// tries with it.
const IMMEDIATE: f64 = 0.2;
const IMMEDIATE_DELAYS: usize = 300;
/// Largest ratio b, at which the damping ratio is 0.05.
pub(crate) const LARGEST_RATIO: f64 = 100.0;
/// Ratios from which a second order starts.
const STARTS: [f64; 3] = [0.02, 0.1, 0.25];
/// Prior standard deviations of ln S and b around the fit. The linearisation at the fit is valid within a factor e of
/// S, and over the ratios b of two lags in series.
const SCALES: [f64; 2] = [1.0, 0.15];
/// Steps of Levenberg–Marquardt.
const STEPS: usize = 40;

/// One record prepared for fits.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    /// y minus its mean; 0 before `from`.
    pub(crate) y: Vec<f64>,
    /// The changes of u.
    pub(crate) switching: Switching,
    /// The first used sample: earlier ones respond to commands before the record.
    pub(crate) from: usize,
    /// ρ of the prewhitening filter 1 − ρ·z⁻¹. It was applied to y, and is applied to responses before they are
    /// compared with y.
    pub(crate) whitening: f64,
}

impl Series {
    /// A prepared record whose command is on above `middle`.
    pub(crate) fn new(record: &Record, middle: f64) -> Self {
        let first = record.u.first().copied().unwrap_or(0.0);
        let before = record.u_before.unwrap_or(first);
        let from = record.followed.len().min(record.len());
        let counted = without_outliers(&record.y[from..]);
        let level = mean(&counted);
        let counted = counted.iter().map(|y| y - level);
        Self {
            y: std::iter::repeat_n(0.0, from).chain(counted).collect(),
            switching: Switching::of(&record.u, before, middle),
            from,
            whitening: 0.0,
        }
    }

    /// Filters values as y is, and sets unused samples to 0.
    fn counted(&self, values: &mut [f64]) {
        prewhiten(values, self.whitening);
        // The first sample has no predecessor.
        let unused = self.from + usize::from(self.whitening > 0.0);
        values.iter_mut().take(unused).for_each(|v| *v = 0.0);
    }

    /// Prewhitens y and the responses, for a disturbance of y with this correlation of neighbouring samples.
    pub(crate) fn whitened(&self, correlation: f64) -> Self {
        let mut whitened = Self {
            whitening: correlation,
            ..self.clone()
        };
        let mut y = std::mem::take(&mut whitened.y);
        whitened.counted(&mut y);
        Self { y, ..whitened }
    }

    /// Decimated by means over `factor` samples, each at the middle of its block.
    pub(crate) fn thinned(&self, factor: usize) -> Self {
        if factor <= 1 {
            return self.clone();
        }
        let scale = factor as f64;
        let mut switching = self.switching.clone();
        for change in &mut switching.changes {
            change.time = (change.time - (scale - 1.0) / 2.0) / scale;
        }
        Self {
            y: self.y.chunks_exact(factor).map(mean).collect(),
            switching,
            from: self.from.div_ceil(factor),
            ..*self
        }
    }

    /// Every `factor`-th sample; no smoothing, unlike [`thinned`](Self::thinned).
    pub(crate) fn picked(&self, factor: usize) -> Self {
        let factor = factor.max(1);
        let mut switching = self.switching.clone();
        for change in &mut switching.changes {
            change.time /= factor as f64;
        }
        Self {
            y: self.y.iter().step_by(factor).copied().collect(),
            switching,
            from: self.from.div_ceil(factor),
            ..*self
        }
    }

    /// The response of a plant from rest with gain 1 on the used samples, written into `out`.
    fn respond(&self, plant: &Plant, out: &mut [f64]) {
        plant.respond(&self.switching, out);
        self.counted(out);
    }

    /// Residual of y for a plant with a gain; level and initial state of the record are eliminated.
    pub(crate) fn residual(&self, plant: &Plant, gain: f64) -> Vec<f64> {
        let mut residual = self.y.clone();
        let mut response = vec![0.0; residual.len()];
        self.respond(plant, &mut response);
        residual
            .iter_mut()
            .zip(&response)
            .for_each(|(y, r)| *y -= gain * r);
        self.without_nuisance(plant, &mut residual);
        residual
    }

    /// Orthonormal basis of the output without command: a constant and the free responses.
    fn basis(&self, plant: &Plant) -> Vec<Vec<f64>> {
        let n = self.y.len();
        let mut basis: Vec<Vec<f64>> = Vec::with_capacity(3);
        for mut column in std::iter::once(vec![1.0; n]).chain(plant.free(&self.switching, n)) {
            self.counted(&mut column);
            let before = dot(&column, &column);
            // The projection is repeated once to remove rounding errors.
            for _ in 0..2 {
                remove(&basis, &mut column);
            }
            let square = dot(&column, &column);
            if square > 1e-10 * before {
                let norm = square.sqrt();
                column.iter_mut().for_each(|c| *c /= norm);
                basis.push(column);
            }
        }
        basis
    }

    /// Projects level and free responses out of `values` (one per sample of the record).
    pub(crate) fn without_nuisance(&self, plant: &Plant, values: &mut [f64]) {
        remove(&self.basis(plant), values);
    }
}

/// Filters values by 1 − ρ·z⁻¹; the values before the first count as 0.
pub(crate) fn prewhiten(values: &mut [f64], correlation: f64) {
    if correlation > 0.0 {
        for k in (1..values.len()).rev() {
            values[k] -= correlation * values[k - 1];
        }
    }
}

/// Projects an orthonormal basis out of `column`.
fn remove(basis: &[Vec<f64>], column: &mut [f64]) {
    for b in basis {
        let share = dot(b, column);
        column.iter_mut().zip(b).for_each(|(c, b)| *c -= share * b);
    }
}

/// The best linear part at one plant.
#[derive(Debug, Clone)]
pub(crate) struct Evaluation {
    /// The plant.
    pub(crate) plant: Plant,
    /// K, units of y per unit of u.
    pub(crate) gain: f64,
    /// y minus the fit, one series for each record.
    pub(crate) residuals: Vec<Vec<f64>>,
    /// Sum of squares of `residuals`.
    pub(crate) rss: f64,
    /// The reduction of the sum of squares by the command.
    pub(crate) explained: f64,
}

/// Orthonormal bases of all records at one plant, and y without them.
struct Eliminated {
    bases: Vec<Vec<Vec<f64>>>,
    y: Vec<Vec<f64>>,
    square: f64,
}

fn eliminate(series: &[Series], plant: &Plant) -> Eliminated {
    let bases: Vec<_> = series.iter().map(|s| s.basis(plant)).collect();
    let y: Vec<Vec<f64>> = series
        .iter()
        .zip(&bases)
        .map(|(s, basis)| {
            let mut y = s.y.clone();
            remove(basis, &mut y);
            y
        })
        .collect();
    Eliminated {
        bases,
        square: y.iter().map(|y| dot(y, y)).sum(),
        y,
    }
}

/// The best gain and the remaining sum of squares. `None` if the command has no influence.
fn gain_and_rss(
    series: &[Series],
    parts: &Eliminated,
    plant: &Plant,
    responses: &mut Vec<Vec<f64>>,
) -> Option<(f64, f64)> {
    let (mut with_y, mut square) = (0.0, 0.0);
    responses.resize(series.len(), Vec::new());
    for (((s, basis), y), response) in series.iter().zip(&parts.bases).zip(&parts.y).zip(responses)
    {
        response.resize(s.y.len(), 0.0);
        s.respond(plant, response);
        remove(basis, response);
        with_y += dot(response, y);
        square += dot(response, response);
    }
    (square > 0.0).then(|| {
        let gain = with_y / square;
        (gain, (parts.square - gain * with_y).max(0.0))
    })
}

/// The best linear part at `plant`.
pub(crate) fn evaluate(series: &[Series], plant: Plant) -> Option<Evaluation> {
    let parts = eliminate(series, &plant);
    let mut responses = Vec::new();
    let (gain, _) = gain_and_rss(series, &parts, &plant, &mut responses)?;
    let mut residuals = parts.y;
    for (residual, response) in residuals.iter_mut().zip(&responses) {
        residual
            .iter_mut()
            .zip(response)
            .for_each(|(y, r)| *y -= gain * r);
    }
    let rss = residuals.iter().map(|r| dot(r, r)).sum();
    Some(Evaluation {
        plant,
        gain,
        residuals,
        rss,
        explained: parts.square - rss,
    })
}

/// Initial linear plants of first and second order from a grid over decimated records: the deepest minima
/// along the time constants. There may be several, because a free initial state can imitate a response. Records are
/// prewhitened for a disturbance with this `correlation` of neighbouring samples.
pub(crate) fn coarse(
    series: &[Series],
    max_delay: f64,
    spacing: usize,
    correlation: f64,
) -> Vec<Plant> {
    let samples: usize = series.iter().map(|s| s.y.len()).sum();
    let factor = samples
        .div_ceil(COARSE_SAMPLES)
        .min((spacing / 8).max(1))
        .max(1);
    let thinned = series.iter().map(|s| s.thinned(factor));
    let thinned: Vec<Series> = thinned
        .map(|s| s.whitened(correlation.powf(factor as f64)))
        .collect();
    let longest = thinned.iter().map(|s| s.y.len()).max().unwrap_or(0) as f64;
    let last = (max_delay / factor as f64).floor().max(1.0);
    let mut starts = Vec::new();
    let mut responses = Vec::new();
    let mut least = f64::INFINITY;
    for ratio in COARSE_RATIOS {
        // The best plant for each time constant.
        let mut floor: Vec<(f64, Plant)> = Vec::new();
        // For a long range of delays the shortest time constants would need too many steps, without better
        // resolution.
        let mut sum = (last / 300.0).max(1.0);
        while sum < 4.0 * longest {
            // A linear plant's free response does not depend on the dead time.
            let parts = eliminate(&thinned, &Plant::linear(0.0, sum, ratio));
            // The response hardly changes within a quarter of its time constant.
            let step = (sum / 4.0).floor().clamp(1.0, (last / 16.0).max(1.0));
            let mut best: Option<(f64, Plant)> = None;
            let mut delay = 0.0;
            while delay <= last {
                let plant = Plant::linear(delay, sum, ratio);
                if let Some((_, rss)) = gain_and_rss(&thinned, &parts, &plant, &mut responses)
                    && best.as_ref().is_none_or(|b| rss < b.0)
                {
                    best = Some((rss, plant));
                }
                delay += step;
            }
            floor.extend(best);
            sum *= COARSE_STEP;
        }
        let at = |i: usize| floor.get(i).map_or(f64::INFINITY, |f| f.0);
        let is_valley = |i: usize| {
            at(i) <= at(i + 1) && i.checked_sub(1).is_none_or(|before| at(i) < at(before))
        };
        let mut valleys: Vec<&(f64, Plant)> = floor
            .iter()
            .enumerate()
            .filter(|(i, _)| is_valley(*i))
            .map(|(_, f)| f)
            .collect();
        order::ascending(&mut valleys, |one| one.0);
        least = valleys.first().map_or(least, |(rss, _)| least.min(*rss));
        let best = valleys.into_iter().take(COARSE_STARTS);
        starts.extend(best.map(|(_, plant)| plant.slower(factor as f64)));
    }
    // A response within one sample lies below the shortest time constant of a long range of delays.
    let parts = eliminate(&thinned, &Plant::linear(0.0, IMMEDIATE, 0.0));
    let mut immediate = None;
    for delay in 0..=(last as usize).min(IMMEDIATE_DELAYS) {
        let plant = Plant::linear(delay as f64, IMMEDIATE, 0.0);
        if let Some((_, rss)) = gain_and_rss(&thinned, &parts, &plant, &mut responses)
            && rss < least
        {
            least = rss;
            immediate = Some(plant.slower(factor as f64));
        }
    }
    starts.extend(immediate);
    starts
}

/// The parameters that a refinement may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Free {
    /// b, in addition to h and S.
    pub(crate) order: bool,
    /// The difference of S between on and off.
    pub(crate) dynamics: bool,
    /// The difference of h between rising and falling.
    pub(crate) delays: bool,
}

impl Free {
    /// h and S only.
    pub(crate) const DELAY: Self = Self {
        order: false,
        dynamics: false,
        delays: false,
    };

    /// Options with b free or fixed.
    pub(crate) fn with_order(self, order: bool) -> Self {
        Self { order, ..self }
    }

    /// Indices of the parameters: h, ln S, b, difference of h, difference of ln S.
    fn axes(self) -> Vec<usize> {
        let further = [(self.order, 2), (self.delays, 3), (self.dynamics, 4)];
        let further = further.into_iter().filter(|f| f.0).map(|f| f.1);
        [0, 1].into_iter().chain(further).collect()
    }
}

/// Result of Levenberg–Marquardt.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    /// The fit.
    pub(crate) at: Evaluation,
    /// JᵀJ over the free parameters, row by row.
    information: Vec<f64>,
    /// The fitted parameters.
    free: Free,
}

impl Refined {
    /// The covariance of the free parameters for a residual variance, with the priors of [`SCALES`]. Without them a
    /// parameter that has no effect at the fit, such as b of a vanishing second lag, makes the interval of h infinite.
    pub(crate) fn covariance(&self, noise: f64) -> Option<Vec<f64>> {
        let axes = self.free.axes();
        let size = axes.len();
        // The linearisation in h is valid for shifts up to the length of the response.
        let shift = 1.0 + self.at.plant.mean_sum();
        let [sum, ratio] = SCALES;
        let scales = [shift, sum, ratio, shift, sum];
        let mut precision: Vec<f64> = self.information.iter().map(|v| v / noise).collect();
        for (place, axis) in axes.iter().enumerate() {
            precision[place * size + place] += scales[*axis].powi(-2);
        }
        let columns = (0..size).map(|axis| {
            let unit: Vec<f64> = (0..size).map(|i| f64::from(u8::from(i == axis))).collect();
            solve_symmetric(&precision, &unit)
        });
        Some(columns.collect::<Option<Vec<_>>>()?.concat())
    }
}

/// Levenberg–Marquardt over the free parameters.
pub(crate) fn refine(
    series: &[Series],
    start: Plant,
    free: Free,
    max_delay: f64,
) -> Option<Refined> {
    let axes = free.axes();
    let size = axes.len();
    let longest = series.iter().map(|s| s.y.len()).max().unwrap_or(0) as f64;
    let moved = |p: Plant, along: &[f64]| {
        let by = |axis: usize| -> f64 {
            let place = axes.iter().position(|a| *a == axis);
            place.and_then(|i| along.get(i)).copied().unwrap_or(0.0)
        };
        let (apart, stretch) = (by(3) / 2.0, by(4) / 2.0);
        let sum = |s: f64, stretch: f64| {
            (s * (by(1) + stretch).clamp(-1.0, 1.0).exp()).clamp(0.02, 20.0 * longest)
        };
        let delay = |h: f64, apart: f64| (h + by(0) + apart).clamp(0.0, max_delay);
        Plant {
            delay: [delay(p.delay[0], apart), delay(p.delay[1], -apart)],
            sum: [sum(p.sum[0], stretch), sum(p.sum[1], -stretch)],
            ratio: (p.ratio + by(2)).clamp(0.0, LARGEST_RATIO),
            third: p.third,
        }
    };
    let mut at = evaluate(series, start)?;
    let mut damping = 1e-3;
    let mut information = Vec::new();
    for step in 0..STEPS {
        let plant = at.plant;
        // These are the steps of the difference quotients. Near a bound, backward differences are
        // used.
        let delta_h = 1e-3 * plant.mean_sum().clamp(1.0, 100.0);
        let deltas = [
            if plant.mean_delay() + delta_h > max_delay {
                -delta_h
            } else {
                delta_h
            },
            1e-4,
            // For an integrator S is very long, and b is very small.
            (1e-2 * plant.ratio).clamp(1e-7, 1e-4),
            delta_h,
            1e-4,
        ];
        let mut columns: Vec<Vec<f64>> = Vec::with_capacity(size);
        for (place, axis) in axes.iter().enumerate() {
            let delta = deltas.get(*axis).copied().unwrap_or(1e-4);
            let by: Vec<f64> = (0..size)
                .map(|i| if i == place { delta } else { 0.0 })
                .collect();
            let there = evaluate(series, moved(plant, &by))?;
            columns.push(
                at.residuals
                    .iter()
                    .flatten()
                    .zip(there.residuals.iter().flatten())
                    .map(|(here, there)| (here - there) / delta)
                    .collect(),
            );
        }
        let flat: Vec<f64> = at.residuals.iter().flatten().copied().collect();
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let right = dots(&flat, columns.iter().copied());
        let products = gram(&columns);
        information.clone_from(&products);
        if step + 1 == STEPS {
            break;
        }
        let mut improved = false;
        for _ in 0..8 {
            let mut damped = products.clone();
            damped
                .iter_mut()
                .step_by(size + 1)
                .for_each(|d| *d *= 1.0 + damping);
            let next = solve_symmetric(&damped, &right)
                .and_then(|by| evaluate(series, moved(plant, &by)))
                .filter(|next| next.rss < at.rss);
            if let Some(next) = next {
                improved = at.rss - next.rss > 1e-7 * at.rss;
                at = next;
                damping = (damping * 0.2).max(1e-9);
                break;
            }
            damping *= 6.0;
        }
        if !improved {
            break;
        }
    }
    Some(Refined {
        at,
        information,
        free,
    })
}

/// The best first-order plant, and the best second-order one if it is better, from the `starts` of
/// [`coarse`]. Empty if the command has no influence.
pub(crate) fn fit(series: &[Series], starts: &[Plant], max_delay: f64) -> Vec<Refined> {
    let (of_first, of_second): (Vec<&Plant>, Vec<&Plant>) =
        starts.iter().partition(|p| p.is_first_order());
    let least =
        |fits: &mut dyn Iterator<Item = Refined>| fits.min_by(|a, b| a.at.rss.total_cmp(&b.at.rss));
    let mut tried = of_first
        .into_iter()
        .filter_map(|start| refine(series, *start, Free::DELAY, max_delay));
    let Some(first) = least(&mut tried) else {
        return Vec::new();
    };
    // The dead time of the first-order fit contains small lags. If S is very long (an integrator), their ratios to S
    // are far below the other starts.
    let within = 0.5 * first.at.plant.mean_delay() / first.at.plant.mean_sum();
    let within = Some(within).filter(|ratio| *ratio > 0.0 && *ratio < STARTS[0]);
    let around = within.into_iter().chain(STARTS).map(|ratio| {
        let plant = first.at.plant;
        // The second time constant is about b·S; the dead time is shortened by it.
        let second = ratio * plant.mean_sum();
        Plant::linear(
            (plant.mean_delay() - second).max(0.0),
            plant.mean_sum() + second,
            ratio,
        )
    });
    let mut tried = around
        .chain(of_second.into_iter().copied())
        .filter_map(|start| refine(series, start, Free::DELAY.with_order(true), max_delay));
    let second = least(&mut tried)
        .filter(|second| second.at.rss < first.at.rss && !second.at.plant.is_first_order());
    std::iter::once(first).chain(second).collect()
}
