//! Laws on unseen rigs: the targets that `design` refuses or accepts, and the law on the true plant.
//!
//! The plants are those of `firmware-sim`, which simulate physics in continuous time and share no code with the
//! model. A rig is recorded, identified and diagnosed like by a user. The law is designed for targets drawn over
//! the reachable interval and tried on the plants that the records do not exclude. Then the law runs on the rig
//! itself, and the ends of the margin are checked there.

use anyhow::Context;
use closed_loop::{Controlled, Figures, OpenLoop, Trace, run, span};
use firmware_sim::bench::{Disturbed, Lost};
use firmware_sim::family::{Family, NoiseKind, RigPlan};
use firmware_sim::plant::{BasePlant, Character, Effect, PlantSpec, Rig};
use host_fit::design::{Margin, RULES, TrackRequest, run_law, steady};
use host_fit::diagnose::Options;
use host_fit::indicators::Scores;
use host_fit::model::{Law, Model, Track};
use host_fit::steps::{self, DesignRequest, IdentifyRequest, NoStress};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// A target on a rig.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Asked {
    /// The target, as a share of the reachable interval.
    pub share: f64,
    /// Reason for rejecting the law; `None` if accepted.
    pub refused: Option<String>,
    /// Whether the law keeps attachment on the true plant; `None` without a law.
    pub works: Option<bool>,
    /// Rms error on the true plant relative to that on the model.
    pub rms_ratio: Option<f64>,
}

/// An end of a stated margin, tested on the true plant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct End {
    /// Error and end.
    pub name: String,
    /// The error, as a share.
    pub share: f64,
    /// Whether the law works on the true plant with that error.
    pub works: bool,
}

/// A rig.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// Its seed.
    pub seed: u64,
    /// Its family.
    pub family: String,
    /// The hidden effect; empty for none.
    pub hidden: String,
    /// Effects named by the diagnosis.
    pub named: Vec<String>,
    /// Validation error over the noise level.
    pub over_noise: f64,
    /// Number of plants consistent with the records.
    pub possible: usize,
    /// The targets.
    pub targets: Vec<Asked>,
    /// The ends of the margin of the first accepted law.
    pub ends: Vec<End>,
}

/// Number of targets per rig.
const TARGETS: usize = 3;

/// A model counts as at the noise level up to this ratio.
const AT_THE_NOISE: f64 = 1.1;

/// Up to this ratio the diagnosis is omitted.
const NOTHING_TO_EXPLAIN: f64 = 1.03;

/// The hidden effect of the rig of this seed: every third rig has an effect of the catalogue that on/off
/// records show.
fn plan_of(seed: u64) -> anyhow::Result<(RigPlan, String)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let family = Family::ALL[rng.random_range(0..Family::ALL.len())];
    let noise = NoiseKind::ALL[rng.random_range(0..NoiseKind::ALL.len())];
    let shown: Vec<&str> = Effect::NAMES
        .iter()
        .copied()
        .filter(|name| !["free-stream-variation", "input-nonlinearity"].contains(name))
        .collect();
    let effect = shown[rng.random_range(0..shown.len())];
    let hidden: &[&str] = if seed % 3 == 2 { &[effect] } else { &[] };
    let plan = RigPlan::draw(family, hidden, noise, &[], seed)?;
    Ok((plan, hidden.join(", ")))
}

/// The plant with errors of delay, gain and time constants as factors. The times of the flow's character scale with
/// its time constants, except the delay of its memory, which is not a time constant.
fn with_errors(plant: &PlantSpec, [delay, gain, time]: [f64; 3]) -> PlantSpec {
    let character = match plant.character.clone() {
        Character::Inertia { time_s } => Character::Inertia {
            time_s: time * time_s,
        },
        Character::SecondLag { time_s } => Character::SecondLag {
            time_s: time * time_s,
        },
        Character::Wake { time_s, pull } => Character::Wake {
            time_s: time * time_s,
            pull,
        },
        other => other,
    };
    PlantSpec {
        base: BasePlant {
            attach_s: time * plant.base.attach_s,
            separate_s: time * plant.base.separate_s,
            gain: gain * plant.base.gain,
            delay: plant.base.delay.scaled(delay),
            ..plant.base
        },
        character,
        ..plant.clone()
    }
}

