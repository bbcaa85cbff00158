//! The free-run objective ε, eq. (9): least squares for the coefficients, then
//! a simulation of every record through the recursion of `model-core`.

use model_core::average::WindowSum;
use model_core::delay::DelayLaw as _;
use model_core::history::Past;
use model_core::recursion::{Bilinear, Grading, LagConvention};

use super::arrival::{Signals, core_law, factor};
use super::layout::Delays;
use super::linearised::{Linearised, Trajectory};
use super::regression::Regression;
use super::structure::{DelayLaw, InputDelay, Structure, WINDOW};
use crate::search::{Evaluation, Point, Problem, Variable};

/// A run beyond this many times the measured range has diverged.
const DIVERGED: f64 = 10.0;

/// Value of a candidate that diverges at once; one that diverges at the very
/// end gets half of it, so that a search can leave the unstable region.
pub(crate) const DIVERGED_VALUE: f64 = 1e9;

/// Coefficients of a candidate, in the order of eq. (3).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Coefficients {
    pub(crate) a: Vec<f64>,
    pub(crate) b: Vec<f64>,
    /// The N2 coefficients of input 1 first.
    pub(crate) c: Vec<f64>,
    pub(crate) constant: f64,
}

impl Coefficients {
    /// Sorts the solution of a regression, in the order of its columns.
    pub(crate) fn new(solution: &[f64], delays: &Delays) -> Self {
        let mut rest = solution.iter().copied();
        let mut next = || rest.next().unwrap_or(0.0);
        let a = delays.state.iter().map(|_| next()).collect();
        let (mut b, mut c) = (Vec::new(), Vec::new());
        for _ in &delays.ticks {
            b.push(next());
            c.extend(delays.product.iter().map(|_| next()));
        }
        Self {
            a,
            b,
            c,
            constant: next(),
        }
    }
}

/// What a simulation came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// Σ (y − y_sim)² over all records.
    Squared(f64),
    /// Given up once the sum had reached this.
    AtLeast(f64),
    /// Left all bounds, with this share of the samples done.
    Diverged(f64),
}

/// Simulates candidates over the records.
#[derive(Debug)]
pub(crate) struct FreeRunner {
    convention: LagConvention,
    law: Option<DelayLaw>,
    averaged: bool,
    bound: f64,
    samples: usize,
    longest: usize,
    /// Per record, number of changes of the input before each sample.
    changes: Vec<Vec<u32>>,
}

/// A simulated output, newest value last.
struct Tail<'a>(&'a [f64]);

impl Past<f64> for Tail<'_> {
    #[inline]
    fn back(&self, lag: usize) -> f64 {
        let newest = self.0.len().wrapping_sub(1);
        self.0.get(newest.wrapping_sub(lag)).copied().unwrap_or(0.0)
    }
}

impl FreeRunner {
    pub(crate) fn new(signals: &Signals, structure: &Structure) -> Self {
        let largest = signals
            .y
            .iter()
            .flatten()
            .fold(0.0f64, |m, y| m.max(y.abs()));
        let changes = signals
            .u
            .iter()
            .map(|u| {
                let (mut before, mut count) = (0.0, 0);
                u.iter()
                    .map(|u| {
                        count += u32::from(*u != before);
                        before = *u;
                        count
                    })
                    .collect()
            })
            .collect();
        Self {
            convention: structure.convention,
            law: match &structure.delay {
                InputDelay::Fixed { .. } => None,
                InputDelay::StateDependent { law, .. } => Some(*law),
            },
            averaged: structure.averaged,
            bound: DIVERGED * largest.max(1e-9),
            samples: signals.y.iter().map(Vec::len).sum(),
            longest: structure.longest_lag.into(),
            changes,
        }
    }

