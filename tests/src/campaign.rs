//! The hidden-effects campaign: rigs of `firmware-sim` that hide something, a
//! diagnosis that is told nothing, and the count of what it found.

use firmware_sim::hidden_set::{HiddenSet, HiddenSetPlan};
use firmware_sim::plant::{Effect, Fault};
use host_fit::diagnose::{Diagnosis, Options, Verdict, diagnose};
use host_fit::model::{Delay, Model, Start, Training};
use model_core::effects::StateDependentDelay;
use model_core::model::Averaging;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What a rig hides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Hidden {
    /// Nothing: every finding is a false alarm.
    Nothing,
    /// Nothing, but the given model has bad delays.
    WrongStart,
    /// One effect of the catalogue, or two.
    Effects(Vec<String>),
    /// Something that the catalogue does not have.
    Fault(String),
}

impl Hidden {
    /// A name for tables.
    #[must_use]
    pub fn label(&self) -> String {
        match self {
            Self::Nothing => "(nothing)".to_owned(),
            Self::WrongStart => "(nothing, wrong delays given)".to_owned(),
            Self::Effects(names) => names.join(" + "),
            Self::Fault(name) => format!("{name} (outside)"),
        }
    }
}

/// A rig to be diagnosed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// What it hides.
    pub hidden: Hidden,
    /// Seed of rig, parameters, commands and noise.
    pub seed: u64,
}

/// What came of a case.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The case.
    pub case: Case,
    /// The verdict.
    pub verdict: Verdict,
    /// The effects found, in order.
    pub missing: Vec<String>,
    /// The group that goes with the first.
    pub group: Vec<String>,
    /// Final held-out error over the noise floor.
    pub over_noise: f64,
    /// The same before any effect was added.
    pub base_over_noise: f64,
    /// Name, true value and estimate of the hidden effects' parameters.
    pub parameters: Vec<(String, f64, f64)>,
    /// Wall time of the diagnosis, s.
    pub seconds: f64,
}

impl Outcome {
    /// Whether what was hidden was found: first for one effect, both for two,
    /// nothing for nothing, `unexplained` for a fault.
    #[must_use]
    pub fn is_found(&self) -> bool {
        match &self.case.hidden {
            Hidden::Nothing | Hidden::WrongStart => self.verdict == Verdict::NothingMissing,
            Hidden::Effects(names) if names.len() == 1 => self.missing.first() == names.first(),
            Hidden::Effects(names) => names.iter().all(|name| self.missing.contains(name)),
            Hidden::Fault(_) => self.verdict == Verdict::Unexplained,
        }
    }

    /// Found, or named in the group that the data cannot separate.
    #[must_use]
    pub fn is_in_group(&self) -> bool {
        let Hidden::Effects(names) = &self.case.hidden else {
            return self.is_found();
        };
        self.is_found() || names.first().is_some_and(|name| self.group.contains(name))
    }

    /// Whether all parameters of the hidden effects are within a quarter.
    #[must_use]
    pub fn parameters_hit(&self) -> Option<bool> {
        let near = |(_, truth, found): &(String, f64, f64)| (found / truth - 1.0).abs() <= 0.25;
        (!self.parameters.is_empty()).then(|| self.parameters.iter().all(near))
    }
}

/// A model as an engineer would hand it in: a rough guess, with the wrong
/// delays where the case says so, without delay law where the law is hidden.
fn given(case: &Case) -> Model {
    let mut rng = ChaCha8Rng::seed_from_u64(case.seed ^ 0x5eed);
    let hides = |name: &str| matches!(&case.hidden, Hidden::Effects(names) if names.iter().any(|n| n == name));
    let mut model = Model {
        sample_period_s: firmware_sim::plant::SAMPLE_PERIOD_S,
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
        b: vec![0.02],
        c: vec![0.0],
        delay: Delay::of::<StateDependentDelay<f64>>(&[35.0, 10.0, 6.0], vec![1.0], false),
        effects: Vec::new(),
        definitions: Vec::new(),
        law: None,
        training: Training::default(),
    };
    if hides("state-dependent-delay") {
        model.delay = Delay::Fixed { delays: vec![40] };
    }
    if case.hidden == Hidden::WrongStart {
        let mut lags =
            |n: usize| -> Vec<u16> { (0..n).map(|_| rng.random_range(1..500)).collect() };
        model.state_lags = [vec![1], lags(4)].concat();
        model.a = vec![0.97, 0.002, 0.001, -0.001, 0.001];
        model.product_lags = lags(3);
        model.c = vec![-0.003, 0.002, 0.001];
        model.delay = Delay::of::<StateDependentDelay<f64>>(&[90.0, 40.0, 2.0], vec![1.0], false);
    }
    model
}

