//! Levenberg–Marquardt with bounds, on sums of squares that come in parts.
//!
//! Damping by the diagonal of JᵀJ (Marquardt 1963). A coordinate that would leave its bounds is held there, and the
//! others are solved again. A [`LeastSquares`] problem is linearised one part (record) at a time. Parts run in
//! parallel, and a run with too high a cost is stopped early.

use super::rules::RULES;
use numerics::linalg::{dots, gram, solve_symmetric};

// These constants change the number of iterations, not the minimum, and are therefore not rules.

/// First damping, as a share of the diagonal of JᵀJ.
const FIRST_DAMPING: f64 = 1e-3;
/// Factor on the damping after a successful step, and its least value.
const LESS_DAMPING: f64 = 0.2;
const LEAST_DAMPING: f64 = 1e-9;
/// Factor on the damping after an unsuccessful step, and its largest value, beyond which steps are
/// negligible.
const MORE_DAMPING: f64 = 6.0;
const LARGEST_DAMPING: f64 = 1e8;
/// Largest number of steps tried from one linearisation.
const TRIES: usize = 10;
/// Added to the diagonal, so that a coordinate without influence does not move.
const FLOOR: f64 = 1e-12;

/// Why a fit ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FitStop {
    /// An iteration lowered the sum of squares by less than the tolerance.
    Converged,
    /// The residual is orthogonal to all derivatives of the free coordinates.
    Stationary,
    /// No coordinate is free to move.
    NothingToFit,
    /// The iteration limit was reached.
    IterationLimit,
    /// No step lowers the sum of squares although its gradient is not 0: the function is rougher than its
    /// derivatives indicate.
    NoDescent,
    /// The derivatives grow without bound.
    Diverged,
}

impl FitStop {
    /// Whether the parameters are those of a minimum.
    #[must_use]
    pub fn was_successful(self) -> bool {
        matches!(
            self,
            Self::Converged | Self::Stationary | Self::NothingToFit
        )
    }

    /// The reason in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stationary => "at a minimum",
            Self::NothingToFit => "there are no free parameters to fit",
            Self::IterationLimit => {
                "stopped at the iteration limit: more iterations may lower the error further"
            }
            Self::NoDescent => "stopped before a minimum: no step lowers the error further",
            Self::Diverged => {
                "stopped because the sensitivities of the free run grow without bound"
            }
        }
    }
}

/// Residuals r and their Jacobian for one part of the data.
pub(crate) struct Part {
    /// Measurement minus model.
    pub(crate) residual: Vec<f64>,
    /// ∂model/∂searched, one series per coordinate, as long as the residual.
    pub(crate) jacobian: Vec<Vec<f64>>,
}

/// A sum of squares to be minimised.
pub(crate) trait LeastSquares {
    /// Number of coordinates that are searched.
    fn free(&self) -> usize;
    /// Σ r² at `values`; infinite where the model diverges. The sum may stop once it exceeds `enough`.
    fn cost(&self, values: &[f64], enough: f64) -> f64;
    /// All parts at `values`; `None` where the model diverges.
    fn linearise(&self, values: &[f64]) -> Option<Vec<Part>>;
    /// The lowest and the highest step of each coordinate from `values`.
    fn reach(&self, values: &[f64]) -> Vec<(f64, f64)>;
    /// `values` after a step of the searched coordinates.
    fn moved(&self, values: &[f64], step: &[f64]) -> Vec<f64>;
}

/// Result of a minimisation.
pub(crate) struct Descent {
    pub(crate) values: Vec<f64>,
    pub(crate) cost: f64,
    pub(crate) iterations: usize,
    pub(crate) stop: FitStop,
    /// The last linearisation and its JᵀJ (row-major). If the last iteration lowered the cost, both are from before it.
    pub(crate) linearised: Option<(Vec<Part>, Vec<f64>)>,
}

