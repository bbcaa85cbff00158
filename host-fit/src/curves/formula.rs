//! Standard functions to replace a fitted curve.

use numerics::linalg::{dot, gram, solve_symmetric};

/// Dimension of a parameter of a form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Dimension of g/xⁿ, with this n.
    Amplitude(i32),
    /// Dimension of g/√x.
    OverRoot,
    /// A position or a width in x.
    Place,
    /// A positive position or width in x.
    Width,
    /// Cycles per unit of x.
    Frequency,
}

/// A parameter of a form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Card {
    pub(crate) name: &'static str,
    kind: Kind,
}

impl Card {
    /// Search interval of the parameter, given an initial value and the extent of x.
    pub(crate) fn range(&self, value: f64, x: [f64; 2]) -> [f64; 2] {
        let extent = (x[1] - x[0]).max(f64::MIN_POSITIVE);
        match self.kind {
            Kind::Amplitude(_) | Kind::OverRoot => {
                let most = 20.0 * value.abs().max(1e-6);
                [-most, most]
            }
            Kind::Place => [x[0], x[1]],
            Kind::Width => [0.002 * extent, 20.0 * extent],
            Kind::Frequency => [0.1 / extent, 100.0 / extent],
        }
    }

    /// Unit of the parameter, given those of g and x.
    pub(crate) fn unit(&self, of_g: &'static str, of_x: &'static str) -> &'static str {
        match self.kind {
            Kind::Amplitude(0) => of_g,
            Kind::Place | Kind::Width => of_x,
            Kind::Frequency if of_x == "s" => "Hz",
            _ => "of its formula",
        }
    }
}

/// A standard function: linear in its amplitudes, which come first, with up to two nonlinear parameters.
#[derive(Debug)]
pub(crate) struct Form {
    /// As an expression of `{x}`.
    pub(crate) expression: &'static str,
    /// Parameters of the formula, amplitudes first.
    pub(crate) parameters: &'static [Card],
    amplitudes: usize,
    /// g at x for these parameters.
    pub(crate) value: fn(f64, &[f64]) -> f64,
    /// Whether the formula is defined for x ≥ 0 only.
    positive: bool,
}

const fn amplitude(power: i32) -> Card {
    Card {
        name: "amplitude",
        kind: Kind::Amplitude(power),
    }
}

const fn place(name: &'static str) -> Card {
    let kind = Kind::Place;
    Card { name, kind }
}

const fn width(name: &'static str) -> Card {
    let kind = Kind::Width;
    Card { name, kind }
}

