//! Runs a case like a user: a folder, `identify`, `diagnose`, the written model.

use std::fs;
use std::path::Path;

use firmware_sim::family::RigPlan;
use firmware_sim::plant::{Character, Effect, FlowDelay};
use host_fit::data::DataSet;
use host_fit::model::{Delay, Model, Start, Training};
use model_core::effect::Unit;
use model_core::effects::StateDependentDelay;
use model_core::model::Averaging;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::case::{Case, Given, Group};
use super::program::{Program, Spent};
use super::row::{Found, PutIn, Row};

/// Runs a case. A failure gives a result too.
#[must_use]
pub fn run(case: &Case, program: &Program) -> Row {
    let nuisances = case.nuisances.iter().map(|n| n.name());
    let circumstances: Vec<&str> = [case.noise.name()].into_iter().chain(nuisances).collect();
    let mut row = Row {
        key: case.to_string(),
        group: case.group,
        family: case.family.name().to_owned(),
        label: case.label(),
        circumstances: circumstances.join(", "),
        hidden: Vec::new(),
        also_right: Vec::new(),
        flow_lag: false,
        verdict: "failed".to_owned(),
        failure: None,
        missing: Vec::new(),
        sets: Vec::new(),
        stand_ins: Vec::new(),
        given_over_floor: None,
        over_floor: None,
        p_value: None,
        put_in: None,
        parameters: Vec::new(),
        identify: Spent::default(),
        diagnose: Spent::default(),
    };
    let key = row.key.clone();
    let is_right = |row: &Row| row.is_right() && row.parameters_hit() != Some(false);
    let fill = |row: &mut Row, folder: &Path| fill(row, case, program, folder);
    row.failure = program.in_folder(&key, &mut row, fill, is_right);
    row
}

fn fill(row: &mut Row, case: &Case, program: &Program, folder: &Path) -> Result<(), String> {
    let mut plan = case.plan().map_err(|e| e.to_string())?;
    if case.group == Group::Power {
        let own = folder.join("without");
        let (put_in, effect) = just_seen(case, &plan, program, &own)?;
        row.put_in = Some(put_in);
        row.hidden = case.hidden.clone();
        let Some(effect) = effect else {
            row.verdict = "unseen".to_owned();
            return Ok(());
        };
        plan.plant.effects = vec![effect];
    }
    let owned = |names: Vec<&str>| names.into_iter().map(str::to_owned).collect();
    row.hidden = owned(plan.hidden());
    row.also_right = owned(plan.also_right());
    row.flow_lag = matches!(
        plan.plant.character,
        Character::Inertia { .. } | Character::SecondLag { .. }
    );
    let document;
    (document, row.identify, row.diagnose) = asked(case, &plan, program, folder)?;
    row.verdict = verdict(&document)?;
    row.missing = names(&document["missing"]);
    row.missing.extend(names(&document["certified"]));
    row.stand_ins = names(&document["stand_ins"]);
    let sets = document["sets"].as_array();
    row.sets = sets.map_or_else(Vec::new, |sets| sets.iter().map(names).collect());
    let over = |rung: Option<&Value>| {
        let rung = rung?;
        Some(rung["validate_rmse"].as_f64()? / rung["noise_rmse"].as_f64()?)
    };
    let ladder = document["ladder"].as_array();
    row.given_over_floor = over(ladder.and_then(|rungs| rungs.first()));
    row.over_floor = over(ladder.and_then(|rungs| rungs.last()));
    let ranking = document["ranking"].as_array();
    let p_values = ranking
        .into_iter()
        .flatten()
        .filter_map(|entry| entry["p_value"].as_f64());
    row.p_value = p_values.reduce(f64::min);
    let found = folder.join(FOUND);
    if found.is_file() {
        let model = Model::load(&found).map_err(|e| e.to_string())?;
        row.parameters = compare(&plan, &model, &document);
    }
    Ok(())
}

/// File name of the model that a diagnosis writes.
const FOUND: &str = "found.toml";

