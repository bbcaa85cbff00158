//! The simulated flows that the program tries a law on: the physical plant that a model resembles most, that plant with
//! every effect that the law does not know of, and under worse conditions than designed for.
//!
//! Plants are no part of the library: a fit must not be judged by a simulator that it depends on.

use anyhow::{Context, bail};
use firmware_sim::bench::{Disturbed, Lost};
use firmware_sim::instrument::{Converter, Noise};
use firmware_sim::plant::{BasePlant, Effect, FlowDelay, FreeStream, PlantSpec, RateLaw, Rig};
use host_fit::design::{CaseGroup, DesignError, RULES, Trial, steady, time_constants};
use host_fit::model::{Added, Delay, Model, TransportLaw};
use model_core::effects::NUISANCES;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const NO_PLANT: &str = "no physical plant could be made from the model";

/// The flows of a proof.
pub(crate) struct Plants {
    /// The plant that the model resembles most, seen through a noisy sensor.
    pub(crate) nearest: Trial<Disturbed<Rig>>,
    /// Friction of that plant under steady blowing (y).
    pub(crate) blown: f64,
    /// The plant with something else about it.
    pub(crate) others: Vec<Trial<Disturbed<Rig>>>,
    /// What of the model no simulated plant has, one sentence each; the plants are without it.
    pub(crate) left_out: Vec<String>,
}

impl Plants {
    /// The plants for `model`, repeatable by `seed`.
    ///
    /// # Errors
    /// When the model does not settle or its constants are no plant's.
    pub(crate) fn of(model: &Model, seed: u64) -> anyhow::Result<Self> {
        let (plant, left_out) = nearest_plant(model)?;
        Ok(Self {
            blown: plant.base.gain,
            left_out,
            nearest: trial(
                CaseGroup::Plant,
                "continuous-time plant, noisy sensor",
                &plant,
                Circumstances::usual(seed),
            )?,
            others: others(&plant, seed)?,
        })
    }
}

/// A first-order flow with the model's levels, its time constants of attachment
/// and separation, its transport delay in continuous time, and those of its effects
/// that the simulated plants know as continuous-time physics.
///
/// # Errors
/// When the model does not settle or its constants are no plant's.
fn nearest_plant(model: &Model) -> anyhow::Result<(PlantSpec, Vec<String>)> {
    let bare = Model {
        effects: Vec::new(),
        ..model.clone()
    };
    let (low, high) = (
        steady(&bare, false)?.friction,
        steady(&bare, true)?.friction,
    );
    if high <= low {
        bail!(DesignError::NoEffect { low, high });
    }
    let [attach_s, separate_s] = time_constants(&bare, low, high);
    let period = model.sample_period_s;
    let delay = match &model.delay {
        Delay::Fixed { delays } => FlowDelay::Fixed {
            delay_s: f64::from(delays.iter().copied().min().unwrap_or(0)) * period,
        },
        Delay::Law(law) => transport(law, period),
    };
    let base = BasePlant {
        attach_s,
        separate_s,
        gain: high,
        delay,
        rate_law: RateLaw::default(),
    };
    let (mut effects, mut left_out) = (Vec::new(), Vec::new());
    let is_nuisance = |added: &&Added| NUISANCES.iter().any(|spec| spec.name == added.name);
    let (nuisances, physical): (Vec<_>, Vec<_>) = model.effects.iter().partition(is_nuisance);
    if !nuisances.is_empty() {
        let names: Vec<&str> = nuisances.iter().map(|added| added.name.as_str()).collect();
        left_out.push(format!(
            "tried on plants without {}: their flow is of first order, and their sensor's zero is at 0",
            names.join(", ")
        ));
    }
    for added in physical {
        match physical_effect(&added.name, &added.parameters) {
            Ok(effect) => effects.push(effect),
            Err(error) => left_out.push(format!(
                "tried on plants without {}, which the simulator does not have so: {error:#}",
                added.name
            )),
        }
    }
    Ok((PlantSpec::new(base, &effects), left_out))
}

/// The law in continuous time; where the plants have no such law, the longest of
/// its delays.
fn transport(law: &TransportLaw, period: f64) -> FlowDelay {
    let factor = law.factors.iter().copied().fold(f64::INFINITY, f64::min);
    let known = physical_effect(law.spec.name, &law.parameters).ok();
    let delay = known.and_then(|effect| effect.delay());
    let longest = || FlowDelay::Fixed {
        delay_s: period * law.range(period)[1],
    };
    delay.unwrap_or_else(longest).scaled(factor)
}

/// The effect of that name with a model's values for it.
fn physical_effect(name: &str, values: &[f64]) -> anyhow::Result<Effect> {
    // Drawn for its kind alone.
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let base = BasePlant::draw(&mut rng);
    let mut effect = Effect::draw(name, &base, &mut rng)?;
    let names = model_core::effects::spec(name).map_or(&[][..], |spec| spec.parameters);
    for (parameter, value) in names.iter().zip(values) {
        effect = effect.with(parameter.name, *value)?;
    }
    Ok(effect)
}

/// What a plant is tried under.
#[derive(Clone, Copy)]
struct Circumstances {
    /// Sensor noise, in units of a hot film's.
    noise: f64,
    lost: Lost,
    seed: u64,
}

impl Circumstances {
    fn usual(seed: u64) -> Self {
        Self {
            noise: 1.0,
            lost: Lost::default(),
            seed,
        }
    }
}

