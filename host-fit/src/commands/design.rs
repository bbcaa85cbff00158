//! `host-fit design`: an on/off law from a model, tried in the loop before it is written.

use std::path::{Path, PathBuf};

use anyhow::Context;
use closed_loop::{Figures, Trace};
use host_fit::design::{
    Case, CaseGroup, JUDGED_FROM, MaximiseRequest, Optimum, Outside, Planned, Proof, Steady,
    TrackDesign, TrackRequest, maximise, prove, prove_pulses, track,
};
use host_fit::model::{Law, Model};
use host_fit::output::write_atomic;
use host_fit::picture::{ClosedLoop, LoopRun, closed_loop};
use serde::Serialize;

use super::Console;
use super::average::{not_negative, positive};
use crate::plants::Plants;

/// Design an on/off law for the valve from a model and write it into the model file.
///
/// `--goal track` holds the friction at `--target`; `--goal maximise` finds the pulses that give the most friction for
/// the air. The law is then tried in the loop: on the model, on the nearest physical plant, on that plant with every
/// effect of the catalogue, and with wrong delays and gains, more noise and lost readings.
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
    /// Picture of the loop; by default beside the model file, ending in `-loop.svg`.
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// The run on the plant as CSV (t, reference, friction, y, u).
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
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

#[derive(Serialize)]
struct Document<'a> {
    model: &'a Path,
    picture: &'a Path,
    law: &'a Law,
    #[serde(skip_serializing_if = "Option::is_none")]
    track: Option<TrackDocument<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    maximise: Option<MaximiseDocument>,
    cases: Vec<CaseDocument<'a>>,
    relay: FiguresDocument,
}

#[derive(Serialize)]
struct TrackDocument<'a> {
    reachable: [f64; 2],
    natural: Steady,
    blown: Steady,
    equivalent_duty: f64,
    duty_on_model: f64,
    remarks: &'a [String],
}

#[derive(Serialize)]
struct MaximiseDocument {
    mean: f64,
    mean_after_minutes: f64,
    mean_detuned: f64,
    range: [f64; 2],
    duty: f64,
    steady_mean: Option<f64>,
    refused: usize,
    refused_mean: Option<f64>,
    pole_moduli: [f64; 2],
    outside: Option<Outside>,
    #[serde(skip_serializing_if = "Option::is_none")]
    planned: Option<Planned>,
}

#[derive(Serialize)]
struct CaseDocument<'a> {
    group: CaseGroup,
    name: &'a str,
    #[serde(flatten)]
    figures: FiguresDocument,
    steady_mean: f64,
    lowest_mean: f64,
    kept: bool,
}

#[derive(Serialize)]
struct FiguresDocument {
    mean: f64,
    rms: f64,
    offset: f64,
    peak_to_peak: f64,
    switches_per_s: f64,
    air: f64,
    settling_s: Option<f64>,
}

impl From<Figures> for FiguresDocument {
    fn from(f: Figures) -> Self {
        Self {
            mean: f.mean,
            rms: f.rms,
            offset: f.offset,
            peak_to_peak: f.peak_to_peak,
            switches_per_s: f.switches_per_s,
            air: f.air,
            settling_s: f.settling_s,
        }
    }
}

