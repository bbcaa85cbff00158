//! `host-fit identify`: recordings to a model.

use model_core::effects::StateDependentDelay;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::bail;
use host_fit::data::{DataSet, Demand, Record, check_excitation};
use host_fit::delay::{DelayOptions, DelayVerdict, study_delays};
use host_fit::extend::{effects_for, extend};
use host_fit::fit::lean_base;
use host_fit::identify::{
    DelayLaw, Identified, IdentifyOptions, InputDelay, Objective, Structure, identify,
};
use host_fit::indicators::{Indicators, Scores, score_new};
use host_fit::model::{Delay, Model, Rounding, Start, Training};
use host_fit::search::{Progress, Settings, Snapshot};
use host_fit::simulate::{Signals, Simulator};
use indicatif::ProgressBar;
use model_core::recursion::LagConvention;

use super::Console;
use super::effect_files::EffectFiles;
use super::interrupt::watch;
use super::scores::{describe, short, table};

/// Identify a model: the delays by search (MADS), the coefficients by least squares inside it.
///
/// With the objective `free-run` the coefficients are refined on the free run afterwards, and kept if the held-out
/// error falls.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// File for the model.
    #[arg(short, long, value_name = "model.toml")]
    output: PathBuf,
    #[command(flatten)]
    request: Request,
}

/// What to identify and how: the options of the command.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Request {
    /// Input delays: constant, eq. (3), or falling with the averaged output, eq. (4).
    #[arg(long, value_enum, default_value_t = DelayKind::Fixed)]
    pub(crate) delay: DelayKind,
    /// Law h = P0 + P1·exp(−P2·ỹ), in samples, in place of a measured one; implies `--delay state-dependent`.
    #[arg(long, value_name = "P0,P1,P2", allow_hyphen_values = true)]
    pub(crate) delay_law: Option<LawArgument>,
    /// Factors f of the delay law, one per input, in place of searching them.
    #[arg(long, value_name = "F1,F2,…", value_delimiter = ',')]
    pub(crate) factors: Vec<f64>,
    /// Identify the model of the moving averages, eqs. (14) and (15).
    #[arg(long)]
    pub(crate) averaged: bool,
    /// Number of state lags N1 [default: 5; averaged: 2].
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=100))]
    pub(crate) n1: Option<u16>,
    /// Number of product lags N2 [default: 10; averaged: 2].
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(0..=100))]
    pub(crate) n2: Option<u16>,
    /// Number of input delays N3 [default: 1; averaged: 2].
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=20))]
    pub(crate) n3: Option<u16>,
    /// Longest lag and input delay, in samples [default: 500, at most a quarter of the shortest record].
    #[arg(long, value_name = "SAMPLES", value_parser = clap::value_parser!(u16).range(1..=20_000))]
    pub(crate) max_lag: Option<u16>,
    /// What a lag τ means: y_{k−τ} as printed in eq. (3), or y_{k+1−τ}.
    #[arg(long, value_enum, default_value_t = Lags::OneStep)]
    pub(crate) lags: Lags,
    /// What the search minimises.
    #[arg(long, value_enum, default_value_t = Aim::FreeRun)]
    pub(crate) objective: Aim,
    /// Most evaluations of the objective.
    #[arg(long, value_name = "COUNT", default_value_t = 20_000, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) evaluations: u64,
    /// Threads; the result does not depend on it.
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) threads: u16,
    /// Seed of every random choice.
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Physical effect to add once the base model is there; repeatable.
    #[arg(long, value_name = "NAME")]
    pub(crate) effect: Vec<String>,
    #[command(flatten)]
    pub(crate) effect_files: EffectFiles,
}

/// `--delay`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum DelayKind {
    Fixed,
    StateDependent,
}

/// `--lags`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Lags {
    Literal,
    OneStep,
}

/// `--objective`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Aim {
    OneStep,
    FreeRun,
}

/// `--delay-law P0,P1,P2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LawArgument(DelayLaw);

impl FromStr for LawArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text
            .split(',')
            .map(|number| number.trim().parse::<f64>())
            .collect::<Result<_, _>>()
            .map_err(|_| "three numbers are needed, as in 47.35,12.69,20.18".to_owned())?;
        match numbers.as_slice() {
            &[floor, rise, rate]
                if numbers.iter().all(|n| n.is_finite()) && floor >= 0.0 && floor + rise >= 0.0 =>
            {
                Ok(Self(DelayLaw { floor, rise, rate }))
            }
            _ => Err("three finite numbers with P0 and P0 + P1 not below 0 are needed, as in 47.35,12.69,20.18".to_owned()),
        }
    }
}

