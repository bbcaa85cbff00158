//! Trials of a law in closed loop: on its own model, on the plants that the records do not exclude, and under
//! stress.
//!
//! A law that loses attachment on the model or on a possible plant is rejected. Stress tests are reported and
//! never reject a law: the nearest physical plant with every effect of the catalogue at its worst, and
//! conditions beyond the design.

use super::bench::Player;
use super::noise::Noisy;
use super::possible::PossibleFlow;
use super::rules::RULES;
use crate::model::{Maximise, Model, Track};
use crate::parallel;
use crate::simulate::HostState;
use closed_loop::{
    Controlled, Controller, Figures, ModelFlow, OpenLoop, Relay, Trace, TrackingController, run,
    span,
};
use serde::{Serialize, Serializer};

/// Group of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CaseGroup {
    /// The model itself.
    Model,
    /// A plant that the records do not exclude.
    Possible,
    /// A plant that the records exclude, with an effect below the detectable size.
    Unseen,
    /// The nearest physical plant with noise.
    Plant,
    /// The nearest physical plant with an effect that the model lacks.
    Effect,
    /// The nearest physical plant under conditions beyond the design.
    Disturbance,
}

impl CaseGroup {
    /// Whether a loss of attachment in this group rejects the law; otherwise it only gives a
    /// warning.
    #[must_use]
    pub fn decides(self) -> bool {
        matches!(self, Self::Model | Self::Possible)
    }
}

/// A plant for a trial, in its initial state.
#[derive(Clone, Debug)]
pub struct Trial<F> {
    /// Group of the trial.
    pub group: CaseGroup,
    /// The difference from the model, in words.
    pub name: String,
    /// The plant; every run gets a copy.
    pub flow: F,
}

/// Result of one law on one plant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// Group of the trial.
    pub group: CaseGroup,
    /// The difference from the model, in words.
    pub name: String,
    /// One-sided p-value of the records under this plant; `None` if unknown.
    pub p_value: Option<f64>,
    /// Figures of the run after 4000 samples (4 s at 1 kHz).
    #[serde(flatten)]
    pub figures: Figures,
    /// Mean friction of the same flow under steady blowing.
    #[serde(rename = "steady_mean")]
    pub steady: f64,
    /// Lowest mean of the friction over 250 samples (250 ms at 1 kHz).
    #[serde(rename = "lowest_mean")]
    pub lowest: f64,
    /// Whether the flow stays attached if steady blowing keeps it attached: the lowest mean exceeds half of
    /// the target or of the level under steady blowing.
    pub kept: bool,
}

/// All trials of a law. Serialises to the keys `cases` and `relay` of `design --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proof {
    /// The trials.
    pub cases: Vec<Case>,
    /// The run on the model, through a noisy sensor.
    #[serde(skip)]
    pub trace: Trace,
    /// A reference run on the same flow: a relay with the same hold times, or steady blowing.
    #[serde(rename = "relay", serialize_with = "figures")]
    pub compared: Trace,
    /// Name of the reference.
    #[serde(skip)]
    pub compared_name: &'static str,
}

impl Proof {
    /// Names of the trials on plants consistent with the records in which attachment was lost.
    #[must_use]
    pub fn lost(&self) -> Vec<String> {
        self.lost_where(CaseGroup::decides)
    }

    /// Whether the law keeps attachment on its own model.
    #[must_use]
    pub fn keeps_its_model(&self) -> bool {
        self.lost_where(|group| group == CaseGroup::Model)
            .is_empty()
    }

    /// The figures of the law on its model with sensor noise.
    #[must_use]
    pub fn on_its_model(&self) -> Option<&Figures> {
        let model = |case: &&Case| case.group == CaseGroup::Model;
        self.cases.iter().rfind(model).map(|case| &case.figures)
    }

    /// Whether a tracking law holds its target on its model with sensor noise.
    #[must_use]
    pub fn holds(&self) -> bool {
        let settles = |figures: &Figures| figures.settling_s.is_some();
        self.on_its_model().is_none_or(settles)
    }

    /// Names of the other trials in which attachment was lost: undetectable effects and stress.
    #[must_use]
    pub fn lost_beyond_the_records(&self) -> Vec<String> {
        self.lost_where(|group| !group.decides())
    }

