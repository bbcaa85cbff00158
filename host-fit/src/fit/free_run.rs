//! Fits to the free-run error ε of eq. (9): exact sensitivities by dual numbers for smooth parameters, secants for
//! stepwise ones, and standard errors robust to correlated residuals.

use super::covariance::covariance;
use super::level_scatter::LevelScatter;
use super::levenberg::{FitStop, LeastSquares, Part, minimise};
use super::rules::RULES;
use crate::data::Record;
use crate::dual::Dual;
use crate::model::{Coordinate, Delay, Kind, Model, Rounding};
use crate::parallel;
use crate::simulate::{Signals, SimulateError, Simulator};
use model_core::effect::Sign;
use model_core::{Output, Real, pairs};
use std::ops::ControlFlow;

/// Numbers of dual parts of a run: the value and the derivatives that are computed together. The last run uses the
/// smallest number that suffices for the remaining derivatives.
const FEW: usize = 8;
const SOME: usize = 12;
const MANY: usize = 20;

/// Options of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Largest number of iterations.
    pub iterations: usize,
    /// Stop when an iteration lowers the sum of squares by less than this fraction.
    pub tolerance: f64,
    /// Whether the constant d may differ from 0.
    pub constant: bool,
    /// Whether the coefficients a, b, c and d are free.
    pub linear: bool,
    /// Whether the delay law is free.
    pub delay: bool,
    /// Scatter of the level between records, if known. Errors in proportion to y then have less
    /// weight.
    pub level_scatter: Option<LevelScatter>,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            iterations: RULES.iterations,
            tolerance: RULES.tolerance,
            constant: false,
            linear: true,
            delay: true,
            level_scatter: None,
        }
    }
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model with its fitted parameters.
    pub model: Model,
    /// Σ (y − y_sim)² over the records, errors along y weighted by the scatter of the level.
    pub sum_of_squares: f64,
    /// Number of scored samples.
    pub samples: usize,
    /// Indices of the free coordinates.
    pub free: Vec<usize>,
    /// Covariance of the free coordinates, robust to correlated residuals and few records: ±1.96 standard
    /// errors is a 95 % interval. Row-major; NaN on the diagonal for coordinates that are not identifiable.
    pub covariance: Vec<f64>,
    /// Iterations made.
    pub iterations: usize,
    /// Why the fit ended.
    pub stop: FitStop,
}

impl Fit {
    /// Mean square error over the scored samples, comparable between models with different warm-ups. Infinite
    /// without samples.
    #[must_use]
    pub fn mean_square(&self) -> f64 {
        if self.samples == 0 {
            return f64::INFINITY;
        }
        self.sum_of_squares / self.samples as f64
    }

    /// Standard error of the coordinate with index `index`, if it is known.
    #[must_use]
    pub fn standard_error(&self, index: usize) -> Option<f64> {
        let n = self.free.len();
        let at = self.free.iter().position(|free| *free == index)?;
        let variance = self.covariance.get(at * n + at)?;
        (*variance >= 0.0).then(|| variance.sqrt())
    }
}

/// How a coordinate is varied.
#[derive(Clone, Copy, Debug)]
struct Searched {
    index: usize,
    logarithmic: bool,
    low: f64,
    high: f64,
    /// Half width of the secant, for stepwise coordinates.
    secant: Option<f64>,
    /// Index of a coordinate that changes by the opposite amount, so that their sum stays constant.
    against: Option<usize>,
}

impl Searched {
    fn of(index: usize, coordinate: &Coordinate) -> Self {
        match coordinate.parameter() {
            None => Self {
                index,
                logarithmic: false,
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
                secant: None,
                against: None,
            },
            Some(parameter) => Self {
                index,
                logarithmic: parameter.is_logarithmic(),
                // A sign that has a physical meaning is kept.
                low: match parameter.sign {
                    Sign::Positive => parameter.low.max(0.0),
                    Sign::Either => parameter.low,
                },
                high: parameter.high,
                secant: (!coordinate.is_smooth())
                    .then_some(RULES.secant * (parameter.high - parameter.low)),
                against: None,
            },
        }
    }