/// Minimises from `values`, where the cost is `cost` and finite, in at most `iterations` iterations. Ends when an
/// iteration lowers the cost by less than the share `tolerance`.
pub(crate) fn minimise(
    problem: &impl LeastSquares,
    mut values: Vec<f64>,
    mut cost: f64,
    iterations: usize,
    tolerance: f64,
) -> Descent {
    let n = problem.free();
    let mut damping = FIRST_DAMPING;
    let mut made = 0;
    let mut linearised = None;
    let stop = loop {
        if n == 0 {
            break FitStop::NothingToFit;
        }
        if made == iterations {
            break FitStop::IterationLimit;
        }
        let Some(parts) = problem.linearise(&values) else {
            break FitStop::Diverged;
        };
        let (information, gradient) = normal_equations(&parts, n);
        made += 1;
        let reach = problem.reach(&values);
        let lowered = (0..TRIES).find_map(|_| {
            if damping > LARGEST_DAMPING {
                return None;
            }
            let mut damped = information.clone();
            for i in 0..n {
                damped[i * n + i] += damping * information[i * n + i] + FLOOR;
            }
            let moved =
                bounded_step(&damped, &gradient, &reach).map(|step| problem.moved(&values, &step));
            let lower = moved
                .map(|moved| (problem.cost(&moved, cost), moved))
                .filter(|(moved_cost, _)| *moved_cost < cost);
            damping = match lower {
                Some(_) => (damping * LESS_DAMPING).max(LEAST_DAMPING),
                None => damping * MORE_DAMPING,
            };
            lower
        });
        let stationary = is_stationary(&information, &gradient, &reach, cost);
        linearised = Some((parts, information));
        let Some((moved_cost, moved)) = lowered else {
            break if stationary {
                FitStop::Stationary
            } else {
                FitStop::NoDescent
            };
        };
        let gain = (cost - moved_cost) / cost.max(f64::MIN_POSITIVE);
        values = moved;
        cost = moved_cost;
        if gain < tolerance {
            break FitStop::Converged;
        }
    };
    Descent {
        values,
        cost,
        iterations: made,
        stop,
        linearised,
    }
}

/// Whether the residual is orthogonal to every column of J that the bounds leave free.
fn is_stationary(a: &[f64], g: &[f64], reach: &[(f64, f64)], cost: f64) -> bool {
    let n = g.len();
    (0..n).all(|i| {
        let (low, high) = reach[i];
        let blocked = if g[i] > 0.0 { high <= 0.0 } else { low >= 0.0 };
        blocked || g[i].abs() <= RULES.stationary * (a[i * n + i] * cost).sqrt()
    })
}

/// JᵀJ (row-major) and Jᵀr.
fn normal_equations(parts: &[Part], n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut information = vec![0.0; n * n];
    let mut gradient = vec![0.0; n];
    for part in parts {
        let columns: Vec<&[f64]> = part.jacobian.iter().map(Vec::as_slice).collect();
        let add = |sum: &mut [f64], own: Vec<f64>| {
            sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
        };
        add(&mut information, gram(&columns));
        add(&mut gradient, dots(&part.residual, columns));
    }
    (information, gradient)
}