/// The diagnosis of a rig, after `identify` unless the case has a model of its own; with both durations.
fn asked(
    case: &Case,
    plan: &RigPlan,
    program: &Program,
    folder: &Path,
) -> Result<(Value, Spent, Spent), String> {
    let inside = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let (data, given, found) = (inside("set"), inside("given.toml"), inside(FOUND));
    // These files may be left over from an earlier run.
    let _ = fs::remove_dir_all(folder.join("set"));
    let _ = fs::remove_file(&found);
    fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    let mut set = plan.build().map_err(|e| e.to_string())?.data;
    if let Some(part) = program.part {
        set = DataSet::from_records(set.title.clone(), part.of(&set)).map_err(|e| e.to_string())?;
    }
    set.save(Path::new(&data)).map_err(|e| e.to_string())?;
    fs::write(inside("answer.toml"), plan.answer()).map_err(|e| e.to_string())?;

    let mut identify = Spent::default();
    if let Some(model) = guess(case, plan) {
        model.save(Path::new(&given)).map_err(|e| e.to_string())?;
    } else {
        let structure = structure(case.given, plan);
        let mut arguments = vec!["identify", &data, "-o", &given];
        arguments.extend(structure.iter().map(String::as_str));
        identify = program.json(&arguments, folder)?.1;
    }
    let arguments = ["diagnose", &given, &data, "-o", &found];
    let (document, diagnose) = program.json(&arguments, folder)?;
    Ok((document, identify, diagnose))
}

fn verdict(document: &Value) -> Result<String, String> {
    let word = document["verdict"].as_str();
    Ok(word
        .ok_or("no verdict in the document of diagnose")?
        .to_owned())
}

/// The effect of a case at its detectable size according to the diagnosis of the rig without it; none if any
/// size could stay undetected.
fn just_seen(
    case: &Case,
    plan: &RigPlan,
    program: &Program,
    folder: &Path,
) -> Result<(PutIn, Option<Effect>), String> {
    let name = case.hidden.first().ok_or("no effect to put in")?;
    let (document, ..) = asked(case, plan, program, folder)?;
    if verdict(&document)? != "nothing-missing" {
        return Err("an effect is reported on the rig without it".to_owned());
    }
    let said = document["detectable"].as_array().into_iter().flatten();
    let own = said.clone().find(|entry| entry["effect"] == name.as_str());
    let own = own.ok_or("nothing is said of how much of it would be seen")?;
    let amplitude = own["amplitude"].as_f64().map(|said| case.times * said);
    let put_in = PutIn {
        effect: name.clone(),
        amplitude,
    };
    if amplitude.is_none() {
        return Ok((put_in, None));
    }
    let mut rng = ChaCha8Rng::seed_from_u64(case.seed);
    let mut effect = Effect::draw(name, &plan.plant.base, &mut rng).map_err(|e| e.to_string())?;
    let values = own["parameters"].as_array().into_iter().flatten();
    let card = model_core::effects::spec(name).and_then(|spec| spec.amplitude);
    let card = card.ok_or("the effect has no amplitude")?;
    for (parameter, value) in effect.parameters().iter().zip(values) {
        let mut value = value.as_f64().ok_or("a parameter is not a number")?;
        if card.together || parameter.name == card.parameter {
            value *= case.times;
        }
        effect = effect
            .with(parameter.name, value)
            .map_err(|e| e.to_string())?;
    }
    Ok((put_in, Some(effect)))
}

fn names(list: &Value) -> Vec<String> {
    let each = list.as_array().into_iter().flatten();
    each.filter_map(|name| name.as_str().map(str::to_owned))
        .collect()
}