    /// Runs all records, until the sum of squares reaches `give_up_at`.
    pub(crate) fn run(
        &self,
        signals: &Signals,
        delays: &Delays,
        coefficients: &Coefficients,
        give_up_at: f64,
        mut keep: Option<&mut Trajectory>,
    ) -> Outcome {
        let recursion = Bilinear {
            convention: self.convention,
            grading: Grading::Proportional,
            constant: coefficients.constant,
            state_lags: &delays.state,
            a: &coefficients.a,
            product_lags: &delays.product,
            b: &coefficients.b,
            c: &coefficients.c,
        };
        let laws: Vec<_> = delays
            .ticks
            .iter()
            .map(|tick| (*tick, self.law.map(|law| core_law(&law, factor(*tick)))))
            .collect();
        // Shortest and longest delay of each input.
        let ranges: Vec<(usize, usize)> = laws
            .iter()
            .map(|(tick, law)| match law {
                None => (*tick as usize, *tick as usize),
                Some(law) => {
                    let ends = [law.floor, law.floor + law.rise].map(|h| law.tap(0, h).whole);
                    (ends[0].min(ends[1]), ends[0].max(ends[1]))
                }
            })
            .collect();
        let mut sum = 0.0;
        let mut done = 0;
        let mut simulated: Vec<f64> = Vec::new();
        let mut arriving = vec![0.0; laws.len()];
        for (record, measured) in signals.y.iter().enumerate() {
            if let Some(keep) = keep.as_deref_mut() {
                keep.arrived
                    .push(vec![Vec::with_capacity(measured.len()); laws.len()]);
            }
            let (u, changes) = (&signals.u[record], &self.changes[record]);
            simulated.clear();
            simulated.resize(self.longest, 0.0);
            simulated.push(if signals.skipped > 0 {
                measured.first().copied().unwrap_or(0.0)
            } else {
                0.0
            });
            let mut average = WindowSum::new();
            for (k, y) in measured.iter().enumerate() {
                let now = simulated[self.longest + k];
                if k >= signals.skipped {
                    let error = y - now;
                    sum += error * error;
                    if sum >= give_up_at {
                        return Outcome::AtLeast(sum);
                    }
                }
                let mut evaluated = None;
                let next = recursion.next(&Tail(&simulated), |l| {
                    let (shortest, longest) = ranges[l];
                    let count = |delay: usize| k.checked_sub(delay).map_or(0, |i| changes[i]);
                    let mut delay = shortest;
                    if count(shortest) != count(longest)
                        && let Some(law) = &laws[l].1
                    {
                        // The input switched within the range of the delay: where exactly counts.
                        let evaluated = *evaluated.get_or_insert_with(|| {
                            let follows = if self.averaged {
                                now
                            } else {
                                average.value() / f64::from(WINDOW)
                            };
                            law.evaluate(follows.max(0.0))
                        });
                        delay = law.tap(0, evaluated).whole;
                    }
                    arriving[l] = k.checked_sub(delay).map_or(0.0, |i| u[i]);
                    arriving[l]
                });
                if let Some(arrived) = keep.as_deref_mut().and_then(|keep| keep.arrived.last_mut())
                {
                    arrived
                        .iter_mut()
                        .zip(&arriving)
                        .for_each(|(all, now)| all.push(*now));
                }
                if next.abs() > self.bound || next.is_nan() {
                    return Outcome::Diverged((done + k) as f64 / self.samples as f64);
                }
                if !self.averaged {
                    let terms = WINDOW as usize - 1;
                    let leaving = k
                        .checked_sub(terms)
                        .map_or(0.0, |i| simulated[self.longest + i]);
                    average.slide(now, leaving, WINDOW - 1);
                }
                simulated.push(if k + 1 < signals.skipped {
                    measured.get(k + 1).copied().unwrap_or(next)
                } else {
                    next
                });
            }
            done += measured.len();
            if let Some(keep) = keep.as_deref_mut() {
                keep.simulated
                    .push(simulated[self.longest..self.longest + measured.len()].to_vec());
            }
        }
        Outcome::Squared(sum)
    }
}

/// ε of the free run as a function of the delays.
pub(crate) struct FreeRun {
    pub(crate) regression: Regression,
    pub(crate) runner: FreeRunner,
}

impl FreeRun {
    /// ε of a candidate, not below `give_up_at` once that is known.
    pub(crate) fn epsilon(&self, delays: &Delays, give_up_at: f64) -> Evaluation {
        let (solution, _) = self.regression.normal(delays).solve();
        let coefficients = Coefficients::new(&solution, delays);
        let limit = give_up_at * give_up_at;
        match self
            .runner
            .run(&self.regression.signals, delays, &coefficients, limit, None)
        {
            Outcome::Squared(sum) => Evaluation::Value(sum.sqrt()),
            Outcome::AtLeast(_) => Evaluation::AtLeast(give_up_at),
            Outcome::Diverged(done) => Evaluation::Value(DIVERGED_VALUE * (1.0 - 0.5 * done)),
        }
    }

    /// The free run linearised at a candidate, if it does not diverge.
    pub(crate) fn linearise(&self, delays: &Delays) -> Option<Linearised> {
        let (solution, _) = self.regression.normal(delays).solve();
        let coefficients = Coefficients::new(&solution, delays);
        let mut trajectory = Trajectory::default();
        let signals = &self.regression.signals;
        let outcome = self.runner.run(
            signals,
            delays,
            &coefficients,
            f64::INFINITY,
            Some(&mut trajectory),
        );
        matches!(outcome, Outcome::Squared(_)).then(|| {
            Linearised::new(
                signals,
                &self.regression.layout,
                delays,
                &solution,
                &trajectory,
            )
        })
    }
}

impl Problem for FreeRun {
    fn variables(&self) -> &[Variable] {
        &self.regression.layout.variables
    }

    fn canonical(&self, point: &[i64]) -> Point {
        self.regression.layout.canonical(point)
    }

    fn groups(&self) -> Vec<Vec<usize>> {
        self.regression.layout.groups()
    }

    fn prepare(&mut self, points: &[&Point]) {
        for point in points {
            let delays = self.regression.layout.delays(point);
            self.regression.tabulate_near(&delays.ticks);
        }
    }

    fn evaluate(&self, point: &Point, give_up_at: f64) -> Evaluation {
        self.epsilon(&self.regression.layout.delays(point), give_up_at)
    }
}
