//! The models to compare.

use host_fit::model::{CommandRange, Delay, Model, TransportLaw};
use host_fit::user_effect::Definition;
use model_core::effect::{Place, Spec};
use model_core::effects::{LAWS, NUISANCES, SPECS};
use model_core::recursion::Grading;
use std::path::{Path, PathBuf};

/// A model with its display name.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name.
    pub name: String,
    /// The model.
    pub model: Model,
    /// Whether the model is a file of this project.
    pub is_bundled: bool,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn files(folder: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join(folder)).expect("a folder of the project");
    let mut paths: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    paths.sort();
    paths
}

fn middle(spec: &Spec) -> Vec<f64> {
    let each = spec.parameters.iter();
    each.map(|p| p.starts[p.starts.len() / 2]).collect()
}

/// A first-order flow with a memory, to which any effect can be added.
fn base() -> Model {
    Model {
        state_lags: vec![1, 30],
        a: vec![0.96, 0.01],
        product_lags: vec![1, 25],
        b: vec![0.033],
        c: vec![-0.011, 0.002],
        delay: Delay::Fixed { delays: vec![21] },
        ..Model::default()
    }
}

/// How graded commands act in the cases of an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gradings {
    /// Each effect with every kind of graded command.
    All,
    /// Each effect with one of the three kinds of graded command, in turn.
    InTurn,
}

/// All models.
///
/// # Panics
/// If a file of the project cannot be read.
#[must_use]
pub fn cases(gradings: Gradings) -> Vec<Case> {
    let mut cases = Vec::new();
    for folder in ["data/paper", "firmware/identified/models"] {
        for path in files(folder) {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            // The rig file is not a model.
            if name != "rig" {
                cases.push(Case {
                    name: name.into_owned(),
                    model: Model::load(&path).expect("a model"),
                    is_bundled: true,
                });
            }
        }
    }
    let mut add = |name: String, model: Model| {
        cases.push(Case {
            name,
            model,
            is_bundled: false,
        });
    };
    let effects = SPECS.iter().chain(NUISANCES);
    for (i, spec) in effects
        .filter(|spec| spec.place != Place::Delay)
        .enumerate()
    {
        for (j, grading) in Grading::ALL.into_iter().enumerate() {
            if gradings == Gradings::InTurn && j != i % Grading::ALL.len() {
                continue;
            }
            let mut model = Model { grading, ..base() };
            model.add(
                spec,
                &middle(spec),
                Some(if spec.channel.is_some() { 10.0 } else { 0.9 }),
            );
            add(format!("{} {grading:?}", spec.name), model);
        }
    }
    for spec in LAWS {
        for interpolated in [false, true] {
            let law = TransportLaw {
                spec,
                parameters: middle(spec),
                factors: vec![1.0],
                interpolated,
            };
            let model = Model {
                delay: Delay::Law(law),
                ..base()
            };
            let how = if interpolated {
                "between samples"
            } else {
                "rounded"
            };
            add(format!("{} {how}", spec.name), model);
        }
    }
    for path in files("docs/effects") {
        let definition = Definition::load(&path).expect("an effect file");
        let mut model = base();
        model.define(definition).expect("no other");
        let reference = definition.spec().channel.map(|_| 20.0);
        model.add(definition.spec(), &middle(definition.spec()), reference);
        add(format!("own: {}", definition.spec().name), model);
    }
    // The effect has every function, comparison and kind of memory of the language of effects.
    let all = Definition::from_toml(ALL, "all.toml").expect("an effect");
    let mut model = base();
    model.define(all).expect("no other");
    model.add(all.spec(), &[0.3, 0.0213], None);
    add("own: every function".to_owned(), model);
    // Effects that interact.
    let mut model = base();
    for name in [
        "slow-wake",
        "level-rate",
        "dry-friction",
        "quadratic-drag",
        "bouc-wen-hysteresis",
        "zero-offset",
    ] {
        let spec = model.spec(name).expect("in the catalogue");
        let mut values = middle(spec);
        if name == "zero-offset" || name == "level-rate" {
            values.fill(0.05);
        }
        model.add(spec, &values, None);
    }
    add("six effects".to_owned(), model);
    let command = CommandRange {
        off: 4.0,
        full: -20.5,
    };
    add("command range".to_owned(), Model { command, ..base() });
    let two = Model {
        b: vec![0.02, 0.013],
        c: vec![-0.011, 0.002, 0.001, -0.003],
        delay: Delay::Fixed {
            delays: vec![21, 40],
        },
        constant: 0.001,
        ..base()
    };
    add("two inputs".to_owned(), two);
    cases
}

const ALL: &str = r#"
name = "everything"
place = "sensor"
summary = "every function"
expression = """
let a = if y > 0.1 && !(u <= 0.5) || t >= 1.5 { sin(20 * t) } else { cos(3 * y + since_edge) };
let b = table(y, 0, 0.1, 0.5, strength, 1, 0.2);
reading + 0.1 * a + b + 0.01 * exp(-abs(y)) + 0.1 * cbrt(slow) + 0.1 * sqrt(y - 0.2)
  + 0.05 * delayed(reading, lag) + 0.05 * delayed(arrived, lag + 0.01 * y, 0.1) + 0.01 * min(max(y, 0.1), 0.4) / (1 + y * y)"""
[[state]]
name = "slow"
start = 0.25
update = "if u == 0 { slow * 0.999 } else if u != 1 { slow + 0.001 } else { slow * 0.99 + 0.01 * y }"
[[parameter]]
name = "strength"
unit = "y"
low = -1.0
high = 1.0
starts = [0.3]
[[parameter]]
name = "lag"
unit = "s"
low = 0.001
high = 0.1
starts = [0.0213]
"#;
