//! `host-fit diagnose`: which physical effect is missing.

use std::path::PathBuf;

use host_fit::data::DataSet;
use host_fit::diagnose::{
    Diagnosis, HeldOutBy, NotTried, Options, ParameterEstimate, Ranked, Rung, Verdict, diagnose,
};
use host_fit::indicators::score;
use host_fit::model::{Model, Training};
use host_fit::output::write_atomic;
use host_fit::picture::{
    Candidate, Column, Ladder, LadderRecord, LadderStep, Ranking, Report, Tone, ladder, ranking,
};

use host_fit::power::{Detectable, detectable};
use host_fit::residual::{Failures, NoiseSource, Where, where_it_fails};
use host_fit::simulate::SimulateError;

use super::Console;
use super::compare::{load, provenance, report_failures};
use super::effect_files::EffectFiles;
use super::interrupt::watch;
use super::scores::{aligned, describe, overlays, report_table, short};

/// Find the physical effect that a model lacks, judged in free run on held-out records.
///
/// Every effect of the catalogue is refitted with everything else; an effect counts if the held-out error falls
/// significantly, by more than chance manages with shifted copies of it.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model.
    #[arg(value_name = "model.toml")]
    model: PathBuf,
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// Write a report page with pictures.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// File for the model with the missing effects added.
    #[arg(short, long, value_name = "new.toml")]
    output: Option<PathBuf>,
    /// Write the command (columns t, u) that would tell apart what these records cannot.
    #[arg(long, value_name = "command.csv")]
    experiment: Option<PathBuf>,
    /// Most effects that are added one after the other.
    #[arg(long, value_name = "COUNT", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=12))]
    most_effects: u32,
    /// Seed of the decoys.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    effect_files: EffectFiles,
}

#[derive(serde::Serialize)]
struct Document<'a> {
    verdict: Verdict,
    missing: &'a [String],
    ladder: &'a [Rung],
    ranking: &'a [Ranked],
    not_tried: &'a [NotTried],
    /// Where the last model of the ladder still fails.
    #[serde(rename = "where")]
    places: &'a [Where],
    /// What of each effect would have been seen, had it been there.
    detectable: &'a [Detectable],
    /// How the errors were held out.
    held_out_by: HeldOutBy,
    restarted_s: Option<f64>,
    /// Where the noise floor comes from, and its size, y rms.
    noise_source: NoiseSource,
    noise_estimate: f64,
    /// The experiment for effects that these records cannot tell apart.
    experiment: Option<ExperimentDocument<'a>>,
    words: &'a str,
}

#[derive(serde::Serialize)]
struct ExperimentDocument<'a> {
    effects: &'a [String],
    description: &'a str,
    separation_sigmas: f64,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let (mut model, set) = load(&args.model, &args.dataset)?;
    args.effect_files.define(&mut model)?;
    let records = model.targets(&set.records);
    let options = Options {
        most_effects: args.most_effects as usize,
        seed: args.seed,
    };
    let bar = console.spinner("trying every effect");
    let diagnosis = diagnose(&model, &records, &options, watch())?;
    let (failures, unstable) = match where_it_fails(&diagnosis.model, &records) {
        Ok(failures) => (Some(failures), None),
        Err(error @ SimulateError::Diverged { .. }) => (None, Some(error.to_string())),
        Err(error) => return Err(error.into()),
    };
    let detectable = match diagnosis.verdict {
        // A model on the verge of instability has no amplitudes to tell.
        Verdict::NothingMissing => match detectable(&diagnosis.model, &records) {
            Err(SimulateError::Diverged { .. }) => Vec::new(),
            other => other?,
        },
        Verdict::EffectMissing | Verdict::Unexplained => Vec::new(),
    };
    bar.finish_and_clear();
    let (headline, meaning) = verdict_words(&diagnosis);
    if let Some(path) = &args.output {
        finished(&diagnosis.model, &set, args.seed)?.save(path)?;
    }
    let separation = diagnosis.separation.as_ref();
    if let (Some(path), Some(separation)) = (&args.experiment, separation) {
        separation.experiment.write_csv(path)?;
    }
    if let Some(path) = &args.report {
        let page = page(&model, &set, &diagnosis, failures.as_ref())?;
        write_atomic(path, |out| out.write_all(page.as_bytes()))?;
    }
    console.say(&headline)?;
    console.say(&meaning)?;
    let described = failures.as_ref().map(Failures::describe);
    for sentence in described.into_iter().flatten().chain(unstable) {
        console.say(&sentence)?;
    }
    for effect in &detectable {
        console.say(&format!("  {}", effect.words))?;
    }
    console.say(&format!("\n{}", ladder_table(&diagnosis)))?;
    if !diagnosis.ranking.is_empty() {
        console.say(&format!("\n{}", ranking_table(&diagnosis.ranking)))?;
    }
    if !diagnosis.not_tried.is_empty() {
        console.say("\nnot tried")?;
        for entry in &diagnosis.not_tried {
            console.say(&format!("  {}: {}", entry.effect, entry.reason))?;
        }
    }
    let command = args.experiment.as_ref();
    if command.is_some() && separation.is_none() {
        console.say("no experiment was written: there is nothing to tell apart")?;
    }
    let command = command.filter(|_| separation.is_some());
    for path in args.report.iter().chain(&args.output).chain(command) {
        console.say(&format!("written to {}", path.display()))?;
    }
    console.document(&Document {
        verdict: diagnosis.verdict,
        missing: &diagnosis.missing,
        ladder: &diagnosis.ladder,
        ranking: &diagnosis.ranking,
        not_tried: &diagnosis.not_tried,
        places: failures.as_ref().map_or(&[], |failures| &failures.by),
        detectable: &detectable,
        held_out_by: diagnosis.held_out_by,
        restarted_s: diagnosis.restarted_s,
        noise_source: diagnosis.noise_source,
        noise_estimate: diagnosis.noise_estimate,
        experiment: separation.map(|separation| ExperimentDocument {
            effects: &separation.effects,
            description: &separation.experiment.description,
            separation_sigmas: separation.experiment.separation_sigmas,
        }),
        words: &format!("{headline}. {meaning}"),
    })
}