/// The forms, in ascending number of parameters.
pub(crate) static FORMS: [Form; 14] = [
    Form {
        expression: "amplitude * {x}",
        parameters: &[amplitude(1)],
        amplitudes: 1,
        value: |x, p| p[0] * x,
        positive: false,
    },
    Form {
        expression: "amplitude * {x} * {x}",
        parameters: &[amplitude(2)],
        amplitudes: 1,
        value: |x, p| p[0] * x * x,
        positive: false,
    },
    Form {
        expression: "amplitude * {x} * {x} * {x}",
        parameters: &[amplitude(3)],
        amplitudes: 1,
        value: |x, p| p[0] * x * x * x,
        positive: false,
    },
    Form {
        expression: "amplitude * sqrt({x})",
        parameters: &[Card {
            name: "amplitude",
            kind: Kind::OverRoot,
        }],
        amplitudes: 1,
        value: |x, p| p[0] * x.max(0.0).sqrt(),
        positive: true,
    },
    Form {
        expression: "amplitude * exp(-{x} / scale)",
        parameters: &[amplitude(0), width("scale")],
        amplitudes: 1,
        value: |x, p| p[0] * (-x / p[1]).exp(),
        positive: true,
    },
    Form {
        expression: "amplitude * (1.0 - exp(-{x} / scale))",
        parameters: &[amplitude(0), width("scale")],
        amplitudes: 1,
        value: |x, p| p[0] * (1.0 - (-x / p[1]).exp()),
        positive: true,
    },
    Form {
        expression: "amplitude * {x} / ({x} + half)",
        parameters: &[amplitude(0), width("half")],
        amplitudes: 1,
        value: |x, p| p[0] * x / (x + p[1]),
        positive: true,
    },
    Form {
        expression: "if {x} > threshold { amplitude } else { 0.0 }",
        parameters: &[amplitude(0), place("threshold")],
        amplitudes: 1,
        value: |x, p| if x > p[1] { p[0] } else { 0.0 },
        positive: false,
    },
    Form {
        expression: "amplitude * max({x} - threshold, 0.0)",
        parameters: &[amplitude(1), place("threshold")],
        amplitudes: 1,
        value: |x, p| p[0] * (x - p[1]).max(0.0),
        positive: false,
    },
    Form {
        expression: "amplitude * max(threshold - {x}, 0.0)",
        parameters: &[amplitude(1), place("threshold")],
        amplitudes: 1,
        value: |x, p| p[0] * (p[1] - x).max(0.0),
        positive: false,
    },
    Form {
        expression: "offset + amplitude * {x}",
        parameters: &[
            Card {
                name: "offset",
                kind: Kind::Amplitude(0),
            },
            amplitude(1),
        ],
        amplitudes: 2,
        value: |x, p| p[0] + p[1] * x,
        positive: false,
    },
    Form {
        expression: "amplitude * {x} + square * {x} * {x}",
        parameters: &[
            amplitude(1),
            Card {
                name: "square",
                kind: Kind::Amplitude(2),
            },
        ],
        amplitudes: 2,
        value: |x, p| p[0] * x + p[1] * x * x,
        positive: false,
    },
    Form {
        expression: "amplitude / (1.0 + exp((middle - {x}) / width))",
        parameters: &[amplitude(0), place("middle"), width("width")],
        amplitudes: 1,
        value: |x, p| p[0] / (1.0 + ((p[1] - x) / p[2]).exp()),
        positive: false,
    },
    Form {
        expression: "amplitude * exp(-{x} / decay) * sin(6.283185307179586 * frequency * {x})",
        parameters: &[
            amplitude(0),
            width("decay"),
            Card {
                name: "frequency",
                kind: Kind::Frequency,
            },
        ],
        amplitudes: 1,
        value: |x, p| p[0] * (-x / p[1]).exp() * (std::f64::consts::TAU * p[2] * x).sin(),
        positive: true,
    },
];

/// Grid points per nonlinear parameter of a form.
const STEPS: usize = 24;

/// Forms are equal if their expressions are.
impl PartialEq for Form {
    fn eq(&self, other: &Self) -> bool {
        self.expression == other.expression
    }
}

impl Form {
    /// Whether one amplitude of the form is a constant.
    pub(crate) fn has_level(&self) -> bool {
        self.parameters.iter().any(|card| card.name == "offset")
    }

    /// Parameters in other units of x and g.
    pub(crate) fn scaled(&self, parameters: &[f64], of_x: f64, of_g: f64) -> Vec<f64> {
        let pairs = self.parameters.iter().zip(parameters);
        pairs
            .map(|(card, value)| match card.kind {
                Kind::Amplitude(power) => value * of_g / of_x.powi(power),
                Kind::OverRoot => value * of_g / of_x.sqrt(),
                Kind::Place | Kind::Width => value * of_x,
                Kind::Frequency => value / of_x,
            })
            .collect()
    }