    /// The result with levels as readings of a sensor with offset `zero`.
    #[must_use]
    pub fn shown_by(mut self, zero: f64) -> Self {
        if zero == 0.0 {
            return self;
        }
        for case in &mut self.cases {
            case.figures.mean += zero;
            case.steady += zero;
            case.lowest += zero;
        }
        for trace in [&mut self.trace, &mut self.compared] {
            for sample in &mut trace.samples {
                sample.friction += zero;
                sample.reference += zero;
            }
        }
        self
    }

    fn lost_where(&self, of: impl Fn(CaseGroup) -> bool) -> Vec<String> {
        let lost = self
            .cases
            .iter()
            .filter(|case| !case.kept && of(case.group));
        lost.map(|case| case.name.clone()).collect()
    }
}

/// The plants of the trials, in addition to the model.
#[derive(Clone, Copy, Debug)]
pub struct Trials<'a, F> {
    /// Flows that are consistent with the records.
    pub possible: &'a [PossibleFlow],
    /// Flows under stress.
    pub stress: &'a [Trial<F>],
    /// Sensor noise on the model and possible plants, as a multiple of the noise of a typical hot film at friction of
    /// order one.
    pub noise: f64,
    /// Seed of that noise.
    pub seed: u64,
}

fn figures<S: Serializer>(trace: &Trace, to: S) -> Result<S::Ok, S::Error> {
    judged(trace).serialize(to)
}

/// Figures of a run after its start.
#[must_use]
pub fn judged(trace: &Trace) -> Figures {
    Figures::of(trace, span(RULES.trial_from, trace.sample_period_s))
}

impl<F: Controlled + Clone> Trial<F> {
    fn run(&self, controller: &mut impl Controller, reference: f64) -> (Case, Trace) {
        let length = span(RULES.trial, self.flow.sample_period_s());
        let steadily = || std::iter::repeat_n(reference, length);
        let trace = run(controller, &mut self.flow.clone(), steadily());
        let mut blowing = OpenLoop::steady();
        let blown = run(&mut blowing, &mut self.flow.clone(), steadily());
        let lowest = lowest_mean(&trace);
        let case = Case {
            group: self.group,
            name: self.name.clone(),
            p_value: None,
            figures: judged(&trace),
            steady: judged(&blown).mean,
            lowest,
            kept: lowest >= RULES.attached * reference.min(lowest_mean(&blown)),
        };
        (case, trace)
    }
}

fn lowest_mean(trace: &Trace) -> f64 {
    lowest_mean_from(trace, RULES.trial_from)
}

/// Lowest mean friction over the window of [`RULES`], from sample `from` on.
fn lowest_mean_from(trace: &Trace, from: usize) -> f64 {
    let [from, window] = [from, RULES.attached_mean].map(|n| span(n, trace.sample_period_s));
    let judged = trace.samples.get(from..).unwrap_or_default();
    let means = judged
        .windows(window)
        .step_by(10)
        .map(|w| w.iter().map(|s| s.friction).sum::<f64>() / window as f64);
    means.fold(f64::INFINITY, f64::min)
}

/// A short run of a law for its robustness margin.
pub(super) struct Attempt {
    /// Root mean square of friction minus reference, y.
    pub(super) rms: f64,
    /// Whether attachment is kept.
    pub(super) kept: bool,
}

impl Attempt {
    pub(super) fn of<F: Controlled + Clone>(bench: &Player<f32>, law: &Track, flow: &F) -> Self {
        let references = std::iter::repeat_n(law.reference, bench.span(RULES.margin_run));
        let trace = run(&mut host_law(bench, law), &mut flow.clone(), references);
        let lowest = lowest_mean_from(&trace, RULES.margin_from);
        Self {
            rms: Figures::of(&trace, bench.span(RULES.margin_from)).rms,
            kept: lowest >= RULES.attached * law.reference,
        }
    }
}

/// A law initialised for a run.
trait Ready: Sync {
    fn run<F: Controlled + Clone>(&self, trial: &Trial<F>) -> (Case, Trace);
}

struct Tracks<'a> {
    bench: &'a Player<f32>,
    law: &'a Track,
}

impl Ready for Tracks<'_> {
    fn run<F: Controlled + Clone>(&self, trial: &Trial<F>) -> (Case, Trace) {
        trial.run(&mut host_law(self.bench, self.law), self.law.reference)
    }
}

struct Pulses<'a> {
    law: &'a Maximise,
    /// Friction under steady blowing, y: the reference.
    blown: f64,
}