    /// d value / d searched.
    fn slope(&self, value: f64) -> f64 {
        if self.logarithmic { value } else { 1.0 }
    }

    fn moved(&self, value: f64, step: f64) -> f64 {
        let moved = if self.logarithmic {
            value * step.exp()
        } else {
            value + step
        };
        moved.clamp(self.low, self.high)
    }

    /// Lowest and highest step: limited by the bounds and by the trust region.
    fn reach(&self, value: f64) -> (f64, f64) {
        if self.logarithmic {
            let to = |bound: f64| (bound / value).ln();
            let leap = RULES.leap;
            (
                to(self.low).clamp(-leap, 0.0),
                to(self.high).clamp(0.0, leap),
            )
        } else {
            ((self.low - value).min(0.0), (self.high - value).max(0.0))
        }
    }
}

struct FreeRunProblem<'a> {
    model: &'a Model,
    signals: Vec<Signals<'a>>,
    measured: Vec<&'a [f64]>,
    axes: Vec<Searched>,
    /// Number of unscored samples at the start of each record.
    lead: Vec<usize>,
    rounding: Rounding,
    level_scatter: Option<LevelScatter>,
}

impl<'a> FreeRunProblem<'a> {
    fn new(
        model: &'a Model,
        records: &[&'a Record],
        axes: Vec<Searched>,
        rounding: Rounding,
        level_scatter: Option<LevelScatter>,
    ) -> Result<Self, SimulateError> {
        let signals: Result<Vec<_>, _> = records.iter().map(|r| Signals::of(model, r)).collect();
        Ok(Self {
            model,
            signals: signals?,
            measured: records.iter().map(|record| record.y.as_slice()).collect(),
            axes,
            lead: records.iter().map(|record| record.lead).collect(),
            rounding,
            level_scatter,
        })
    }

    /// Number of scored samples.
    fn samples(&self) -> usize {
        let each = self.measured.iter().zip(&self.lead);
        each.map(|(y, lead)| y.len().saturating_sub(*lead)).sum()
    }

    /// y_sim of a record; `None` if it diverges.
    fn run(&self, values: &[f64], record: usize) -> Option<Vec<f64>> {
        let simulator = Simulator::with_values(self.model, values, self.rounding);
        simulator.readings(&self.signals[record]).ok()
    }

    /// Residuals of a record and their Jacobian; `None` if it diverges.
    fn part(&self, values: &[f64], record: usize) -> Option<Part> {
        let (smooth, slopes): (Vec<usize>, Vec<Slopes>) = (self.axes.iter().enumerate())
            .filter(|(_, axis)| axis.secant.is_none())
            .map(|(i, axis)| {
                let own = (axis.index, axis.slope(values[axis.index]));
                let against = axis.against.map(|index| (index, -1.0));
                (i, [Some(own), against])
            })
            .unzip();
        let signals = &self.signals[record];
        let (simulated, columns) =
            derivatives(self.model, values, self.rounding, signals, &slopes)?;
        let mut jacobian: Vec<Vec<f64>> = vec![Vec::new(); self.axes.len()];
        for (axis, column) in smooth.into_iter().zip(columns) {
            jacobian[axis] = column;
        }
        let (measured, lead) = (self.measured[record], self.lead[record]);
        let residual = |(k, sim): (usize, &f64)| {
            if k < lead { 0.0 } else { measured[k] - sim }
        };
        let mut residual: Vec<f64> = simulated.iter().enumerate().map(residual).collect();
        for (axis, column) in self.axes.iter().zip(&mut jacobian) {
            let Some(half) = axis.secant else {
                let unscored = lead.min(column.len());
                column[..unscored].fill(0.0);
                continue;
            };
            let at = |shift: f64| {
                let mut moved = values.to_vec();
                moved[axis.index] = (values[axis.index] + shift).clamp(axis.low, axis.high);
                (moved[axis.index], self.run(&moved, record))
            };
            let ((above, high), (below, low)) = (at(half), at(-half));
            let (high, low) = (high?, low?);
            let width = (above - below).max(1e-12);
            let scale = axis.slope(values[axis.index]) / width;
            let slopes = high.iter().zip(&low).enumerate();
            *column = slopes
                .map(
                    |(k, (high, low))| {
                        if k < lead { 0.0 } else { (high - low) * scale }
                    },
                )
                .collect();
        }
        if let Some(scatter) = &self.level_scatter {
            let y = measured.get(lead..).unwrap_or(&[]);
            for series in jacobian.iter_mut().chain([&mut residual]) {
                let judged = series.get_mut(lead..).unwrap_or(&mut []);
                scatter.shrink(judged, y, 1);
            }
        }
        Some(Part { residual, jacobian })
    }
}

/// Direction of a derivative: up to two coordinates, each with its rate of change.
type Slopes = [Option<(usize, f64)>; 2];

/// y_sim and its derivatives along `slopes`, in as few runs as possible; `None` if it diverges.
fn derivatives(
    model: &Model,
    values: &[f64],
    rounding: Rounding,
    signals: &Signals<'_>,
    slopes: &[Slopes],
) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    if slopes.is_empty() {
        let simulator = Simulator::with_values(model, values, rounding);
        return Some((simulator.readings(signals).ok()?, Vec::new()));
    }
    let (mut simulated, mut columns, mut rest) = (Vec::new(), Vec::new(), slopes);
    while !rest.is_empty() {
        let at_once = if rest.len() < MANY {
            rest.len()
        } else {
            FEW - 1
        };
        let chunk;
        (chunk, rest) = rest.split_at(at_once);
        let (run, own) = match at_once {
            0..FEW => derivatives_at_once::<FEW>(model, values, rounding, signals, chunk)?,
            FEW..SOME => derivatives_at_once::<SOME>(model, values, rounding, signals, chunk)?,
            _ => derivatives_at_once::<MANY>(model, values, rounding, signals, chunk)?,
        };
        simulated = run;
        columns.extend(own);
    }
    Some((simulated, columns))
}

