//! The models that a board runs in lockstep: base, averaged, laws, user effects, discovered terms, and every effect of
//! the catalogue alone.

use anyhow::{Context, Result};
use host_fit::codegen::generate;
use host_fit::design::{TrackRequest, track};
use host_fit::model::{Law, Model};
use host_fit::terms::Units;
use host_fit::user_effect::Definition;
use model_core::control::period::loop_period_us;
use model_core::effect::{Place, Spec};
use model_core::effects::{LAWS, NUISANCES, SPECS};
use std::path::Path;

/// Steps of the cases with budgets, and of the others.
const LONG: usize = 20_000;
const SHORT: usize = 3_000;

macro_rules! bundled {
    ($name:literal) => {
        include_str!(concat!(
            "../../../firmware/identified/models/",
            $name,
            ".toml"
        ))
    };
}

/// A model on the board.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of the module on the board.
    pub name: String,
    /// The model with its law.
    pub model: Model,
    /// Number of steps.
    pub steps: usize,
}

impl Case {
    /// A case with a long run.
    #[must_use]
    pub fn new(name: &str, model: Model) -> Self {
        Self {
            name: name.to_owned(),
            model,
            steps: LONG,
        }
    }

    fn short(self) -> Self {
        Self {
            steps: SHORT,
            ..self
        }
    }
}

/// All cases, in the order of their numbers on the board.
///
/// # Errors
/// A bundled model file that cannot be read, or no law for one.
pub fn all() -> Result<Vec<Case>> {
    let read = |text, name| Model::from_toml(text, name).map_err(anyhow::Error::from);
    let full = read(bundled!("full"), "full.toml")?;
    let base = Model {
        law: None,
        ..full.clone()
    };
    let with = |name: &str| {
        let spec = SPECS.iter().find(|spec| spec.name == name);
        spec.map(|spec| with_effect(&base, spec))
            .with_context(|| format!("no effect `{name}`"))
    };
    let mut cases = vec![
        Case::new("base", base.clone()),
        // The boards' own model has this name.
        Case::new("full", full),
        Case::new("averaged", read(bundled!("averaged"), "averaged.toml")?),
        Case::new(
            "law_jet_flow_sensor",
            read(bundled!("effects"), "effects.toml")?,
        )
        .short(),
        Case::new("law_jet", designed(with("plenum-droop")?)?).short(),
        Case::new("law_sensor", designed(with("hot-film-lag")?)?).short(),
        Case::new("own_effects", read(bundled!("own"), "own.toml")?).short(),
        Case::new("found_terms", with_found(&base)?).short(),
    ];
    for spec in known() {
        let name = format!("effect_{}", spec.name.replace('-', "_"));
        cases.push(Case::new(&name, with_effect(&base, spec)).short());
    }
    // Sorted as on the board.
    cases.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(cases)
}

/// Cases at other loop periods: a relay, the tracking law alone and with an effect at each place, pulses, user
/// effects. All run on a rig whose times scale with the period; in one model the effects keep their times in
/// seconds. The laws are designed for each period. Names end in the period in µs.
///
/// # Errors
/// A bundled model file that cannot be read, an invalid loop period, or a model without a law.
pub fn at(periods_s: &[f64]) -> Result<Vec<Case>> {
    // The boards' own model has this name.
    let full = Model::from_toml(bundled!("full"), "full.toml")?;
    let mut cases = vec![Case::new("full", full).short()];
    for period_s in periods_s {
        let us = loop_period_us(*period_s)
            .with_context(|| format!("no loop runs with a sample every {period_s} s"))?;
        for (name, model) in slower(*period_s)? {
            cases.push(Case::new(&format!("{name}_{us}us"), model).short());
        }
    }
    // Sorted as on the board.
    cases.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(cases)
}

/// The models of [`at`] for one period.
fn slower(period_s: f64) -> Result<Vec<(&'static str, Model)>> {
    let read = |text, name| Model::from_toml(text, name).map_err(anyhow::Error::from);
    let full = read(bundled!("full"), "full.toml")?;
    let clock = Units {
        time: period_s / full.sample_period_s,
        ..Units::NONE
    };
    let on_clock = |model: &Model| Model {
        // Avoids 0.0010000000000000002.
        sample_period_s: period_s,
        ..clock.model_out(model)
    };
    let base = Model {
        law: None,
        ..on_clock(&full)
    };
    let mut seconds = base.clone();
    for name in [
        "valve-lag",
        "plenum-droop",
        "hot-film-lag",
        "vortex-shedding",
    ] {
        let spec = SPECS.iter().find(|spec| spec.name == name);
        seconds = with_effect(
            &seconds,
            spec.with_context(|| format!("no effect `{name}`"))?,
        );
    }
    Ok(vec![
        ("relay", base),
        ("seconds", seconds),
        ("tracking", designed(on_clock(&full))?),
        (
            "effects",
            designed(on_clock(&read(bundled!("effects"), "effects.toml")?))?,
        ),
        (
            "pulses",
            on_clock(&read(bundled!("averaged"), "averaged.toml")?),
        ),
        ("own", on_clock(&read(bundled!("own"), "own.toml")?)),
    ])
}

/// Every effect and delay law of a model, base terms included.
fn known() -> impl Iterator<Item = &'static Spec> {
    let effects = SPECS.iter().filter(|spec| spec.place != Place::Delay);
    LAWS.iter().chain(effects).chain(NUISANCES)
}