impl<'a> From<&'a Case> for CaseDocument<'a> {
    fn from(case: &'a Case) -> Self {
        Self {
            group: case.group,
            name: &case.name,
            figures: case.figures.into(),
            steady_mean: case.steady,
            lowest_mean: case.lowest,
            kept: case.kept,
        }
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
    let mut model = Model::load(&args.model)?;
    let plants = Plants::of(&model, args.seed)?;
    let bar = console.progress(0, "{spinner} designing and trying in the loop {elapsed}");
    let (law, design, proof) = match args.goal {
        Goal::Track => {
            let design = track(&model, &request(args))?;
            let proof = prove(&model, &design.law, &plants.nearest, &plants.others);
            (Law::Track(design.law.clone()), Design::Track(design), proof)
        }
        Goal::Maximise => {
            let optimum = maximise(
                &model,
                &MaximiseRequest {
                    min_on_s: args.min_on,
                    min_off_s: args.min_off,
                    air_price: args.air_price,
                    pulses: args.pulses.into(),
                    longest_period_s: 3.0,
                    horizon_s: args.horizon,
                },
            )?;
            let proof = prove_pulses(&optimum.law, plants.blown, &plants.nearest, &plants.others);
            (
                Law::Maximise(optimum.law.clone()),
                Design::Maximise(optimum),
                proof,
            )
        }
    };
    bar.finish_and_clear();
    let picture = args.picture.clone().unwrap_or_else(|| {
        let stem = args
            .output
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy();
        args.output.with_file_name(format!("{stem}-loop.svg"))
    });
    let svg = draw(&proof, args.goal);
    write_atomic(&picture, |file| file.write_all(svg.as_bytes())).context("saving the picture")?;
    if let Some(path) = &args.csv {
        let csv = proof.trace.to_csv();
        write_atomic(path, |file| file.write_all(csv.as_bytes())).context("saving the run")?;
    }
    model.law = Some(law.clone());
    model.save(&args.output)?;

    match &design {
        Design::Track(design) => console.say(&track_words(design))?,
        Design::Maximise(optimum) => console.say(&optimum_words(optimum))?,
    }
    if !plants.left_out.is_empty() {
        console.say(&format!(
            "note: tried on plants without {}, which the simulator does not know",
            plants.left_out.join(", ")
        ))?;
    }
    console.say(&case_table(&proof))?;
    console.say(&format!(
        "written to {}, picture {}",
        args.output.display(),
        picture.display()
    ))?;
    console.document(&Document {
        model: &args.output,
        picture: &picture,
        law: &law,
        track: match &design {
            Design::Track(d) => Some(TrackDocument {
                reachable: d.law.reachable,
                natural: d.natural,
                blown: d.blown,
                equivalent_duty: d.equivalent_duty,
                duty_on_model: d.duty,
                remarks: &d.remarks,
            }),
            Design::Maximise(_) => None,
        },
        maximise: match &design {
            Design::Maximise(o) => Some(MaximiseDocument {
                mean: o.mean,
                mean_after_minutes: o.mean_after_minutes,
                mean_detuned: o.mean_detuned,
                range: o.range,
                duty: o.duty,
                steady_mean: o.steady_mean,
                refused: o.refused,
                refused_mean: o.refused_mean,
                pole_moduli: o.moduli,
                outside: o.outside,
                planned: o.planned,
            }),
            Design::Track(_) => None,
        },
        cases: proof.cases.iter().map(CaseDocument::from).collect(),
        relay: Figures::of(&proof.compared, JUDGED_FROM).into(),
    })
}

enum Design {
    Track(TrackDesign),
    Maximise(Optimum),
}

fn request(args: &Args) -> TrackRequest {
    TrackRequest {
        // Asked for before with `--goal track`.
        target: args.target.unwrap_or(f64::NAN),
        min_on_s: args.min_on,
        min_off_s: args.min_off,
        switches_per_s: args.max_switches,
        air: args.max_air,
        ramp_per_s: args.ramp,
        least_air: args.least_air,
    }
}

fn track_words(design: &TrackDesign) -> String {
    let law = &design.law;
    let mut text = format!(
        "holds {} of the interval ({:.3}, {:.3}); duty {:.3} on the model, u_eq = {:.3}\n\
         shortest times {} ms open, {} ms closed; looks up to {} ms ahead",
        law.reference,
        law.reachable[0],
        law.reachable[1],
        design.duty,
        design.equivalent_duty,
        law.hold.on,
        law.hold.off,
        law.look_ahead
    );
    for remark in &design.remarks {
        text.push_str("\nnote: ");
        text.push_str(remark);
    }
    text
}