/// [`derivatives`] along fewer than `N` slopes, in one run.
fn derivatives_at_once<const N: usize>(
    model: &Model,
    values: &[f64],
    rounding: Rounding,
    signals: &Signals<'_>,
    slopes: &[Slopes],
) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let mut duals: Vec<Dual<N>> = values.iter().map(|v| Dual::constant(*v)).collect();
    for (lane, moved) in slopes.iter().enumerate() {
        for (index, slope) in moved.iter().flatten() {
            duals[*index] = duals[*index].with_slope(lane, *slope);
        }
    }
    let mut y = Vec::with_capacity(signals.u.len());
    // The clone of an empty vector has no capacity.
    let mut columns: Vec<Vec<f64>> = slopes
        .iter()
        .map(|_| Vec::with_capacity(signals.u.len()))
        .collect();
    let simulator = Simulator::with_values(model, &duals, rounding);
    let left = simulator.run(
        signals,
        #[inline(always)]
        |_, output: &Output<Dual<N>>| {
            y.push(output.measured.value());
            for (column, slope) in pairs(&mut columns, output.measured.partials()) {
                column.push(*slope);
            }
            ControlFlow::Continue(())
        },
    );
    left.is_none().then_some((y, columns))
}

impl LeastSquares for FreeRunProblem<'_> {
    fn free(&self) -> usize {
        self.axes.len()
    }

    fn cost(&self, values: &[f64], enough: f64) -> f64 {
        let simulator = Simulator::with_values(self.model, values, self.rounding);
        let each = |record: usize| {
            let (measured, lead) = (self.measured[record], self.lead[record]);
            let (mut sum, mut product, mut square) = (0.0, 0.0, 0.0);
            // With level scatter the run cannot be stopped early, because the component of the
            // error along y is known only at the end of the record.
            let enough = match self.level_scatter {
                Some(_) => f64::MAX,
                None => enough,
            };
            let left = simulator.run(&self.signals[record], |k, output: &Output<f64>| {
                if k >= lead {
                    let error = measured[k] - output.measured;
                    sum += error * error;
                    if self.level_scatter.is_some() {
                        product += error * measured[k];
                        square += measured[k] * measured[k];
                    }
                }
                // A NaN also ends the run.
                if sum <= enough {
                    ControlFlow::Continue(())
                } else {
                    ControlFlow::Break(())
                }
            });
            match &self.level_scatter {
                _ if left.is_some() || sum.is_nan() => f64::INFINITY,
                Some(scatter) => scatter.sum_of_squares(sum, product, square),
                None => sum,
            }
        };
        let sums = parallel::each(0..self.signals.len(), each);
        sums.iter().sum()
    }

    fn linearise(&self, values: &[f64]) -> Option<Vec<Part>> {
        parallel::all(0..self.signals.len(), |record| self.part(values, record))
    }

    fn reach(&self, values: &[f64]) -> Vec<(f64, f64)> {
        let reach = |axis: &Searched| axis.reach(values[axis.index]);
        self.axes.iter().map(reach).collect()
    }

    fn moved(&self, values: &[f64], step: &[f64]) -> Vec<f64> {
        let mut moved = values.to_vec();
        for (axis, step) in self.axes.iter().zip(step) {
            moved[axis.index] = axis.moved(moved[axis.index], *step);
            if let Some(index) = axis.against {
                moved[index] -= step;
            }
        }
        moved
    }
}