impl Default for Request {
    fn default() -> Self {
        Self {
            delay: DelayKind::Fixed,
            delay_law: None,
            factors: Vec::new(),
            averaged: false,
            n1: None,
            n2: None,
            n3: None,
            max_lag: None,
            lags: Lags::OneStep,
            objective: Aim::FreeRun,
            evaluations: 20_000,
            threads: 1,
            seed: 0,
            effect: Vec::new(),
            effect_files: EffectFiles::default(),
        }
    }
}

/// What the command found.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) identified: Identified,
    /// The final model: with its effects and its training record.
    pub(crate) model: Model,
    pub(crate) scores: Scores,
    /// What the user should know, one sentence each.
    pub(crate) remarks: Vec<String>,
}

struct Bar<'a>(&'a ProgressBar);

impl Progress for Bar<'_> {
    fn report(&self, snapshot: &Snapshot) {
        self.0.set_position(snapshot.evaluations as u64);
        self.0.set_message(format!(
            "{} evaluations, best {:.5}",
            snapshot.evaluations, snapshot.best
        ));
    }
}

impl Request {
    /// Sizes and conventions, without the input delay.
    fn structure(&self, set: &DataSet) -> anyhow::Result<Structure> {
        let learning: Vec<&Record> = set.identify().collect();
        let Some(shortest) = learning.iter().map(|r| r.len()).min() else {
            bail!(
                "the data set has no record with use \"identify\"; mark at least one record so in dataset.toml"
            );
        };
        let at_rest = set.is_on_off() && starts_at_rest(&learning);
        let size = |given: Option<u16>, full: u16, averaged: u16| -> usize {
            given
                .unwrap_or(if self.averaged { averaged } else { full })
                .into()
        };
        let longest_lag = self.max_lag.unwrap_or_else(|| {
            u16::try_from(shortest / 4).map_or(500, |quarter| quarter.clamp(1, 500))
        });
        Ok(Structure {
            state_lags: size(self.n1, 5, 2).min(longest_lag.into()),
            product_lags: size(self.n2, 10, 2).min(longest_lag.into()),
            inputs: size(self.n3, 1, 2),
            longest_lag,
            convention: match self.lags {
                Lags::Literal => LagConvention::Literal,
                Lags::OneStep => LagConvention::OneStep,
            },
            delay: InputDelay::Fixed { delays: None },
            averaged: self.averaged,
            constant: !at_rest,
            start: if at_rest {
                Start::Rest
            } else {
                Start::Measured
            },
        })
    }

    /// What the commands of `set` cannot tell about the model asked for, one sentence each.
    fn excitation(&self, set: &DataSet) -> anyhow::Result<Vec<String>> {
        let structure = self.structure(set)?;
        let demand = Demand {
            max_lag: structure.longest_lag.into(),
            coefficients: structure.coefficients(),
        };
        Ok(check_excitation(set, demand)?.remarks)
    }

    /// Identifies a model on `set`.
    pub(crate) fn identify(&self, set: &DataSet, console: Console) -> anyhow::Result<Found> {
        let mut remarks = Vec::new();
        let learning: Vec<&Record> = set.identify().collect();
        let mut structure = self.structure(set)?;
        if structure.start == Start::Measured {
            remarks.push(
                "the records do not start at rest or the input is not on/off: the model has a constant term, and \
                 free runs follow the measurement for as long as the longest lag"
                    .to_owned(),
            );
        }
        if self.factors.iter().any(|f| !(f.is_finite() && *f >= 0.0)) {
            bail!("--factors takes finite numbers that are not below 0, as in --factors 1");
        }
        let law = match (self.delay_law, self.delay) {
            (None, DelayKind::Fixed) if !self.factors.is_empty() => {
                bail!(
                    "--factors multiplies a delay law: add --delay state-dependent or --delay-law"
                )
            }
            (Some(LawArgument(law)), _) => Some(law),
            (None, DelayKind::Fixed) => None,
            (None, DelayKind::StateDependent) => Some(measured_law(set, &learning, &mut remarks)?),
        };
        if let Some(law) = law {
            structure.delay = InputDelay::StateDependent {
                law,
                factors: (!self.factors.is_empty()).then(|| self.factors.clone()),
            };
        }
        let options = IdentifyOptions {
            structure,
            objective: match self.objective {
                Aim::OneStep => Objective::OneStep,
                Aim::FreeRun => Objective::FreeRun,
            },
            search: Settings {
                evaluations: usize::try_from(self.evaluations).unwrap_or(usize::MAX),
                seed: self.seed,
                threads: self.threads.into(),
                ..Settings::default()
            },
            ..IdentifyOptions::default()
        };
        // A fault in an effect file shows before the search, not after it.
        let own = self.effect_files.load()?;
        let bar = console.progress(self.evaluations, "{spinner} {msg} ({elapsed})");
        let identified = identify(&set.records, &options, &Bar(&bar), watch())?;
        bar.finish_and_clear();

        let mut model = identified.model.clone();
        for definition in own {
            model.define(definition)?;
        }
        let records = model.targets(&set.records);
        if !self.effect.is_empty() {
            effects_for(&model, &self.effect)?;
            let bar = console.spinner("refitting with the effects");
            model = extend(&model, &records, &self.effect)?.model;
            bar.finish_and_clear();
        }
        let (scores, diverged) = score_new(&model, &records)?;
        remarks.extend(diverged.iter().map(ToString::to_string));
        remarks.extend(overfitted(&scores));
        model.training = Training {
            data_hash: set.hash.clone(),
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: self.seed,
            objective: identified.objective.name().to_owned(),
            objective_value: identified.objective_value,
            identify_fit_percent: finite(scores.identify.as_ref()).unwrap_or(0.0),
            validate_fit_percent: finite(scores.validate.as_ref()),
            ..Training::envelope(&learning)
        };
        Ok(Found {
            identified,
            model,
            scores,
            remarks,
        })
    }
}

