//! Place and coordinate of a term, true and reported.

use firmware_sim::plant;
use serde::{Deserialize, Serialize};

/// Reported place and coordinate.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Spot {
    /// jet, delay, flow or sensor.
    pub place: String,
    /// The coordinate.
    pub coordinate: String,
}

/// A correct finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Truth {
    /// The place.
    pub place: String,
    /// Equivalent coordinates.
    pub coordinates: Vec<String>,
}

impl From<plant::Truth> for Truth {
    fn from(truth: plant::Truth) -> Self {
        Self {
            place: truth.port.word().to_owned(),
            coordinates: truth.coordinates,
        }
    }
}

/// Times of memories and windows count as correct within this factor: neighbours of the search grid are a
/// factor of three apart.
const TIMES: f64 = 2.0;

impl Truth {
    /// Whether both spots have the same place.
    #[must_use]
    pub fn is_at(&self, spot: &Spot) -> bool {
        spot.place == self.place
    }

    /// Whether both spots have the same place and coordinate.
    #[must_use]
    pub fn is(&self, spot: &Spot) -> bool {
        let own = factors(&self.place, &spot.coordinate);
        self.is_at(spot)
            && self.coordinates.iter().any(|coordinate| {
                let truth = factors(&self.place, coordinate);
                let one = |a: &Factor<'_>| own.iter().any(|b| a.is_like(b));
                truth.len() == own.len() && truth.iter().all(one)
            })
    }
}

/// A factor of a coordinate: its kind, and its time if it has one (s).
#[derive(Clone, Copy, Debug, PartialEq)]
struct Factor<'a> {
    kind: &'a str,
    time: Option<f64>,
}

impl<'a> Factor<'a> {
    fn of(words: &'a str) -> Self {
        let words = words.trim();
        const WINDOW: &str = "blowing in the last";
        let (kind, rest) = match words.split_once(" (") {
            Some((kind, rest)) => (kind, rest),
            None if words.starts_with(WINDOW) => words.split_at(WINDOW.len()),
            None => (words, ""),
        };
        let time = rest.split_whitespace().next().and_then(|t| t.parse().ok());
        Self { kind, time }
    }

    fn is_like(&self, other: &Self) -> bool {
        let near = match (self.time, other.time) {
            (Some(a), Some(b)) => (a / b).max(b / a) <= TIMES,
            _ => true,
        };
        self.kind == other.kind && near
    }
}

/// The factors of a coordinate at a place. A flow returns in proportion to y, and a sensor reads in proportion to
/// y. The distinction between a term of the rate and of the level, or of the sensitivity and of the offset, is
/// therefore not counted, unless the term depends on nothing else.
fn factors<'a>(place: &str, coordinate: &'a str) -> Vec<Factor<'a>> {
    let all: Vec<Factor<'a>> = coordinate.split(" × ").map(Factor::of).collect();
    let own = |factor: &Factor<'_>| match place {
        "flow" => factor.kind == "y",
        "sensor" => factor.kind == "reading" || factor.kind == "y",
        _ => false,
    };
    let others: Vec<Factor<'a>> = all.iter().copied().filter(|f| !own(f)).collect();
    if others.is_empty() {
        all.into_iter().take(1).collect()
    } else {
        others
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(place: &str, coordinate: &str) -> Spot {
        Spot {
            place: place.to_owned(),
            coordinate: coordinate.to_owned(),
        }
    }

    fn truth(place: &str, coordinates: &[&str]) -> Truth {
        Truth {
            place: place.to_owned(),
            coordinates: coordinates.iter().map(|c| (*c).to_owned()).collect(),
        }
    }

    #[test]
    fn the_kind_counts_and_a_time_within_a_factor() {
        let memory = truth("jet", &["memory of u (0.5 s)", "blowing in the last"]);
        assert!(memory.is(&told("jet", "memory of u (0.9 s)")));
        assert!(!memory.is(&told("jet", "memory of u (1.1 s)")));
        assert!(!memory.is(&told("jet", "memory of y (0.5 s)")));
        assert!(!memory.is(&told("flow", "memory of u (0.5 s)")));
        assert!(memory.is(&told("jet", "blowing in the last 3 s")));
        assert!(truth("flow", &["past y"]).is(&told("flow", "past y (0.1 s)")));
    }

    #[test]
    fn what_the_place_goes_in_proportion_to_is_no_coordinate_of_its_own() {
        let rate = truth("flow", &["pulse length × y"]);
        assert!(rate.is(&told("flow", "pulse length × y")));
        assert!(rate.is(&told("flow", "pulse length")));
        assert!(!rate.is(&told("flow", "y")));
        let level = truth("flow", &["y"]);
        assert!(level.is(&told("flow", "y")) && level.is(&told("flow", "y × y")));
        assert!(!level.is(&told("flow", "past y (0.1 s) × y")));
        let late = truth("sensor", &["time in record × reading"]);
        assert!(late.is(&told("sensor", "time in record")));
        assert!(!late.is(&told("sensor", "reading")));
        let product = truth("jet", &["rest before × pulse number"]);
        assert!(product.is(&told("jet", "pulse number × rest before")));
        assert!(!product.is(&told("jet", "pulse number")));
    }
}