/// Fits the parameters of `model` to the free-run error on `records`, starting from their present values.
///
/// A rounded delay law is fitted without rounding first, so that the free run is differentiable; the
/// coefficients are then refitted with it.
///
/// # Errors
/// A missing channel, or a model whose free run diverges at the start.
pub fn fit(model: &Model, records: &[&Record], options: &FitOptions) -> Result<Fit, SimulateError> {
    let rounded = matches!(&model.delay, Delay::Law(law) if !law.interpolated);
    if !rounded {
        return descend(model, records, options, Rounding::Samples);
    }
    let smooth = descend(model, records, options, Rounding::None)?;
    let last = FitOptions {
        iterations: options.iterations.min(4),
        delay: false,
        ..*options
    };
    let rounded = descend(&smooth.model, records, &last, Rounding::Samples)?;
    Ok(Fit {
        model: rounded.model,
        sum_of_squares: rounded.sum_of_squares,
        ..smooth
    })
}

/// The free run of `model` over `record` and its derivatives with respect to the coordinates with these
/// `indices` (see [`Model::coordinates`]), in their own units; `None` if it diverges or a channel is missing.
/// Delays are not rounded.
#[must_use]
pub fn sensitivities(
    model: &Model,
    record: &Record,
    indices: &[usize],
) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let signals = Signals::of(model, record).ok()?;
    let slopes: Vec<Slopes> = indices.iter().map(|i| [Some((*i, 1.0)), None]).collect();
    derivatives(model, &model.values(), Rounding::None, &signals, &slopes)
}

fn descend(
    model: &Model,
    records: &[&Record],
    options: &FitOptions,
    rounding: Rounding,
) -> Result<Fit, SimulateError> {
    let coordinates = model.coordinates();
    let moves = |index: usize, coordinate: &Coordinate| match coordinate.parameter() {
        None => options.linear && (index > 0 || options.constant),
        Some(parameter) if parameter.low >= parameter.high => false,
        Some(_) => options.delay || !matches!(coordinate.kind, Kind::Delay(_)),
    };
    let axes: Vec<Searched> = coordinates
        .iter()
        .enumerate()
        .filter(|(index, coordinate)| moves(*index, coordinate))
        .map(|(index, coordinate)| Searched {
            against: held_sum(model, index),
            ..Searched::of(index, coordinate)
        })
        .collect();
    let mut problem = FreeRunProblem::new(model, records, axes, rounding, options.level_scatter)?;
    let samples = problem.samples();
    let values = model.values();
    let cost = problem.cost(&values, f64::INFINITY);
    if !cost.is_finite() {
        for record in records {
            model.free_run(record)?;
        }
    }
    let descent = |problem: &FreeRunProblem<'_>, values, cost| {
        minimise(problem, values, cost, options.iterations, options.tolerance)
    };
    let mut end = descent(&problem, values, cost);
    // A reading with direct jet pickup jumps when an edge crosses a sample: the error is stepwise in the
    // delays, but other parameters may still improve.
    for _ in 0..RULES.held_delays {
        if end.stop != FitStop::NoDescent {
            break;
        }
        let is_delay = |axis: &Searched| matches!(coordinates[axis.index].kind, Kind::Delay(_));
        let delays: Vec<Searched>;
        (delays, problem.axes) = problem.axes.into_iter().partition(is_delay);
        let held = descent(&problem, end.values.clone(), end.cost);
        problem.axes.extend(delays);
        problem.axes.sort_by_key(|axis| axis.index);
        if held.cost > (1.0 - options.tolerance) * end.cost {
            break;
        }
        let made = end.iterations + held.iterations;
        end = descent(&problem, held.values, held.cost);
        end.iterations += made;
    }
    let covariance = end
        .linearised
        .and_then(|(parts, information)| covariance(&parts, &information, problem.axes.len()))
        .map(|searched| in_values(&searched, &problem.axes, &end.values))
        .unwrap_or_default();
    Ok(Fit {
        model: model.with_values(&end.values),
        sum_of_squares: end.cost,
        samples,
        free: problem.axes.iter().map(|axis| axis.index).collect(),
        covariance,
        iterations: end.iterations,
        stop: end.stop,
    })
}

