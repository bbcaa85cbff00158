//! `host-fit design`: an on/off law from a model, tried in the loop before it is written.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use host_fit::data::DataSet;
use host_fit::design::{MaximiseRequest, TrackRequest, check_period};
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps::{self, Answer, DesignOutcome, DesignRequest};
use rig_line::RigFile;

use super::average::{not_negative, positive};
use super::drawings::{margin_picture, proof_picture};
use super::load::shell_word;
use super::time_span::TimeSpan;
use super::tried::{NoiseFrom, Tried};
use super::{Console, check_outputs, page, rig_constants};
use crate::plants::Plants;

/// Design an on/off law for the valve from a model and write it into the model file.
///
/// `--goal track` holds y at `--target`; `--goal maximise` finds the pulses with the highest mean y for a given
/// price of air. The law is then tried in the loop: on the model, and on every plant that is consistent with the
/// records of DATASET (delay, gain and time constants at the ends of their intervals, each effect at the largest
/// size that is not excluded). A law that loses attachment on one of these is refused, with the targets that pass.
/// Stress beyond the records (every effect at its worst, wrong delays and gains, more noise, lost readings) is
/// reported and never refuses a law.
///
/// Example: host-fit design model.toml DATASET --target 0.5 -o controlled.toml
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model.
    #[arg(value_name = "MODEL.toml")]
    model: PathBuf,
    /// The records of the model: folder with dataset.toml, or one CSV file. Without them only the model is tried.
    #[arg(value_name = "DATASET")]
    dataset: Option<PathBuf>,
    /// File for the model with its law.
    #[arg(short, long, value_name = "FILE.toml")]
    output: PathBuf,
    /// Goal of the law.
    #[arg(long, value_enum, default_value_t = Goal::Track)]
    goal: Goal,
    /// Level of y to hold, as measured, offset included (needed for `--goal track`).
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    target: Option<f64>,
    /// Shortest time the valve stays open, in seconds (`0.02`, `20ms`) or samples of the model (`2samples`); seconds
    /// are rounded up to whole samples. A time shorter than the shortest one in `rig.toml` (without it, in the records)
    /// is refused [default: that shortest time; 10 ms if neither is known].
    #[arg(long, value_name = "S", value_parser = valve_time)]
    min_on: Option<TimeSpan>,
    /// Shortest time the valve stays closed, in the same form.
    #[arg(long, value_name = "S", value_parser = valve_time)]
    min_off: Option<TimeSpan>,
    /// Switches per second that the valve can give in the long run (tracking).
    #[arg(long, value_name = "PER_S", value_parser = positive)]
    max_switches: Option<f64>,
    /// Share of the air of steady blowing that may be used in the long run, 0 to 1 (tracking).
    #[arg(long, value_name = "SHARE", value_parser = share)]
    max_air: Option<f64>,
    /// Fastest change of the reference, in y per second (tracking; a step otherwise).
    #[arg(long, value_name = "Y_PER_S", value_parser = positive)]
    ramp: Option<f64>,
    /// Switch at the rate that takes the least air on the model, not as fast as the valve can (tracking).
    #[arg(long)]
    least_air: bool,
    /// Price of steady blowing, in y: mean friction minus price times duty is maximised (maximising).
    #[arg(long, value_name = "Y", default_value_t = 0.0, value_parser = not_negative)]
    air_price: f64,
    /// Largest number of pulses in a period (maximising).
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=4))]
    pulses: u8,
    /// Horizon of an additional search over free on/off commands, in seconds (`2`, `500ms`) or samples
    /// (`2000samples`) (maximising).
    #[arg(long, value_name = "S", value_parser = some_time)]
    horizon: Option<TimeSpan>,
    /// Rig file from `record --calibrate`: its sensor noise and its valve's shortest times are used.
    #[arg(long, value_name = "rig.toml")]
    rig: Option<PathBuf>,
    /// Picture of the closed loop; by default next to the model file, ending in `-loop.svg`. The picture of the
    /// robustness margin is written next to the model file, ending in `-margin.svg`.
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// The run on the model through a noisy sensor as CSV (t, reference, friction, y, u).
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Write a report page: the law, the closed loop, every trial.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// Write the law even if it loses attachment on a plant that is consistent with the records; the file names the
    /// plant.
    #[arg(long)]
    force: bool,
    /// Seed of the noise, and of the effects under stress.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Goal {
    Track,
    Maximise,
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("a number from 0 to 1 is needed".into()),
    }
}

/// Default shortest times of the valve, s.
const USUAL_VALVE_S: f64 = 0.010;

