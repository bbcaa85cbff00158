//! Runs a case as a user would: a folder, `identify`, `diagnose`, the written model.

use std::fs;
use std::path::Path;

use firmware_sim::family::RigPlan;
use firmware_sim::plant::{Character, FlowDelay};
use host_fit::model::{Delay, Model, Start, Training};
use model_core::effect::Unit;
use model_core::effects::StateDependentDelay;
use model_core::model::Averaging;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::case::{Case, Given};
use super::program::{Program, Spent};
use super::row::{Found, Row};

/// Runs a case. What goes wrong is a row too.
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
        parameters: Vec::new(),
        identify: Spent::default(),
        diagnose: Spent::default(),
    };
    let kept = (program.keep.as_ref()).map(|keep| keep.join(row.key.replace('/', "_")));
    let outcome = match &kept {
        Some(folder) => fill(&mut row, case, program, folder),
        None => tempfile::tempdir()
            .map_err(|e| e.to_string())
            .and_then(|scratch| fill(&mut row, case, program, scratch.path())),
    };
    row.failure = outcome.err();
    if row.is_right()
        && row.parameters_hit() != Some(false)
        && let Some(folder) = &kept
    {
        // What stays is looked at by people; a folder too many does no harm.
        let _ = fs::remove_dir_all(folder);
    }
    row
}

fn fill(row: &mut Row, case: &Case, program: &Program, folder: &Path) -> Result<(), String> {
    let plan = case.plan().map_err(|e| e.to_string())?;
    let owned = |names: Vec<&str>| names.into_iter().map(str::to_owned).collect();
    row.hidden = owned(plan.hidden());
    row.also_right = owned(plan.also_right());
    row.flow_lag = matches!(
        plan.plant.character,
        Character::Inertia { .. } | Character::SecondLag { .. }
    );
    let inside = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let (data, given, found) = (inside("set"), inside("given.toml"), inside("found.toml"));
    // Of an earlier run.
    let _ = fs::remove_dir_all(folder.join("set"));
    let _ = fs::remove_file(&found);
    fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    let set = plan.build().map_err(|e| e.to_string())?.data;
    set.save(Path::new(&data)).map_err(|e| e.to_string())?;
    fs::write(inside("answer.toml"), plan.answer()).map_err(|e| e.to_string())?;

    if let Some(model) = guess(case, &plan) {
        model.save(Path::new(&given)).map_err(|e| e.to_string())?;
    } else {
        let structure = structure(case.given, &plan);
        let mut arguments = vec!["identify", &data, "-o", &given];
        arguments.extend(structure.iter().map(String::as_str));
        row.identify = program.json(&arguments, folder)?.1;
    }
    let arguments = ["diagnose", &given, &data, "-o", &found];
    let document;
    (document, row.diagnose) = program.json(&arguments, folder)?;

    row.verdict = (document["verdict"].as_str())
        .ok_or("no verdict in the document of diagnose")?
        .to_owned();
    row.missing = names(&document["missing"]);
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
    if Path::new(&found).is_file() {
        let model = Model::load(Path::new(&found)).map_err(|e| e.to_string())?;
        row.parameters = compare(&plan, &model);
    }
    Ok(())
}

fn names(list: &Value) -> Vec<String> {
    let each = list.as_array().into_iter().flatten();
    each.filter_map(|name| name.as_str().map(str::to_owned))
        .collect()
}

/// Parameters of the hidden effects that the model has too.
fn compare(plan: &RigPlan, model: &Model) -> Vec<Found> {
    let mut found = Vec::new();
    for (effect, parameters) in plan.exact() {
        let added = model.effects.iter().find(|added| added.name == effect);
        let values = match (&model.delay, added) {
            (_, Some(added)) => &added.parameters,
            (Delay::Law(law), None) if law.spec.name == effect => &law.parameters,
            _ => continue,
        };
        for (parameter, value) in parameters.iter().zip(values) {
            let scale = Unit::of(parameter.unit).scale(plan.units.y, plan.units.time, 1.0);
            found.push(Found {
                name: format!("{effect}.{}", parameter.name),
                truth: scale * parameter.value,
                found: *value,
            });
        }
    }
    found
}

/// Options of `identify` for the model that is handed in.
pub(super) fn structure(given: Given, plan: &RigPlan) -> Vec<String> {
    let hidden = plan.hidden();
    let lags = match (given, &plan.plant.character) {
        (Given::Truth, Character::Memory(terms)) => 1 + terms.len(),
        (Given::Truth, Character::Inertia { .. } | Character::SecondLag { .. }) => 2,
        (Given::Truth, Character::Wake { .. }) => 2,
        (Given::Truth, Character::FirstOrder | Character::RateOfFriction { .. })
        | (Given::Lean, _) => 1,
        // A law that `identify` has found is not missing: what hides one is asked with fixed delays.
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

/// A model as an engineer would hand it in without fitting: a rough guess, without delay law where the law is
/// hidden; with the wrong lags and delays where the case says so.
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
        grading: model_core::recursion::Grading::Proportional,
        constant: 0.0,
        state_lags: vec![1],
        a: vec![0.98],
        product_lags: vec![1],
        b: vec![0.02 * plan.units.y],
        c: vec![0.0],
        delay: law(35.0, 10.0, 6.0),
        effects: Vec::new(),
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