    /// Least-squares parameters for the points of a curve, and the remaining mean square; with `free_level`, up to a
    /// constant. `None` if the form is not defined at these points.
    pub(crate) fn nearest(
        &self,
        x: &[f64],
        g: &[f64],
        weights: &[f64],
        free_level: bool,
    ) -> Option<(Vec<f64>, f64)> {
        let (low, high) = (*x.first()?, *x.last()?);
        if self.positive && low < -1e-9 * (high - low) {
            return None;
        }
        let inner = &self.parameters[self.amplitudes..];
        let axes: Vec<Vec<f64>> = inner
            .iter()
            .map(|card| {
                let [from, to] = card.range(1.0, [low, high]);
                let along = (0..STEPS).map(|i| (i as f64 + 0.5) / STEPS as f64);
                along
                    .map(|along| match card.kind {
                        Kind::Place => between(x, along),
                        _ => from * (to / from).powf(along),
                    })
                    .collect()
            })
            .collect();
        let mut points: Vec<Vec<f64>> = vec![Vec::new()];
        for axis in &axes {
            let longer = points.iter().flat_map(|point| {
                axis.iter()
                    .map(|value| [point.clone(), vec![*value]].concat())
            });
            points = longer.collect();
        }
        let fits = points
            .iter()
            .filter_map(|point| self.amplitudes_at(point, x, g, weights, free_level));
        fits.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn amplitudes_at(
        &self,
        inner: &[f64],
        x: &[f64],
        g: &[f64],
        weights: &[f64],
        free_level: bool,
    ) -> Option<(Vec<f64>, f64)> {
        let mut columns: Vec<Vec<f64>> = (0..self.amplitudes)
            .map(|i| {
                let mut unit = vec![0.0; self.amplitudes];
                unit[i] = 1.0;
                unit.extend_from_slice(inner);
                let weighted = x.iter().zip(weights);
                weighted.map(|(x, w)| w * (self.value)(*x, &unit)).collect()
            })
            .collect();
        if free_level {
            columns.push(weights.to_vec());
        }
        let target: Vec<f64> = g.iter().zip(weights).map(|(g, w)| g * w).collect();
        let n = columns.len();
        let mut products = gram(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>());
        (0..n).for_each(|i| products[i * n + i] *= 1.0 + 1e-9);
        let right: Vec<f64> = columns.iter().map(|column| dot(column, &target)).collect();
        let scale = solve_symmetric(&products, &right)?;
        let mut rest = target;
        for (column, scale) in columns.iter().zip(&scale) {
            rest.iter_mut()
                .zip(column)
                .for_each(|(r, c)| *r -= scale * c);
        }
        let left = dot(&rest, &rest);
        let parameters = [&scale[..self.amplitudes], inner].concat();
        (left.is_finite() && parameters.iter().all(|p| p.is_finite())).then_some((parameters, left))
    }
}

/// The value at the fraction `along` of the sorted points, interpolated between neighbours. The points
/// follow the distribution of the coordinate, which may span decades.
fn between(points: &[f64], along: f64) -> f64 {
    let index = along * (points.len() - 1) as f64;
    let before = (index as usize).min(points.len() - 2);
    let share = index - before as f64;
    points[before] + share * (points[before + 1] - points[before])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The form behind a set of points is recovered to a few per cent.
    #[test]
    fn a_curve_that_is_a_form_is_found_again() {
        let x: Vec<f64> = (0..8).map(|i| 0.1 + 0.2 * f64::from(i)).collect();
        let weights = vec![1.0; x.len()];
        for (form, truth) in [
            (&FORMS[0], vec![0.4]),
            (&FORMS[4], vec![-0.3, 0.35]),
            (&FORMS[7], vec![0.5, 0.8]),
            (&FORMS[8], vec![-0.7, 0.6]),
            (&FORMS[9], vec![0.5, 0.6]),
            (&FORMS[10], vec![0.2, -0.4]),
        ] {
            let g: Vec<f64> = x.iter().map(|x| (form.value)(*x, &truth)).collect();
            let (found, left) = form.nearest(&x, &g, &weights, false).unwrap();
            let size = dot(&g, &g);
            assert!(left < 2e-3 * size, "{}: {left}", form.expression);
            assert!((found[0] / truth[0] - 1.0).abs() < 0.1, "{found:?}");
        }
    }

    /// Scaling x and g before or after the fit gives the same parameters.
    #[test]
    fn parameters_follow_their_units() {
        for form in &FORMS {
            let parameters: Vec<f64> = (0..form.parameters.len())
                .map(|i| 0.7 - 0.2 * i as f64)
                .collect();
            let scaled = form.scaled(&parameters, 30.0, 4.0);
            for x in [0.2, 0.9] {
                let inner = (form.value)(x, &parameters);
                let outer = (form.value)(30.0 * x, &scaled);
                assert!((outer - 4.0 * inner).abs() < 1e-12, "{}", form.expression);
            }
        }
    }
}