/// A time option of this command: a number without a unit is in seconds.
fn valve_time(text: &str) -> Result<TimeSpan, String> {
    if let Ok(seconds) = not_negative(text) {
        return Ok(TimeSpan::Seconds(seconds));
    }
    if let Some(count) = text.strip_suffix("samples").or(text.strip_suffix("sample")) {
        let count = count.trim().parse();
        return count.map(TimeSpan::Samples).map_err(|_| {
            format!("`{text}` is not a whole number of samples; write it as `2samples`")
        });
    }
    match text.parse() {
        Ok(TimeSpan::Seconds(seconds)) => Ok(TimeSpan::Seconds(seconds)),
        _ => Err(format!(
            "`{text}` is not a time; give seconds (`0.02`, `20ms`) or samples (`2samples`)"
        )),
    }
}

/// A time above 0.
fn some_time(text: &str) -> Result<TimeSpan, String> {
    match valve_time(text)? {
        TimeSpan::Samples(0) | TimeSpan::Seconds(0.0) => Err("a time above 0 is needed".into()),
        time => Ok(time),
    }
}

/// The time in seconds; refused if it is shorter than a sample but not 0.
fn at_period(option: &str, time: TimeSpan, period_s: f64) -> anyhow::Result<f64> {
    match time {
        TimeSpan::Samples(samples) => Ok(f64::from(samples) * period_s),
        // The tolerance of 1/1000 is for printed values that were rounded.
        TimeSpan::Seconds(seconds) if seconds > 0.0 && seconds < 0.999 * period_s => bail!(
            "{option} {seconds} s is shorter than the model's sample period, {period_s} s (key `sample_period_s`), \
             and the loop switches at most once per sample. Give {option} {period_s} or more, or {option} 0 if the \
             valve follows every sample"
        ),
        TimeSpan::Seconds(seconds) => Ok(seconds),
    }
}

/// The shortest time of a valve in one position.
struct ShortestTime<'a> {
    option: &'a str,
    /// The requested time.
    asked: Option<TimeSpan>,
    /// The shortest time measured in `rig.toml`, s.
    measured: Option<f64>,
    /// The shortest time between two switches in the records, s.
    recorded: Option<f64>,
}

impl ShortestTime<'_> {
    /// The time in seconds. An error if it is shorter than the measured shortest time or, without a measurement, the
    /// shortest time in the records.
    fn seconds(&self, period_s: f64) -> anyhow::Result<f64> {
        let Self { option, .. } = self;
        let known = self.measured.or(self.recorded);
        let Some(asked) = self.asked else {
            return Ok(known.unwrap_or(USUAL_VALVE_S));
        };
        let asked = at_period(option, asked, period_s)?;
        // The tolerance of half a sample is for rounding.
        match known {
            Some(known) if asked < known - 0.5 * period_s => {
                let known = (known * 1e6).round() * 1e-6;
                let reason = if self.measured.is_some() {
                    format!("the rig's shortest effective pulse is {known} s (rig.toml)")
                } else {
                    format!(
                        "the shortest time between two switches in the records of the model is {known} s, and the \
                        response to shorter times is unknown; record shorter times, or measure the valve (`record \
                        --calibrate`, then `--rig rig.toml`)"
                    )
                };
                bail!(
                    "{option} {asked} s is too short: {reason}. Give {option} {known} or more, or leave it out"
                )
            }
            _ => Ok(asked),
        }
    }
}

/// The words of a command with another target; `None` if it has none.
fn again(mut words: Vec<String>, target: f64) -> Option<Vec<String>> {
    let is_target = |word: &String| word == "--target" || word.starts_with("--target=");
    let option = words.iter().position(is_target)?;
    match words[option].contains('=') {
        true => words[option] = format!("--target={target}"),
        false => *words.get_mut(option + 1)? = target.to_string(),
    }
    Some(words)
}

impl Args {
    fn request(&self, rig: Option<&RigFile>, model: &Model) -> anyhow::Result<DesignRequest> {
        let period_s = model.sample_period_s;
        let recorded = model.training.shortest_time_s();
        let min_on_s = ShortestTime {
            option: "--min-on",
            asked: self.min_on,
            measured: rig.map(|rig| rig.valve.shortest_on_s),
            recorded,
        };
        let min_off_s = ShortestTime {
            option: "--min-off",
            asked: self.min_off,
            measured: rig.map(|rig| rig.valve.shortest_off_s),
            recorded,
        };
        let (min_on_s, min_off_s) = (min_on_s.seconds(period_s)?, min_off_s.seconds(period_s)?);
        let horizon_s = self
            .horizon
            .map(|time| at_period("--horizon", time, period_s));
        let horizon_s = horizon_s.transpose()?;
        Ok(match self.goal {
            Goal::Track => DesignRequest::Track(TrackRequest {
                // Checked before.
                target: self.target.unwrap_or(f64::NAN),
                min_on_s,
                min_off_s,
                slow_noise: rig.and_then(|rig| {
                    let counts = rig.sensor.slow_noise_counts?;
                    Some(counts * rig.sensor.per_count.abs())
                }),
                switches_per_s: self.max_switches,
                air: self.max_air,
                ramp_per_s: self.ramp,
                least_air: self.least_air,
            }),
            Goal::Maximise => DesignRequest::Maximise(MaximiseRequest {
                min_on_s,
                min_off_s,
                air_price: self.air_price,
                pulses: self.pulses.into(),
                longest_period_s: None,
                horizon_s,
            }),
        })
    }

