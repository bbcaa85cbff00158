//! The result of a case: one line of JSON.

use serde::{Deserialize, Serialize};

use super::spot::{Spot, Truth};
use crate::campaign::case::Group;
use crate::campaign::ledger::Entry;
use crate::campaign::program::Spent;

/// A reported term.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Told {
    /// Place and coordinate of the term.
    #[serde(flatten)]
    pub spot: Spot,
    /// Equivalence set of the term, without the term itself.
    pub alike: Vec<Spot>,
    /// Share of the unexplained variance that the term explains, %.
    pub excess_taken_percent: f64,
    /// p-value.
    pub p_value: f64,
    /// Similar effects of the catalogue.
    pub resembles: Vec<String>,
    /// Formula of the term.
    pub formula: String,
    /// Points of the curve: (coordinate, value).
    #[serde(default)]
    pub curve: Vec<(f64, f64)>,
}

impl Told {
    fn spots(&self) -> impl Iterator<Item = &Spot> {
        [&self.spot].into_iter().chain(&self.alike)
    }
}

/// The result of a case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Key of the case.
    pub key: String,
    /// Group of the case; none before it was run.
    pub group: Option<Group>,
    /// Name of the family.
    pub family: String,
    /// The hidden effect, by the plant's name.
    pub label: String,
    /// Noise, and nuisances where there are any.
    pub circumstances: String,
    /// Weight of the hidden effect; none without one.
    pub weight: Option<f64>,
    /// The correct findings.
    pub truths: Vec<Truth>,
    /// Further correct findings.
    pub also_true: Vec<Truth>,
    /// Whether the physics deviates in one region only.
    pub regional: bool,
    /// Why there is no result.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// The reported terms, in order.
    pub terms: Vec<Told>,
    /// Validation error of the given model over the noise level.
    pub given_over_floor: Option<f64>,
    /// Validation error of the best base without a new term, over the noise level.
    pub base_over_floor: Option<f64>,
    /// Validation error of the final model over the noise level.
    pub over_floor: Option<f64>,
    /// Share of the unexplained variance of the best base that the curve explains.
    pub curve_taken: Option<f64>,
    /// The share that the reported formula or curve explains.
    pub formula_taken: Option<f64>,
    /// Reduction of the squared distance to the noise-free validation readings from the given to the final
    /// model; these are known only in the simulation.
    pub truly_taken: Option<f64>,
    /// For physics in one region: F1 score of the samples that the curve assigns to that region.
    pub region_f1: Option<f64>,
    /// For first-order flows with one lag: the larger relative error of the two time constants in the final
    /// model.
    #[serde(default)]
    pub base_bias: Option<f64>,
    /// Duration of the identification.
    pub identify: Spent,
    /// Duration of the search.
    pub discover: Spent,
}

impl Entry for Row {
    fn key(&self) -> &str {
        &self.key
    }
}

/// Share of the unexplained variance that a correct curve must explain.
pub(super) const ENOUGH: f64 = 0.6;

impl Row {
    /// The first term that is not a property of the rig itself.
    #[must_use]
    pub fn first(&self) -> Option<&Told> {
        let known = |told: &&Told| {
            let hidden = self.truths.iter().any(|truth| truth.is(&told.spot));
            let mut also = self.also_true.iter();
            !hidden && also.any(|truth| truth.is(&told.spot))
        };
        self.terms.iter().find(|told| !known(told))
    }

    /// Whether a term is reported although the rig lacks none.
    #[must_use]
    pub fn is_needless(&self) -> bool {
        self.truths.is_empty() && self.first().is_some()
    }

    fn one(&self, test: impl Fn(&Truth, &Told) -> bool) -> bool {
        let first = self.first();
        first.is_some_and(|told| self.truths.iter().any(|truth| test(truth, told)))
    }

    /// Whether the place is correct.
    #[must_use]
    pub fn has_place(&self) -> bool {
        self.one(|truth, told| truth.is_at(&told.spot))
    }

    /// Whether the place is correct, or that of a member of the equivalence set.
    #[must_use]
    pub fn has_place_in_set(&self) -> bool {
        self.one(|truth, told| told.spots().any(|spot| truth.is_at(spot)))
    }

