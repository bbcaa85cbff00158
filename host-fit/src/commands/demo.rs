//! `host-fit demo`: the whole way on bundled and simulated data, from recordings to constants and a loop.

use std::path::{Path, PathBuf};

use closed_loop::{Figures, OpenLoop, Relay, SAMPLE_PERIOD_S, run as close_the_loop};
use firmware_sim::family::{Family, NoiseKind, RigPlan};
use firmware_sim::hidden_set::HiddenSetPlan;
use firmware_sim::plant::{PlantSpec, Rig};
use host_fit::data::DataSet;
use host_fit::design::{TrackRequest, run_law};
use host_fit::diagnose::Options;
use host_fit::discover;
use host_fit::indicators::Indicators;
use host_fit::model::Model;
use host_fit::output::{Staging, write_atomic};
use host_fit::picture::{Column, Report};
use host_fit::steps::{self, DelayKind, Design, DesignOutcome, DesignRequest, IdentifyRequest};
use model_core::control::HoldTimes;

use super::Console;
use super::drawings::{LoopPicture, ladder_picture, loop_picture};
use super::page::{
    command_line, provenance, report_climb, report_discovery, report_finding, report_runs,
    report_scores,
};
use super::words::{aligned, ladder_table};

/// Show the whole way on bundled data: identify, compare, find the missing effect, add it, find a term that no
/// catalogue has, generate constants, close the loop; leaves a report, models and data to play with.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder for the report, the pictures, the models and the data.
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
}

macro_rules! bundled {
    ($folder:literal, $file:literal) => {
        (
            concat!($folder, "/", $file),
            include_str!(concat!("../../../data/", $folder, "/", $file)),
        )
    };
}

/// The bundled files, so that the program shows them wherever it is.
const FILES: [(&str, &str); 16] = [
    bundled!("ramp-cfd", "dataset.toml"),
    bundled!("ramp-cfd", "README.md"),
    bundled!("ramp-cfd", "step.csv"),
    bundled!("ramp-cfd", "4Hz50.csv"),
    bundled!("ramp-cfd", "4Hz80.csv"),
    bundled!("ramp-cfd", "8Hz50.csv"),
    bundled!("hidden-ramp", "dataset.toml"),
    bundled!("hidden-ramp", "README.md"),
    bundled!("hidden-ramp", "step.csv"),
    bundled!("hidden-ramp", "sq4-50.csv"),
    bundled!("hidden-ramp", "sq4-80.csv"),
    bundled!("hidden-ramp", "sq8-50.csv"),
    bundled!("hidden-ramp", "sq8-80.csv"),
    bundled!("hidden-ramp", "sq2-30.csv"),
    bundled!("hidden-ramp", "random-a.csv"),
    bundled!("hidden-ramp", "random-b.csv"),
];

/// What really made the hidden set; only the loop is run on it.
const ANSWER: &str = include_str!("../../../data/hidden-ramp/answer.toml");
/// What no effect of the catalogue does, hidden in a rig of this seed, and the folder of its recordings.
const BEYOND: (&str, u64, &str) = ("tiring-jet", 4, "tiring-ramp");
/// Friction to hold in the loop (y), about 0.8 of steady blowing.
const TARGET: f64 = 0.7;
/// Shortest on and off times of the valve, samples.
const TIMES: HoldTimes = HoldTimes { on: 10, off: 10 };

