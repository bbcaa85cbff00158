//! The result of a discovery.

use super::trace::Trace;
use crate::curves::{Candidate, Place, Shape, Term};
use crate::diagnose::{ParameterEstimate, Rung};
use crate::experiment::Separation;
use crate::fit::Fit;
use crate::model::Model;
use crate::preparation::MovingZero;
use crate::residual::NoiseSource;
use crate::terms::{HeldOutBy, Hypothesis, Judged, Units};
use serde::Serialize;
use std::collections::BTreeMap;

/// A point of a curve with its 95 % band, in the user's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Value of the coordinate.
    pub x: f64,
    /// Lower end of the band.
    pub low: f64,
    /// Value of g.
    pub value: f64,
    /// Upper end.
    pub high: f64,
}

/// A term that is not distinguishable from another.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Alike {
    /// Where it acts.
    pub place: Place,
    /// The coordinate of the term.
    pub coordinate: String,
}

/// Detectable size of a term at a place: rms of its values, from the easiest coordinate to the hardest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Smallest {
    /// Detectable size for the easiest coordinate.
    pub from: f64,
    /// Detectable size for the hardest coordinate of the easier half.
    pub to: f64,
    /// The unit.
    pub unit: &'static str,
}

/// A discovered term. Serialises to an entry of `terms` of `discover --json`.
#[derive(Clone, Debug, Serialize)]
pub struct FoundTerm {
    /// Name of the term's effect.
    pub effect: String,
    /// Where it acts.
    pub place: Place,
    /// The quantity that the term changes, in words.
    pub changes: &'static str,
    /// The coordinate of the term.
    pub coordinate: String,
    /// Unit of the coordinate.
    pub coordinate_unit: &'static str,
    /// Share of the unexplained validation variance that the curve explains, %.
    pub excess_taken_percent: f64,
    /// Share of the unexplained validation variance that the reported formula or curve explains, %.
    pub formula_taken_percent: f64,
    /// Family-wise p-value of the term's gain, over all curves screened.
    pub p_value: f64,
    /// The curve with its band.
    pub curve: Vec<CurvePoint>,
    /// Unit of the curve.
    pub unit: &'static str,
    /// Effects of the catalogue with a similar change of the free run.
    pub resembles: Vec<String>,
    /// The formula of the effect: an expression in its coordinate, or a table if no formula fits equally
    /// well.
    pub formula: String,
    /// Whether the term is a formula; false for a table.
    pub is_formula: bool,
    /// Parameters of the formula.
    pub parameters: BTreeMap<String, ParameterEstimate>,
    /// Terms that these records do not distinguish from this one.
    pub alike: Vec<Alike>,
    /// Share of bootstrap resamples of the validation records in which this place and coordinate fit best, %.
    pub stability_percent: f64,
    /// Effect file of the term.
    #[serde(skip)]
    pub file: String,
}

/// The result of a discovery.
#[derive(Clone, Debug)]
pub struct Discovery {
    /// The terms in the order found.
    pub terms: Vec<FoundTerm>,
    /// Validation errors from the given model to the final one.
    pub ladder: Vec<Rung>,
    /// Detectable size of a term, by place.
    pub smallest_seen: BTreeMap<String, Smallest>,
    /// How the validation error was obtained.
    pub held_out_by: HeldOutBy,
    /// Where the noise level comes from.
    pub noise_source: NoiseSource,
    /// The noise level on the validation samples, y rms.
    pub noise_estimate: f64,
    /// Number of curves screened.
    pub looked_at: usize,
    /// At each place, the signal that would explain the error of the base without the first term. If no term was
    /// found, the base is the best one. `None` if no error remains.
    pub trace: Option<Trace>,
    /// The command that would distinguish the first ambiguous term from the terms equivalent to it.
    pub separation: Option<Separation>,
    /// The record-to-record offset of the sensor, if there is one: a term must explain more than this offset
    /// does.
    pub moving_zero: Option<MovingZero>,
    /// The model with the terms.
    pub model: Model,
}

