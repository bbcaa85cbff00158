//! `host-fit identify`: recordings to a model.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use host_fit::data::DataSet;
use host_fit::identify::{ExponentialDelay, Objective};
use host_fit::output::write_atomic;
use host_fit::steps::{self, DelayKind, IdentifyRequest};
use model_core::recursion::LagConvention;

use super::effect_files::EffectFiles;
use super::effect_names::EffectName;
use super::load::shell_word;
use super::time_span::{NotATime, TimeSpan};
use super::{Console, check_outputs, page};

/// Identify a model: structure chosen by validation error, or with given numbers of lags.
///
/// With given numbers of lags, the delays are found by search (MADS), and for each candidate the coefficients by
/// least squares.
///
/// With the objective `free-run` the coefficients are then refined on the free run, and kept if the validation
/// error falls.
///
/// Example: host-fit identify DATASET -o model.toml
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// File for the model.
    #[arg(short, long, value_name = "model.toml")]
    output: PathBuf,
    /// Write a report page: the model on every record, where it fails.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    request: Request,
}

/// Options of an identification.
#[derive(Debug, Clone, clap::Args)]
struct Request {
    /// Input delays: constant, eq. (3), or falling with the averaged output, eq. (4) [default: the one with the
    /// lower validation error; fixed if numbers of lags are given].
    #[arg(long, value_enum)]
    delay: Option<Delay>,
    /// Interpolate delays between samples even if the validation error hardly falls; with an automatic structure.
    #[arg(long)]
    interpolated: bool,
    /// Law h = P0 + P1·exp(−P2·ỹ), in samples, instead of a measured one; implies `--delay state-dependent`.
    #[arg(long, value_name = "P0,P1,P2", allow_hyphen_values = true)]
    delay_law: Option<LawArgument>,
    /// Factors f of the delay law, one per input, instead of a search for them.
    #[arg(long, value_name = "F1,F2,…", value_delimiter = ',')]
    factors: Vec<f64>,
    /// Identify the model of the moving averages, eqs. (14) and (15).
    #[arg(long)]
    averaged: bool,
    /// Number of state lags N1, or `auto`: the structure is chosen by validation error [default: auto if no number
    /// is given; 5 together with other numbers; averaged: 2].
    #[arg(long, value_name = "COUNT|auto")]
    n1: Option<Count>,
    /// Number of product lags N2 [default: 10; averaged: 2].
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(0..=100))]
    n2: Option<u16>,
    /// Number of input delays N3 [default: 1; averaged: 2].
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=20))]
    n3: Option<u16>,
    /// Longest lag and input delay, in samples (`500`) or as a time (`0.5s`) [default: 500 samples, at most a quarter
    /// of the shortest record].
    #[arg(long, value_name = "SAMPLES|TIME", value_parser = longest_lag)]
    max_lag: Option<TimeSpan>,
    /// Meaning of a lag τ: y_{k−τ} as printed in eq. (3), or y_{k+1−τ}.
    #[arg(long, value_enum, default_value_t = Lags::OneStep)]
    lags: Lags,
    /// Objective of the search.
    #[arg(long, value_enum, default_value_t = Aim::FreeRun)]
    objective: Aim,
    /// Largest number of evaluations of the objective.
    #[arg(long, value_name = "COUNT", default_value_t = 20_000, value_parser = clap::value_parser!(u64).range(1..))]
    evaluations: u64,
    /// Number of threads; the result does not depend on it.
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
    /// Seed of every random choice.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Physical effect to add to the base model; repeatable.
    #[arg(long, value_name = "NAME", value_parser = EffectName, hide_possible_values = true)]
    effect: Vec<String>,
    #[command(flatten)]
    effect_files: EffectFiles,
}

/// `--n1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Count {
    Automatic,
    Lags(u16),
}

impl FromStr for Count {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse::<u16>() {
            _ if text == "auto" => Ok(Self::Automatic),
            Ok(count @ 1..=100) => Ok(Self::Lags(count)),
            _ => Err("a number from 1 to 100 is needed, or auto".to_owned()),
        }
    }
}

/// `--delay`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Delay {
    Fixed,
    StateDependent,
}

/// `--lags`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Lags {
    Literal,
    OneStep,
}

/// `--objective`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Aim {
    OneStep,
    FreeRun,
}

