//! Stress trials of a law on simulated plants: the continuous-time plant nearest to the model, that plant
//! with each effect of the catalogue at its usual strength, and under conditions beyond the design.
//!
//! The plants are not part of the library: a fit must not be tested with a simulator on which it depends.
//!
//! The simulator runs at 1 ms per sample. A model of another period is converted to that clock with all its
//! times, and its plant runs at the model's own period: the plant of a model at 100 ms is a hundred times
//! slower. Friction is of order one in the simulator; the trial converts it to the model's units, sensor
//! offset included.

use anyhow::{Context, bail};
use closed_loop::{Controlled, span};
use firmware_sim::bench::{Disturbed, Lost};
use firmware_sim::instrument::{Converter, Noise};
use firmware_sim::plant::{
    BasePlant, Effect, FlowDelay, FreeStream, PlantSpec, RateLaw, Rig, SAMPLE_PERIOD_S,
};
use host_fit::design::{CaseGroup, DesignError, RULES, Trial, steady, time_constants};
use host_fit::model::{Added, Delay, Model, TransportLaw};
use host_fit::picture::significant;
use host_fit::steps::units_of_order_one;
use host_fit::terms::Units;
use model_core::effect::Unit;
use model_core::effects::{NUISANCES, ZERO_OFFSET};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const NO_PLANT: &str = "no physical plant could be made from the model";

/// A plant in the model's time and units.
#[derive(Clone, Debug)]
pub(crate) struct Clocked {
    flow: Disturbed<Rig>,
    units: Units,
}

impl Controlled for Clocked {
    fn sample_period_s(&self) -> f64 {
        SAMPLE_PERIOD_S * self.units.time
    }
    fn step(&mut self, command: bool) -> Option<f64> {
        let reading = self.flow.step(command)?;
        Some(self.units.zero + self.units.y * reading)
    }
    fn friction(&self) -> f64 {
        self.units.y * self.flow.friction()
    }
}

/// The plants of the stress trials.
pub(crate) struct Plants {
    /// The plant nearest to the model with sensor noise, then variations of it.
    pub(crate) stress: Vec<Trial<Clocked>>,
    /// Parts of the model that no simulated plant can represent, one sentence each.
    pub(crate) left_out: Vec<String>,
}

impl Plants {
    /// The plants for `model`, repeatable by `seed`. `noise` is that of the sensor as a multiple of a typical hot film's.
    ///
    /// # Errors
    /// The model does not settle, or its constants are not physical.
    pub(crate) fn of(model: &Model, noise: f64, seed: u64) -> anyhow::Result<Self> {
        let units = Units {
            time: model.sample_period_s / SAMPLE_PERIOD_S,
            ..units_of_order_one(model)
        };
        let (plant, left_out) = nearest_plant(&units.model_in(model))?;
        let usual = Circumstances {
            noise,
            lost: Lost::default(),
            seed,
            units,
        };
        let mut stress = vec![trial(
            CaseGroup::Plant,
            "continuous-time plant, noisy sensor",
            &plant,
            usual,
        )?];
        stress.extend(others(&plant, usual)?);
        Ok(Self { stress, left_out })
    }
}

/// A first-order flow with the model's levels, attachment and separation times and continuous-time transport
/// delay, and those of its effects that the simulator can represent.
///
/// # Errors
/// The model does not settle, or its constants are not physical.
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
    // The sensor's offset is added by the trial.
    let shown = |added: &&Added| added.name != ZERO_OFFSET.name;
    let is_nuisance = |added: &&Added| NUISANCES.iter().any(|spec| spec.name == added.name);
    let (nuisances, physical): (Vec<_>, Vec<_>) =
        model.effects.iter().filter(shown).partition(is_nuisance);
    if !nuisances.is_empty() {
        let names: Vec<&str> = nuisances.iter().map(|added| added.name.as_str()).collect();
        left_out.push(format!(
            "stress trials use plants without {}, because the flow of these plants is of first order",
            names.join(", ")
        ));
    }
    for added in physical {
        match physical_effect(&added.name, &added.parameters) {
            Ok(effect) => effects.push(effect),
            Err(_) if model.definition(&added.name).is_some() => left_out.push(format!(
                "stress trials use plants without {}, which is not an effect of the simulator",
                added.name
            )),
            Err(error) => left_out.push(format!(
                "stress trials use plants without {}, which the simulator cannot represent: {error:#}",
                added.name
            )),
        }
    }
    Ok((PlantSpec::new(base, &effects), left_out))
}

/// The law in continuous time; if the simulator does not have it, a constant delay, the longest of the law's.
fn transport(law: &TransportLaw, period: f64) -> FlowDelay {
    let factor = law.factors.iter().copied().fold(f64::INFINITY, f64::min);
    let known = physical_effect(law.spec.name, &law.parameters).ok();
    let delay = known.and_then(|effect| effect.delay());
    let longest = || FlowDelay::Fixed {
        delay_s: period * law.range(period)[1],
    };
    delay.unwrap_or_else(longest).scaled(factor)
}

/// The simulator's effect of that name with the model's values.
fn physical_effect(name: &str, values: &[f64]) -> anyhow::Result<Effect> {
    // Only the kind is used, not the drawn values.
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let base = BasePlant::draw(&mut rng);
    let mut effect = Effect::draw(name, &base, &mut rng)?;
    let names = model_core::effects::spec(name).map_or(&[][..], |spec| spec.parameters);
    for (parameter, value) in names.iter().zip(values) {
        effect = effect.with(parameter.name, *value)?;
    }
    Ok(effect)
}

