//! Runs a case like a user: a folder, `identify`, `discover`, the written model.

use std::fs;
use std::path::Path;

use firmware_sim::family::RigPlan;
use firmware_sim::plant::{self, Character};
use firmware_sim::recording::Recorded;
use host_fit::data::Use;
use host_fit::model::Model;
use serde_json::Value;

use super::case::of_the_catalogue;
use super::region::f1;
use super::row::{Row, Told};
use super::spot::{Spot, Truth};
use crate::campaign::case::{Case, Group};
use crate::campaign::program::Program;
use crate::campaign::run::structure;

/// Runs a case with at most `terms` terms. A failure gives a result too.
#[must_use]
pub fn run(case: &Case, program: &Program, terms: u32) -> Row {
    let mut row = Row::of(case);
    let key = row.key.clone();
    let fill = |row: &mut Row, folder: &Path| fill(row, case, program, terms, folder);
    row.failure = program.in_folder(&key, &mut row, fill, Row::is_right);
    row
}

fn fill(
    row: &mut Row,
    case: &Case,
    program: &Program,
    terms: u32,
    folder: &Path,
) -> Result<(), String> {
    let plan = case.plan().map_err(|e| e.to_string())?;
    let beyond = plan.truths();
    row.expect(&plan);
    let inside = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let [data, given, found, own] = ["set", "given.toml", "found.toml", "own.toml"].map(&inside);
    // These files may be left over from an earlier run.
    let _ = fs::remove_dir_all(folder.join("set"));
    let _ = fs::remove_file(&found);
    let _ = fs::remove_file(&own);
    fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    let set = plan.build().map_err(|e| e.to_string())?;
    (set.data.save(Path::new(&data))).map_err(|e| e.to_string())?;
    fs::write(inside("answer.toml"), plan.answer()).map_err(|e| e.to_string())?;

    let structure = structure(case.given, &plan);
    let mut arguments = vec!["identify", &data, "-o", &given];
    arguments.extend(structure.iter().map(String::as_str));
    row.identify = program.json(&arguments, folder)?.1;
    let terms = terms.to_string();
    let mut arguments = vec!["discover", &given, &data, "-o", &found, "--terms", &terms];
    arguments.extend(["--effect-out", &own]);
    if case.group == Group::Single {
        arguments.extend(["--without", &row.label]);
    }
    let document;
    (document, row.discover) = program.json(&arguments, folder)?;

    row.hear(&document)?;
    let model = |path: &str| Model::load(Path::new(path)).map_err(|e| e.to_string());
    let (given, found) = (model(&given)?, model(&found)?);
    let (before, after) = (distance(&given, &set)?, distance(&found, &set)?);
    row.truly_taken = (!row.terms.is_empty()).then(|| 1.0 - after / before);
    row.region_f1 = row.regional.then(|| region(row, &beyond[0], &set));
    row.base_bias = row.regional.then(|| bias(&plan, &found)).flatten();
    Ok(())
}

impl Row {
    /// An empty result for a case.
    #[must_use]
    pub fn of(case: &Case) -> Self {
        let nuisances = case.nuisances.iter().map(|n| n.name());
        let circumstances: Vec<&str> = [case.noise.name()].into_iter().chain(nuisances).collect();
        Self {
            key: case.to_string(),
            group: Some(case.group),
            family: case.family.name().to_owned(),
            label: case.label(),
            circumstances: circumstances.join(", "),
            ..Self::default()
        }
    }

    /// Sets the correct findings for its rig.
    pub fn expect(&mut self, plan: &RigPlan) {
        let beyond = plan.truths();
        self.weight = plan.weight.is_finite().then_some(plan.weight);
        self.regional = beyond.iter().any(|truth| truth.region.is_some());
        self.truths = match self.group {
            Some(Group::Single) => of_the_catalogue(&self.label),
            _ => beyond.into_iter().map(Truth::from).collect(),
        };
        self.also_true = plan.also_true().into_iter().map(Truth::from).collect();
    }

    /// Reads a document of `discover --json`.
    ///
    /// # Errors
    /// A document without terms.
    pub fn hear(&mut self, document: &Value) -> Result<(), String> {
        self.terms = read(document)?;
        errors(self, document);
        Ok(())
    }
}

/// F1 of the region of the reported term; 0 if the term is wrong.
fn region(row: &Row, truth: &plant::Truth, set: &Recorded) -> f64 {
    let told = row.first().filter(|_| row.has_coordinate());
    let above = truth.region.map(|region| region.above);
    let own = truth.coordinates.iter().flat_map(|c| c.split(" × "));
    match (told, above, own.into_iter().next()) {
        (Some(told), Some(above), Some(coordinate)) => f1(set, coordinate, above, &told.curve),
        _ => 0.0,
    }
}