/// A term that was found, with its model.
#[derive(Clone)]
pub(super) struct Found {
    /// The reported form: a formula, or the curve.
    pub(super) term: Term,
    /// The term as a curve, as fitted.
    pub(super) curve: Term,
    /// Standard errors of the curve's values.
    pub(super) errors: Vec<f64>,
    /// The model with the term.
    pub(super) with: Hypothesis,
    /// The base model without the term, refitted.
    pub(super) without: Judged,
    pub(super) p: f64,
    /// Share of the unexplained variance that the curve explains.
    pub(super) taken: f64,
    /// Share of the unexplained variance that the formula explains.
    pub(super) formula_taken: f64,
    pub(super) resembles: Vec<String>,
    pub(super) alike: Vec<Alike>,
    /// Terms that these records do not distinguish from this one, each in its model.
    pub(super) rivals: Vec<Candidate>,
    /// Earlier terms that the models of `rivals` contain too.
    pub(super) beside: Vec<Term>,
    /// Share of bootstrap resamples in which it or an equivalent term is the best.
    pub(super) stability: f64,
}

impl Found {
    /// The curve with its band, in the user's units.
    pub(super) fn curve(&self, units: &Units) -> Vec<CurvePoint> {
        let outer = self.curve.out(units);
        let scale = outer.entry.scale(units);
        let Shape::Points { x, g, .. } = &outer.shape else {
            return Vec::new();
        };
        let points = x.iter().zip(g).zip(&self.errors);
        points
            .map(|((x, g), error)| {
                let half = 1.96 * error * scale;
                CurvePoint {
                    x: *x,
                    low: g - half,
                    value: *g,
                    high: g + half,
                }
            })
            .collect()
    }
}

/// A found term for the report; `written` is the reported form in the user's units, `scored` names the records of
/// its error.
pub(super) fn told(
    found: &Found,
    written: &Term,
    fitted: &Fit,
    units: &Units,
    scored: &str,
) -> FoundTerm {
    let entry = written.entry;
    let curve = found.curve(units);
    let is_formula = matches!(written.shape, Shape::Formula { .. });
    let parameters = estimates(&found.term, written, fitted);
    let name = written.name();
    let place = entry.place();
    let share = |share: f64| 100.0 * share;
    let mut comment = format!(
        "Found by `host-fit discover`: {} as a function of {}.\nIt explains {:.0} % of the model error above the noise on the {scored}; p = {:.1e}.",
        entry.words(),
        written.coordinate.words(),
        share(found.formula_taken),
        found.p
    );
    if !found.resembles.is_empty() {
        comment += &format!("\nResembles {}.", found.resembles.join(", "));
    }
    for other in &found.alike {
        let place = other.place.word();
        comment += &format!(
            "\nNot distinguishable on the records from a term at the {place} that depends on {}.",
            other.coordinate
        );
    }
    FoundTerm {
        effect: name,
        place,
        changes: entry.words(),
        coordinate: entry.depends_on(&written.coordinate),
        coordinate_unit: written.coordinate.unit().symbol(),
        excess_taken_percent: share(found.taken),
        formula_taken_percent: share(found.formula_taken),
        p_value: found.p,
        curve,
        unit: entry.unit().symbol(),
        resembles: found.resembles.clone(),
        formula: written.formula(),
        is_formula,
        parameters,
        alike: found.alike.clone(),
        stability_percent: share(found.stability),
        file: written.file(&comment),
    }
}

/// Parameters with their intervals in the user's units.
fn estimates(inner: &Term, outer: &Term, fitted: &Fit) -> BTreeMap<String, ParameterEstimate> {
    let Ok(definition) = outer.definition() else {
        return BTreeMap::new();
    };
    let inner = inner.in_model(&fitted.model);
    let coordinates = fitted.model.coordinates();
    let name = outer.name();
    let values = inner.values().into_iter().zip(outer.values());
    let cards = definition.spec().parameters.iter();
    cards
        .zip(values)
        .map(|(card, (inside, outside))| {
            let full = format!("{name}.{}", card.name);
            let index = coordinates.iter().position(|c| c.name == full);
            let error = index.and_then(|index| fitted.standard_error(index));
            let scale = if inside == 0.0 { 0.0 } else { outside / inside };
            let half = error.map_or(f64::INFINITY, |error| 1.96 * (error * scale).abs());
            let estimate = ParameterEstimate {
                value: outside,
                unit: card.unit.symbol().to_owned(),
                low: (outside - half).max(card.low),
                high: (outside + half).min(card.high),
                determined: half.is_finite()
                    && (outside - half > card.low || outside + half < card.high),
            };
            (card.name.to_owned(), estimate)
        })
        .collect()
}