/// The rig in closed loop, with its own noise.
fn in_the_loop(plan: &RigPlan, plant: &PlantSpec) -> anyhow::Result<Disturbed<Rig>> {
    let rig = Rig::new(plant, None).context("no such plant")?;
    let instrument = &plan.instrument;
    Ok(Disturbed::new(
        rig,
        Some(instrument.noise),
        instrument.converter,
        Lost::default(),
        plan.seed ^ 0x5eed,
    ))
}

/// Figures after the start, and whether attachment was kept, as in `design`.
fn judged(trace: &Trace, blown: &Trace, reference: f64) -> (Figures, bool) {
    let period_s = trace.sample_period_s;
    let [from, window] =
        [RULES.trial_from, RULES.attached_mean].map(|samples| span(samples, period_s));
    let lowest = |trace: &Trace| {
        let judged = trace.samples.get(from..).unwrap_or_default();
        let means = judged
            .windows(window)
            .step_by(10)
            .map(|w| w.iter().map(|s| s.friction).sum::<f64>() / window as f64);
        means.fold(f64::INFINITY, f64::min)
    };
    let kept = lowest(trace) >= RULES.attached * reference.min(lowest(blown));
    (Figures::of(trace, from), kept)
}

fn on_the_rig(model: &Model, law: &Track, flow: &(impl Controlled + Clone)) -> (Figures, bool) {
    let length = span(RULES.trial, model.sample_period_s);
    let references = || std::iter::repeat_n(law.reference, length);
    let trace = run_law(model, law, &mut flow.clone(), references());
    let blown = run(&mut OpenLoop::steady(), &mut flow.clone(), references());
    judged(&trace, &blown, law.reference)
}

/// Runs the rig of a seed; a `quick` one is identified with two lags each and not diagnosed.
///
/// # Errors
/// A rig that cannot be drawn, recorded or identified.
pub fn play(seed: u64, quick: bool) -> anyhow::Result<Row> {
    let (plan, hidden) = plan_of(seed)?;
    let set = plan.build()?.data;
    let request = if quick {
        IdentifyRequest {
            n1: Some(2),
            n2: Some(2),
            max_lag: Some(150),
            evaluations: 1_000,
            ..IdentifyRequest::default()
        }
    } else {
        IdentifyRequest::default()
    };
    let identified = steps::identify(&set, &request, &())?;
    let of_noise = |scores: &Scores| {
        let own = scores.validate.as_ref().or(scores.identify.as_ref());
        own.map_or(f64::INFINITY, |own| {
            own.rmse / own.noise_rmse.unwrap_or(f64::NAN)
        })
    };
    let mut over_noise = of_noise(&identified.scores);
    let (mut model, mut named) = (identified.model, Vec::new());
    // A model at the noise level is not diagnosed.
    let diagnosed = !quick && (over_noise > NOTHING_TO_EXPLAIN || over_noise.is_nan());
    if diagnosed {
        let found = steps::diagnose(&model, &set, &Options::default(), &())?;
        over_noise = of_noise(&found.scores);
        named = found.diagnosis.missing;
        model = found.model;
    }
    let possible = steps::possible(&model, &set)?;
    let mut row = Row {
        seed,
        family: plan.family.name().to_owned(),
        hidden,
        named,
        over_noise,
        possible: possible.len(),
        targets: Vec::new(),
        ends: Vec::new(),
    };
    let shortest_s = model.training.shortest_time_s().unwrap_or(0.01);
    let zero = steps::units_of_order_one(&model).zero;
    let reachable = steady(&model, false).and_then(|low| {
        let high = steady(&model, true)?;
        Ok([low.friction, high.friction].map(|friction| friction + zero))
    });
    let flow = in_the_loop(&plan, &plan.plant)?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1);
    for _ in 0..TARGETS {
        let share = rng.random_range(0.1..0.9);
        let mut asked = Asked {
            share,
            refused: None,
            works: None,
            rms_ratio: None,
        };
        let design = reachable
            .clone()
            .map_err(Into::into)
            .and_then(|[low, high]| {
                let request = TrackRequest {
                    min_on_s: shortest_s,
                    min_off_s: shortest_s,
                    ..TrackRequest::holding(low + share * (high - low))
                };
                steps::design(&model, &DesignRequest::Track(request))
            });
        match design {
            Err(error) => asked.refused = Some(format!("no law: {error}")),
            Ok(design) => {
                let Law::Track(law) = &design.law else {
                    anyhow::bail!("a tracking law was asked for");
                };
                let proof = steps::try_out::<NoStress>(&design, &possible, &[], seed);
                let lost = proof.lost();
                asked.refused = (!lost.is_empty()).then(|| lost.join("; "));
                let (figures, works) = on_the_rig(&model, law, &flow);
                asked.works = Some(works);
                let nominal = proof.cases.get(1).map(|case| case.figures.rms);
                asked.rms_ratio = nominal.map(|rms| figures.rms / rms);
                if lost.is_empty() && row.ends.is_empty() {
                    let margin = steps::law_margin(&design, seed, false);
                    if let Some(margin) = margin {
                        row.ends = ends(&plan, &model, law, &margin, figures.rms)?;
                    }
                }
            }
        }
        row.targets.push(asked);
    }
    Ok(row)
}