/// Runs a case.
///
/// # Errors
/// A paragraph if the rig cannot be built or the diagnosis has no result.
pub fn run(case: &Case) -> Result<Outcome, String> {
    let (effects, faults): (Vec<&str>, Vec<&str>) = match &case.hidden {
        Hidden::Nothing | Hidden::WrongStart => (Vec::new(), Vec::new()),
        Hidden::Effects(names) => (names.iter().map(String::as_str).collect(), Vec::new()),
        Hidden::Fault(name) => (Vec::new(), vec![name.as_str()]),
    };
    let plan = HiddenSetPlan::draw(&effects, &faults, case.seed).map_err(|e| e.to_string())?;
    let set = plan.build().map_err(|e| e.to_string())?;
    let start = Instant::now();
    let options = Options {
        seed: case.seed,
        ..Options::default()
    };
    let diagnosis = diagnose(
        &given(case),
        &set.data.records,
        &options,
        &AtomicBool::new(false),
        &|_| (),
    )
    .map_err(|e| e.to_string())?;
    Ok(outcome(
        case,
        &set,
        &diagnosis,
        start.elapsed().as_secs_f64(),
    ))
}

fn outcome(case: &Case, set: &HiddenSet, diagnosis: &Diagnosis, seconds: f64) -> Outcome {
    let first = diagnosis.missing.first();
    let group = diagnosis
        .ranking
        .iter()
        .find(|entry| Some(&entry.effect) == first);
    let over = |rung: Option<&host_fit::diagnose::Rung>| {
        rung.map_or(f64::NAN, |r| {
            r.validate_rmse / r.noise_rmse.unwrap_or(f64::NAN)
        })
    };
    let mut parameters = Vec::new();
    for effect in &set.truth.plant.effects {
        let found = diagnosis.parameters.get(effect.name());
        for parameter in effect.parameters() {
            let estimate = found.and_then(|all| all.get(parameter.name));
            if let Some(estimate) = estimate {
                let name = format!("{}.{}", effect.name(), parameter.name);
                parameters.push((name, parameter.value, estimate.value));
            }
        }
    }
    Outcome {
        case: case.clone(),
        verdict: diagnosis.verdict,
        missing: diagnosis.missing.clone(),
        group: group
            .map(|entry| entry.confounded_with.clone())
            .unwrap_or_default(),
        over_noise: over(diagnosis.ladder.last()),
        base_over_noise: over(diagnosis.ladder.get(1)),
        parameters,
        seconds,
    }
}

/// The cases of a campaign: `draws` rigs for each effect and fault, `nulls`
/// rigs without, `pairs` pairs, from `seed` on.
#[must_use]
pub fn cases(draws: u64, nulls: u64, pairs: u64, seed: u64) -> Vec<Case> {
    let mut all = Vec::new();
    let mut add = |hidden: &Hidden, seed: u64| {
        all.push(Case {
            hidden: hidden.clone(),
            seed,
        });
    };
    for draw in 0..draws {
        for name in Effect::NAMES {
            add(&Hidden::Effects(vec![(*name).to_owned()]), seed + draw);
        }
        for name in Fault::NAMES {
            add(&Hidden::Fault((*name).to_owned()), seed + draw);
        }
    }
    for draw in 0..nulls {
        add(&Hidden::Nothing, seed + 1000 + draw);
    }
    for draw in 0..nulls.div_ceil(10) {
        add(&Hidden::WrongStart, seed + 2000 + draw);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x9a12);
    let mut left = pairs;
    while left > 0 {
        let mut name = || Effect::NAMES[rng.random_range(0..Effect::NAMES.len())].to_owned();
        let names = vec![name(), name()];
        let as_str: Vec<&str> = names.iter().map(String::as_str).collect();
        // Pairs that cannot be in one rig are drawn again.
        if HiddenSetPlan::draw(&as_str, &[], seed + 3000 + left).is_ok() {
            add(&Hidden::Effects(names), seed + 3000 + left);
            left -= 1;
        }
    }
    all
}

