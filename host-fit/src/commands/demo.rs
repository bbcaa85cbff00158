//! `host-fit demo`: the complete workflow on bundled and simulated data, from recordings to constants and
//! closed loop.

use anyhow::Context;
use std::path::{Path, PathBuf};

use closed_loop::{Figures, OpenLoop, Relay, run as close_the_loop};
use firmware_sim::family::{Family, NoiseKind, RigPlan};
use firmware_sim::hidden_set::HiddenSetPlan;
use firmware_sim::plant::{PlantSpec, Rig};
use host_fit::data::DataSet;
use host_fit::design::{TrackRequest, run_law};
use host_fit::diagnose::Options;
use host_fit::discover;
use host_fit::indicators::Indicators;
use host_fit::model::{Delay, Model};
use host_fit::output::{Staging, write_atomic};
use host_fit::picture::{Column, Report, significant};
use host_fit::steps::{
    self, Answer, DelayKind, Design, DesignOutcome, DesignRequest, IdentifyRequest, Tone,
};
use model_core::control::HoldTimes;

use super::Console;
use super::drawings::{LoopPicture, ladder_picture, loop_picture};
use super::load::shell_word;
use super::page::{
    command_line, discovery_details, discovery_lead, errors_of_models, finding_details,
    finding_lead, lead, provenance, report_runs, report_scores,
};
use super::page_parts::card;
use super::words::aligned;

/// Run the whole workflow on bundled data: identify, compare, diagnose, extend, discover, generate constants, close
/// the loop. Takes about a minute; writes a report page, models and data.
///
/// Example: host-fit demo --out demo
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder for the report, the pictures, the models and the data.
    #[arg(long, value_name = "DIR", default_value = "out/demo", value_hint = clap::ValueHint::DirPath)]
    out: PathBuf,
}

macro_rules! bundled {
    ($folder:literal, $file:literal) => {
        (
            concat!($folder, "/", $file),
            include_str!(concat!("../../data/", $folder, "/", $file)),
        )
    };
}

/// The bundled files, so that the program has them wherever it is installed.
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

/// The true effects of the hidden set; used only to simulate the closed loop.
const ANSWER: &str = include_str!("../../data/hidden-ramp/answer.toml");
/// Hidden effect outside the catalogue, seed of its rig, and folder of its recordings.
const BEYOND: (&str, u64, &str) = ("tiring-jet", 4, "tiring-ramp");
/// Five of the eight records, which suffice to find the term in half the time.
const BEYOND_RECORDS: [&str; 5] = ["step", "sq4-80", "sq2-30", "sq5-40", "sq2-60"];
/// Friction to hold in the loop (y), about 0.8 of steady blowing.
const TARGET: f64 = 0.7;
/// Shortest on and off times of the valve, samples.
const TIMES: HoldTimes = HoldTimes { on: 10, off: 10 };

/// The files of the bundled ramp with a hidden effect: names and contents.
pub(super) fn bundled_ramp() -> impl Iterator<Item = (&'static str, &'static str)> {
    let ramp = FILES
        .iter()
        .map(|(name, text)| (name.split_once('/'), *text));
    ramp.filter_map(|(name, text)| Some((name.filter(|n| n.0 == "hidden-ramp")?.1, text)))
}

/// A small structure, for speed.
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
    std::fs::create_dir_all(out).with_context(|| format!("{} cannot be made", out.display()))?;
    let data = out.join("data");
    let mut staging = Staging::new(&data)?;
    for (name, text) in FILES {
        staging.write(name, |file| file.write_all(text.as_bytes()))?;
    }
    staging.commit()?;

    let mut report = Report::new(
        "Demo",
        "From recordings to a model, its missing effect and a control law: four parts, each with its answer \
        first",
    );
    let fits = real_input(&data, out, console, &mut report)?;
    let (model, words) = hidden_effect(&data, out, console, &mut report)?;
    let found = beyond_the_catalogue(&data, out, console, &mut report)?;
    let design = steps::design(
        &model,
        &DesignRequest::Track(TrackRequest {
            min_on_s: model.sample_period_s * f64::from(TIMES.on),
            min_off_s: model.sample_period_s * f64::from(TIMES.off),
            ..TrackRequest::holding(TARGET)
        }),
    )?;
    design.model.save(&out.join("controlled.toml"))?;
    let constants = steps::constants(&design.model)?;
    write_atomic(&out.join("identified.rs"), |file| {
        file.write_all(constants.text.as_bytes())
    })?;
    let next = format!(
        "host-fit codegen {} --lang python -o identified.py",
        shell_word(&out.join("controlled.toml"))
    );
    let figures = the_loop(&design, &next, console, &mut report)?;
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