/// The final model with what it was trained on.
fn finished(model: &Model, set: &DataSet, seed: u64) -> anyhow::Result<Model> {
    let (scores, _) = score(model, &model.targets(&set.records))?;
    let learning: Vec<_> = set.identify().collect();
    Ok(Model {
        training: Training {
            data_hash: set.hash.clone(),
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            seed,
            objective: "free-run".to_owned(),
            objective_value: scores.identify.as_ref().map_or(0.0, |i| i.epsilon),
            identify_fit_percent: scores.identify.as_ref().map_or(0.0, |i| i.fit_percent),
            validate_fit_percent: scores.validate.as_ref().map(|i| i.fit_percent),
            ..Training::envelope(&learning)
        },
        ..model.clone()
    })
}

/// Headline and meaning of a diagnosis, in words.
pub(crate) fn verdict_words(diagnosis: &Diagnosis) -> (String, String) {
    let (headline, mut meaning) = finding_words(diagnosis);
    match diagnosis.held_out_by {
        HeldOutBy::Records => {}
        HeldOutBy::Turns => meaning.push_str(
            " No record is marked `validate`: each in turn was judged by models that had not seen it.",
        ),
        HeldOutBy::End => meaning.push_str(
            " There is one record only: its end was judged by models that saw its beginning; a second record would say more.",
        ),
    }
    if let Some(seconds) = diagnosis.restarted_s {
        meaning.push_str(&format!(
            " The rig integrates and its free run drifts: all errors here are of free runs that start anew from the measurement every {} s.",
            short(seconds)
        ));
    }
    if let Some(separation) = &diagnosis.separation {
        meaning.push_str(&format!(
            " To tell {} apart, play this: {} (`--experiment command.csv` writes it).",
            separation.effects.join(" and "),
            separation.experiment.words().trim_end_matches('.')
        ));
    }
    (headline, meaning)
}