/// Covariance of the coordinates, transformed from that of the varied quantities.
fn in_values(searched: &[f64], axes: &[Searched], values: &[f64]) -> Vec<f64> {
    let n = axes.len();
    // ∂coordinate i/∂searched j.
    let slope = |i: usize, j: usize| match axes[j].against {
        _ if i == j => axes[j].slope(values[axes[j].index]),
        Some(index) if axes[i].index == index => -1.0,
        _ => 0.0,
    };
    // Only terms with a non-zero factor are summed: an unknown variance is NaN, and 0 · NaN is NaN.
    let along = |i: usize, value: &dyn Fn(usize) -> f64| -> f64 {
        let own = (0..n).map(|k| (k, slope(i, k)));
        let own = own.filter(|(_, slope)| *slope != 0.0);
        own.map(|(k, slope)| slope * value(k)).sum()
    };
    let cells = (0..n * n).map(|cell| (cell / n, cell % n));
    let half: Vec<f64> = cells
        .clone()
        .map(|(i, j)| along(i, &|k| searched[k * n + j]))
        .collect();
    cells.map(|(i, j)| along(j, &|k| half[i * n + k])).collect()
}

/// The coordinate that is changed in the opposite direction to the one with index `index`: a_1 for every other a_i.
/// On oversampled plants the sum of the a_i is determined to many more digits than their differences. Damping in
/// proportion to the sum would therefore freeze the differences.
fn held_sum(model: &Model, index: usize) -> Option<usize> {
    // The constant comes before a_1.
    (2..=model.a.len()).contains(&index).then_some(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use crate::model::Start;

    /// A motor's position at 1 kHz: a_1 + a_2 = 1 to many digits, and the damping lies in the difference.
    #[test]
    fn the_damping_of_an_oversampled_integrator_is_found() {
        let u: Vec<f64> = (0..4000)
            .map(|k| if k / 300 % 2 == 0 { 1.0 } else { -0.9 })
            .collect();
        let model = |pole: f64, gain: f64| Model {
            sample_period_s: 0.001,
            start: Start::Measured,
            state_lags: vec![1, 2],
            a: vec![1.0 + pole, -pole],
            product_lags: Vec::new(),
            b: vec![gain],
            c: Vec::new(),
            delay: Delay::Fixed { delays: vec![0] },
            ..Model::default()
        };
        let mut y = vec![0.0, 0.0];
        for k in 1..u.len() - 1 {
            y.push(1.998 * y[k] - 0.998 * y[k - 1] + 1e-5 * u[k]);
        }
        let record = Record::new("moves", Use::Identify, 0.001, u, y);
        let start = model(0.99, 4e-5);
        let fitted = fit(&start, &[&record], &FitOptions::default()).expect("a fit");
        assert!(
            (fitted.model.a[1] + 0.998).abs() < 1e-5,
            "{:?}",
            fitted.model.a
        );
        assert!(fitted.standard_error(1).is_some_and(|error| error < 1e-4));
    }

    /// A steep curve hides a state that grows far beyond it while the jets are on: y and its derivatives stay finite.
    #[test]
    fn derivatives_behind_a_saturated_curve_are_finite() {
        let u = (0..900).map(|k| f64::from(u8::from(k < 600))).collect();
        let mut model = Model {
            a: vec![0.99],
            b: vec![0.02],
            c: vec![0.0195],
            delay: Delay::Fixed { delays: vec![1] },
            ..Model::default()
        };
        let spec = model.spec("reading-curve").expect("a base term");
        model.add(spec, &[0.5, 0.4], None);
        let record = Record::new("grows", Use::Identify, 0.001, u, vec![0.8; 900]);
        let all: Vec<usize> = (0..model.coordinates().len()).collect();
        let (run, columns) = sensitivities(&model, &record, &all).expect("bounded");
        let limit = 0.4 * (1.0 + (0.5_f64 / 0.4).tanh());
        assert!((run[600] - limit).abs() < 1e-9, "{}", run[600]);
        assert!(columns.iter().flatten().all(|slope| slope.is_finite()));
    }

    /// A limit that no reading reaches is not identifiable; all other parameters are.
    #[test]
    fn an_unknown_coordinate_takes_no_other_interval_with_it() {
        let u: Vec<f64> = (0..6000)
            .map(|k| f64::from(u8::from(k / 170 % 2 == 1)))
            .collect();
        let mut model = Model {
            a: vec![0.98],
            b: vec![0.02],
            c: vec![0.0],
            delay: Delay::Fixed { delays: vec![12] },
            ..Model::default()
        };
        let spec = model.spec("sensor-saturation").expect("in the catalogue");
        model.add(spec, &[-5.0, 5.0], None);
        let mut record = Record::new("r", Use::Identify, 0.001, u, vec![1.0; 6000]);
        record.y = model.free_run(&record).expect("stable");
        for (k, y) in record.y.iter_mut().enumerate() {
            *y += 0.01 * f64::from((k * 7919 % 13) as u8) - 0.06;
        }
        let fitted = fit(&model, &[&record], &FitOptions::default()).expect("a fit");
        let known = |name: &str| {
            let own = fitted.model.coordinates();
            let index = own.iter().position(|own| own.name == name);
            fitted.standard_error(index.expect("a coordinate"))
        };
        assert_eq!(known("sensor-saturation.upper_limit"), None);
        for name in ["a1", "b1", "c11"] {
            let error = known(name);
            assert!(error.is_some_and(|error| error > 0.0), "{name}: {error:?}");
        }
    }

    /// A fixed delay is a whole number of samples at the start, where the free run has a kink; its derivative must
    /// not be 0 there.
    #[test]
    fn a_delay_leaves_the_whole_sample_that_it_set_out_from() {
        let u: Vec<f64> = (0..3000)
            .map(|k| f64::from(u8::from(k % 500 > 180)))
            .collect();
        let back = |k: usize, lag: usize| k.checked_sub(lag).map_or(0.0, |k| u[k]);
        let mut y = vec![0.0];
        for k in 0..u.len() - 1 {
            y.push(0.97 * y[k] + 0.03 * (0.4 * back(k, 41) + 0.6 * back(k, 42)));
        }
        let record = Record::new("squares", Use::Identify, 0.001, u, y);
        let mut start = Model {
            sample_period_s: 0.001,
            state_lags: vec![1],
            a: vec![0.97],
            product_lags: Vec::new(),
            b: vec![0.03],
            c: Vec::new(),
            delay: Delay::Fixed { delays: vec![40] },
            ..Model::default()
        };
        start.delay_between_samples();
        let fitted = fit(&start, &[&record], &FitOptions::default()).expect("a fit");
        let Delay::Law(law) = &fitted.model.delay else {
            panic!("{:?}", fitted.model.delay);
        };
        assert!((law.parameters[0] - 41.6).abs() < 0.01, "{law:?}");
    }
}