/// `--delay-law P0,P1,P2`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LawArgument(ExponentialDelay);

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
                Ok(Self(ExponentialDelay { floor, rise, rate }))
            }
            _ => Err("three finite numbers with P0 ≥ 0 and P0 + P1 ≥ 0 are needed, as in 47.35,12.69,20.18".to_owned()),
        }
    }
}

/// Allowed lags of a search, samples.
const LAGS: RangeInclusive<u32> = 1..=20_000;

fn longest_lag(text: &str) -> Result<TimeSpan, String> {
    match text.parse().map_err(|error: NotATime| error.to_string())? {
        TimeSpan::Samples(samples) if !LAGS.contains(&samples) => Err(format!(
            "{samples} samples are outside {} to {}",
            LAGS.start(),
            LAGS.end()
        )),
        lag => Ok(lag),
    }
}

impl Request {
    /// The request for the library, for records with this sample period; reads the effect files.
    fn library(&self, period_s: f64) -> anyhow::Result<IdentifyRequest> {
        let max_lag = self.max_lag.map(|lag| {
            let lag = lag.samples_within(period_s, "--max-lag", LAGS)?;
            anyhow::Ok(u16::try_from(lag)?)
        });
        Ok(IdentifyRequest {
            delay: match (self.delay_law, self.delay) {
                (Some(LawArgument(law)), _) => Some(DelayKind::Prescribed(law)),
                (None, Some(Delay::Fixed)) => Some(DelayKind::Fixed),
                (None, Some(Delay::StateDependent)) => Some(DelayKind::StateDependent),
                (None, None) => None,
            },
            interpolated: self.interpolated,
            factors: self.factors.clone(),
            averaged: self.averaged,
            n1: self.n1.and_then(|count| match count {
                Count::Automatic => None,
                Count::Lags(count) => Some(count),
            }),
            n2: self.n2,
            n3: self.n3,
            max_lag: max_lag.transpose()?,
            lags: match self.lags {
                Lags::Literal => LagConvention::Literal,
                Lags::OneStep => LagConvention::OneStep,
            },
            objective: match self.objective {
                Aim::OneStep => Objective::OneStep,
                Aim::FreeRun => Objective::FreeRun,
            },
            evaluations: usize::try_from(self.evaluations).unwrap_or(usize::MAX),
            threads: self.threads.into(),
            seed: self.seed,
            effects: self.effect.clone(),
            definitions: self.effect_files.load()?,
        })
    }
}

impl Args {
    /// Structure and options of the identification, for records with this sample period; reads the effect
    /// files.
    pub(super) fn request(&self, period_s: f64) -> anyhow::Result<IdentifyRequest> {
        self.request.library(period_s)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    check_outputs([&args.output].into_iter().chain(&args.report))?;
    let set = DataSet::load(&args.dataset)?;
    let request = args.request(set.sample_period_s)?;
    let mut found = steps::identify(&set, &request, &console.watch())?;
    let (made, data) = (shell_word(&args.output), shell_word(&args.dataset));
    found.answer = found.answer.with_files(&made, &data);
    found.model.save(&args.output)?;
    let mut written: Vec<&Path> = vec![&args.output];
    if let Some(path) = &args.report {
        let run = steps::compare(&found.model, &set)?;
        let page = page::identification(&set, &found, &run);
        write_atomic(path, |out| out.write_all(page.as_bytes()))?;
        written.push(path);
    }
    console.show(&found, &[("model", &args.output)], &written)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_longest_lag_is_samples_or_a_time() {
        assert_eq!(longest_lag("500"), Ok(TimeSpan::Samples(500)));
        assert_eq!(longest_lag("0.5s"), Ok(TimeSpan::Seconds(0.5)));
        for wrong in ["0", "20001", "-1", "0.5", "soon"] {
            assert!(longest_lag(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_law_is_three_numbers() {
        let law: LawArgument = "47.35, 12.69,20.18".parse().unwrap();
        assert_eq!(law.0, ExponentialDelay::PAPER);
        for wrong in ["", "1,2", "1,2,3,4", "1,2,x", "-1,2,3", "1,-2,3", "nan,1,1"] {
            assert!(wrong.parse::<LawArgument>().is_err(), "{wrong}");
        }
    }
}