/// Whether records begin near y = 0, as a flow at rest does.
fn starts_at_rest(records: &[&Record]) -> bool {
    records.iter().all(|record| {
        let largest = record.y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
        record.y.first().is_some_and(|y| y.abs() <= 0.1 * largest)
    })
}

/// Law (2) from the edges; where they do not bear one out, from the free run of the leanest model.
fn measured_law(
    set: &DataSet,
    learning: &[&Record],
    remarks: &mut Vec<String>,
) -> anyhow::Result<DelayLaw> {
    let study = study_delays(set, &DelayOptions::default())?;
    let borne_out = matches!(
        study.verdict,
        DelayVerdict::StateDependent | DelayVerdict::EdgeAndStateDependent
    );
    if let Some(law) = study.law.as_ref().filter(|_| borne_out) {
        let measured = DelayLaw {
            floor: law.p0.value,
            rise: law.p1.value,
            rate: law.p2.value,
        };
        if measured.floor >= 0.0 && measured.rate > 0.0 {
            remarks.push(format!("delay law measured on {} edges", law.edges));
            return Ok(measured);
        }
    }
    let template = Model {
        sample_period_s: set.sample_period_s,
        delay: Delay::of::<StateDependentDelay<f64>>(
            &[
                DelayLaw::PAPER.floor,
                DelayLaw::PAPER.rise,
                DelayLaw::PAPER.rate,
            ],
            vec![1.0],
            false,
        ),
        ..Model::default()
    };
    let lean = lean_base(&template, learning)?;
    remarks.push(format!(
        "the edges bear no state-dependent law out ({}): it was fitted in free run instead",
        study.words
    ));
    let law = lean.model.delay.law::<StateDependentDelay<f64>>();
    match law.map(|law| law.parameters.as_slice()) {
        Some(&[floor, rise, rate]) => Ok(DelayLaw { floor, rise, rate }),
        _ => bail!(
            "no delay law could be found on these records; prescribe one with --delay-law P0,P1,P2, or use --delay fixed"
        ),
    }
}

/// √Σ (y_{k+1} − prediction from the measured past)² over the identify records.
fn one_step_norm(model: &Model, set: &DataSet) -> anyhow::Result<f64> {
    let simulator = Simulator::with_values(model, &model.values(), Rounding::Samples);
    let mut sum = 0.0;
    for record in model.targets(&set.records) {
        if record.role == host_fit::data::Use::Identify {
            let signals = Signals::of(model, &record)?;
            simulator.predict(&signals, |k, predicted: f64| {
                if k >= model.warm_up() {
                    sum += record.y.get(k).map_or(0.0, |y| (y - predicted).powi(2));
                }
            });
        }
    }
    Ok(sum.sqrt())
}

/// Points of FIT between identified and held-out records from which a word is due.
const OVERFITTED: f64 = 12.0;

#[derive(serde::Serialize)]
struct Document<'a> {
    model: &'a Path,
    objective: &'static str,
    objective_value: f64,
    one_step_norm: f64,
    evaluations: usize,
    wall_time_s: f64,
    records: &'a [Indicators],
    identify: &'a Option<Indicators>,
    validate: &'a Option<Indicators>,
    delays: Delays<'a>,
    screened: usize,
    stop: &'static str,
    refinement: Option<RefinementDocument>,
    poles: [f64; 2],
    remarks: &'a [String],
    excitation: &'a [String],
}