fn finding_words(diagnosis: &Diagnosis) -> (String, String) {
    let rmse = |rung: Option<&Rung>| rung.map_or(f64::NAN, |rung| rung.validate_rmse);
    let first = rmse(diagnosis.ladder.first());
    let last = rmse(diagnosis.ladder.last());
    let noise = diagnosis.noise_estimate;
    let floor = match diagnosis.noise_source {
        NoiseSource::Measured => format!(
            "the noise floor is {} ({:.2} times it is left)",
            short(noise),
            last / noise
        ),
        NoiseSource::Repeats => format!(
            "there is no y_sd; how y differs between repeats of the command puts the noise floor at {} ({:.2} times it is left)",
            short(noise),
            last / noise
        ),
        NoiseSource::Scatter => format!(
            "the noise floor is not known: there is no y_sd and no repeat; from sample to sample y scatters by {}",
            short(noise)
        ),
    };
    match diagnosis.verdict {
        Verdict::NothingMissing => (
            "nothing is missing".to_owned(),
            format!(
                "Refitted, the model's held-out error is {}: {floor}. No effect of the catalogue lowers it significantly.",
                short(last)
            ),
        ),
        Verdict::EffectMissing => {
            let headline = match diagnosis.missing.as_slice() {
                [one] => format!("{one} is missing"),
                several => format!("{} are missing", several.join(" and ")),
            };
            let mut meaning = format!(
                "With {} the held-out error falls from {} to {}; {floor}.",
                if diagnosis.missing.len() == 1 {
                    "it"
                } else {
                    "them"
                },
                short(first),
                short(last)
            );
            let found = diagnosis
                .ranking
                .iter()
                .filter(|r| diagnosis.missing.contains(&r.effect));
            for entry in found.filter(|entry| !entry.confounded_with.is_empty()) {
                meaning.push_str(&format!(
                    " These records cannot tell {} from {}.",
                    entry.effect,
                    entry.confounded_with.join(", ")
                ));
            }
            (headline, meaning)
        }
        Verdict::Unexplained => (
            "something is missing that the catalogue does not have".to_owned(),
            match diagnosis
                .ladder
                .last()
                .map(|rung| rung.effects.join(" and "))
            {
                Some(tried) if !tried.is_empty() => format!(
                    "The best that the catalogue does is {tried}: the held-out error is then {} and {floor}. \
                     That is too little to name them as the cause; they are not in the model \
                     (`host-fit extend` adds them all the same).",
                    short(last)
                ),
                _ => format!(
                    "The held-out error is {} and {floor}; no effect of the catalogue, nor several, explains most of it.",
                    short(last)
                ),
            },
        ),
    }
}

fn ladder_rows(diagnosis: &Diagnosis) -> Vec<Vec<String>> {
    let row = |rung: &Rung| {
        vec![
            rung.step.clone(),
            format!("{:.5}", rung.validate_rmse),
            format!("{:.2}", rung.validate_fit_percent),
            rung.noise_rmse
                .map_or_else(|| "–".into(), |noise| format!("{noise:.5}")),
        ]
    };
    diagnosis.ladder.iter().map(row).collect()
}

/// The ladder of held-out errors as an aligned table.
pub(crate) fn ladder_table(diagnosis: &Diagnosis) -> String {
    let head = ["held-out error, step by step", "RMSE", "FIT %", "noise"];
    aligned(&head, &ladder_rows(diagnosis), 1)
}

/// `name = value unit (low … high)`.
fn estimate_words(name: &str, p: &ParameterEstimate) -> String {
    let unit = if p.unit == "-" { "" } else { p.unit.as_str() };
    let space = if unit.is_empty() { "" } else { " " };
    format!(
        "{name} {}{space}{unit} ({} … {})",
        short(p.value),
        short(p.low),
        short(p.high)
    )
}

fn ranking_rows(ranked: &[Ranked]) -> Vec<Vec<String>> {
    let row = |r: &Ranked| {
        let parameters: Vec<String> = r
            .parameters
            .iter()
            .map(|(name, p)| estimate_words(name, p))
            .collect();
        let mut said = parameters.join(", ");
        if !r.confounded_with.is_empty() {
            said.push_str(&format!("; or {}", r.confounded_with.join(", ")));
        }
        vec![
            r.effect.clone(),
            if r.significant { "yes" } else { "no" }.to_owned(),
            format!("{:.1} %", r.error_reduction_percent),
            format!("{:.1} %", r.best_decoy_percent),
            if r.p_value < 0.001 {
                "< 0.001".to_owned()
            } else {
                format!("{:.3}", r.p_value)
            },
            said,
        ]
    };
    ranked.iter().map(row).collect()
}

fn ranking_table(ranked: &[Ranked]) -> String {
    // Parameters of effects that do nothing say nothing.
    let shown = ranking_rows(ranked)
        .into_iter()
        .zip(ranked)
        .map(|(mut row, entry)| {
            if !entry.significant
                && let Some(last) = row.last_mut()
            {
                last.clear();
            }
            row.swap(4, 5);
            let parameters = row.remove(4);
            row.push(parameters);
            row
        })
        .collect::<Vec<_>>();
    let head = [
        "each effect alone",
        "counts",
        "error falls",
        "by chance",
        "p",
        "parameters (95 % interval)",
    ];
    aligned_last_left(&head, &shown)
}

/// As [`aligned`], with words in the last column.
fn aligned_last_left(head: &[&str], rows: &[Vec<String>]) -> String {
    let cut = head.len().saturating_sub(1);
    let numbers: Vec<Vec<String>> = rows
        .iter()
        .map(|row| row.iter().take(cut).cloned().collect())
        .collect();
    let table = aligned(head.get(..cut).unwrap_or(head), &numbers, 1);
    let last = head
        .last()
        .map(|cell| (*cell).to_owned())
        .into_iter()
        .chain(
            rows.iter()
                .map(|row| row.get(cut).cloned().unwrap_or_default()),
        );
    let lines: Vec<String> = table
        .lines()
        .zip(last)
        .map(|(line, last)| format!("{line}  {last}").trim_end().to_owned())
        .collect();
    lines.join("\n")
}

