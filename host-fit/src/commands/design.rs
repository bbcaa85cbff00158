//! `host-fit design`: an on/off law from a model, tried in the loop before it is written.

use std::path::PathBuf;

use anyhow::{Context, bail};
use host_fit::design::{MaximiseRequest, Proof, TrackRequest};
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::steps::{self, DesignRequest};
use rig_line::RigFile;

use super::average::{not_negative, positive};
use super::drawings::proof_picture;
use super::tried::Tried;
use super::{Console, page};
use crate::plants::Plants;

/// Design an on/off law for the valve from a model and write it into the model file.
///
/// `--goal track` holds the friction at `--target`; `--goal maximise` finds the pulses that give the most friction for
/// the air. The law is then tried in the loop: on the model, on the nearest physical plant, on that plant with every
/// effect of the catalogue, and with wrong delays and gains, more noise and lost readings. A law that loses attachment in
/// one of these trials is not written unless `--force` says so; then the file names the trials.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model.
    #[arg(value_name = "MODEL.toml")]
    model: PathBuf,
    /// Where the model goes with its law.
    #[arg(short, long, value_name = "FILE.toml")]
    output: PathBuf,
    /// What the law is for.
    #[arg(long, value_enum, default_value_t = Goal::Track)]
    goal: Goal,
    /// Friction to hold, in y of the flow (needed for `--goal track`).
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    target: Option<f64>,
    /// Shortest time the valve stays open, in seconds.
    #[arg(long, value_name = "S", default_value_t = 0.010, value_parser = not_negative)]
    min_on: f64,
    /// Shortest time the valve stays closed, in seconds.
    #[arg(long, value_name = "S", default_value_t = 0.010, value_parser = not_negative)]
    min_off: f64,
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
    /// What steady blowing costs, in y: mean friction minus price times duty is maximised.
    #[arg(long, value_name = "Y", default_value_t = 0.0, value_parser = not_negative)]
    air_price: f64,
    /// Most pulses in a period (maximising).
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=4))]
    pulses: u8,
    /// Horizon over which free on/off commands are searched as well, in seconds (maximising).
    #[arg(long, value_name = "S", value_parser = positive)]
    horizon: Option<f64>,
    /// The rig, as `record --calibrate` measured it: the law weighs its sensor's noise and keeps its valve's shortest
    /// times.
    #[arg(long, value_name = "rig.toml")]
    rig: Option<PathBuf>,
    /// Picture of the loop; by default beside the model file, ending in `-loop.svg`.
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// The run on the plant as CSV (t, reference, friction, y, u).
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Write a report page: the law, the loop, every trial.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// Write the law even if a trial loses attachment; the file says in which.
    #[arg(long)]
    force: bool,
    /// Seed of the plants' effects and noise.
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

impl Args {
    fn request(&self, rig: Option<&RigFile>) -> DesignRequest {
        let at_least =
            |asked: f64, of: fn(&RigFile) -> f64| rig.map_or(asked, |rig| asked.max(of(rig)));
        match self.goal {
            Goal::Track => DesignRequest::Track(TrackRequest {
                // Asked for before.
                target: self.target.unwrap_or(f64::NAN),
                min_on_s: at_least(self.min_on, |rig| rig.valve.shortest_on_s),
                min_off_s: at_least(self.min_off, |rig| rig.valve.shortest_off_s),
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
                min_on_s: at_least(self.min_on, |rig| rig.valve.shortest_on_s),
                min_off_s: at_least(self.min_off, |rig| rig.valve.shortest_off_s),
                air_price: self.air_price,
                pulses: self.pulses.into(),
                longest_period_s: 3.0,
                horizon_s: self.horizon,
            }),
        }
    }

    /// The law, tried in the loop.
    pub(super) fn tried(&self, model: &Model) -> anyhow::Result<Tried> {
        if self.tracks() && self.target.is_none() {
            bail!("--goal track needs --target Y, the friction to hold");
        }
        let rig = self.rig.as_deref().map(RigFile::load).transpose()?;
        let design = steps::design(model, &self.request(rig.as_ref()))?;
        // A law is worth having also where the simulator has no plant to try it on.
        let plants = Plants::of(model, self.seed);
        let proof = plants
            .as_ref()
            .ok()
            .map(|plants| steps::try_out(&design, plants.blown, &plants.nearest, &plants.others));
        let lost = proof.as_ref().map(Proof::lost).unwrap_or_default();
        Ok(Tried {
            design: design.which_lost(lost),
            proof,
            not_tried: match plants {
                Ok(plants) => plants.left_out,
                Err(error) => vec![format!("the law was not tried on a plant: {error:#}")],
            },
        })
    }

    /// What the law is for, in a few words.
    pub(super) fn goal_words(&self) -> String {
        match (self.goal, self.target) {
            (Goal::Track, Some(target)) => format!("law: hold {target}"),
            (Goal::Track, None) => "law: hold".to_owned(),
            (Goal::Maximise, _) => "law: most friction for the air".to_owned(),
        }
    }

    /// Whether the law is to hold the friction at a value.
    pub(super) fn tracks(&self) -> bool {
        self.goal == Goal::Track
    }

    /// Whether a law goes into the file even if a trial loses attachment.
    pub(super) fn force(&self) -> bool {
        self.force
    }

    /// Where the picture of the loop goes.
    pub(super) fn picture(&self) -> PathBuf {
        self.picture.clone().unwrap_or_else(|| {
            let stem = self.output.file_stem().unwrap_or_default();
            let name = format!("{}-loop.svg", stem.to_string_lossy());
            self.output.with_file_name(name)
        })
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
    let model = Model::load(&args.model)?;
    let bar = console.progress(0, "{spinner} designing and trying in the loop {elapsed}");
    let tried = args.tried(&model)?;
    bar.finish_and_clear();
    let refused = tried.refused("--force").filter(|_| !args.force);
    if let Some(refused) = refused {
        console.show(&tried, &[], &[])?;
        bail!("{refused}");
    }
    let (picture, csv) = (args.picture(), args.csv.as_ref());
    let mut keys = vec![("model", args.output.as_path())];
    let mut written = vec![args.output.as_path()];
    if let Some(proof) = &tried.proof {
        let svg = proof_picture(proof, args.tracks());
        write_atomic(&picture, |file| file.write_all(svg.as_bytes()))
            .context("saving the picture")?;
        keys.push(("picture", &picture));
        written.push(&picture);
        if let Some(path) = csv {
            let csv = proof.trace.to_csv();
            write_atomic(path, |file| file.write_all(csv.as_bytes())).context("saving the run")?;
            written.push(path);
        }
    }
    tried.design.model.save(&args.output)?;
    if let Some(path) = &args.report {
        let page = page::law(&model, &tried, args.tracks(), &page::command_line());
        write_atomic(path, |file| file.write_all(page.as_bytes())).context("saving the report")?;
        written.push(path);
    }
    console.show(&tried, &keys, &written)
}