/// The larger relative error of the flow's two time constants, if the flow and the model have no others.
fn bias(plan: &RigPlan, model: &Model) -> Option<f64> {
    let plain = matches!(plan.plant.character, Character::FirstOrder);
    let ([a], [c], true) = (&model.a[..], &model.c[..], plain) else {
        return None;
    };
    let time = |rest: f64| -model.sample_period_s / rest.ln();
    let base = &plan.plant.base;
    let pairs = [(time(*a), base.separate_s), (time(a + c), base.attach_s)];
    let errors = pairs.map(|(found, truth)| (found / truth - 1.0).abs());
    let largest = errors[0].max(errors[1]);
    largest.is_finite().then_some(largest)
}

/// Mean square difference of the model's free run and the noise-free readings over the validation records.
fn distance(model: &Model, set: &Recorded) -> Result<f64, String> {
    let (mut sum, mut samples) = (0.0, 0_usize);
    for (record, truth) in set.data.records.iter().zip(&set.noise_free) {
        if record.role == Use::Validate {
            let run = model.free_run(record).map_err(|e| e.to_string())?;
            let off = run.iter().zip(truth).map(|(a, b)| (a - b) * (a - b));
            sum += off.sum::<f64>();
            samples += truth.len();
        }
    }
    Ok(sum / samples.max(1) as f64)
}

/// The terms of the document.
fn read(document: &Value) -> Result<Vec<Told>, String> {
    let terms = (document["terms"].as_array()).ok_or("no terms in the document of discover")?;
    let word = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let spot = |value: &Value| Spot {
        place: word(&value["place"]),
        coordinate: word(&value["coordinate"]),
    };
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let each = terms.iter().map(|term| Told {
        spot: spot(term),
        alike: list(&term["alike"]).iter().map(spot).collect(),
        excess_taken_percent: number(&term["excess_taken_percent"]),
        p_value: number(&term["p_value"]),
        resembles: list(&term["resembles"]).iter().map(word).collect(),
        formula: word(&term["formula"]),
        curve: (list(&term["curve"]).iter())
            .map(|point| (number(&point["x"]), number(&point["value"])))
            .collect(),
    });
    Ok(each.collect())
}

/// Validation errors from the ladder: the best base is the last step without a term, the curves are the first
/// step with all terms, and the last step is the final model.
fn errors(row: &mut Row, document: &Value) {
    let Some(ladder) = document["ladder"].as_array() else {
        return;
    };
    let terms = |rung: &Value| rung["effects"].as_array().map_or(0, Vec::len);
    let noise = |rung: &Value| rung["noise_rmse"].as_f64();
    let error = |rung: &Value| rung["validate_rmse"].as_f64();
    let over = |rung: &Value| Some(error(rung)? / noise(rung)?);
    let excess = |rung: &Value| Some((error(rung)?.powi(2) - noise(rung)?.powi(2)).max(0.0));
    let base = ladder.iter().rev().find(|rung| terms(rung) == 0);
    let curves = ladder.iter().find(|rung| terms(rung) == row.terms.len());
    row.given_over_floor = ladder.first().and_then(over);
    row.base_over_floor = base.and_then(over);
    row.over_floor = ladder.last().and_then(over);
    let taken = |rung: Option<&Value>| {
        let before = excess(base?)?;
        (before > 0.0).then_some(1.0 - excess(rung?)? / before)
    };
    if !row.terms.is_empty() {
        row.curve_taken = taken(curves);
        row.formula_taken = taken(ladder.last());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_document_is_read_as_the_contract_has_it() {
        let document = json!({
            "terms": [{
                "place": "jet", "coordinate": "rest before", "excess_taken_percent": 91.0,
                "p_value": 1e-4, "unit": "", "resembles": ["plenum-droop"],
                "curve": [{"x": 0.1, "low": -0.4, "value": -0.3, "high": -0.2}],
                "formula": "a * exp(-x / t)", "parameters": {},
                "alike": [{"place": "delay", "coordinate": "y"}],
            }],
            "ladder": [
                {"effects": [], "validate_rmse": 0.05, "noise_rmse": 0.01},
                {"effects": [], "validate_rmse": 0.03, "noise_rmse": 0.01},
                {"effects": ["jet-rest-before"], "validate_rmse": 0.01, "noise_rmse": 0.01},
                {"effects": ["jet-rest-before"], "validate_rmse": 0.02, "noise_rmse": 0.01},
            ],
        });
        let mut row = Row::default();
        row.hear(&document).unwrap();
        let told = &row.terms[0];
        assert_eq!(told.spot.coordinate, "rest before");
        assert_eq!(told.curve, [(0.1, -0.3)]);
        assert_eq!(told.alike[0].place, "delay");
        assert_eq!(row.curve_taken, Some(1.0));
        let left = (0.02_f64.powi(2) - 1e-4) / (0.03_f64.powi(2) - 1e-4);
        assert!((row.formula_taken.unwrap() - (1.0 - left)).abs() < 1e-12);
        assert!((row.given_over_floor.unwrap() - 5.0).abs() < 1e-12);
        assert!(read(&json!({})).is_err());
    }
}