/// The held-out error step by step, as a picture.
pub(crate) fn ladder_picture(diagnosis: &Diagnosis, set: &DataSet) -> String {
    let finite = diagnosis
        .ladder
        .iter()
        .filter(|rung| rung.validate_rmse.is_finite());
    let steps: Vec<LadderStep<'_>> = finite
        .map(|rung| LadderStep {
            label: &rung.step,
            rmse: rung.validate_rmse,
        })
        .collect();
    let records: [LadderRecord<'_>; 0] = [];
    ladder(&Ladder {
        title: set.title.as_deref().unwrap_or("Held-out error"),
        y_unit: "y",
        steps: &steps,
        records: &records,
        noise_rmse: diagnosis.ladder.last().and_then(|rung| rung.noise_rmse),
    })
}

/// The sections of a report that tell a diagnosis.
pub(crate) fn report_diagnosis(report: &mut Report, set: &DataSet, diagnosis: &Diagnosis) {
    let (headline, meaning) = verdict_words(diagnosis);
    let tone = match diagnosis.verdict {
        Verdict::NothingMissing => Tone::Good,
        Verdict::EffectMissing => Tone::Finding,
        Verdict::Unexplained => Tone::Warning,
    };
    report.verdict(tone, &headline, &meaning);
    report.section("Held-out error, step by step");
    report.figure(
        &ladder_picture(diagnosis, set),
        "Root mean square error of the free run on the held-out records.",
    );
    report.table(
        "",
        &[
            Column::Text("step"),
            Column::Number("RMSE"),
            Column::Number("FIT, %"),
            Column::Number("noise floor"),
        ],
        &ladder_rows(diagnosis),
    );
    if !diagnosis.ranking.is_empty() {
        report.section("Every effect, refitted alone");
        let base = diagnosis
            .ladder
            .get(1)
            .or(diagnosis.ladder.first())
            .map(|rung| rung.validate_rmse);
        let candidates: Vec<Candidate<'_>> = diagnosis
            .ranking
            .iter()
            .map(|r| Candidate {
                name: &r.effect,
                rmse: r.validate_rmse,
                low: f64::NAN,
                high: f64::NAN,
                decoy: false,
                accepted: diagnosis.missing.contains(&r.effect),
                note: if r.significant { "" } else { "not significant" },
            })
            .collect();
        report.figure(
            &ranking(&Ranking {
                title: "Held-out error with each effect",
                y_unit: "y",
                candidates: &candidates,
                base_rmse: base,
                noise_rmse: diagnosis.ladder.last().and_then(|rung| rung.noise_rmse),
            }),
            "",
        );
        report.table(
            "By chance: the best that time-shifted and swapped copies of the effect's contribution achieved. \
             p is corrected for the number of effects tried (Holm).",
            &[
                Column::Text("effect"),
                Column::Text("counts"),
                Column::Number("error falls"),
                Column::Number("by chance"),
                Column::Number("p"),
                Column::Text("parameters (95 % interval)"),
            ],
            &ranking_rows(&diagnosis.ranking),
        );
    }
    if !diagnosis.not_tried.is_empty() {
        report.section("Not tried");
        let lines: Vec<String> = diagnosis
            .not_tried
            .iter()
            .map(|n| format!("`{}`: {}", n.effect, n.reason))
            .collect();
        report.list(&lines);
    }
}

fn page(
    given: &Model,
    set: &DataSet,
    diagnosis: &Diagnosis,
    failures: Option<&Failures>,
) -> anyhow::Result<String> {
    let title = set.title.as_deref().unwrap_or("data set");
    let mut report = Report::new("Diagnosis", title);
    report_diagnosis(&mut report, set, diagnosis);
    let records = given.targets(&set.records);
    // A model whose free run diverges has neither scores nor pictures.
    if let Some(failures) = failures {
        let (scores, runs) = score(&diagnosis.model, &records)?;
        report_failures(&mut report, failures);
        report.section("The model with what was missing");
        report.paragraph(&describe(&diagnosis.model));
        report_table(&mut report, &scores);
        let before = score(given, &records).ok().map(|(_, runs)| runs);
        let mut all: Vec<(&str, &[Vec<f64>])> = Vec::new();
        if let Some(before) = &before {
            all.push(("as given", before));
        }
        all.push(("with what was missing", &runs));
        for (_, svg) in overlays(&records, &all) {
            report.figure(&svg, "");
        }
    }
    provenance(&mut report, set);
    Ok(report.html())
}
