//! A law tried in the loop: on its own model, on a physical flow, on that flow
//! with every effect it does not know of, and under worse conditions than designed for.

use super::DesignError;
use super::bench::{Bench, HostState};
use super::physical::nearest_plant;
use crate::model::{Maximise, Model, Track};
use firmware_sim::closed_loop::{
    Controller, Disturbed, Figures, Flow, Law, Lost, ModelFlow, OpenLoop, Relay, Trace, run,
};
use firmware_sim::instrument::{Converter, Noise};
use firmware_sim::plant::{BasePlant, DelayLaw, Effect, FreeStream, PlantSpec, Rig};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

/// Samples of a trial, and from where it is judged.
const SAMPLES: usize = 12_000;
const JUDGED: usize = 4000;
/// Samples over which friction is averaged before attachment is called lost.
const ATTACHED_MEAN: usize = 250;

/// What a case is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CaseGroup {
    /// The model in place of the flow.
    Model,
    /// The nearest physical plant, noisy.
    Plant,
    /// The plant with an effect that the law does not know of.
    Effect,
    /// The plant otherwise than designed for.
    Disturbance,
}

/// One trial of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What it is about.
    pub group: CaseGroup,
    /// What is different, in words.
    pub name: String,
    /// What came of it, from 4 s on.
    pub figures: Figures,
    /// Mean friction of the same flow under steady blowing.
    pub steady: f64,
    /// Lowest 250 ms mean of the friction.
    pub lowest: f64,
    /// Whether the flow stays attached wherever steady blowing keeps it so: the
    /// lowest mean is above half of what was asked for or steady blowing gives.
    pub kept: bool,
}

/// All trials of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// The physical plant.
    pub plant: PlantSpec,
    /// The trials.
    pub cases: Vec<Case>,
    /// The run on the plant.
    pub trace: Trace,
    /// Something simpler on the same plant: a relay with the same hold times, or
    /// steady blowing.
    pub compared: Trace,
    /// What it is.
    pub compared_name: &'static str,
}

/// A plant in its circumstances.
#[derive(Clone)]
struct Trial {
    group: CaseGroup,
    name: String,
    plant: PlantSpec,
    noise: f64,
    lost: Lost,
    seed: u64,
}

impl Trial {
    fn flow(&self) -> Result<Disturbed<Rig>, DesignError> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let stream = FreeStream::draw(&mut rng, SAMPLES);
        let rig =
            Rig::new(&self.plant, Some(stream)).map_err(|e| DesignError::Plant(e.to_string()))?;
        let noise = Noise {
            white: self.noise * Noise::HOT_FILM.white,
            coloured: self.noise * Noise::HOT_FILM.coloured,
            ..Noise::HOT_FILM
        };
        Ok(Disturbed::new(
            rig,
            Some(noise),
            Some(Converter::TWELVE_BIT),
            self.lost,
            self.seed,
        ))
    }

    fn run(
        &self,
        controller: &mut impl Controller,
        reference: f64,
    ) -> Result<(Case, Trace), DesignError> {
        let goal = || std::iter::repeat_n(reference, SAMPLES);
        let trace = run(controller, &mut self.flow()?, goal());
        let blown = run(&mut OpenLoop::steady(), &mut self.flow()?, goal());
        let steady = Figures::of(&blown, JUDGED).mean;
        let lowest = lowest_mean(&trace);
        let case = Case {
            group: self.group,
            name: self.name.clone(),
            figures: Figures::of(&trace, JUDGED),
            steady,
            lowest,
            kept: lowest >= 0.5 * reference.min(lowest_mean(&blown)),
        };
        Ok((case, trace))
    }
}

fn lowest_mean(trace: &Trace) -> f64 {
    let judged = trace.samples.get(JUDGED..).unwrap_or_default();
    let means = judged
        .windows(ATTACHED_MEAN)
        .step_by(10)
        .map(|w| w.iter().map(|s| s.friction).sum::<f64>() / ATTACHED_MEAN as f64);
    means.fold(f64::INFINITY, f64::min)
}