    /// Whether place and coordinate are correct.
    #[must_use]
    pub fn has_coordinate(&self) -> bool {
        self.one(|truth, told| truth.is(&told.spot))
    }

    /// Whether place and coordinate are correct, or those of a member of the equivalence set.
    #[must_use]
    pub fn has_coordinate_in_set(&self) -> bool {
        self.one(|truth, told| told.spots().any(|spot| truth.is(spot)))
    }

    /// Whether the curve explains enough of the unexplained variance.
    #[must_use]
    pub fn takes_enough(&self) -> bool {
        self.curve_taken.is_some_and(|taken| taken >= ENOUGH)
    }

    /// Whether the result is correct in every respect.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.failure.is_none()
            && if self.truths.is_empty() {
                !self.is_needless()
            } else {
                self.has_coordinate_in_set() && self.takes_enough()
            }
    }

    /// The finding in short.
    #[must_use]
    pub fn said(&self) -> String {
        if let Some(failure) = &self.failure {
            return failure.clone();
        }
        let told = |told: &Told| {
            let alike: Vec<String> = (told.alike.iter())
                .map(|spot| format!("{} by {}", spot.place, spot.coordinate))
                .collect();
            let spot = format!("{} by {}", told.spot.place, told.spot.coordinate);
            match &alike[..] {
                [] => spot,
                _ => format!("{spot} (or {})", alike.join(", ")),
            }
        };
        match &self.terms[..] {
            [] => "nothing".to_owned(),
            terms => terms.iter().map(told).collect::<Vec<_>>().join(" + "),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(place: &str, coordinate: &str) -> Spot {
        Spot {
            place: place.to_owned(),
            coordinate: coordinate.to_owned(),
        }
    }

    fn row(terms: &[(&str, &str)]) -> Row {
        let truth = |place: &str, coordinate: &str| Truth {
            place: place.to_owned(),
            coordinates: vec![coordinate.to_owned()],
        };
        let told = |(place, coordinate): &(&str, &str)| Told {
            spot: spot(place, coordinate),
            ..Told::default()
        };
        Row {
            group: Some(Group::Beyond),
            truths: vec![truth("jet", "pulse number")],
            also_true: vec![truth("delay", "mean y")],
            terms: terms.iter().map(told).collect(),
            curve_taken: Some(0.9),
            ..Row::default()
        }
    }

    #[test]
    fn what_is_true_anyway_does_not_count_and_what_is_alike_does() {
        let right = row(&[("delay", "mean y (0.25 s)"), ("jet", "pulse number")]);
        assert!(right.has_coordinate() && right.is_right());
        let mut other = row(&[("jet", "time in record")]);
        assert!(other.has_place() && !other.has_coordinate_in_set() && !other.is_right());
        other.terms[0].alike = vec![spot("jet", "pulse number")];
        assert!(other.has_coordinate_in_set() && !other.has_coordinate() && other.is_right());
        other.curve_taken = Some(0.5);
        assert!(!other.is_right());
        assert!(!row(&[]).has_place_in_set());
    }

    #[test]
    fn nothing_should_be_told_of_a_rig_where_nothing_is_missing() {
        let null = |terms| Row {
            truths: Vec::new(),
            ..row(terms)
        };
        assert!(null(&[]).is_right());
        assert!(null(&[("delay", "mean y (0.25 s)")]).is_right());
        assert!(null(&[("jet", "pulse number")]).is_needless());
        let mut failed = null(&[]);
        failed.failure = Some("stopped".to_owned());
        assert!(!failed.is_right());
    }

    #[test]
    fn rows_survive_the_file() {
        let mut own = row(&[("jet", "pulse number")]);
        own.terms[0].curve = vec![(1.0, 0.0), (9.0, -0.3)];
        let line = serde_json::to_string(&own).unwrap();
        assert!(!line.contains('\n') && line.contains("\"place\":\"jet\""));
        assert_eq!(serde_json::from_str::<Row>(&line).unwrap(), own);
    }
}