    /// The law with its trials in closed loop; the records of `set` determine the possible plants. Impossible
    /// requests are refused before anything is read or run.
    pub(super) fn tried(&self, model: &Model, set: Option<&DataSet>) -> anyhow::Result<Tried> {
        check_period(model)?;
        if self.tracks() && self.target.is_none() {
            bail!("--goal track needs --target Y, the friction to hold");
        }
        let rig = self.rig.as_deref().map(RigFile::load).transpose()?;
        if let (Some(rig), Some(file)) = (&rig, &self.rig) {
            rig_constants::same_period(rig, model)
                .map_err(|reason| anyhow!("{}: {reason}", file.display()))?;
        }
        let mut request = self.request(rig.as_ref(), model)?;
        let mut noise_from = NoiseFrom::HotFilm;
        if let DesignRequest::Track(track) = &mut request {
            if track.slow_noise.is_some() {
                noise_from = NoiseFrom::Rig;
            } else if let Some(set) = set
                && let Some(noise) = steps::slow_noise(model, set)?
            {
                (track.slow_noise, noise_from) = (Some(noise), NoiseFrom::Records);
            }
        }
        let design = steps::design(model, &request)?;
        // The level of rest of the law's model is 0.
        let model = &Model {
            law: None,
            ..design.model.clone()
        };
        let mut notes = Vec::new();
        let possible = match set {
            Some(set) => steps::possible(model, set)?,
            None => {
                notes.push(
                    "the law was tried only on the model: `host-fit design MODEL.toml DATASET` tries the law on every \
                     plant that is consistent with the records"
                        .to_owned(),
                );
                Vec::new()
            }
        };
        // A law is returned even if the simulator has no plant for stress trials.
        let stress = match Plants::of(model, design.noise, self.seed) {
            Ok(plants) => {
                notes.extend(plants.left_out);
                plants.stress
            }
            Err(error) => {
                notes.push(format!("no stress trials were made: {error:#}"));
                Vec::new()
            }
        };
        let proof = steps::try_out(&design, &possible, &stress, self.seed);
        let lost = proof.lost();
        let targets = match (&request, &design.outcome) {
            (DesignRequest::Track(request), DesignOutcome::Track(track))
                if !lost.is_empty() || !proof.holds() =>
            {
                steps::passing_targets(model, request, track.reachable, &possible, self.seed)
            }
            _ => Vec::new(),
        };
        let passing = targets.iter().filter(|target| target.passes);
        let from = |target: f64| (target - self.target.unwrap_or(f64::NAN)).abs();
        let nearest = passing
            .map(|passing| passing.target)
            .min_by(|a, b| from(*a).total_cmp(&from(*b)));
        // A law that loses attachment on its own model has no margin.
        let margin = proof
            .keeps_its_model()
            .then(|| steps::law_margin(&design, self.seed, true))
            .flatten();
        Ok(Tried {
            margin,
            design: design.which_lost(lost),
            proof,
            targets,
            not_tried: notes,
            noise_from,
            again: nearest
                .and_then(|target| again(page::arguments(), target))
                .map(|words| page::command(&words)),
            file: shell_word(&self.output),
            answer: Answer::default(),
        }
        .answered())
    }

    /// The goal in a few words.
    pub(super) fn goal_words(&self) -> String {
        match (self.goal, self.target) {
            (Goal::Track, Some(target)) => format!("law: hold {target}"),
            (Goal::Track, None) => "law: hold".to_owned(),
            (Goal::Maximise, _) => "law: maximise mean friction minus the price of air".to_owned(),
        }
    }

    /// Whether the goal is tracking.
    pub(super) fn tracks(&self) -> bool {
        self.goal == Goal::Track
    }

    /// Whether a law is written although it loses attachment on a plant consistent with the records.
    pub(super) fn force(&self) -> bool {
        self.force
    }

    /// Path of the picture of the loop.
    pub(super) fn picture(&self) -> PathBuf {
        self.picture
            .clone()
            .unwrap_or_else(|| self.beside("loop.svg"))
    }