/// Tries the tracking `law` of `model`. Repeatable by `seed`.
///
/// # Errors
/// [`DesignError`] when no physical plant can be made from the model.
pub fn prove(model: &Model, law: &Track, seed: u64) -> Result<Proof, DesignError> {
    let bench = Bench::<f32>::of(model);
    let plant = nearest_plant(model)?;
    let trials = trials(&plant, seed)?;
    let controller = || host_law(&bench, law);
    let cases = trials.par_iter().map(|trial| {
        trial
            .run(&mut controller(), law.reference)
            .map(|(case, _)| case)
    });
    let mut cases = cases.collect::<Result<Vec<_>, _>>()?;

    let mut flow = ModelFlow::new(&bench.prepared, bench.at_rest(), bench.channels.clone());
    cases.insert(0, on_model(&mut controller(), &mut flow, law, &bench));
    let (_, trace) = trials[0].run(&mut controller(), law.reference)?;
    let mut relay = Relay::new(law.hold.into(), 0.0);
    let (_, relay) = trials[0].run(&mut relay, law.reference)?;
    Ok(Proof {
        plant,
        cases,
        trace,
        compared: relay,
        compared_name: "plain relay, same hold times",
    })
}

/// Tries the pulses of a maximising law on the nearest plant, with the effects
/// of the catalogue and worse conditions; the reference is steady blowing.
///
/// # Errors
/// [`DesignError`] when no physical plant can be made from the model.
pub fn prove_pulses(model: &Model, law: &Maximise, seed: u64) -> Result<Proof, DesignError> {
    let plant = nearest_plant(model)?;
    let trials = trials(&plant, seed)?;
    let pulses = || OpenLoop::train(law.train(), law.hold.into());
    let reference = plant.base.gain;
    let cases = trials
        .par_iter()
        .map(|trial| trial.run(&mut pulses(), reference).map(|(case, _)| case));
    let cases = cases.collect::<Result<Vec<_>, _>>()?;
    let (_, trace) = trials[0].run(&mut pulses(), reference)?;
    let (_, steady) = trials[0].run(&mut OpenLoop::steady(), reference)?;
    Ok(Proof {
        plant,
        cases,
        trace,
        compared: steady,
        compared_name: "steady blowing",
    })
}

/// Runs the tracking `law` of `model` on `flow`, in single precision as on a
/// board, for as many samples as there are references.
pub fn run_law(
    model: &Model,
    law: &Track,
    flow: &mut impl Flow,
    references: impl IntoIterator<Item = f64>,
) -> Trace {
    let bench = Bench::<f32>::of(model);
    run(&mut host_law(&bench, law), flow, references)
}

type HostLaw<'a> = Law<
    'a,
    f32,
    crate::model::Prepared<f32>,
    crate::simulate::Ring<f32>,
    crate::simulate::Ring<f32>,
>;

fn host_law<'a>(bench: &'a Bench<f32>, law: &Track) -> HostLaw<'a> {
    let at_rest: HostState<f32> = bench.at_rest();
    Law::new(
        &bench.prepared,
        law.tracking(),
        at_rest,
        bench.channels.clone(),
    )
}

fn on_model(
    controller: &mut impl Controller,
    flow: &mut impl Flow,
    law: &Track,
    bench: &Bench<f32>,
) -> Case {
    let goal = || std::iter::repeat_n(law.reference, SAMPLES);
    let trace = run(controller, flow, goal());
    let mut flow = ModelFlow::new(&bench.prepared, bench.at_rest(), bench.channels.clone());
    let blown = run(&mut OpenLoop::steady(), &mut flow, goal());
    let lowest = lowest_mean(&trace);
    Case {
        group: CaseGroup::Model,
        name: "the model itself, no noise".to_owned(),
        figures: Figures::of(&trace, JUDGED),
        steady: Figures::of(&blown, JUDGED).mean,
        lowest,
        kept: lowest >= 0.5 * law.reference,
    }
}