fn trial(
    group: CaseGroup,
    name: &str,
    plant: &PlantSpec,
    under: Circumstances,
) -> anyhow::Result<Trial<Disturbed<Rig>>> {
    let mut rng = ChaCha8Rng::seed_from_u64(under.seed);
    let stream = FreeStream::draw(&mut rng, RULES.trial);
    let rig = Rig::new(plant, Some(stream)).context(NO_PLANT)?;
    let noise = Noise {
        white: under.noise * Noise::HOT_FILM.white,
        coloured: under.noise * Noise::HOT_FILM.coloured,
        ..Noise::HOT_FILM
    };
    let converter = Some(Converter::TWELVE_BIT);
    Ok(Trial {
        group,
        name: name.to_owned(),
        flow: Disturbed::new(rig, Some(noise), converter, under.lost, under.seed),
    })
}

/// The plant with every effect of the catalogue in turn, then otherwise than designed for.
fn others(plant: &PlantSpec, seed: u64) -> anyhow::Result<Vec<Trial<Disturbed<Rig>>>> {
    let usual = Circumstances::usual(seed);
    let mut others = Vec::new();
    for (index, name) in Effect::NAMES.iter().enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(index as u64 + 1);
        let effect = Effect::draw(name, &plant.base, &mut rng).context(NO_PLANT)?;
        let mut with = plant.clone();
        with.effects.retain(|present| !effect.excludes(present));
        with.effects.push(effect);
        let values: Vec<String> = effect
            .parameters()
            .iter()
            .map(|p| format!("{} {:.3}", p.name, p.value))
            .collect();
        let name = format!("{name} ({})", values.join(", "));
        others.push(trial(CaseGroup::Effect, &name, &with, usual)?);
    }
    let delayed = |factor: f64| BasePlant {
        delay: plant.base.delay.scaled(factor),
        ..plant.base
    };
    let stronger = |factor: f64| BasePlant {
        gain: plant.base.gain * factor,
        ..plant.base
    };
    let noisier = Circumstances {
        noise: 3.0,
        ..usual
    };
    let losing = |share: f64, stretch: Option<(usize, usize)>| Circumstances {
        lost: Lost { share, stretch },
        ..usual
    };
    for (name, base, under) in [
        ("delay +20 %", delayed(1.2), usual),
        ("delay -20 %", delayed(0.8), usual),
        ("gain +10 %", stronger(1.1), usual),
        ("gain -10 %", stronger(0.9), usual),
        ("noise x 3", plant.base, noisier),
        ("every fifth reading lost", plant.base, losing(0.2, None)),
        (
            "no reading for a second",
            plant.base,
            losing(0.0, Some((6000, 1000))),
        ),
    ] {
        let plant = PlantSpec {
            base,
            ..plant.clone()
        };
        others.push(trial(CaseGroup::Disturbance, name, &plant, under)?);
    }
    Ok(others)
}

#[cfg(test)]
mod tests {
    use super::*;
    use closed_loop::Figures;
    use host_fit::design::{Case, Proof, TrackRequest, prove, track};
    use model_core::recursion::LagConvention;
    use std::path::Path;

    /// Table II, state-dependent delay.
    fn paper() -> Model {
        let path = "../data/paper/table-2-state-dependent.toml";
        Model {
            convention: LagConvention::OneStep,
            ..Model::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
        }
    }

    /// The paper's model rises to .62 in 0.5 s and to .84 in 1 s; the nearest plant must be near.
    #[test]
    fn the_plant_rises_as_the_model() {
        let mut model = paper();
        let spec = model_core::effects::spec("plenum-droop").unwrap();
        model.add(spec, &[1.0, 0.0], None);
        let (spec, left_out) = nearest_plant(&model).unwrap();
        assert!(left_out.is_empty());
        assert_eq!(spec.effects.len(), 1);
        let mut rig = Rig::new(&spec, None).unwrap();
        let y = rig.play(&[1.0; 4000]);
        assert!(y[46] == 0.0);
        assert!((y[500] - 0.62).abs() < 0.08, "{}", y[500]);
        assert!((y[1000] - 0.84).abs() < 0.08, "{}", y[1000]);
        assert!((y[3999] - 1.067).abs() < 0.03, "{}", y[3999]);
    }

    fn proof(target: f64, seed: u64) -> Proof {
        let request = TrackRequest::holding(target);
        let model = paper();
        let law = track(&model, &request).unwrap().law;
        let plants = Plants::of(&model, seed).unwrap();
        prove(&model, &law, &plants.nearest, &plants.others)
    }

    #[test]
    fn the_law_of_the_papers_model_survives_everything() {
        let proof = proof(0.8, 1);
        let lost: Vec<&Case> = proof.cases.iter().filter(|case| !case.kept).collect();
        assert!(lost.is_empty(), "{lost:#?}");
        let on_model = proof.cases[0].figures;
        assert!(
            on_model.rms < 0.02 && on_model.offset.abs() < 0.005,
            "{on_model:?}"
        );
        let on_plant = proof.cases[1].figures;
        let relay = Figures::of(&proof.compared, RULES.trial_from);
        assert!(on_plant.rms < 0.5 * relay.rms, "{on_plant:?} {relay:?}");
        assert!(on_plant.offset.abs() < 0.01);
        for case in &proof.cases {
            if case.group == CaseGroup::Disturbance {
                assert!(case.figures.offset.abs() < 0.01, "{case:?}");
                assert!(case.figures.rms < relay.rms, "{case:?}");
            }
        }
    }

    #[test]
    fn a_proof_repeats_bit_for_bit() {
        assert_eq!(proof(0.6, 7), proof(0.6, 7));
    }
}
