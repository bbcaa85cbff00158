//! A discovered term as an effect file: a piecewise-linear curve or a formula.

use super::RULES;
use super::coordinate::{Coordinate, FADING};
use super::formula::Form;
use super::place::Entry;
use crate::fit::Fit;
use crate::model::Model;
use crate::order;
use crate::terms::Units;
use crate::user_effect::{Definition, DefinitionError};
use std::fmt::Write as _;

/// The function g of the coordinate.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    /// Piecewise linear. Where the base already contains a constant g, one value is fixed at 0.
    Points {
        x: Vec<f64>,
        g: Vec<f64>,
        pinned: Option<usize>,
    },
    /// A formula with its parameters.
    Formula {
        form: &'static Form,
        parameters: Vec<f64>,
        /// Extent of the coordinate.
        range: [f64; 2],
    },
}

/// A term outside the catalogue.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    pub(crate) entry: Entry,
    pub(crate) coordinate: Coordinate,
    pub(crate) shape: Shape,
    /// Search interval of the coordinate's filter time constant, s, if that is a parameter.
    pub(crate) fading: Option<[f64; 2]>,
    /// Above this level the command counts as on.
    pub(crate) on: f64,
    /// Time by which the model's own delay is shortened, s, so that the term can also shorten the
    /// delay.
    pub(crate) shift: f64,
    /// Inner unit of time, s.
    pub(crate) time: f64,
    /// Number of the term among those of its kind.
    pub(crate) number: usize,
}

/// A parameter of an effect file and its unit conversion.
struct Parameter {
    name: String,
    value: f64,
    unit: &'static str,
    low: f64,
    high: f64,
}