/// Conditions of a trial.
#[derive(Clone, Copy)]
struct Circumstances {
    /// Sensor noise relative to a hot film's.
    noise: f64,
    lost: Lost,
    seed: u64,
    /// Conversion between the units of the simulator and those of the model, time included.
    units: Units,
}

impl Circumstances {
    /// The model's sample period, s.
    fn sample_period_s(&self) -> f64 {
        SAMPLE_PERIOD_S * self.units.time
    }

    /// Length at the model's period of a run of this many samples at 1 kHz.
    fn span(&self, samples: usize) -> usize {
        span(samples, self.sample_period_s())
    }
}

fn trial(
    group: CaseGroup,
    name: &str,
    plant: &PlantSpec,
    under: Circumstances,
) -> anyhow::Result<Trial<Clocked>> {
    let mut rng = ChaCha8Rng::seed_from_u64(under.seed);
    let stream = FreeStream::draw(&mut rng, under.span(RULES.trial));
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
        flow: Clocked {
            flow: Disturbed::new(rig, Some(noise), converter, under.lost, under.seed),
            units: under.units,
        },
    })
}

/// The plant with every effect of the catalogue in turn, then under conditions beyond the design.
fn others(plant: &PlantSpec, usual: Circumstances) -> anyhow::Result<Vec<Trial<Clocked>>> {
    let Circumstances { seed, units, .. } = usual;
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
            // In the model's units.
            .map(|p| {
                let unit = Unit::of(p.unit);
                let value = significant(units.value_out(unit, p.value), 3);
                match unit {
                    Unit::None => format!("{} {value}", p.name),
                    unit => format!("{} {value} {unit}", p.name),
                }
            })
            .collect();
        let name = match values.as_slice() {
            [] => (*name).to_owned(),
            values => format!("{name} ({})", values.join(", ")),
        };
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
        noise: 3.0 * usual.noise,
        ..usual
    };
    let losing = |share: f64, stretch: Option<(usize, usize)>| Circumstances {
        lost: Lost { share, stretch },
        ..usual
    };
    // One second of the simulator's clock, in samples.
    let [from, length] = [6000, 1000].map(|samples| usual.span(samples));
    let gap_s = length as f64 * usual.sample_period_s();
    let gap = if (gap_s - 1.0).abs() < 1e-6 {
        "no reading for a second".to_owned()
    } else {
        format!("no reading for {gap_s:.4} s")
    };
    for (name, base, under) in [
        ("delay +20 %", delayed(1.2), usual),
        ("delay −20 %", delayed(0.8), usual),
        ("gain +10 %", stronger(1.1), usual),
        ("gain −10 %", stronger(0.9), usual),
        ("noise × 3", plant.base, noisier),
        ("every fifth reading lost", plant.base, losing(0.2, None)),
        (gap.as_str(), plant.base, losing(0.0, Some((from, length)))),
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
    use host_fit::design::{Case, Proof, TrackRequest, Trials, judged, prove, track};
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

    /// The paper's model rises to .62 in 0.5 s and to .84 in 1 s; the nearest plant must be close to that.
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
        proof_of(&paper(), target, seed)
    }

    fn proof_of(model: &Model, target: f64, seed: u64) -> Proof {
        // The shortest times are ten samples at any period.
        let shortest = 10.0 * model.sample_period_s;
        let request = TrackRequest {
            min_on_s: shortest,
            min_off_s: shortest,
            ..TrackRequest::holding(target)
        };
        let law = track(model, &request).unwrap().law;
        let plants = Plants::of(model, 1.0, seed).unwrap();
        let trials = Trials {
            possible: &[],
            stress: &plants.stress,
            noise: 1.0,
            seed,
        };
        prove(model, &law, &trials)
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
        let on_plant = proof.cases[2].figures;
        let relay = judged(&proof.compared);
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

    /// The paper's flow with all times, sample period included, multiplied by `slower`.
    fn slowed(slower: f64) -> Model {
        let mut model = paper();
        let spec = model_core::effects::spec("plenum-droop").unwrap();
        model.add(spec, &[1.0, 0.05], None);
        let clock = Units {
            time: slower,
            ..Units::NONE
        };
        clock.model_out(&model)
    }

    /// If all times of the data are multiplied by c, the law is the same, and all times in its
    /// results are multiplied by c.
    #[test]
    fn a_slower_clock_changes_times_and_nothing_else() {
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(1e-3);
        let at_1_khz = proof_of(&slowed(1.0), 0.6, 3);
        let slower = 100.0;
        let model = slowed(slower);
        assert!(near(model.sample_period_s, 0.001 * slower));
        let proof = proof_of(&model, 0.6, 3);
        assert_eq!(proof.cases.len(), at_1_khz.cases.len());
        for (case, fast) in proof.cases.iter().zip(&at_1_khz.cases) {
            assert_eq!(
                (case.group, case.kept),
                (fast.group, fast.kept),
                "{case:?} {fast:?}"
            );
            let (f, g) = (case.figures, fast.figures);
            assert!((f.mean - g.mean).abs() < 0.01, "{case:?} {fast:?}");
            assert!((f.rms - g.rms).abs() < 0.01, "{case:?} {fast:?}");
            let switches = f.switches_per_s * slower / g.switches_per_s;
            assert!((switches - 1.0).abs() < 0.05, "{case:?} {fast:?}");
        }
        assert!(near(proof.trace.sample_period_s, 0.001 * slower));
    }
}