/// The minimiser of ½ sᵀ·A·s − gᵀ·s within bounds: coordinates that would leave are held at their bound and
/// the others solved again.
fn bounded_step(a: &[f64], g: &[f64], reach: &[(f64, f64)]) -> Option<Vec<f64>> {
    let n = g.len();
    let mut held: Vec<Option<f64>> = vec![None; n];
    loop {
        let free: Vec<usize> = (0..n).filter(|i| held[*i].is_none()).collect();
        let mut step: Vec<f64> = held.iter().map(|h| h.unwrap_or(0.0)).collect();
        if !free.is_empty() {
            let sub: Vec<f64> = free
                .iter()
                .flat_map(|i| free.iter().map(move |j| a[i * n + j]))
                .collect();
            let rest = |i: &usize| g[*i] - (0..n).map(|j| a[i * n + j] * step[j]).sum::<f64>();
            let right: Vec<f64> = free.iter().map(rest).collect();
            for (i, value) in free.iter().zip(solve_symmetric(&sub, &right)?) {
                step[*i] = value;
            }
        }
        let mut left = false;
        for i in free {
            let (low, high) = reach[i];
            if step[i] < low || step[i] > high {
                held[i] = Some(step[i].clamp(low, high));
                left = true;
            }
        }
        if !left {
            return Some(step);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::linalg::inverse_where_known;

    /// A curve fitted through points, unbounded by default.
    struct Curve {
        points: Vec<(f64, f64)>,
        /// The curve and its slopes along the parameters.
        model: fn(&[f64], f64) -> (f64, Vec<f64>),
        bounds: Vec<(f64, f64)>,
    }

    impl Curve {
        fn sum(&self, values: &[f64]) -> f64 {
            let error = |(y, x): &(f64, f64)| (y - (self.model)(values, *x).0).powi(2);
            self.points.iter().map(error).sum()
        }
    }

    impl LeastSquares for Curve {
        fn free(&self) -> usize {
            self.bounds.len()
        }
        fn cost(&self, values: &[f64], _: f64) -> f64 {
            self.sum(values)
        }
        /// Two parts, to test the summation over parts.
        fn linearise(&self, values: &[f64]) -> Option<Vec<Part>> {
            let (first, second) = self.points.split_at(self.points.len() / 3);
            let part = |points: &[(f64, f64)]| {
                let at: Vec<_> = points.iter().map(|p| (self.model)(values, p.1)).collect();
                Part {
                    residual: points.iter().zip(&at).map(|(p, m)| p.0 - m.0).collect(),
                    jacobian: (0..values.len())
                        .map(|i| at.iter().map(|m| m.1[i]).collect())
                        .collect(),
                }
            };
            Some(vec![part(first), part(second)])
        }
        fn reach(&self, values: &[f64]) -> Vec<(f64, f64)> {
            let room = |(value, (low, high)): (&f64, &(f64, f64))| (low - value, high - value);
            values.iter().zip(&self.bounds).map(room).collect()
        }
        fn moved(&self, values: &[f64], step: &[f64]) -> Vec<f64> {
            values.iter().zip(step).map(|(v, s)| v + s).collect()
        }
    }

    fn solve(curve: &Curve, start: &[f64]) -> Descent {
        minimise(curve, start.to_vec(), curve.sum(start), 2000, 1e-15)
    }

    /// A problem of the Statistical Reference Datasets (NIST, nonlinear regression) with
    /// its certified values: parameters, their standard deviations, residual sum of squares.
    struct Reference {
        name: &'static str,
        y: &'static [f64],
        x: &'static [f64],
        model: fn(&[f64], f64) -> (f64, Vec<f64>),
        /// Starts far from and near the solution.
        starts: [&'static [f64]; 2],
        certified: &'static [f64],
        deviations: &'static [f64],
        sum: f64,
    }

    const REFERENCES: [Reference; 6] = [
        Reference {
            name: "Misra1a",
            y: &[
                10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40,
                75.47, 81.78,
            ],
            x: &[
                77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1,
                689.1, 760.0,
            ],
            model: rising,
            starts: [&[500.0, 0.0001], &[250.0, 0.0005]],
            certified: &[2.3894212918e2, 5.5015643181e-4],
            deviations: &[2.7070075241, 7.2668688436e-6],
            sum: 1.2455138894e-1,
        },
        Reference {
            name: "BoxBOD",
            y: &[109.0, 149.0, 149.0, 191.0, 213.0, 224.0],
            x: &[1.0, 2.0, 3.0, 5.0, 7.0, 10.0],
            model: rising,
            starts: [&[1.0, 1.0], &[100.0, 0.75]],
            certified: &[2.1380940889e2, 5.4723748542e-1],
            deviations: &[1.2354515176e1, 1.0455993237e-1],
            sum: 1.1680088766e3,
        },
        Reference {
            name: "Rat42",
            y: &[
                8.930, 10.800, 18.590, 22.330, 39.350, 56.110, 61.730, 64.620, 67.080,
            ],
            x: &[9.0, 14.0, 21.0, 28.0, 42.0, 57.0, 63.0, 70.0, 79.0],
            model: |b, x| {
                let e = (b[1] - b[2] * x).exp();
                let whole = b[0] / (1.0 + e);
                let slope = -whole * e / (1.0 + e);
                (whole, vec![1.0 / (1.0 + e), slope, -slope * x])
            },
            starts: [&[100.0, 1.0, 0.1], &[75.0, 2.5, 0.07]],
            certified: &[7.2462237576e1, 2.6180768402, 6.7359200066e-2],
            deviations: &[1.7340283401, 8.8295217536e-2, 3.4465663377e-3],
            sum: 8.0565229338,
        },
        Reference {
            name: "MGH09",
            y: &[
                0.1957, 0.1947, 0.1735, 0.16, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235,
                0.0246,
            ],
            x: &[
                4.0, 2.0, 1.0, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625,
            ],
            model: |b, x| {
                let (above, below) = (x * x + x * b[1], x * x + x * b[2] + b[3]);
                let whole = b[0] * above / below;
                let slopes = vec![
                    above / below,
                    b[0] * x / below,
                    -whole * x / below,
                    -whole / below,
                ];
                (whole, slopes)
            },
            starts: [&[25.0, 39.0, 41.5, 39.0], &[0.25, 0.39, 0.415, 0.39]],
            certified: &[
                1.9280693458e-1,
                1.9128232873e-1,
                1.2305650693e-1,
                1.3606233068e-1,
            ],
            deviations: &[
                1.1435312227e-2,
                1.9633220911e-1,
                8.0842031232e-2,
                9.0025542308e-2,
            ],
            sum: 3.0750560385e-4,
        },
        Reference {
            name: "MGH10",
            y: &[
                34780.0, 28610.0, 23650.0, 19630.0, 16370.0, 13720.0, 11540.0, 9744.0, 8261.0,
                7030.0, 6005.0, 5147.0, 4427.0, 3820.0, 3307.0, 2872.0,
            ],
            x: &[
                50.0, 55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0, 105.0, 110.0,
                115.0, 120.0, 125.0,
            ],
            model: |b, x| {
                let e = (b[1] / (x + b[2])).exp();
                let whole = b[0] * e;
                (
                    whole,
                    vec![e, whole / (x + b[2]), -whole * b[1] / (x + b[2]).powi(2)],
                )
            },
            starts: [&[2.0, 400_000.0, 25_000.0], &[0.02, 4000.0, 250.0]],
            certified: &[5.6096364710e-3, 6.1813463463e3, 3.4522363462e2],
            deviations: &[1.5687892471e-4, 2.3309021107e1, 7.8486103508e-1],
            sum: 8.7945855171e1,
        },
        Reference {
            name: "Thurber",
            y: &[
                80.574, 84.248, 87.264, 87.195, 89.076, 89.608, 89.868, 90.101, 92.405, 95.854,
                100.696, 101.060, 401.672, 390.724, 567.534, 635.316, 733.054, 759.087, 894.206,
                990.785, 1090.109, 1080.914, 1122.643, 1178.351, 1260.531, 1273.514, 1288.339,
                1327.543, 1353.863, 1414.509, 1425.208, 1421.384, 1442.962, 1464.350, 1468.705,
                1447.894, 1457.628,
            ],
            x: &[
                -3.067, -2.981, -2.921, -2.912, -2.840, -2.797, -2.702, -2.699, -2.633, -2.481,
                -2.363, -2.322, -1.501, -1.460, -1.274, -1.212, -1.100, -1.046, -0.915, -0.714,
                -0.566, -0.545, -0.400, -0.309, -0.109, -0.103, 0.010, 0.119, 0.377, 0.790, 0.963,
                1.006, 1.115, 1.572, 1.841, 2.047, 2.200,
            ],
            model: |b, x| {
                let powers = [1.0, x, x * x, x * x * x];
                let above: f64 = b.iter().zip(powers).map(|(b, p)| b * p).sum();
                let below = 1.0 + b[4] * x + b[5] * powers[2] + b[6] * powers[3];
                let whole = above / below;
                let up = powers.iter().map(|p| p / below);
                let down = powers.iter().skip(1).map(|p| -whole * p / below);
                (whole, up.chain(down).collect())
            },
            starts: [
                &[1000.0, 1000.0, 400.0, 40.0, 0.7, 0.3, 0.03],
                &[1300.0, 1500.0, 500.0, 75.0, 1.0, 0.4, 0.05],
            ],
            certified: &[
                1.2881396800e3,
                1.4910792535e3,
                5.8323836877e2,
                7.5416644291e1,
                9.6629502864e-1,
                3.9797285797e-1,
                4.9727297349e-2,
            ],
            deviations: &[
                4.6647963344,
                3.9571156086e1,
                2.8698696102e1,
                5.5675370270,
                3.1333340687e-2,
                1.4984928198e-2,
                6.5842344623e-3,
            ],
            sum: 5.6427082397e3,
        },
    ];

    /// b1·(1 − exp(−b2·x)).
    fn rising(b: &[f64], x: f64) -> (f64, Vec<f64>) {
        let e = (-b[1] * x).exp();
        (b[0] * (1.0 - e), vec![1.0 - e, b[0] * x * e])
    }

    fn curve(reference: &Reference) -> Curve {
        let points = reference.y.iter().copied().zip(reference.x.iter().copied());
        Curve {
            points: points.collect(),
            model: reference.model,
            bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); reference.certified.len()],
        }
    }

    #[test]
    fn certified_values_are_reached() {
        for reference in &REFERENCES {
            let (name, n) = (reference.name, reference.certified.len());
            let curve = curve(reference);
            for start in reference.starts {
                // From the far start two of the problems end on a plateau.
                if matches!(name, "BoxBOD" | "MGH10") && start == reference.starts[0] {
                    continue;
                }
                let end = solve(&curve, start);
                assert!(end.stop.was_successful(), "{name}: {:?}", end.stop);
                assert!((end.cost / reference.sum - 1.0).abs() < 1e-9, "{name}");
                for (found, certified) in end.values.iter().zip(reference.certified) {
                    assert!((found / certified - 1.0).abs() < 1e-7, "{name}: {found}");
                }
                let (_, information) = end.linearised.expect("iterations were made");
                let (inverse, _) = inverse_where_known(&information, n).expect("regular");
                let variance = end.cost / (reference.y.len() - n) as f64;
                for (i, certified) in reference.deviations.iter().enumerate() {
                    let found = (inverse[i * n + i] * variance).sqrt();
                    assert!((found / certified - 1.0).abs() < 1e-4, "{name}: {found}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_minimum_is_not_called_one() {
        for reference in &REFERENCES {
            if matches!(reference.name, "BoxBOD" | "MGH10") {
                let end = solve(&curve(reference), reference.starts[0]);
                assert!(end.cost > 2.0 * reference.sum);
                assert!(!end.stop.was_successful(), "{}", reference.name);
            }
        }
    }

    /// With b1 bounded below its optimum, the other parameter compensates.
    #[test]
    fn a_bound_holds_one_coordinate_and_the_others_go_on() {
        let mut curve = curve(&REFERENCES[0]);
        curve.bounds = vec![(0.0, 200.0), (0.0, 1.0)];
        let end = solve(&curve, &[150.0, 1e-3]);
        assert!(end.stop.was_successful(), "{:?}", end.stop);
        assert_eq!(end.values[0], 200.0);
        for other in [0.999, 1.001] {
            assert!(curve.sum(&[200.0, other * end.values[1]]) > end.cost);
        }
    }

    #[test]
    fn a_fit_says_why_it_ended() {
        let curve = curve(&REFERENCES[0]);
        let stop = |iterations, tolerance| {
            let start = REFERENCES[0].starts[0];
            let end = minimise(
                &curve,
                start.to_vec(),
                curve.sum(start),
                iterations,
                tolerance,
            );
            assert!(end.iterations <= iterations && !end.stop.words().is_empty());
            end.stop
        };
        assert_eq!(stop(3, 1e-9), FitStop::IterationLimit);
        assert_eq!(stop(100, 1e-3), FitStop::Converged);
        assert_eq!(stop(0, 1e-3), FitStop::IterationLimit);
        let nothing = Curve {
            bounds: Vec::new(),
            ..curve
        };
        let end = minimise(&nothing, vec![1.0, 1.0], 1.0, 5, 1e-3);
        assert_eq!((end.stop, end.iterations), (FitStop::NothingToFit, 0));
        assert!(end.stop.was_successful());
    }
}