/// The campaign's tables as text.
#[must_use]
pub fn table(outcomes: &[Outcome]) -> String {
    let mut rows: BTreeMap<String, Vec<&Outcome>> = BTreeMap::new();
    for outcome in outcomes {
        rows.entry(outcome.case.hidden.label())
            .or_default()
            .push(outcome);
    }
    let mut text = format!(
        "{:<48} {:>5} {:>6} {:>6} {:>9} {:>11} {:>6}  {}\n",
        "hidden", "rigs", "found", "group", "at floor", "parameters", "s", "found instead"
    );
    for (label, rows) in &rows {
        let count = |test: &dyn Fn(&Outcome) -> bool| rows.iter().filter(|o| test(o)).count();
        let instead: Vec<String> = rows
            .iter()
            .filter(|outcome| !outcome.is_found())
            .map(|outcome| format!("#{}: {}", outcome.case.seed, said(outcome)))
            .collect();
        let hits = count(&|o| o.parameters_hit() == Some(true));
        let with = count(&|o| o.parameters_hit().is_some());
        let _ = writeln!(
            text,
            "{label:<48} {:>5} {:>6} {:>6} {:>9} {:>11} {:>6.0}  {}",
            rows.len(),
            count(&Outcome::is_found),
            count(&Outcome::is_in_group),
            count(&|o| o.over_noise <= 1.25),
            if with > 0 {
                format!("{hits}/{with}")
            } else {
                String::new()
            },
            rows.iter().map(|o| o.seconds).sum::<f64>() / rows.len() as f64,
            instead.join("; ")
        );
    }
    let share = |name: &str, test: &dyn Fn(&Outcome) -> bool, of: &dyn Fn(&Outcome) -> bool| {
        let all: Vec<&Outcome> = outcomes.iter().filter(|o| of(o)).collect();
        let hit = all.iter().filter(|o| test(o)).count();
        format!(
            "{name}: {hit} of {} ({:.0} %)\n",
            all.len(),
            100.0 * hit as f64 / all.len().max(1) as f64
        )
    };
    let effects = |o: &Outcome, n: usize| matches!(&o.case.hidden, Hidden::Effects(names) if names.len() == n);
    let single = |o: &Outcome| effects(o, 1);
    text.push('\n');
    text += &share("hidden effect first", &Outcome::is_found, &single);
    text += &share(
        "first, or in its stated group",
        &Outcome::is_in_group,
        &single,
    );
    text += &share(
        "held-out error at most 1.25 x noise floor",
        &|o| o.over_noise <= 1.25,
        &single,
    );
    let fitted = |o: &Outcome| single(o) && o.parameters_hit().is_some();
    text += &share(
        "parameters within 25 %",
        &|o| o.parameters_hit() == Some(true),
        &fitted,
    );
    let null = |o: &Outcome| matches!(o.case.hidden, Hidden::Nothing | Hidden::WrongStart);
    text += &share("false alarms", &|o| !o.missing.is_empty(), &null);
    text += &share("both effects of a pair", &Outcome::is_found, &|o| {
        effects(o, 2)
    });
    let fault = |o: &Outcome| matches!(o.case.hidden, Hidden::Fault(_));
    text += &share(
        "outside the catalogue: unexplained",
        &Outcome::is_found,
        &fault,
    );
    text
}

/// What the diagnosis said, in short.
#[must_use]
pub fn said(outcome: &Outcome) -> String {
    let verdict = match outcome.verdict {
        Verdict::NothingMissing => "nothing",
        Verdict::EffectMissing => "",
        Verdict::PartlyExplained => "partly ",
        Verdict::Unexplained => "unexplained ",
    };
    format!("{verdict}{}", outcome.missing.join(" + "))
}