impl Term {
    /// Whether two terms have the same entry, and the same coordinate except for its time constant.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        self.entry == other.entry && self.coordinate.slug() == other.coordinate.slug()
    }

    /// Whether the term's coordinate has a time constant that was chosen from a grid and is not fitted.
    pub(crate) fn has_chosen_time(&self) -> bool {
        self.coordinate.has_time() && self.fading.is_none()
    }

    /// The term with the coordinate's filter time constant, if any, as a parameter within `factor`.
    pub(crate) fn with_free_time(self, factor: f64) -> Self {
        let time = self.coordinate.fading();
        Self {
            fading: time.map(|time| [time / factor, time * factor]),
            ..self
        }
    }

    /// Standard errors of the values of a curve in a fitted model; 0 where a value is fixed.
    pub(crate) fn errors(&self, fitted: &Fit) -> Vec<f64> {
        let Shape::Points { g, pinned, .. } = &self.shape else {
            return Vec::new();
        };
        let coordinates = fitted.model.coordinates();
        let name = self.name();
        let error = |i: usize| {
            if Some(i) == *pinned {
                return 0.0;
            }
            let full = format!("{name}.g{i}");
            let index = coordinates.iter().position(|c| c.name == full);
            let known = index.and_then(|index| fitted.standard_error(index));
            known.unwrap_or(f64::INFINITY)
        };
        (0..g.len()).map(error).collect()
    }

    /// Name of the term's effect.
    pub(crate) fn name(&self) -> String {
        let entry = match self.entry {
            Entry::Jet => "jet",
            Entry::Delay => "delay",
            Entry::Level => "level",
            Entry::Rate => "rate",
            Entry::Reading => "reading",
            Entry::Sensitivity => "sensitivity",
        };
        let number = match self.number {
            0 | 1 => String::new(),
            number => format!("-{number}"),
        };
        let mut slug = self.coordinate.slug();
        slug.truncate(20);
        format!("{entry}-by-{}{number}", slug.trim_end_matches('-'))
    }

    /// The term in the user's units.
    pub(crate) fn out(&self, units: &Units) -> Self {
        let (of_x, of_g) = (self.coordinate.scale(units), self.entry.scale(units));
        let scaled = |values: &[f64], scale: f64| values.iter().map(|v| v * scale).collect();
        let shape = match &self.shape {
            Shape::Points { x, g, pinned } => Shape::Points {
                x: scaled(x, of_x),
                g: scaled(g, of_g),
                pinned: *pinned,
            },
            Shape::Formula {
                form,
                parameters,
                range,
            } => Shape::Formula {
                form,
                parameters: form.scaled(parameters, of_x, of_g),
                range: range.map(|x| x * of_x),
            },
        };
        Self {
            shape,
            coordinate: self.coordinate.out(units),
            fading: self.fading.map(|range| range.map(|t| t * units.time)),
            shift: self.shift * units.time,
            time: self.time * units.time,
            ..self.clone()
        }
    }

    /// g as an expression in an effect file.
    pub(crate) fn formula(&self) -> String {
        let x = self.coordinate.expression();
        match &self.shape {
            Shape::Formula { form, .. } => form.expression.replace("{x}", &x),
            Shape::Points { x: at, pinned, .. } => {
                let points = at.iter().enumerate().map(|(i, at)| {
                    let value = if *pinned == Some(i) {
                        "0.0".to_owned()
                    } else {
                        format!("g{i}")
                    };
                    format!("{at:?}, {value}")
                });
                let points: Vec<String> = points.collect();
                format!("table({x}, {})", points.join(", "))
            }
        }
    }

    fn parameters(&self) -> Vec<Parameter> {
        let of_g = self.entry.unit().symbol();
        let mut all: Vec<Parameter> = match &self.shape {
            Shape::Points { g, pinned, .. } => {
                let size = match self.entry {
                    Entry::Delay => RULES.longest_delay_s * self.time,
                    _ => RULES.largest * g.iter().fold(1.0, |m: f64, g| m.max(g.abs())),
                };
                let free = (0..g.len()).filter(|i| Some(*i) != *pinned);
                let values = free.map(|i| Parameter {
                    name: format!("g{i}"),
                    value: g[i].clamp(-size, size),
                    unit: of_g,
                    low: -size,
                    high: size,
                });
                values.collect()
            }
            Shape::Formula {
                form,
                parameters,
                range,
            } => {
                let cards = form.parameters.iter().zip(parameters);
                let own = cards.map(|(card, value)| {
                    let [low, high] = card.range(*value, *range);
                    Parameter {
                        name: card.name.to_owned(),
                        value: value.clamp(low, high),
                        unit: card.unit(of_g, self.coordinate.unit().symbol()),
                        low,
                        high,
                    }
                });
                own.collect()
            }
        };
        let time = self.coordinate.fading().zip(self.fading);
        all.extend(time.map(|(time, [low, high])| Parameter {
            name: FADING.to_owned(),
            value: time.clamp(low, high),
            unit: "s",
            low,
            high,
        }));
        all
    }

    /// Parameter values of the term's effect.
    pub(crate) fn values(&self) -> Vec<f64> {
        self.parameters().iter().map(|p| p.value).collect()
    }

    /// The curve with more points where it is steepest relative to its standard `errors`. If there are too many points,
    /// those collinear with their neighbours are removed. `None` if nothing changes.
    pub(crate) fn finer(&self, errors: &[f64]) -> Option<Self> {
        let Shape::Points { x, g, pinned } = &self.shape else {
            return None;
        };
        let rise = |i: &usize| (g[i + 1] - g[*i]).abs() - 2.0 * errors[*i].hypot(errors[i + 1]);
        let steepest = (0..x.len().checked_sub(1)?).max_by(|a, b| rise(a).total_cmp(&rise(b)))?;
        let mut points: Vec<(f64, f64, bool)> = (0..x.len())
            .map(|i| (x[i], g[i], *pinned == Some(i)))
            .collect();
        let between = |along: f64| {
            let at = |from: f64, to: f64| from + along * (to - from);
            let (i, j) = (steepest, steepest + 1);
            (at(x[i], x[j]), at(g[i], g[j]), false)
        };
        let new = (1..=RULES.inserted).map(|k| between(k as f64 / (RULES.inserted + 1) as f64));
        points.splice(steepest + 1..steepest + 1, new);
        let kept = steepest..=steepest + 1 + RULES.inserted;
        let mut spare: Vec<usize> = (1..points.len() - 1)
            .filter(|i| !kept.contains(i))
            .collect();
        let off_line = |i: &usize| {
            let [a, b, c] = [points[i - 1], points[*i], points[i + 1]];
            (b.1 - (a.1 + (c.1 - a.1) * (b.0 - a.0) / (c.0 - a.0))).abs()
        };
        spare.retain(|i| !points[*i].2);
        order::ascending(&mut spare, off_line);
        spare.truncate(points.len().saturating_sub(RULES.most_points));
        let mut index = 0;
        points.retain(|_| {
            index += 1;
            !spare.contains(&(index - 1))
        });
        Some(Self {
            shape: Shape::Points {
                x: points.iter().map(|point| point.0).collect(),
                g: points.iter().map(|point| point.1).collect(),
                pinned: points.iter().position(|point| point.2),
            },
            ..self.clone()
        })
    }

    /// The term with other parameter values.
    pub(crate) fn with_values(&self, values: &[f64]) -> Self {
        let mut other = self.clone();
        let own: Vec<&mut f64> = match &mut other.shape {
            Shape::Points { g, pinned, .. } => {
                let free = g.iter_mut().enumerate();
                let free = free.filter(|(i, _)| Some(*i) != *pinned);
                free.map(|(_, value)| value).collect()
            }
            Shape::Formula { parameters, .. } => parameters.iter_mut().collect(),
        };
        let time = values.get(own.len()).filter(|_| self.fading.is_some());
        for (own, value) in own.into_iter().zip(values) {
            *own = *value;
        }
        if let Some(time) = time {
            other.coordinate = other.coordinate.with_fading(*time);
        }
        other
    }

    /// The term as an effect file, which starts with the lines of `comment`.
    pub(crate) fn file(&self, comment: &str) -> String {
        let longest = self.shift + RULES.longest_delay_s * self.time;
        let mut text = String::new();
        for line in comment.lines() {
            let _ = writeln!(text, "# {line}");
        }
        let summary = format!(
            "{} by {}",
            self.entry.words(),
            self.coordinate.words().replace(['"', '\\'], "")
        );
        let g = self.formula();
        let expression = self
            .entry
            .expression(&g, self.shift, longest, 2.0 * self.on);
        let _ = writeln!(
            text,
            "name = \"{}\"\nplace = \"{}\"\nsummary = \"{summary}\"\nsource = \"found by discover\"",
            self.name(),
            self.entry.of_effect(),
        );
        if let Some(channel) = self.coordinate.channel() {
            let _ = writeln!(text, "channel = \"{channel}\"");
        }
        let _ = writeln!(text, "expression = \"{expression}\"");
        for state in self
            .coordinate
            .states(self.on, self.time, self.fading.is_some())
        {
            let _ = writeln!(
                text,
                "\n[[state]]\nname = \"{}\"\nstart = {:?}\nupdate = \"{}\"",
                state.name, state.start, state.update
            );
        }
        for p in self.parameters() {
            let _ = writeln!(
                text,
                "\n[[parameter]]\nname = \"{}\"\nunit = \"{}\"\nlow = {:?}\nhigh = {:?}\nstarts = [{:?}]",
                p.name, p.unit, p.low, p.high, p.value
            );
        }
        text
    }

    /// Definition of the term as an effect file.
    pub(crate) fn definition(&self) -> Result<&'static Definition, DefinitionError> {
        Definition::from_toml(&self.file(""), &self.name())
    }

    /// The model with the term; `reference` is the reference of its channel. `None` if the model has an effect of the
    /// same name.
    pub(crate) fn added_to(&self, model: &Model, reference: Option<f64>) -> Option<Model> {
        let mut model = model.clone();
        let definition = self.definition().ok()?;
        if model.has_effect(&self.name()) {
            return None;
        }
        model.define(definition).ok()?;
        model.delay_later(-self.shift / model.sample_period_s);
        model.add(definition.spec(), &self.values(), reference);
        Some(model)
    }

    /// The model without the term.
    pub(crate) fn taken_from(&self, model: &Model) -> Model {
        let mut model = model.clone();
        let name = self.name();
        model.effects.retain(|added| added.name != name);
        model.definitions.retain(|known| known.spec().name != name);
        model.delay_later(self.shift / model.sample_period_s);
        model
    }

    /// The term with the values of a model that contains it.
    pub(crate) fn in_model(&self, model: &Model) -> Self {
        let name = self.name();
        let own = model.effects.iter().find(|added| added.name == name);
        own.map_or_else(|| self.clone(), |own| self.with_values(&own.parameters))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(x: &[f64], g: &[f64], pinned: Option<usize>) -> Term {
        Term {
            entry: Entry::Sensitivity,
            coordinate: Coordinate::Time,
            shape: Shape::Points {
                x: x.to_vec(),
                g: g.to_vec(),
                pinned,
            },
            fading: None,
            on: 0.5,
            shift: 0.0,
            time: 1.0,
            number: 1,
        }
    }

    #[test]
    fn a_memory_s_fading_time_is_fitted_where_it_is_free() {
        let fixed = Term {
            coordinate: Coordinate::MemoryOfU(0.2),
            ..curve(&[0.0, 0.5, 1.0], &[0.0, 0.1, 0.3], Some(0))
        };
        assert_eq!(fixed.values(), [0.1, 0.3]);
        assert!(fixed.has_chosen_time());
        let free = fixed.with_free_time(2.0);
        assert_eq!(free.values(), [0.1, 0.3, 0.2]);
        assert!(!free.has_chosen_time());
        let other = free.with_values(&[0.2, 0.4, 0.35]);
        assert_eq!(other.coordinate, Coordinate::MemoryOfU(0.35));
        assert_eq!(other.values(), [0.2, 0.4, 0.35]);
        // The physical search interval stays the same; its numbers are converted with the unit.
        assert_eq!(other.fading, Some([0.1, 0.4]));
        let slow = Units {
            time: 10.0,
            ..Units::NONE
        };
        assert_eq!(other.out(&slow).fading, Some([1.0, 4.0]));
        // A coordinate without a time constant has none to fit.
        let timeless = curve(&[0.0, 1.0], &[0.0, 1.0], None).with_free_time(2.0);
        assert_eq!((timeless.fading, timeless.values().len()), (None, 2));
    }

    #[test]
    fn a_curve_gets_points_where_it_is_steepest_beyond_its_errors() {
        let x: Vec<f64> = (0..8).map(f64::from).collect();
        let g = [0.0, 0.01, 0.0, 0.0, 0.0, -0.2, -0.2, -0.5];
        // The last value is poorly determined.
        let errors = [0.01, 0.01, 0.01, 0.01, 0.0, 0.01, 0.01, 0.3];
        let finer = curve(&x, &g, Some(4)).finer(&errors).expect("a curve");
        let Shape::Points { x, g, pinned } = &finer.shape else {
            panic!("a curve stays one");
        };
        assert_eq!(x.len(), RULES.most_points);
        assert_eq!(x[4..9], [4.0, 4.25, 4.5, 4.75, 5.0]);
        assert!((g[6] + 0.1).abs() < 1e-12);
        assert_eq!(*pinned, Some(4));
        // In the next round, points collinear with their neighbours are removed, except the fixed point and
        // the end points.
        let errors = [0.0; 11];
        let finest = finer.finer(&errors).expect("a curve");
        let Shape::Points { x, g, pinned } = &finest.shape else {
            panic!("a curve stays one");
        };
        assert_eq!(x.len(), RULES.most_points);
        assert_eq!((x[0], x[10]), (0.0, 7.0));
        assert!(x.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(pinned.map(|i| (x[i], g[i])), Some((4.0, 0.0)));
    }
}
