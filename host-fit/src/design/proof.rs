//! A law tried in the loop: on its own model, and on whatever flows the caller has.
//! The program brings the nearest physical plant, with effects that the law does not
//! know of and under worse conditions than designed for.

use super::bench::Player;
use super::rules::RULES;
use crate::model::{Maximise, Model, Track};
use crate::simulate::HostState;
use closed_loop::{
    Controlled, Controller, Figures, ModelFlow, OpenLoop, Relay, Trace, TrackingController, run,
};
use rayon::prelude::*;
use serde::{Serialize, Serializer};

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

/// A flow that a law is tried on, at the start of the trial.
#[derive(Clone, Debug)]
pub struct Trial<F> {
    /// What it is about.
    pub group: CaseGroup,
    /// What is different, in words.
    pub name: String,
    /// The flow; every run has a copy of its own.
    pub flow: F,
}

/// One law on one flow.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// What it is about.
    pub group: CaseGroup,
    /// What is different, in words.
    pub name: String,
    /// What came of it, from 4 s on.
    #[serde(flatten)]
    pub figures: Figures,
    /// Mean friction of the same flow under steady blowing.
    #[serde(rename = "steady_mean")]
    pub steady: f64,
    /// Lowest 250 ms mean of the friction.
    #[serde(rename = "lowest_mean")]
    pub lowest: f64,
    /// Whether the flow stays attached wherever steady blowing keeps it so: the
    /// lowest mean is above half of what was asked for or steady blowing gives.
    pub kept: bool,
}

/// All trials of a law. Serialises to the keys `cases` and `relay` of `design --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proof {
    /// The trials.
    pub cases: Vec<Case>,
    /// The run on the plant as it is.
    #[serde(skip)]
    pub trace: Trace,
    /// Something simpler on the same plant: a relay with the same hold times, or
    /// steady blowing; here its figures.
    #[serde(rename = "relay", serialize_with = "figures")]
    pub compared: Trace,
    /// What it is.
    #[serde(skip)]
    pub compared_name: &'static str,
}

impl Proof {
    /// The trials in which attachment was lost, by name.
    #[must_use]
    pub fn lost(&self) -> Vec<String> {
        let lost = self.cases.iter().filter(|case| !case.kept);
        lost.map(|case| case.name.clone()).collect()
    }
}

fn figures<S: Serializer>(trace: &Trace, to: S) -> Result<S::Ok, S::Error> {
    Figures::of(trace, RULES.trial_from).serialize(to)
}

fn steadily(reference: f64) -> impl Iterator<Item = f64> {
    std::iter::repeat_n(reference, RULES.trial)
}

impl<F: Controlled + Clone> Trial<F> {
    fn run(&self, controller: &mut impl Controller, reference: f64) -> (Case, Trace) {
        let trace = run(controller, &mut self.flow.clone(), steadily(reference));
        let mut blowing = OpenLoop::steady();
        let blown = run(&mut blowing, &mut self.flow.clone(), steadily(reference));
        let lowest = lowest_mean(&trace);
        let case = Case {
            group: self.group,
            name: self.name.clone(),
            figures: Figures::of(&trace, RULES.trial_from),
            steady: Figures::of(&blown, RULES.trial_from).mean,
            lowest,
            kept: lowest >= RULES.attached * reference.min(lowest_mean(&blown)),
        };
        (case, trace)
    }
}

fn lowest_mean(trace: &Trace) -> f64 {
    let judged = trace.samples.get(RULES.trial_from..).unwrap_or_default();
    let means = judged
        .windows(RULES.attached_mean)
        .step_by(10)
        .map(|w| w.iter().map(|s| s.friction).sum::<f64>() / RULES.attached_mean as f64);
    means.fold(f64::INFINITY, f64::min)
}

/// Tries the tracking `law` of `model` on its own model, on the flow as it is expected (`plant`) and on others.
pub fn prove<F>(model: &Model, law: &Track, plant: &Trial<F>, others: &[Trial<F>]) -> Proof
where
    F: Controlled + Clone + Sync,
{
    let bench = Player::<f32>::of(model);
    let (as_it_is, trace) = plant.run(&mut host_law(&bench, law), law.reference);
    let mut cases = vec![on_model(law, &bench), as_it_is];
    cases.par_extend(others.par_iter().map(|trial| {
        let (case, _) = trial.run(&mut host_law(&bench, law), law.reference);
        case
    }));
    let mut relay = Relay::new(law.hold, 0.0);
    let (_, compared) = plant.run(&mut relay, law.reference);
    Proof {
        cases,
        trace,
        compared,
        compared_name: "plain relay, same hold times",
    }
}

/// Tries the pulses of a maximising law on the flow as it is expected (`plant`) and on others; `blown`, the friction
/// under steady blowing, is the reference.
pub fn prove_pulses<F>(law: &Maximise, blown: f64, plant: &Trial<F>, others: &[Trial<F>]) -> Proof
where
    F: Controlled + Clone + Sync,
{
    let pulses = || OpenLoop::train(law.train(), law.hold);
    let (as_it_is, trace) = plant.run(&mut pulses(), blown);
    let mut cases = vec![as_it_is];
    cases.par_extend(others.par_iter().map(|trial| {
        let (case, _) = trial.run(&mut pulses(), blown);
        case
    }));
    let (_, compared) = plant.run(&mut OpenLoop::steady(), blown);
    Proof {
        cases,
        trace,
        compared,
        compared_name: "steady blowing",
    }
}

/// Runs the tracking `law` of `model` on `flow`, in single precision as on a
/// board, for as many samples as there are references.
pub fn run_law(
    model: &Model,
    law: &Track,
    flow: &mut impl Controlled,
    references: impl IntoIterator<Item = f64>,
) -> Trace {
    let bench = Player::<f32>::of(model);
    run(&mut host_law(&bench, law), flow, references)
}

type HostLaw<'a> = TrackingController<
    'a,
    f32,
    crate::model::Prepared<f32>,
    crate::ring::Ring<f32>,
    crate::ring::Ring<f32>,
>;

fn host_law<'a>(bench: &'a Player<f32>, law: &Track) -> HostLaw<'a> {
    let at_rest: HostState<f32> = bench.at_rest();
    TrackingController::new(
        &bench.prepared,
        law.tracking(),
        at_rest,
        bench.channels.clone(),
    )
}

fn on_model(law: &Track, bench: &Player<f32>) -> Case {
    let itself = Trial {
        group: CaseGroup::Model,
        name: "the model itself, no noise".to_owned(),
        flow: ModelFlow::new(&bench.prepared, bench.at_rest(), bench.channels.clone()),
    };
    let (case, _) = itself.run(&mut host_law(bench, law), law.reference);
    // On a model steady blowing may grow; what was asked for is the measure.
    Case {
        kept: case.lowest >= RULES.attached * law.reference,
        ..case
    }
}
