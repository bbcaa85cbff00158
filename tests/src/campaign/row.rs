//! The result of a case: one line of JSON.

use serde::{Deserialize, Serialize};

use super::case::Group;
use super::ledger::Entry;
use super::program::Spent;

/// A parameter of a hidden effect: true and estimated value, in the units of the record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// EFFECT.PARAMETER.
    pub name: String,
    /// True value of the rig.
    pub truth: f64,
    /// Value in the written model.
    pub found: f64,
    /// Symbol of the parameter's unit.
    #[serde(default)]
    pub unit: String,
    /// The stated 95 % interval; none if there is none.
    #[serde(default)]
    pub interval: Option<[f64; 2]>,
}

impl Found {
    /// Whether the found value is within the tolerance.
    #[must_use]
    pub fn is_near(&self) -> bool {
        (self.found - self.truth).abs() <= NEAR * self.truth.abs()
    }

    /// Whether the interval contains the truth; none without an interval.
    #[must_use]
    pub fn is_covered(&self) -> Option<bool> {
        let [low, high] = self.interval?;
        Some((low..=high).contains(&self.truth))
    }

    /// Kind of the parameter: times, levels of y, or anything else.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self.unit.as_str() {
            "s" | "Hz" | "rad/s" | "samples" => "times and frequencies",
            "y" => "levels of y",
            _ => "other",
        }
    }
}

/// An effect at its detectable size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PutIn {
    /// Name of the effect.
    pub effect: String,
    /// Amplitude of the effect; none if the diagnosis states that any size could stay undetected.
    pub amplitude: Option<f64>,
}

/// The result of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Key of the case.
    pub key: String,
    /// Its group.
    pub group: Group,
    /// Name of the family.
    pub family: String,
    /// The hidden effects, by the plant's names.
    pub label: String,
    /// Noise, and nuisances where there are any.
    pub circumstances: String,
    /// The names that should be found.
    pub hidden: Vec<String>,
    /// Further correct names.
    pub also_right: Vec<String>,
    /// Whether the flow has a second lag, which is equivalent to a film lag: a film lag in a set with `flow-lag` is
    /// correct, one named alone is not.
    #[serde(default)]
    pub flow_lag: bool,
    /// The verdict, or `failed` with the reason in `failure`.
    pub verdict: String,
    /// Why there is no diagnosis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// The named effects in their order, and those certified although another error remains.
    pub missing: Vec<String>,
    /// Equivalence set of each named effect.
    #[serde(default)]
    pub sets: Vec<Vec<String>>,
    /// Surrogates.
    #[serde(default)]
    pub stand_ins: Vec<String>,
    /// Validation error of the given model over the noise level.
    pub given_over_floor: Option<f64>,
    /// Validation error of the final model over the noise level.
    pub over_floor: Option<f64>,
    /// Family-wise p-value of the most significant effect; none if none was tried.
    #[serde(default)]
    pub p_value: Option<f64>,
    /// The added effect with its detectable size according to the diagnosis of the rig without it.
    #[serde(default)]
    pub put_in: Option<PutIn>,
    /// Parameters of the effects that were hidden and found.
    pub parameters: Vec<Found>,
    /// Duration of the identification.
    pub identify: Spent,
    /// Duration of the diagnosis.
    pub diagnose: Spent,
}

/// A model counts as at the noise level up to this ratio.
pub(super) const AT_FLOOR: f64 = 1.1;

/// Relative tolerance of a parameter.
const NEAR: f64 = 0.2;

impl Entry for Row {
    fn key(&self) -> &str {
        &self.key
    }
}

impl Row {
    /// The names that count. Names that are true of the rig, although not hidden on purpose, are
    /// left out.
    #[must_use]
    pub fn named(&self) -> Vec<&str> {
        let has = |names: &[String], name: &str| names.iter().any(|other| other == name);
        let lag = |name: &str| {
            let mut sets = self.sets.iter();
            let own = sets.find(|set| set.first().is_some_and(|first| first == name));
            self.flow_lag && own.is_some_and(|set| has(set, "flow-lag"))
        };
        let names = self.missing.iter().map(String::as_str);
        names
            .filter(|name| has(&self.hidden, name) || !(has(&self.also_right, name) || lag(name)))
            .collect()
    }

    /// Names of effects that the rig does not have.
    #[must_use]
    pub fn needless(&self) -> Vec<&str> {
        let named = self.named().into_iter();
        let needless = named.filter(|name| !self.hidden.iter().any(|hidden| hidden == name));
        needless.collect()
    }

    /// Whether the hidden effect was found: named first; both names for a pair; no name for a null case; for
    /// a fault, no name and a verdict other than "nothing missing".
    #[must_use]
    pub fn is_found(&self) -> bool {
        if self.failure.is_some() {
            return false;
        }
        let named = self.named();
        match self.group {
            Group::Single | Group::Altered | Group::Units | Group::Power => {
                named.first().copied() == self.hidden.first().map(String::as_str)
            }
            Group::Pair => self
                .hidden
                .iter()
                .all(|name| named.contains(&name.as_str())),
            Group::Nothing => named.is_empty(),
            Group::Outside | Group::Beyond => named.is_empty() && self.verdict != "nothing-missing",
        }
    }