/// `base` with an effect at the first of its starting values. Its rest level is slightly below 0, for effects
/// that depend on the sign.
fn with_effect(base: &Model, spec: &'static Spec) -> Model {
    let mut model = slightly_negative(base);
    let values: Vec<f64> = spec
        .parameters
        .iter()
        .map(|parameter| {
            let start = parameter.starts.first().copied();
            // A parameter of 0 would have no influence.
            start.filter(|start| *start != 0.0).unwrap_or(0.05)
        })
        .collect();
    let reference = spec.channel.map(|_| 10.0);
    model.add(spec, &values, reference);
    model
}

/// `base` with terms in the form of `discover`: a table, and a varying delay.
fn with_found(base: &Model) -> Result<Model> {
    let mut model = slightly_negative(base);
    for text in [
        include_str!("../../../docs/effects/tiring-jets.toml"),
        include_str!("../../../docs/effects/drifting-delay.toml"),
    ] {
        let definition = Definition::from_toml(text, "a found term")?;
        model.define(definition)?;
        let starts = definition.spec().parameters.iter();
        let values: Vec<f64> = starts.flat_map(|p| p.starts.first().copied()).collect();
        model.add(definition.spec(), &values, None);
    }
    Ok(model)
}

fn slightly_negative(base: &Model) -> Model {
    Model {
        constant: -6e-4,
        ..base.clone()
    }
}

/// `model` with a law that holds half of its friction.
fn designed(mut model: Model) -> Result<Model> {
    let request = TrackRequest {
        min_on_s: 20.0 * model.sample_period_s,
        min_off_s: 20.0 * model.sample_period_s,
        ..TrackRequest::holding(0.5)
    };
    model.law = Some(Law::Track(track(&model, &request)?.law));
    Ok(model)
}

/// Writes the constants of `cases` into the existing folder `folder` and removes those of others.
///
/// # Errors
/// A model that has no constants, or a folder that cannot be written.
pub fn write(cases: &[Case], folder: &Path) -> Result<()> {
    for file in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = file?.path();
        let of_case = |case: &Case| path.file_stem() == Some(case.name.as_ref());
        if path.extension().is_some_and(|kind| kind == "rs") && !cases.iter().any(of_case) {
            std::fs::remove_file(&path).with_context(|| path.display().to_string())?;
        }
    }
    for case in cases {
        let text = generate(&case.model).with_context(|| case.name.clone())?;
        let path = folder.join(&case.name).with_extension("rs");
        // Unchanged files are not rewritten, to avoid recompilation.
        if std::fs::read_to_string(&path).ok().as_deref() != Some(&text) {
            std::fs::write(&path, text).with_context(|| path.display().to_string())?;
        }
    }
    Ok(())
}

/// The effects of a model, by place.
#[must_use]
pub fn places(model: &Model) -> Vec<(String, Option<Place>)> {
    let names = model.effect_names().into_iter();
    names
        .map(|name| {
            let place = model.spec(&name).map(|spec| spec.place);
            (name, place)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Predictions of a model for readings that make a relay blow most of the time.
    fn predictions(model: &Model) -> Vec<u32> {
        let mut step = crate::lockstep::host::steps(model);
        let readings =
            (0..3000_u16).map(|k| (if k % 150 < 120 { 900 } else { 2500 }, 2000 + k % 300));
        readings
            .map(|(counts, channel)| step(counts, channel).0.to_bits())
            .collect()
    }

    /// A lockstep run of an effect without influence would test nothing.
    #[test]
    fn every_effect_changes_what_its_model_predicts() {
        let cases = all().expect("cases");
        let base = cases.iter().find(|case| case.name == "base");
        let bare = predictions(&slightly_negative(&base.expect("a base").model));
        for case in cases.iter().filter(|case| case.name.starts_with("effect_")) {
            assert_ne!(predictions(&case.model), bare, "{}", case.name);
        }
    }

    /// Effects with times in seconds differ at a slower clock.
    #[test]
    fn effects_in_seconds_follow_the_clock() {
        let cases = at(&[2e-4, 1e-3, 0.01, 0.1]).expect("cases");
        let predicted = |us: u32| {
            let name = format!("seconds_{us}us");
            let case = cases.iter().find(|case| case.name == name);
            predictions(&case.expect("a case").model)
        };
        assert_ne!(predicted(1000), predicted(10_000));
    }

    /// The predicted memory of a board agrees with the build.
    #[test]
    fn the_boards_memory_is_known_before_it_is_built() {
        use firmware::on_board::{MOST, OnBoard};
        use host_fit::codegen::board;
        assert_eq!(board::MOST, MOST);
        let model = Model::from_toml(bundled!("full"), "full.toml").expect("a model file");
        let law = model.law.as_ref().expect("a law");
        let said = board::loop_bytes(&model, law);
        let taken = size_of::<firmware::controller::Controller<OnBoard>>();
        assert!(taken <= said && said < 2 * taken, "{taken} {said}");
    }

    #[test]
    fn every_effect_and_every_kind_of_law_is_there() {
        let cases = all().expect("cases");
        let met: BTreeSet<String> = cases
            .iter()
            .flat_map(|case| case.model.effect_names())
            .collect();
        for spec in SPECS {
            assert!(met.contains(spec.name), "{} is in no case", spec.name);
        }
        let law_at = |place: Place| {
            cases.iter().any(|case| {
                matches!(case.model.law, Some(Law::Track(_)))
                    && places(&case.model).iter().any(|(_, at)| *at == Some(place))
            })
        };
        assert!(law_at(Place::Jet) && law_at(Place::Sensor));
        assert!(cases.iter().any(|case| case.model.averaging.averaged_model));
        assert!(cases.iter().any(|case| !case.model.definitions.is_empty()));
    }
}