    /// A file next to the model file, with its name and `-ending`.
    fn beside(&self, ending: &str) -> PathBuf {
        let stem = self.output.file_stem().unwrap_or_default();
        let name = format!("{}-{ending}", stem.to_string_lossy());
        self.output.with_file_name(name)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    if args.goal == Goal::Track && args.target.is_none() {
        let problem = "--goal track needs --target Y, the friction to hold\n";
        clap::Command::new("host-fit design")
            .error(clap::error::ErrorKind::MissingRequiredArgument, problem)
            .exit();
    }
    let outputs = [&args.output].into_iter().chain(&args.report);
    check_outputs(outputs.chain(&args.picture).chain(&args.csv))?;
    let model = Model::load(&args.model)?;
    check_period(&model).with_context(|| format!("no law for {}", args.model.display()))?;
    let set = args.dataset.as_deref().map(DataSet::load).transpose()?;
    let bar = console.progress(0, "{spinner} designing and trying in the loop {elapsed}");
    let tried = args.tried(&model, set.as_ref())?;
    bar.finish_and_clear();
    let refused = tried.refused("--force").filter(|_| !args.force);
    if let Some(refused) = refused {
        console.show(&tried, &[], &[])?;
        bail!("{refused}");
    }
    let (picture, margin) = (args.picture(), args.beside("margin.svg"));
    let save = |path: &Path, text: &str, what: &'static str| {
        write_atomic(path, |file| file.write_all(text.as_bytes())).context(what)
    };
    let mut keys = vec![("model", args.output.as_path()), ("picture", &picture)];
    let mut written = vec![args.output.as_path(), &picture];
    let svg = proof_picture(&tried.proof, args.tracks());
    save(&picture, &svg, "saving the picture")?;
    if let Some(found) = &tried.margin {
        save(
            &margin,
            &margin_picture(found),
            "saving the picture of the margin",
        )?;
        keys.push(("margin_picture", &margin));
        written.push(&margin);
    }
    if let Some(path) = &args.csv {
        save(path, &tried.proof.trace.to_csv(), "saving the run")?;
        written.push(path);
    }
    tried.design.model.save(&args.output)?;
    if let Some(path) = &args.report {
        let page = page::law(&model, &tried, args.tracks(), &page::command_line());
        save(path, &page, "saving the report")?;
        written.push(path);
    }
    console.show(&tried, &keys, &written)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_seconds_and_units_say_otherwise() {
        for (text, time) in [
            ("0.02", TimeSpan::Seconds(0.02)),
            ("10", TimeSpan::Seconds(10.0)),
            ("20ms", TimeSpan::Seconds(0.02)),
            ("0.3s", TimeSpan::Seconds(0.3)),
            ("3samples", TimeSpan::Samples(3)),
            ("1 sample", TimeSpan::Samples(1)),
        ] {
            let Ok(TimeSpan::Seconds(read)) = valve_time(text) else {
                assert_eq!(valve_time(text), Ok(time), "{text}");
                continue;
            };
            assert!(
                matches!(time, TimeSpan::Seconds(s) if (s - read).abs() < 1e-12),
                "{text}"
            );
        }
        for wrong in ["", "-1", "nan", "soon", "xsamples", "-1samples"] {
            assert!(valve_time(wrong).is_err(), "{wrong}");
        }
        assert!(some_time("0").is_err() && some_time("0samples").is_err());
    }

    #[test]
    fn the_command_is_repeated_with_the_target_that_passes() {
        let line = |text: &str| {
            let words = text.split(' ').map(str::to_owned).collect();
            again(words, 42.0).map(|words| page::command(&words))
        };
        assert_eq!(
            line("design m.toml set --target 35 --min-on 5 -o c.toml").as_deref(),
            Some("host-fit design m.toml set --target 42 --min-on 5 -o c.toml")
        );
        assert_eq!(
            line("design m.toml --target=35 -o c.toml").as_deref(),
            Some("host-fit design m.toml --target=42 -o c.toml")
        );
        assert_eq!(line("workbench set"), None);
        assert_eq!(line("design m.toml --target"), None);
    }

    #[test]
    fn a_time_within_a_sample_is_refused_and_nought_is_every_sample() {
        let of = |time| at_period("--min-on", time, 0.01);
        assert!(matches!(of(TimeSpan::Seconds(0.02)), Ok(s) if s == 0.02));
        assert!(matches!(of(TimeSpan::Samples(3)), Ok(s) if (s - 0.03).abs() < 1e-12));
        assert!(matches!(of(TimeSpan::Seconds(0.0)), Ok(0.0)));
        let error = of(TimeSpan::Seconds(0.004)).unwrap_err().to_string();
        for part in [
            "--min-on 0.004 s",
            "0.01 s",
            "`sample_period_s`",
            "--min-on 0 ",
        ] {
            assert!(error.contains(part), "{error}");
        }
    }
}