    /// Wrong names that are alone in their sets.
    #[must_use]
    pub fn wrong_alone(&self) -> Vec<&str> {
        let mut names = self.needless();
        names.retain(|name| {
            let own = self
                .sets
                .iter()
                .find(|set| set.first().is_some_and(|first| first == name));
            own.is_none_or(|set| set.len() == 1)
        });
        names
    }

    /// Whether the hidden effect was found, without a wrong name.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.is_found() && self.needless().is_empty()
    }

    /// Whether the hidden effect was found, or is in the equivalence set of a named effect.
    #[must_use]
    pub fn is_in_set(&self) -> bool {
        let mut sets = self.sets.iter().flatten();
        self.is_found() || sets.any(|name| self.hidden.first() == Some(name))
    }

    /// Whether the final model is at the noise level.
    #[must_use]
    pub fn is_at_floor(&self) -> bool {
        self.over_floor.is_some_and(|over| over <= AT_FLOOR)
    }

    /// Whether all parameters of the hidden effects are within the tolerance; none without any.
    #[must_use]
    pub fn parameters_hit(&self) -> Option<bool> {
        (!self.parameters.is_empty()).then(|| self.parameters.iter().all(Found::is_near))
    }

    /// The verdict in short.
    #[must_use]
    pub fn said(&self) -> String {
        if let Some(failure) = &self.failure {
            return failure.clone();
        }
        let mut said = match self.verdict.as_str() {
            "effect-missing" => self.missing.join(" + "),
            "nothing-missing" => "nothing".to_owned(),
            other => other.to_owned(),
        };
        if !self.stand_ins.is_empty() {
            said += &format!(" ({})", self.stand_ins.join(" + "));
        }
        said
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(group: Group, hidden: &[&str], missing: &[&str]) -> Row {
        let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
        Row {
            key: "key".to_owned(),
            group,
            family: "wake".to_owned(),
            label: hidden.join("+"),
            circumstances: "white".to_owned(),
            hidden: owned(hidden),
            also_right: vec!["state-dependent-delay".to_owned()],
            flow_lag: false,
            verdict: "effect-missing".to_owned(),
            failure: None,
            missing: owned(missing),
            sets: Vec::new(),
            stand_ins: Vec::new(),
            given_over_floor: Some(3.0),
            over_floor: Some(1.05),
            p_value: None,
            put_in: None,
            parameters: Vec::new(),
            identify: Spent::default(),
            diagnose: Spent {
                wall_s: 2.0,
                cpu_s: Some(3.0),
            },
        }
    }

    #[test]
    fn the_first_name_counts_and_true_names_beside_it_do_not() {
        let right = row(
            Group::Single,
            &["valve-lag"],
            &["state-dependent-delay", "valve-lag"],
        );
        assert!(right.is_right());
        let late = row(Group::Single, &["valve-lag"], &["echo-path", "valve-lag"]);
        assert!(!late.is_found());
        assert_eq!(late.needless(), ["echo-path"]);
        let mut alike = row(Group::Single, &["valve-lag"], &["hot-film-lag"]);
        assert!(!alike.is_in_set());
        alike.sets = vec![vec!["hot-film-lag".to_owned(), "valve-lag".to_owned()]];
        assert!(alike.is_in_set() && !alike.is_found());
        assert!(row(Group::Nothing, &[], &["state-dependent-delay"]).is_found());
        assert!(!row(Group::Nothing, &[], &["echo-path"]).is_found());
        let hidden = row(
            Group::Single,
            &["state-dependent-delay"],
            &["state-dependent-delay"],
        );
        assert!(hidden.is_found() && hidden.is_at_floor());
    }

    #[test]
    fn a_lag_of_the_film_is_true_of_a_flow_with_a_second_lag_if_that_is_said() {
        let mut alone = row(Group::Nothing, &[], &["hot-film-lag"]);
        alone.flow_lag = true;
        alone.sets = vec![vec!["hot-film-lag".to_owned()]];
        assert!(!alone.is_found());
        alone.sets[0].push("flow-lag".to_owned());
        assert!(alone.is_found());
        alone.flow_lag = false;
        assert!(!alone.is_found());
    }

    #[test]
    fn rows_survive_the_file_and_failures_are_no_finds() {
        let mut failed = row(Group::Nothing, &[], &[]);
        failed.failure = Some("timed out".to_owned());
        failed.over_floor = None;
        let line = serde_json::to_string(&failed).unwrap();
        assert!(!line.contains('\n'));
        assert_eq!(serde_json::from_str::<Row>(&line).unwrap(), failed);
        assert!(!failed.is_found() && !failed.is_at_floor());
        assert_eq!(failed.said(), "timed out");
    }

    #[test]
    fn parameters_are_right_within_a_fifth() {
        let mut one = row(Group::Single, &["valve-lag"], &["valve-lag"]);
        assert_eq!(one.parameters_hit(), None);
        for (found, hit) in [(-0.0119, true), (-0.0121, false), (f64::NAN, false)] {
            let name = "valve-lag.opening_time".to_owned();
            let truth = -0.01;
            let unit = "s".to_owned();
            one.parameters = vec![Found {
                name,
                truth,
                found,
                unit,
                interval: Some([-0.0125, -0.01]),
            }];
            assert_eq!(one.parameters[0].is_covered(), Some(true));
            assert_eq!(one.parameters_hit(), Some(hit));
        }
    }
}