impl Ready for Pulses<'_> {
    fn run<F: Controlled + Clone>(&self, trial: &Trial<F>) -> (Case, Trace) {
        let mut pulses = OpenLoop::train(self.law.train(), self.law.hold);
        trial.run(&mut pulses, self.blown)
    }
}

/// The model as the plant, with sensor noise.
fn on_bench<'a>(
    bench: &'a Player<f64>,
    group: CaseGroup,
    name: &str,
    noise: f64,
    seed: u64,
) -> Trial<Noisy<impl Controlled + Clone + 'a>> {
    let flow = ModelFlow::new(
        &bench.prepared,
        bench.at_rest(),
        bench.channels.clone(),
        bench.period_s,
    );
    Trial {
        group,
        name: name.to_owned(),
        flow: Noisy::new(flow, noise, seed),
    }
}

/// Trial on a possible plant of a law for a sensor with offset `zero`.
fn on_possible(law: &impl Ready, flow: &PossibleFlow, zero: f64, noise: f64, seed: u64) -> Case {
    let own = flow.model.zero_among(&flow.model.values());
    let bench = Player::<f64>::of(&flow.model);
    let group = if flow.is_possible() {
        CaseGroup::Possible
    } else {
        CaseGroup::Unseen
    };
    let mut trial = on_bench(&bench, group, &flow.name, noise, seed);
    trial.flow = trial.flow.with_zero(own - zero);
    let (case, _) = law.run(&trial);
    Case {
        p_value: Some(flow.p_value),
        ..case
    }
}

/// All trials of a law, and its run on the noisy model.
fn cases<F>(law: &impl Ready, model: &Model, trials: &Trials<'_, F>) -> (Vec<Case>, Trace)
where
    F: Controlled + Clone + Sync,
{
    let bench = Player::<f64>::of(model);
    let noisy = on_bench(
        &bench,
        CaseGroup::Model,
        "the model, noisy sensor",
        trials.noise,
        trials.seed,
    );
    let (on_model, trace) = law.run(&noisy);
    let mut cases = vec![on_model];
    let zero = model.zero_among(&model.values());
    cases.extend(parallel::each(trials.possible, |flow| {
        on_possible(law, flow, zero, trials.noise, trials.seed)
    }));
    cases.extend(parallel::each(trials.stress, |trial| law.run(trial).0));
    (cases, trace)
}

/// Runs the tracking `law` of `model` on its own model and in all `trials`.
pub fn prove<F>(model: &Model, law: &Track, trials: &Trials<'_, F>) -> Proof
where
    F: Controlled + Clone + Sync,
{
    let bench = Player::<f32>::of(model);
    let ready = Tracks { bench: &bench, law };
    let (others, trace) = cases(&ready, model, trials);
    let mut cases = vec![on_model(law, &bench)];
    cases.extend(others);
    let mut relay = Relay::new(law.hold, 0.0).with_zero(model.zero_among(&model.values()));
    Proof {
        cases,
        trace,
        compared: compared(&mut relay, law.reference, model, trials),
        compared_name: "plain relay, same hold times",
    }
}

/// Runs the pulses of a maximising law of `model` in all `trials`; `blown`, the friction under steady
/// blowing, is the reference.
pub fn prove_pulses<F>(model: &Model, law: &Maximise, blown: f64, trials: &Trials<'_, F>) -> Proof
where
    F: Controlled + Clone + Sync,
{
    let (cases, trace) = cases(&Pulses { law, blown }, model, trials);
    Proof {
        cases,
        trace,
        compared: compared(&mut OpenLoop::steady(), blown, model, trials),
        compared_name: "steady blowing",
    }
}

/// The reference run on the model with the same sensor noise.
fn compared<F>(
    controller: &mut impl Controller,
    reference: f64,
    model: &Model,
    trials: &Trials<'_, F>,
) -> Trace {
    let bench = Player::<f64>::of(model);
    let noisy = on_bench(&bench, CaseGroup::Model, "", trials.noise, trials.seed);
    noisy.run(controller, reference).1
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
        flow: ModelFlow::new(
            &bench.prepared,
            bench.at_rest(),
            bench.channels.clone(),
            bench.period_s,
        ),
    };
    let (case, _) = itself.run(&mut host_law(bench, law), law.reference);
    // The model may diverge under steady blowing, so the target is the reference.
    Case {
        kept: case.lowest >= RULES.attached * law.reference,
        ..case
    }
}