/// Validation FIT of two models of the flow simulation: with a fixed and with a state-dependent delay.
fn real_input(
    data: &Path,
    out: &Path,
    console: Console,
    report: &mut Report,
) -> anyhow::Result<[f64; 2]> {
    let set = DataSet::load(&data.join("ramp-cfd"))?;
    report.section("1. A flow over a ramp: identify and compare");
    let mut rows = Vec::new();
    let mut fits = [f64::NAN; 2];
    let mut models = Vec::new();
    let kinds = [
        (DelayKind::Fixed, "fixed delay", "ramp-fixed.toml"),
        (
            DelayKind::StateDependent,
            "state-dependent delay",
            "ramp-state-dependent.toml",
        ),
    ];
    for ((kind, name, file), fit) in kinds.into_iter().zip(&mut fits) {
        let found = steps::identify(&set, &request(kind), &console.show_progress())?;
        found.model.save(&out.join(file))?;
        // A law is used only if it is better than a constant delay.
        let is_constant = matches!(found.model.delay, Delay::Fixed { .. });
        let name = match (kind, is_constant) {
            (DelayKind::StateDependent, true) => "constant: no delay law has a lower error",
            _ => name,
        };
        let percent = |i: &Option<Indicators>| i.as_ref().map_or(f64::NAN, |i| i.fit_percent);
        *fit = percent(&found.scores.validate);
        rows.push(vec![
            name.to_owned(),
            format!("{:.1}", percent(&found.scores.identify)),
            format!("{:.1}", *fit),
        ]);
        models.push((name.to_owned(), found.model));
    }
    let borrowed: Vec<(String, &Model)> = models.iter().map(|(n, m)| (n.clone(), m)).collect();
    let mut compared = steps::compare_several(&borrowed, &set).map_err(|(_, error)| error)?;
    let best = compared.best().map(|best| best.model.clone());
    let best = models
        .iter()
        .position(|(name, _)| Some(name) == best.as_ref());
    let (_, _, file) = kinds[best.unwrap_or(0)];
    let answer = std::mem::take(&mut compared.answer);
    compared.answer = answer.with_files(
        &shell_word(&out.join(file)),
        &shell_word(&data.join("ramp-cfd")),
    );
    let runs: Vec<(&str, &[Vec<f64>])> = compared
        .models
        .iter()
        .map(|named| (named.model.as_str(), named.comparison.runs.as_slice()))
        .collect();
    let picture = errors_of_models(&compared);
    let worst = lead(
        report,
        &compared.answer,
        picture.as_ref(),
        &set.records,
        &runs,
    );
    report.fold("Every record of part 1");
    for named in &compared.models {
        report.subsection(&named.model);
        report_scores(report, &named.comparison.scores);
    }
    report_runs(report, &set.records, &runs, None, worst);
    report.end_fold();
    provenance(report, &set, 0, &command_line());
    console.say("1. flow over a ramp (2-D Navier–Stokes): FIT of the free run, %")?;
    console.say(&indented(&aligned(
        &["model", "estimation", "validation"],
        &rows,
        1,
    )))?;
    console.say(&indented(&short_form(&compared.answer)))?;
    Ok(fits)
}

/// From a model with a missing effect to a complete one.
fn hidden_effect(
    data: &Path,
    out: &Path,
    console: Console,
    report: &mut Report,
) -> anyhow::Result<(Model, String)> {
    let set = DataSet::load(&data.join("hidden-ramp"))?;
    let request = request(DelayKind::StateDependent);
    let found = steps::identify(&set, &request, &console.show_progress())?;
    found.model.save(&out.join("hidden-before.toml"))?;
    let finding = steps::diagnose(
        &found.model,
        &set,
        &Options::default(),
        &console.show_progress(),
    )?;
    let mut finding = finding;
    let model = shell_word(&out.join("hidden-before.toml"));
    let records = shell_word(&data.join("hidden-ramp"));
    finding.answer = finding.answer.with_files(&model, &records);
    console.say("\n2. a ramp with a hidden effect: diagnose")?;
    console.say(&indented(&short_form(&finding.answer)))?;
    report.section("2. A ramp with a hidden effect: diagnose");
    let worst = finding_lead(report, &found.model, &set, &finding);
    report
        .fold("Details of part 2: candidates, where the model fails, residual tests, every record");
    finding_details(report, &found.model, &set, &finding, worst);
    report.end_fold();
    let svg = ladder_picture(&finding.diagnosis);
    write_atomic(&out.join("ladder.svg"), |file| {
        file.write_all(svg.as_bytes())
    })?;
    finding.model.save(&out.join("hidden-after.toml"))?;
    provenance(report, &set, 0, &command_line());
    let words = finding.answer.sentence();
    Ok((finding.model, words))
}