/// The ends of a margin on the true plant.
fn ends(
    plan: &RigPlan,
    model: &Model,
    law: &Track,
    margin: &Margin,
    rms: f64,
) -> anyhow::Result<Vec<End>> {
    let mut ends = Vec::new();
    for (index, interval) in margin.intervals.iter().enumerate() {
        for (side, share) in [("lowest", interval.low), ("highest", interval.high)] {
            let mut factors = [1.0; 3];
            factors[index] = 1.0 + share;
            // Plants that the simulator rejects are not counted.
            let Ok(flow) = in_the_loop(plan, &with_errors(&plan.plant, factors)) else {
                continue;
            };
            let (figures, kept) = on_the_rig(model, law, &flow);
            ends.push(End {
                name: format!("{side} {}", interval.error),
                share,
                works: kept && figures.rms <= RULES.margin_rms * rms,
            });
        }
    }
    Ok(ends)
}

/// The table over all rows, in Markdown.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "| rigs | model at the noise | targets | accepted | refused wrongly | no law | accepted, lost on the plant | margin ends that hold |\n|---|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    let mut line = |name: &str, of: &dyn Fn(&Row) -> bool| {
        let rows: Vec<&Row> = rows.iter().filter(|row| of(row)).collect();
        let targets: Vec<&Asked> = rows.iter().flat_map(|row| &row.targets).collect();
        let count = |of: &dyn Fn(&Asked) -> bool| targets.iter().filter(|asked| of(asked)).count();
        let accepted = count(&|asked| asked.refused.is_none());
        let wrongly = count(&|asked| asked.refused.is_some() && asked.works == Some(true));
        let working = count(&|asked| asked.works == Some(true));
        let none = count(&|asked| asked.works.is_none());
        let lost = count(&|asked| asked.refused.is_none() && asked.works == Some(false));
        let ends: Vec<&End> = rows.iter().flat_map(|row| &row.ends).collect();
        let hold = ends.iter().filter(|end| end.works).count();
        let at_noise = rows
            .iter()
            .filter(|row| row.over_noise <= AT_THE_NOISE)
            .count();
        text.push_str(&format!(
            "| {name}: {} | {at_noise} | {} | {accepted} | {wrongly} of {working} that work | {none} | {lost} of {accepted} | {hold} of {} |\n",
            rows.len(),
            targets.len(),
            ends.len()
        ));
    };
    line("all", &|_| true);
    line("at the noise level", &|row| row.over_noise <= AT_THE_NOISE);
    line("nothing hidden", &|row| row.hidden.is_empty());
    line("an effect hidden", &|row| !row.hidden.is_empty());
    for family in Family::ALL {
        line(family.name(), &|row| row.family == family.name());
    }
    for row in rows {
        for asked in &row.targets {
            let told = match (&asked.refused, asked.works) {
                (Some(why), Some(true)) => format!("refused wrongly: {why}"),
                (None, Some(false)) => "accepted, lost on the plant".to_owned(),
                (Some(why), None) => why.clone(),
                _ => continue,
            };
            text.push_str(&format!(
                "\n- rig {} ({}{}{}), target at {:.2} of the interval, model at {:.2} times the noise: {told}",
                row.seed,
                row.family,
                if row.hidden.is_empty() { "" } else { ", hides " },
                row.hidden,
                asked.share,
                row.over_noise
            ));
        }
        for end in row.ends.iter().filter(|end| !end.works) {
            text.push_str(&format!(
                "\n- rig {} ({}): the law does not work at the {} of the margin, {:+.0} %",
                row.seed,
                row.family,
                end.name,
                100.0 * end.share
            ));
        }
    }
    text
}