#[derive(serde::Serialize)]
struct Delays<'a> {
    state: &'a [u16],
    product: &'a [u16],
    input: &'a [u16],
    factors: &'a [f64],
    law: Option<&'a [f64]>,
}

#[derive(serde::Serialize)]
struct RefinementDocument {
    identify_epsilon: [f64; 2],
    validate_epsilon: Option<[f64; 2]>,
    kept: bool,
}

fn delays(model: &Model) -> Delays<'_> {
    let (input, factors, law) = match &model.delay {
        Delay::Fixed { delays } => (delays.as_slice(), &[][..], None),
        Delay::Law(law) => (
            &[][..],
            law.factors.as_slice(),
            Some(law.parameters.as_slice()),
        ),
    };
    Delays {
        state: &model.state_lags,
        product: &model.product_lags,
        input,
        factors,
        law,
    }
}

fn finite(indicators: Option<&Indicators>) -> Option<f64> {
    indicators
        .map(|i| i.fit_percent)
        .filter(|fit| fit.is_finite())
}

/// What to do about a model that holds on its own records only.
fn overfitted(scores: &Scores) -> Option<String> {
    let (own, held_out) = (
        finite(scores.identify.as_ref())?,
        finite(scores.validate.as_ref())?,
    );
    (held_out < own - OVERFITTED).then(|| {
        format!(
            "The model fits what it learned from ({own:.0} % FIT) far better than what was held out ({held_out:.0} %): \
             it has more lags than these records can tell. Use fewer (`--n1 2 --n2 2`), more varied records, or \
             `diagnose`, which starts from the fewest lags and adds physical effects."
        )
    })
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let set = DataSet::load(&args.dataset)?;
    let excitation = args.request.excitation(&set)?;
    for remark in &excitation {
        console.warn(remark)?;
    }
    let Found {
        identified,
        model,
        scores,
        remarks,
    } = args.request.identify(&set, console)?;
    let norm = if model.effects.is_empty() {
        one_step_norm(&model, &set)?
    } else {
        identified.one_step_norm
    };
    model.save(&args.output)?;
    console.say(&describe(&model))?;
    console.say(&format!(
        "state lags {:?}, product lags {:?}",
        model.state_lags, model.product_lags
    ))?;
    console.say(&format!(
        "{} {} after {} evaluations in {:.1} s; {}",
        identified.objective.name(),
        short(identified.objective_value),
        identified.evaluations,
        identified.wall_time.as_secs_f64(),
        identified.stop
    ))?;
    if let Some(refinement) = &identified.refinement {
        console.say(&refinement_words(refinement))?;
    }
    for remark in &remarks {
        console.say(remark)?;
    }
    console.say(&table(&scores))?;
    console.say(&format!("written to {}", args.output.display()))?;
    console.document(&Document {
        model: &args.output,
        objective: identified.objective.name(),
        objective_value: identified.objective_value,
        one_step_norm: norm,
        evaluations: identified.evaluations,
        wall_time_s: identified.wall_time.as_secs_f64(),
        records: &scores.records,
        identify: &scores.identify,
        validate: &scores.validate,
        delays: delays(&model),
        screened: identified.screened,
        stop: identified.stop.name(),
        refinement: identified.refinement.as_ref().map(|r| RefinementDocument {
            identify_epsilon: r.identify.into(),
            validate_epsilon: r.validate.map(<[f64; 2]>::from),
            kept: r.kept,
        }),
        poles: [identified.pole_off, identified.pole_on],
        remarks: &remarks,
        excitation: &excitation,
    })
}

fn refinement_words(refinement: &host_fit::identify::Refinement) -> String {
    let pair = |(before, after): (f64, f64)| format!("{} → {}", short(before), short(after));
    let mut text = format!(
        "refined on the free run: identify ε {}",
        pair(refinement.identify)
    );
    if let Some(validate) = refinement.validate {
        text.push_str(&format!(", held-out ε {}", pair(validate)));
    }
    text.push_str(if refinement.kept {
        "; kept"
    } else {
        "; not kept"
    });
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_is_three_numbers() {
        let law: LawArgument = "47.35, 12.69,20.18".parse().unwrap();
        assert_eq!(law.0, DelayLaw::PAPER);
        for wrong in ["", "1,2", "1,2,3,4", "1,2,x", "-1,2,3", "1,-2,3", "nan,1,1"] {
            assert!(wrong.parse::<LawArgument>().is_err(), "{wrong}");
        }
    }
}