/// The plant as it is first, then everything else.
fn trials(plant: &PlantSpec, seed: u64) -> Result<Vec<Trial>, DesignError> {
    let as_it_is = Trial {
        group: CaseGroup::Plant,
        name: "continuous-time plant, noisy sensor".to_owned(),
        plant: plant.clone(),
        noise: 1.0,
        lost: Lost::default(),
        seed,
    };
    let mut trials = vec![as_it_is.clone()];
    for (index, name) in Effect::NAMES.iter().enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(index as u64 + 1);
        let effect = Effect::draw(name, &plant.base, &mut rng)
            .map_err(|e| DesignError::Plant(e.to_string()))?;
        let mut with = plant.clone();
        with.effects.retain(|present| !effect.excludes(present));
        with.effects.push(effect);
        let values: Vec<String> = effect
            .parameters()
            .iter()
            .map(|p| format!("{} {:.3}", p.name, p.value))
            .collect();
        trials.push(Trial {
            group: CaseGroup::Effect,
            name: format!("{name} ({})", values.join(", ")),
            plant: with,
            ..as_it_is.clone()
        });
    }
    let disturbed = |name: &str, plant: PlantSpec, noise: f64, lost: Lost| Trial {
        group: CaseGroup::Disturbance,
        name: name.to_owned(),
        plant,
        noise,
        lost,
        seed,
    };
    let with_base = |base: BasePlant| PlantSpec {
        base,
        ..plant.clone()
    };
    for (name, factor) in [("delay +20 %", 1.2), ("delay -20 %", 0.8)] {
        let base = BasePlant {
            delay: scaled(plant.base.delay, factor),
            ..plant.base
        };
        trials.push(disturbed(name, with_base(base), 1.0, Lost::default()));
    }
    for (name, factor) in [("gain +10 %", 1.1), ("gain -10 %", 0.9)] {
        let base = BasePlant {
            gain: plant.base.gain * factor,
            ..plant.base
        };
        trials.push(disturbed(name, with_base(base), 1.0, Lost::default()));
    }
    trials.push(disturbed("noise x 3", plant.clone(), 3.0, Lost::default()));
    let some = Lost {
        share: 0.2,
        stretch: None,
    };
    trials.push(disturbed(
        "every fifth reading lost",
        plant.clone(),
        1.0,
        some,
    ));
    let stretch = Lost {
        share: 0.0,
        stretch: Some((6000, 1000)),
    };
    trials.push(disturbed(
        "no reading for a second",
        plant.clone(),
        1.0,
        stretch,
    ));
    Ok(trials)
}

fn scaled(delay: DelayLaw, factor: f64) -> DelayLaw {
    match delay {
        DelayLaw::Fixed { delay_s } => DelayLaw::Fixed {
            delay_s: delay_s * factor,
        },
        DelayLaw::StateDependent {
            floor_s,
            rise_s,
            rate,
        } => DelayLaw::StateDependent {
            floor_s: floor_s * factor,
            rise_s: rise_s * factor,
            rate,
        },
        DelayLaw::EdgeDependent { rise_s, fall_s } => DelayLaw::EdgeDependent {
            rise_s: rise_s * factor,
            fall_s: fall_s * factor,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::super::track;
    use super::super::tracking::tests::{paper_state_dependent, request};
    use super::*;
    use model_core::recursion::LagConvention;

    #[test]
    fn the_law_of_the_papers_model_survives_everything() {
        let model = paper_state_dependent(LagConvention::OneStep);
        let design = track(&model, &request(0.8)).unwrap();
        let proof = prove(&model, &design.law, 1).unwrap();
        let lost: Vec<&Case> = proof.cases.iter().filter(|case| !case.kept).collect();
        assert!(lost.is_empty(), "{lost:#?}");
        let on_model = proof.cases[0].figures;
        assert!(
            on_model.rms < 0.02 && on_model.offset.abs() < 0.005,
            "{on_model:?}"
        );
        let on_plant = proof.cases[1].figures;
        let relay = Figures::of(&proof.compared, JUDGED);
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
        let model = paper_state_dependent(LagConvention::OneStep);
        let design = track(&model, &request(0.6)).unwrap();
        let first = prove(&model, &design.law, 7).unwrap();
        assert_eq!(prove(&model, &design.law, 7).unwrap(), first);
    }
}