fn optimum_words(optimum: &Optimum) -> String {
    let law = &optimum.law;
    let mut text = if law.period == 1 {
        format!("best: steady blowing, mean friction {:.3}", optimum.mean)
    } else {
        let pulses: Vec<String> = law
            .pulses
            .iter()
            .map(|(first, length)| format!("{length} ms from {first} ms"))
            .collect();
        format!(
            "best: period {} ms, open {}; mean friction {:.3} with {:.1} % of the air ({} under steady blowing)",
            law.period,
            pulses.join(" and "),
            optimum.mean,
            100.0 * optimum.duty,
            optimum
                .steady_mean
                .map_or("the model grows".to_owned(), |mean| format!("{mean:.3}"))
        )
    };
    text.push_str(&format!(
        "\nafter four minutes {:.3}; with the period 2 % off {:.3}; pole moduli {:.5} closed, {:.5} open",
        optimum.mean_after_minutes, optimum.mean_detuned, optimum.moduli[0], optimum.moduli[1]
    ));
    if optimum.mean_detuned < 0.9 * optimum.mean {
        text.push_str(
            "\nnote: a sharp resonance of the model; try it on the rig before relying on it",
        );
    }
    if let Some(mean) = optimum.refused_mean {
        text.push_str(&format!(
            "\nrefused: {} pulse trains that looked better (up to {mean:.3}) but grow in a long run: instabilities of the model",
            optimum.refused
        ));
    }
    if let Some(planned) = &optimum.planned {
        text.push_str(&format!(
            "\nfree commands over {} s from rest ({}, every {:.0} ms): value {:.3} with {:.1} % of the air (steady blowing {:.3}); {}",
            planned.horizon_s,
            if planned.exact { "all tried" } else { "beam search" },
            1000.0 * planned.block_s,
            planned.value,
            100.0 * planned.duty,
            planned.steady_value,
            match planned.cycle_s {
                None => "planning again and again, the valve comes to rest or the model grows".to_owned(),
                Some(cycle_s) => format!(
                    "planning again and again runs into a cycle of {:.0} ms ({:.0} % of it irregular), tried with the others",
                    1000.0 * cycle_s,
                    100.0 * planned.irregular
                ),
            }
        ));
    }
    match &optimum.outside {
        None => text.push_str("\nnote: the model file says nothing of what was recorded; the optimum may be an extrapolation"),
        Some(outside) if outside.is_inside() => text.push_str("\ninside what was recorded"),
        Some(outside) => text.push_str(&format!(
            "\noutside what was recorded: friction by {:.3}, duty by {:.3}, on-times by a factor {:.2}",
            outside.friction, outside.duty, outside.on_time_factor
        )),
    }
    text
}

fn case_table(proof: &Proof) -> String {
    let mut text = format!(
        "{:<44} {:>6} {:>6} {:>7} {:>6} {:>6} {:>6} {:>7} {:>6}  attachment",
        "in the loop, from 4 s to 12 s",
        "mean",
        "rms",
        "offset",
        "p2p",
        "sw/s",
        "air",
        "settle",
        "steady"
    );
    let mut line = |name: &str, f: &Figures, steady: Option<f64>, kept: Option<bool>| {
        let settling = f
            .settling_s
            .map_or("never".to_owned(), |s| format!("{s:.2} s"));
        let steady = steady.map_or(String::new(), |s| format!("{s:.3}"));
        let kept = match kept {
            Some(true) => "kept",
            Some(false) => "LOST",
            None => "",
        };
        let name: String = name.chars().take(44).collect();
        text.push_str(&format!(
            "\n{name:<44} {:>6.3} {:>6.3} {:>+7.3} {:>6.3} {:>6.1} {:>6.3} {settling:>7} {steady:>6}  {kept}",
            f.mean, f.rms, f.offset, f.peak_to_peak, f.switches_per_s, f.air
        ));
    };
    for case in &proof.cases {
        line(
            &case.name,
            &case.figures,
            Some(case.steady),
            Some(case.kept),
        );
    }
    line(
        proof.compared_name,
        &Figures::of(&proof.compared, JUDGED_FROM),
        None,
        None,
    );
    text
}

fn draw(proof: &Proof, goal: Goal) -> String {
    let column = |trace: &Trace| -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let y = trace.samples.iter().map(|s| s.friction).collect();
        let u: Vec<f64> = trace
            .samples
            .iter()
            .map(|s| f64::from(u8::from(s.on)))
            .collect();
        let air = u
            .iter()
            .scan(0.0, |sum, on| {
                *sum += on * 0.001;
                Some(*sum)
            })
            .collect();
        (y, u, air)
    };
    let (law, other) = (column(&proof.trace), column(&proof.compared));
    let reference: Vec<f64> = match goal {
        Goal::Track => proof.trace.samples.iter().map(|s| s.reference).collect(),
        Goal::Maximise => Vec::new(),
    };
    let runs = [
        LoopRun {
            label: proof.compared_name,
            y: &other.0,
            u: &other.1,
            air: &other.2,
        },
        LoopRun {
            label: "the designed law",
            y: &law.0,
            u: &law.1,
            air: &law.2,
        },
    ];
    closed_loop(&ClosedLoop {
        title: "The law on the continuous-time plant, noisy sensor",
        y_label: "friction gain y",
        air_label: "",
        sample_period_s: 0.001,
        reference: &reference,
        runs: &runs,
        window_s: Some((0.0, 6.0)),
    })
}