/// A few lags are enough to show the way, and quick.
fn request(delay: DelayKind) -> IdentifyRequest {
    IdentifyRequest {
        delay: Some(delay),
        n1: Some(2),
        n2: Some(2),
        max_lag: Some(150),
        evaluations: 3_000,
        ..IdentifyRequest::default()
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let out = &args.out;
    std::fs::create_dir_all(out)?;
    let data = out.join("data");
    let mut staging = Staging::new(&data)?;
    for (name, text) in FILES {
        staging.write(name, |file| file.write_all(text.as_bytes()))?;
    }
    staging.commit()?;

    let mut report = Report::new(
        "Demo",
        "recordings → model → missing effect → constants → loop",
    );
    let fits = real_input(&data, out, console, &mut report)?;
    let (model, words) = hidden_effect(&data, out, console, &mut report)?;
    let found = beyond_the_catalogue(&data, out, console, &mut report)?;
    let design = steps::design(
        &model,
        &DesignRequest::Track(TrackRequest {
            min_on_s: SAMPLE_PERIOD_S * f64::from(TIMES.on),
            min_off_s: SAMPLE_PERIOD_S * f64::from(TIMES.off),
            ..TrackRequest::holding(TARGET)
        }),
    )?;
    design.model.save(&out.join("controlled.toml"))?;
    let constants = steps::constants(&design.model)?;
    write_atomic(&out.join("identified.rs"), |file| {
        file.write_all(constants.text.as_bytes())
    })?;
    let figures = the_loop(&design, console, &mut report)?;
    write_atomic(&out.join("report.html"), |file| {
        file.write_all(report.html().as_bytes())
    })?;
    console.say(&format!(
        "\nwritten to {}: report.html, models, identified.rs, data",
        out.display()
    ))?;
    console.document(&serde_json::json!({
        "out": out,
        "ramp_cfd_validate_fit_percent": {"fixed": fits[0], "state_dependent": fits[1]},
        "words": words,
        "beyond_the_catalogue": found,
        "loop": figures,
    }))
}

/// Fixed against state-dependent delay on the flow simulation; held-out FIT of both.
fn real_input(
    data: &Path,
    out: &Path,
    console: Console,
    report: &mut Report,
) -> anyhow::Result<[f64; 2]> {
    let set = DataSet::load(&data.join("ramp-cfd"))?;
    report.section("A flow over a ramp (2-D Navier–Stokes)");
    let mut rows = Vec::new();
    let mut fits = [f64::NAN; 2];
    let mut runs = Vec::new();
    let kinds = [
        (DelayKind::Fixed, "fixed delay", "ramp-fixed.toml"),
        (
            DelayKind::StateDependent,
            "state-dependent delay",
            "ramp-state-dependent.toml",
        ),
    ];
    for ((kind, name, file), fit) in kinds.into_iter().zip(&mut fits) {
        let found = steps::identify(&set, &request(kind), &console.watch())?;
        found.model.save(&out.join(file))?;
        let percent = |i: &Option<Indicators>| i.as_ref().map_or(f64::NAN, |i| i.fit_percent);
        *fit = percent(&found.scores.validate);
        rows.push(vec![
            name.to_owned(),
            format!("{:.1}", percent(&found.scores.identify)),
            format!("{:.1}", *fit),
        ]);
        report.subsection(name);
        report_scores(report, &found.scores);
        runs.push((name, steps::compare(&found.model, &set)?.runs));
    }
    let runs: Vec<(&str, &[Vec<f64>])> = runs.iter().map(|(n, r)| (*n, r.as_slice())).collect();
    report_runs(report, &set.records, &runs, None);
    provenance(report, &set, 0, &command_line());
    console.say("flow over a ramp (2-D Navier–Stokes), free run")?;
    console.say(&aligned(
        &["model", "FIT % identified", "held out"],
        &rows,
        1,
    ))?;
    Ok(fits)
}

/// From a model that lacks something to one that does not.
fn hidden_effect(
    data: &Path,
    out: &Path,
    console: Console,
    report: &mut Report,
) -> anyhow::Result<(Model, String)> {
    let set = DataSet::load(&data.join("hidden-ramp"))?;
    let request = request(DelayKind::StateDependent);
    let found = steps::identify(&set, &request, &console.watch())?;
    found.model.save(&out.join("hidden-before.toml"))?;
    let finding = steps::diagnose(&found.model, &set, &Options::default(), &console.watch())?;
    let (headline, meaning) = (&finding.headline, &finding.meaning);
    console.say(&format!(
        "\na ramp with a hidden effect: {headline}\n{meaning}"
    ))?;
    console.say(&ladder_table(&finding.diagnosis.ladder))?;
    report.section("A ramp with a hidden effect");
    report_finding(report, &set, &finding);
    let svg = ladder_picture(&finding.diagnosis, &set);
    write_atomic(&out.join("ladder.svg"), |file| {
        file.write_all(svg.as_bytes())
    })?;
    report.section("With what was missing");
    report_scores(report, &finding.scores);
    report_climb(report, &set.records, &finding, None);
    finding.model.save(&out.join("hidden-after.toml"))?;
    provenance(report, &set, 0, &command_line());
    let words = format!("{headline}. {meaning}");
    Ok((finding.model, words))
}

/// Recordings of a rig whose physics no catalogue has, and the term that is found in them, in words.
fn beyond_the_catalogue(
    data: &Path,
    out: &Path,
    console: Console,
    report: &mut Report,
) -> anyhow::Result<String> {
    let (hidden, seed, name) = BEYOND;
    let plan = RigPlan::draw(Family::FirstOrder, &[hidden], NoiseKind::White, &[], seed)?;
    let folder = data.join(name);
    plan.build()?.data.save(&folder)?;
    let set = DataSet::load(&folder)?;
    let given = steps::identify(&set, &IdentifyRequest::default(), &console.watch())?.model;
    given.save(&out.join("beyond-before.toml"))?;
    let options = discover::Options {
        terms: 1,
        ..discover::Options::default()
    };
    let found = steps::discover(&given, &set, &options, &console.watch())?;
    console.say(&format!(
        "\na ramp with physics that no catalogue has: {}\n{}",
        found.headline, found.meaning
    ))?;
    console.say(&ladder_table(&found.discovery.ladder))?;
    report.section("A ramp with physics that no catalogue has");
    report_discovery(report, &given.targets(&set.records), &found);
    provenance(report, &set, 0, &command_line());
    found.model.save(&out.join("beyond-after.toml"))?;
    if let Some(term) = found.discovery.terms.first() {
        write_atomic(&out.join("beyond-effect.toml"), |file| {
            file.write_all(term.file.as_bytes())
        })?;
    }
    Ok(format!("{}. {}", found.headline, found.meaning))
}

#[derive(Clone, Copy, serde::Serialize)]
struct LoopRow {
    controller: &'static str,
    mean_friction: f64,
    rms_error: f64,
    switches_per_s: f64,
    air: f64,
}

/// The plant that made the hidden set, drawn again from what its answer records.
fn hidden_plant() -> anyhow::Result<PlantSpec> {
    #[derive(serde::Deserialize)]
    struct Answer {
        seed: u64,
        effect: Vec<Named>,
    }
    #[derive(serde::Deserialize)]
    struct Named {
        name: String,
    }
    let answer: Answer = toml::from_str(ANSWER)?;
    let names: Vec<&str> = answer.effect.iter().map(|e| e.name.as_str()).collect();
    Ok(HiddenSetPlan::draw(&names, &[], answer.seed)?.plant)
}

/// Steady blowing, a plain relay and the designed law on the plant that made the
/// hidden set. The law runs in single precision as its generated constants do on
/// the board: the golden run in `identified.rs` is of this code.
fn the_loop(
    design: &Design,
    console: Console,
    report: &mut Report,
) -> anyhow::Result<Vec<LoopRow>> {
    const SAMPLES: usize = 10_000;
    let plant = hidden_plant()?;
    let rig = || Rig::new(&plant, None);
    let references = || std::iter::repeat_n(TARGET, SAMPLES);
    let steady = close_the_loop(&mut OpenLoop::steady(), &mut rig()?, references());
    let relay = close_the_loop(&mut Relay::new(TIMES, 0.02), &mut rig()?, references());
    let DesignOutcome::Track(track) = &design.outcome else {
        anyhow::bail!("the demo designs a tracking law");
    };
    let designed = run_law(&design.model, &track.law, &mut rig()?, references());
    let runs = [
        ("steady blowing", &steady),
        ("relay", &relay),
        ("the generated law", &designed),
    ];
    let rows = runs.map(|(controller, trace)| {
        let figures = Figures::of(trace, 1000);
        LoopRow {
            controller,
            mean_friction: figures.mean,
            rms_error: figures.rms,
            switches_per_s: figures.switches_per_s,
            air: figures.air,
        }
    });
    report.section("In the loop at 1 kHz, on the plant");
    report.figure(
        &loop_picture(&LoopPicture {
            title: "Held at 0.7",
            air: false,
            reference: &[TARGET; SAMPLES],
            runs: &runs,
            seconds: 3.0,
        }),
        "",
    );
    let table: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            vec![
                r.controller.to_owned(),
                format!("{:.3}", r.mean_friction),
                format!("{:.3}", r.rms_error),
                format!("{:.1}", r.switches_per_s),
                format!("{:.2}", r.air),
            ]
        })
        .collect();
    report.table(
        "",
        &[
            Column::Text("controller"),
            Column::Number("mean friction"),
            Column::Number("rms error"),
            Column::Number("switches/s"),
            Column::Number("air"),
        ],
        &table,
    );
    console.say("")?;
    console.say(&aligned(
        &[
            "in the loop, on the plant",
            "mean friction",
            "rms error",
            "switches/s",
            "air",
        ],
        &table,
        1,
    ))?;
    Ok(rows.to_vec())
}