/// Estimated and true parameters of the hidden effects that the model contains.
fn compare(plan: &RigPlan, model: &Model, document: &Value) -> Vec<Found> {
    let ranking = document["ranking"].as_array();
    let mut found = Vec::new();
    for (effect, parameters) in plan.exact() {
        let added = model.effects.iter().find(|added| added.name == effect);
        let values = match (&model.delay, added) {
            (_, Some(added)) => &added.parameters,
            (Delay::Law(law), None) if law.spec.name == effect => &law.parameters,
            _ => continue,
        };
        for (parameter, value) in parameters.iter().zip(values) {
            let mut entries = ranking.into_iter().flatten();
            let stated = entries.find(|entry| entry["effect"] == effect);
            let bound = |end: &str| stated?["parameters"][parameter.name][end].as_f64();
            let scale = Unit::of(parameter.unit).scale(plan.units.y, plan.units.time, 1.0);
            found.push(Found {
                name: format!("{effect}.{}", parameter.name),
                truth: scale * parameter.value,
                found: *value,
                unit: parameter.unit.to_owned(),
                interval: bound("low").zip(bound("high")).map(<[f64; 2]>::from),
            });
        }
    }
    found
}

/// Options of `identify` for the given model.
pub(super) fn structure(given: Given, plan: &RigPlan) -> Vec<String> {
    let hidden = plan.hidden();
    let lags = match (given, &plan.plant.character) {
        (Given::Truth, Character::Memory(terms)) => 1 + terms.len(),
        (Given::Truth, Character::Inertia { .. } | Character::SecondLag { .. }) => 2,
        (Given::Truth, Character::Wake { .. }) => 2,
        (Given::Truth, Character::FirstOrder | Character::RateOfFriction { .. })
        | (Given::Lean, _) => 1,
        // A law found by `identify` is not missing: if one is hidden, fixed delays are used.
        (Given::Default, _) if hidden.contains(&"state-dependent-delay") => {
            return ["--delay", "fixed"].map(str::to_owned).to_vec();
        }
        (Given::Default | Given::Guess | Given::BadDelays, _) => return Vec::new(),
    };
    let delay = match plan.plant.delay() {
        FlowDelay::StateDependent { .. } | FlowDelay::Clamped { .. }
            if !hidden.contains(&"state-dependent-delay") =>
        {
            "state-dependent"
        }
        _ => "fixed",
    };
    let lags = lags.to_string();
    ["--n1", &lags, "--n2", &lags, "--delay", delay]
        .map(str::to_owned)
        .to_vec()
}

/// A rough model without a fit: without a delay law if the law is hidden, and with wrong lags and delays if
/// the case requires it.
fn guess(case: &Case, plan: &RigPlan) -> Option<Model> {
    let bad = match case.given {
        Given::Guess => false,
        Given::BadDelays => true,
        Given::Default | Given::Lean | Given::Truth => return None,
    };
    let law = |floor: f64, rise: f64, rate: f64| {
        let values = [floor, rise, rate / plan.units.y];
        Delay::of::<StateDependentDelay<f64>>(&values, vec![1.0], false)
    };
    let mut model = Model {
        sample_period_s: firmware_sim::plant::SAMPLE_PERIOD_S * plan.units.time,
        convention: model_core::recursion::LagConvention::OneStep,
        averaging: Averaging {
            window: 250,
            averaged_model: false,
        },
        start: Start::Rest,
        command: Default::default(),
        grading: model_core::recursion::Grading::Proportional,
        constant: 0.0,
        state_lags: vec![1],
        a: vec![0.98],
        product_lags: vec![1],
        b: vec![0.02 * plan.units.y],
        c: vec![0.0],
        delay: law(35.0, 10.0, 6.0),
        effects: Vec::new(),
        calibrated_at: None,
        definitions: Vec::new(),
        law: None,
        training: Training::default(),
    };
    if plan.hidden().contains(&"state-dependent-delay") {
        model.delay = Delay::Fixed { delays: vec![40] };
    }
    if bad {
        let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 0x5eed);
        let mut lags =
            |n: usize| -> Vec<u16> { (0..n).map(|_| rng.random_range(1..500)).collect() };
        model.state_lags = [vec![1], lags(4)].concat();
        model.a = vec![0.97, 0.002, 0.001, -0.001, 0.001];
        model.product_lags = lags(3);
        model.c = vec![-0.003, 0.002, 0.001];
        model.delay = law(90.0, 40.0, 2.0);
    }
    Some(model)
}
