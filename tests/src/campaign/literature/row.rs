//! The result of a case, and how it is counted.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::case::Case;
use crate::campaign::ledger::Entry;
use crate::campaign::program::Spent;

/// The result of a case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Key of the case.
    pub key: String,
    /// The published model.
    pub model: String,
    /// The hidden effect; empty for a null case.
    pub hidden: Vec<String>,
    /// Effects that are part of the published physics.
    pub also_right: Vec<String>,
    /// The verdict; `failed` without one.
    pub verdict: String,
    /// Why there is no verdict.
    pub failure: Option<String>,
    /// Names that are claimed.
    pub missing: Vec<String>,
    /// Certified names in an unexplained verdict.
    pub certified: Vec<String>,
    /// Equivalence set of each of `missing`.
    pub sets: Vec<Vec<String>>,
    /// Names of surrogates.
    pub surrogates: Vec<String>,
    /// Error of the given model over the noise level.
    pub given_over_noise: Option<f64>,
    /// Error of the best model over the noise level.
    pub over_noise: Option<f64>,
    /// Duration of `identify`.
    pub identify: Spent,
    /// Duration of `diagnose`.
    pub diagnose: Spent,
}

impl Entry for Row {
    fn key(&self) -> &str {
        &self.key
    }
}

impl Row {
    /// An empty result for a case.
    #[must_use]
    pub fn of(case: &Case) -> Self {
        Self {
            key: case.to_string(),
            model: case.model.to_owned(),
            hidden: case.hidden.into_iter().map(str::to_owned).collect(),
            verdict: "failed".to_owned(),
            ..Self::default()
        }
    }

    /// Reads a document of `diagnose --json`.
    ///
    /// # Errors
    /// A document without a verdict.
    pub fn hear(&mut self, document: &Value) -> Result<(), String> {
        let word = document["verdict"].as_str();
        let word = word.ok_or("no verdict in the document of diagnose")?;
        self.verdict = word.to_owned();
        self.missing = names(&document["missing"]);
        self.certified = names(&document["certified"]);
        self.surrogates = names(&document["stand_ins"]);
        let sets = document["sets"].as_array();
        self.sets = sets.map_or_else(Vec::new, |sets| sets.iter().map(names).collect());
        let over = |rung: Option<&Value>| {
            let rung = rung?;
            Some(rung["validate_rmse"].as_f64()? / rung["noise_rmse"].as_f64()?)
        };
        let ladder = document["ladder"].as_array();
        self.given_over_noise = over(ladder.and_then(|rungs| rungs.first()));
        self.over_noise = over(ladder.and_then(|rungs| rungs.last()));
        Ok(())
    }

    /// Whether nothing is hidden.
    #[must_use]
    pub fn is_null(&self) -> bool {
        self.hidden.is_empty()
    }

    /// Whether the hidden effect is the first name that is claimed.
    #[must_use]
    pub fn is_named_first(&self) -> bool {
        !self.is_null() && self.claimed().next() == self.hidden.first()
    }

    /// Whether the hidden effect is claimed or in a claimed name's set.
    #[must_use]
    pub fn is_in_set(&self) -> bool {
        let told: Vec<&String> = self.claimed().chain(self.sets.iter().flatten()).collect();
        !self.is_null() && self.hidden.iter().all(|name| told.contains(&name))
    }

    /// Whether nothing is claimed and the hidden effect is the first surrogate.
    #[must_use]
    pub fn is_first_surrogate(&self) -> bool {
        !self.is_null()
            && self.claimed().next().is_none()
            && self.surrogates.first() == self.hidden.first()
    }

    /// Whether a claimed name is neither hidden nor part of the published physics, and its set contains no
    /// such name.
    #[must_use]
    pub fn has_wrong_name(&self) -> bool {
        let right = |name: &String| self.hidden.contains(name) || self.also_right.contains(name);
        let set_of = |name: &String| self.sets.iter().find(|set| set.first() == Some(name));
        self.claimed().any(|name| {
            let in_set = set_of(name).is_some_and(|set| set.iter().any(right));
            !right(name) && !in_set
        })
    }

    fn claimed(&self) -> impl Iterator<Item = &String> {
        self.missing.iter().chain(&self.certified)
    }

    /// Share of the unexplained variance of the given model that the best model explains.
    #[must_use]
    pub fn explained(&self) -> Option<f64> {
        let excess = |over: f64| (over * over - 1.0).max(0.0);
        let before = self.given_over_noise.map(excess).filter(|e| *e > 0.0)?;
        Some((1.0 - excess(self.over_noise?) / before).max(0.0))
    }

    /// The verdict in short.
    #[must_use]
    pub fn said(&self) -> String {
        if let Some(failure) = &self.failure {
            return failure.clone();
        }
        let mut words = self.verdict.clone();
        for (what, list) in [
            ("", &self.missing),
            ("certified ", &self.certified),
            ("surrogates ", &self.surrogates),
        ] {
            if !list.is_empty() {
                words += &format!(" {what}[{}]", list.join(", "));
            }
        }
        words
    }
}

fn names(list: &Value) -> Vec<String> {
    let each = list.as_array().into_iter().flatten();
    each.filter_map(|name| name.as_str().map(str::to_owned))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn names_count_as_the_goals_have_them() {
        let case = Case {
            model: "wrong-way",
            hidden: Some("valve-lag"),
            real_instruments: true,
            seed: 1,
        };
        let heard = |missing: &[&str], sets: &[&[&str]], stand_ins: &[&str]| {
            let mut row = Row::of(&case);
            let document = json!({
                "verdict": "effect-missing", "missing": missing, "sets": sets, "stand_ins": stand_ins,
                "ladder": [
                    {"validate_rmse": 0.03, "noise_rmse": 0.01},
                    {"validate_rmse": 0.01, "noise_rmse": 0.01},
                ],
            });
            row.hear(&document).unwrap();
            row
        };
        let right = heard(&["valve-lag"], &[&["valve-lag"]], &[]);
        assert!(right.is_named_first() && right.is_in_set() && !right.has_wrong_name());
        assert_eq!(right.explained(), Some(1.0));
        let set = heard(&["hot-film-lag"], &[&["hot-film-lag", "valve-lag"]], &[]);
        assert!(!set.is_named_first() && set.is_in_set() && !set.has_wrong_name());
        let wrong = heard(&["hot-film-lag"], &[&["hot-film-lag"]], &["valve-lag"]);
        assert!(!wrong.is_in_set() && wrong.has_wrong_name() && !wrong.is_first_surrogate());
        assert!(heard(&[], &[], &["valve-lag"]).is_first_surrogate());
        assert!(Row::of(&case).hear(&json!({})).is_err());
    }
}