/// The answer without its notes, which are in the report.
fn short_form(answer: &Answer) -> String {
    let short = Answer {
        notes: Vec::new(),
        ..answer.clone()
    };
    short.words()
}

/// Indented lines below a heading.
fn indented(text: &str) -> String {
    let lines = text.lines().map(|line| format!("   {line}"));
    lines.collect::<Vec<_>>().join("\n")
}

/// Records a rig with an effect outside the catalogue; returns the discovered term in words.
fn beyond_the_catalogue(
    data: &Path,
    out: &Path,
    console: Console,
    report: &mut Report,
) -> anyhow::Result<String> {
    let (hidden, seed, name) = BEYOND;
    let plan = RigPlan::draw(Family::FirstOrder, &[hidden], NoiseKind::White, &[], seed)?;
    let folder = data.join(name);
    let mut recorded = plan.build()?.data;
    recorded
        .records
        .retain(|record| BEYOND_RECORDS.contains(&record.name.as_str()));
    recorded.save(&folder)?;
    let set = DataSet::load(&folder)?;
    let given = steps::identify(&set, &IdentifyRequest::default(), &console.show_progress())?.model;
    given.save(&out.join("beyond-before.toml"))?;
    let options = discover::Options {
        terms: 1,
        ..discover::Options::default()
    };
    let found = steps::discover(&given, &set, &options, &console.show_progress())?;
    let mut found = found;
    let model = shell_word(&out.join("beyond-before.toml"));
    found.answer = found.answer.with_files(&model, &shell_word(&folder));
    if !found.discovery.terms.is_empty() {
        // The demo has written the files of `discover` already.
        found.answer.next = format!(
            "host-fit diagnose {} {}",
            shell_word(&out.join("beyond-after.toml")),
            shell_word(&folder)
        );
    }
    console.say("\n3. a ramp with an effect outside the catalogue: discover")?;
    console.say(&indented(&short_form(&found.answer)))?;
    report.section("3. A ramp with an effect outside the catalogue: discover");
    let records = given.targets(&set.records);
    let worst = discovery_lead(report, &records, &found);
    report.fold("Details of part 3: formula, trace, residual tests, every record");
    discovery_details(report, &given, &records, &found, worst);
    report.end_fold();
    provenance(report, &set, 0, &command_line());
    found.model.save(&out.join("beyond-after.toml"))?;
    if let Some(term) = found.discovery.terms.first() {
        write_atomic(&out.join("beyond-effect.toml"), |file| {
            file.write_all(term.file.as_bytes())
        })?;
    }
    Ok(found.answer.sentence())
}

#[derive(Clone, Copy, serde::Serialize)]
struct LoopRow {
    controller: &'static str,
    mean_friction: f64,
    rms_error: f64,
    switches_per_s: f64,
    air: f64,
}

/// The plant of the hidden set, rebuilt from the recorded answer.
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

/// Steady blowing, a plain relay and the designed law on the plant of the hidden set. The law runs in single
/// precision, as on the board; the reference run in `identified.rs` comes from this code.
fn the_loop(
    design: &Design,
    next: &str,
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
    report.section("4. The generated law in the loop, at 1 kHz on the plant");
    let [_, relay_row, law] = &rows;
    let holds = (law.mean_friction - TARGET).abs() <= 0.05 * TARGET;
    let (tone, verdict) = match holds {
        true => (Tone::Good, format!("the law holds y at {TARGET}")),
        false => (
            Tone::Warning,
            format!("the law does not hold y at {TARGET}"),
        ),
    };
    let answer = Answer::new(tone, verdict)
        .evidence(format!(
            "On the plant, after the first second: mean y {}, rms error {}, with a relay {}.",
            significant(law.mean_friction, 3),
            significant(law.rms_error, 3),
            significant(relay_row.rms_error, 3)
        ))
        .confidence(
            "One simulated run of 10 s on the true plant of part 2, without sensor noise; `host-fit design` makes the trials \
             that decide.",
        )
        .next(next);
    report.columns().cell();
    card(report, &answer);
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
            Column::Number("mean y"),
            Column::Number("rms error"),
            Column::Number("switches/s"),
            Column::Number("air"),
        ],
        &table,
    );
    report.end_columns();
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
    report.end_columns();
    console.say("\n4. the generated law in the loop, on the plant: hold y at 0.7")?;
    let head = ["controller", "mean y", "rms error", "switches/s", "air"];
    console.say(&indented(&aligned(&head, &table, 1)))?;
    console.say(&indented(&answer.words()))?;
    Ok(rows.to_vec())
}
