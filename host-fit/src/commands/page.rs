//! Results as pages.

use host_fit::data::{DataSet, Record};
use host_fit::diagnose::{Diagnosis, Verdict};
use host_fit::discover::{Entry, FoundTerm, TRACED, Trace};
use host_fit::indicators::{Scores, score};
use host_fit::model::Model;
use host_fit::picture::{
    BandPoint, Candidate, Column, CurvePlot, KeyNumber, Living, Ranking, Report, Stretches, Tone,
    WhereItFails, curve, ranking,
};
use host_fit::residual::Failures;
use host_fit::steps::{Comparison, Extension, Finding, Identification, Terms};

use super::drawings::{experiment_picture, ladder_picture, proof_picture};
use super::tried::Tried;
use super::words::{Words, describe, ladder_rows, ranking_rows, role_name, score_rows, short};

/// The page of a comparison, made by `command`.
pub(crate) fn comparison(
    model: &Model,
    set: &DataSet,
    found: &Comparison,
    command: &str,
) -> String {
    let mut report = Report::new("Comparison", title(set));
    report.section("How well the model matches");
    report.paragraph(&describe(model));
    if let Some(all) = found.scores.held_out() {
        let noise = all.noise_rmse.map_or_else(|| "–".to_owned(), short);
        report.key_numbers(&[
            KeyNumber::new("FIT", format!("{:.1} %", all.fit_percent), "free run"),
            KeyNumber::new("RMSE", short(all.rmse), "in y"),
            KeyNumber::new("noise floor", noise, "a perfect model's RMSE"),
        ]);
    }
    report_scores(&mut report, &found.scores);
    let records = model.targets(&set.records);
    report_failures(&mut report, &found.failures);
    report.section("Record by record");
    let samples = found
        .failures
        .samples(&records, &found.runs, model.longest_delay());
    let lit = Some((&found.failures, samples.as_slice()));
    report_runs(&mut report, &records, &[("model", &found.runs)], lit);
    provenance(&mut report, set, model.training.seed, command);
    report.html()
}

/// The page of an identification.
pub(crate) fn identification(set: &DataSet, found: &Identification, run: &Comparison) -> String {
    let model = &found.model;
    let mut report = Report::new("Identification", title(set));
    report.section("The model");
    report.paragraph(&describe(model));
    if !found.remarks.is_empty() {
        report.list(&found.remarks);
    }
    if !found.excitation.is_empty() {
        report.section("What the commands can tell");
        report.list(&found.excitation);
    }
    report.section("How well it matches");
    report_scores(&mut report, &found.scores);
    report_failures(&mut report, &run.failures);
    report.section("Record by record");
    let records = model.targets(&set.records);
    let samples = run
        .failures
        .samples(&records, &run.runs, model.longest_delay());
    let lit = Some((&run.failures, samples.as_slice()));
    report_runs(&mut report, &records, &[("model", &run.runs)], lit);
    provenance(&mut report, set, model.training.seed, &command_line());
    report.html()
}

/// The page of a model before and after effects were added; `before` is missing where its free run diverges.
pub(crate) fn extension(
    set: &DataSet,
    found: &Extension,
    before: Option<&Comparison>,
    after: &Comparison,
) -> String {
    let model = &found.model;
    let mut report = Report::new("Extension", title(set));
    report.section(&format!("With {}", found.effects.join(", ")));
    report.paragraph(&describe(model));
    let tile = |label: &str, run: &Scores| {
        run.held_out().map(|all| {
            KeyNumber::new(
                label,
                short(all.rmse),
                format!("FIT {:.1} %", all.fit_percent),
            )
        })
    };
    let noise = after.scores.held_out().and_then(|all| all.noise_rmse);
    let tiles = [
        before.and_then(|run| tile("RMSE before", &run.scores)),
        tile("RMSE after", &after.scores),
        noise.map(|n| KeyNumber::new("noise floor", short(n), "a perfect model's RMSE")),
    ];
    report.key_numbers(&tiles.into_iter().flatten().collect::<Vec<_>>());
    report_scores(&mut report, &after.scores);
    report_failures(&mut report, &after.failures);
    report.section("Record by record");
    let records = model.targets(&set.records);
    let samples = after
        .failures
        .samples(&records, &after.runs, model.longest_delay());
    let mut runs: Vec<(&str, &[Vec<f64>])> = Vec::new();
    runs.extend(before.map(|run| ("before", run.runs.as_slice())));
    runs.push(("after", &after.runs));
    let lit = Some((&after.failures, samples.as_slice()));
    report_runs(&mut report, &records, &runs, lit);
    provenance(&mut report, set, model.training.seed, &command_line());
    report.html()
}

/// The page of a diagnosis of `given`.
pub(crate) fn finding(
    given: &Model,
    set: &DataSet,
    found: &Finding,
    seed: u64,
    command: &str,
) -> String {
    let mut report = Report::new("Diagnosis", title(set));
    report_finding(&mut report, set, found);
    // A model whose free run diverges has neither scores nor pictures.
    if let (Some(failures), Some(runs)) = (&found.failures, &found.runs) {
        report_failures(&mut report, failures);
        // The bars are of the model as given.
        let records = given.targets(&set.records);
        let before = found.runs_before.as_deref().unwrap_or(runs);
        let samples = failures.samples(&records, before, given.longest_delay());
        report.section("The model with what was missing");
        report.paragraph(&describe(&found.model));
        report_scores(&mut report, &found.scores);
        report_climb(
            &mut report,
            &records,
            found,
            Some((failures, samples.as_slice())),
        );
    }
    provenance(&mut report, set, seed, command);
    report.html()
}

/// The page of a discovery beside `given`.
pub(crate) fn discovery(given: &Model, set: &DataSet, found: &Terms, command: &str) -> String {
    let mut report = Report::new("Discovery", title(set));
    report_discovery(&mut report, &given.targets(&set.records), found);
    provenance(&mut report, set, 0, command);
    report.html()
}

/// What was found on `records`, with its curves, and the runs before and after.
pub(crate) fn report_discovery(report: &mut Report, records: &[Record], found: &Terms) {
    let terms = &found.discovery.terms;
    let tone = if terms.is_empty() {
        Tone::Warning
    } else {
        Tone::Finding
    };
    report.verdict(tone, &found.headline, &found.meaning);
    report.section("Held-out error, step by step");
    report.table("", &LADDER, &ladder_rows(&found.discovery.ladder));
    for term in terms {
        report.section(&format!("{} by {}", term.changes, term.coordinate));
        report.figure(
            &term_picture(term),
            "The curve that was fitted with everything else, in straight lines between its points.",
        );
        report.paragraph("The effect file that the term makes:");
        report.code(&term.file);
    }
    if let Some(separation) = &found.discovery.separation {
        report.section("How to tell it from what is like it");
        report.figure(&experiment_picture(separation), &separation.words());
    }
    if let Some(trace) = &found.discovery.trace {
        report_trace(report, trace);
    }
    report.section("The model with the terms");
    report.paragraph(&describe(&found.model));
    report_scores(report, &found.scores);
    let mut all: Vec<(&str, &[Vec<f64>])> = Vec::new();
    if let Some(before) = &found.runs_before {
        all.push(("as given", before));
    }
    all.push(("with the terms", &found.runs));
    report_runs(report, records, &all, None);
}

/// The page of a law for `model` that was tried in the loop.
pub(super) fn law(model: &Model, tried: &Tried, tracks: bool, command: &str) -> String {
    let mut report = Report::new("A law for the valve", &describe(model));
    report.section("The law");
    for line in tried.design.words().lines() {
        report.paragraph(line);
    }
    if !tried.not_tried.is_empty() {
        report.list(&tried.not_tried);
    }
    if let Some(proof) = &tried.proof {
        report.section("In the loop");
        report.figure(
            &proof_picture(proof, tracks),
            "On the physical plant that the model resembles most, seen through a noisy sensor.",
        );
        report.section("Every trial");
        report.code(&proof.words());
    }
    report.provenance("tool", concat!("host-fit ", env!("CARGO_PKG_VERSION")));
    report.provenance("command", command);
    report.provenance("data", &model.training.data_hash);
    report.html()
}

/// Records whose trace is drawn.
const TRACED_RECORDS: usize = 3;

/// What is missing at the likeliest place, record by record.
fn report_trace(report: &mut Report, trace: &Trace) {
    let likeliest = TRACED.iter().enumerate().max_by(|a, b| {
        let odds = |entry: &Entry| trace.odds.get(entry.place().word()).copied().unwrap_or(0.0);
        odds(a.1).total_cmp(&odds(b.1))
    });
    let Some((index, entry)) = likeliest else {
        return;
    };
    report.section("The trace of what is missing");
    report.paragraph(&format!(
        "The signal at the {} that would explain the misfit of the best base without a term, whatever it depends on: lay it \
         beside what else was measured that day. `--trace trace.csv` writes it, with those at the other places.",
        entry.place().word()
    ));
    for record in trace.records.iter().rev().take(TRACED_RECORDS) {
        let Some(signal) = record.signals.get(index) else {
            continue;
        };
        let values = signal.value.iter().zip(&signal.half);
        let points: Vec<BandPoint> = record
            .t
            .iter()
            .zip(values)
            .map(|(t, (w, half))| BandPoint {
                x: *t,
                value: *w,
                low: w - half,
                high: w + half,
            })
            .collect();
        let picture = curve(&CurvePlot {
            x_label: "time in record (s)",
            y_label: &format!(
                "{} ({})",
                entry.words().split(" of ").next().unwrap_or_default(),
                entry.unit().symbol()
            ),
            points: &points,
            ..CurvePlot::default()
        });
        report.figure(&picture, &format!("{}: {}.", record.name, entry.words()));
    }
}

/// The curve of a term.
pub(super) fn term_picture(term: &FoundTerm) -> String {
    let points: Vec<BandPoint> = term
        .curve
        .iter()
        .map(|p| BandPoint {
            x: p.x,
            value: p.value,
            low: p.low,
            high: p.high,
        })
        .collect();
    curve(&CurvePlot {
        title: "",
        x_label: &format!("{} ({})", term.coordinate, term.coordinate_unit),
        // Of what is in the heading: an axis is short.
        y_label: &format!(
            "{} ({})",
            term.changes.split(" of ").next().unwrap_or_default(),
            term.unit
        ),
        points: &points,
        ..CurvePlot::default()
    })
}

/// Columns of a ladder's table.
const LADDER: [Column<'_>; 4] = [
    Column::Text("step"),
    Column::Number("RMSE"),
    Column::Number("FIT, %"),
    Column::Number("noise floor"),
];

fn title(set: &DataSet) -> &str {
    set.title.as_deref().unwrap_or("data set")
}

/// Measurement and free runs, record by record; with `lit`, the bars of [`report_failures`] light up their samples in them.
pub(crate) fn report_runs(
    report: &mut Report,
    records: &[Record],
    runs: &[(&str, &[Vec<f64>])],
    lit: Option<(&Failures, &[Vec<Stretches>])>,
) {
    report.living(&living(records, runs, lit));
}

/// Measurement and free runs of a diagnosis, record by record: the model as given, the one that it ends in, and, once they are
/// switched on, the steps of the ladder between them.
pub(crate) fn report_climb(
    report: &mut Report,
    records: &[Record],
    found: &Finding,
    lit: Option<(&Failures, &[Vec<Stretches>])>,
) {
    let (ladder, last) = (&found.diagnosis.ladder, &found.diagnosis.model);
    let steps: Vec<(&str, Vec<Vec<f64>>)> = ladder
        .iter()
        .skip(1)
        .filter_map(|rung| {
            let model = rung.model.as_ref().filter(|model| *model != last)?;
            let (_, runs) = score(model, records).ok()?;
            Some((rung.step.as_str(), runs))
        })
        .collect();
    let skipped = steps.len().saturating_sub(most_steps(records));
    let mut runs: Vec<(&str, &[Vec<f64>])> = Vec::new();
    let before = found.runs_before.as_deref();
    runs.extend(before.map(|before| ("as given", before)));
    let first = runs.len();
    let shown = steps[skipped..].iter();
    runs.extend(shown.map(|(step, runs)| (*step, runs.as_slice())));
    let between = first..runs.len();
    if let Some(after) = &found.runs {
        let label = match found.diagnosis.missing.is_empty() {
            true => "as diagnosed",
            false => "with what was missing",
        };
        runs.push((label, after));
    }
    let mut living = living(records, &runs, lit);
    living.off(between);
    report.living(&living);
}

/// How many steps of a ladder a page can carry as curves: it is to weigh less than 5 MB, and six lines can be told apart.
fn most_steps(records: &[Record]) -> usize {
    const SAMPLES: usize = 320_000;
    let samples: usize = records.iter().map(Record::len).sum();
    (SAMPLES / samples.max(1)).min(4)
}

/// The numbers of [`report_runs`].
pub(super) fn living(
    records: &[Record],
    runs: &[(&str, &[Vec<f64>])],
    lit: Option<(&Failures, &[Vec<Stretches>])>,
) -> Living {
    let role = |record: &Record| role_name(record.role).to_owned();
    let mut living = Living::new("friction gain y", records, runs, role);
    if let Some((failures, samples)) = lit {
        for (found, places) in failures.by.iter().zip(samples) {
            let name = found.coordinate.to_string();
            living.coordinate(&name, found.coordinate.unit(), places);
        }
    }
    living
}

/// The indicators as a table of a report.
pub(crate) fn report_scores(report: &mut Report, scores: &Scores) {
    report.table(
        "Free run against the measurement. FIT, ρ and ε are eqs. (10), (11) and (9) of the paper; noise is the \
         standard error of the measurement, inside the share of samples within its envelope.",
        &[
            Column::Text("record"),
            Column::Text("use"),
            Column::Number("FIT, %"),
            Column::Number("ρ"),
            Column::Number("RMSE"),
            Column::Number("noise"),
            Column::Number("ε"),
            Column::Number("inside"),
        ],
        &score_rows(scores).into_iter().map(Vec::from).collect::<Vec<_>>(),
    );
}

/// The part of a page that says where the model fails.
fn report_failures(report: &mut Report, failures: &Failures) {
    report.section("Where it fails");
    for sentence in failures.describe() {
        report.paragraph(&sentence);
    }
    report.bars(
        &failures_picture(failures),
        "Each panel splits the same error by one coordinate. A bar lights up its samples in the records below; the sample that \
         is read there marks its bars.",
    );
}

pub(super) fn failures_picture(failures: &Failures) -> String {
    host_fit::picture::where_it_fails(&WhereItFails {
        title: "Error of the free run on the held-out records",
        y_label: "rms error, y",
        views: &failures.views(),
    })
}

/// The sections of a report that tell a diagnosis.
pub(crate) fn report_finding(report: &mut Report, set: &DataSet, found: &Finding) {
    let diagnosis = &found.diagnosis;
    let tone = match diagnosis.verdict {
        Verdict::NothingMissing => Tone::Good,
        Verdict::EffectMissing => Tone::Finding,
        Verdict::PartlyExplained | Verdict::Unexplained => Tone::Warning,
    };
    report.verdict(tone, &found.headline, &found.meaning);
    report.section("Held-out error, step by step");
    report.figure(
        &ladder_picture(diagnosis, set),
        "Root mean square error of the free run on the held-out records.",
    );
    report.table("", &LADDER, &ladder_rows(&diagnosis.ladder));
    if !diagnosis.ranking.is_empty() {
        report.section("Every effect, refitted alone");
        report.figure(&ranking_picture(diagnosis), "");
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

/// Every candidate's held-out error.
pub(super) fn ranking_picture(diagnosis: &Diagnosis) -> String {
    let base = diagnosis
        .ladder
        .get(1)
        .or(diagnosis.ladder.first())
        .map(|rung| rung.validate_rmse);
    let candidate = |r| {
        let r: &host_fit::diagnose::Ranked = r;
        Candidate {
            name: &r.effect,
            rmse: r.validate_rmse,
            low: f64::NAN,
            high: f64::NAN,
            accepted: diagnosis.missing.contains(&r.effect),
            note: if r.significant { "" } else { "not significant" },
        }
    };
    let candidates: Vec<Candidate<'_>> = diagnosis.ranking.iter().map(candidate).collect();
    ranking(&Ranking {
        title: "Held-out error with each effect",
        y_unit: "y",
        candidates: &candidates,
        base_rmse: base,
        noise_rmse: diagnosis.ladder.last().and_then(|rung| rung.noise_rmse),
    })
}

/// What a page was made from.
pub(crate) fn provenance(report: &mut Report, set: &DataSet, seed: u64, command: &str) {
    report.provenance("tool", concat!("host-fit ", env!("CARGO_PKG_VERSION")));
    report.provenance("command", command);
    report.provenance("seed", &seed.to_string());
    report.provenance("data", &set.hash);
    report.provenance("records", &set.records.len().to_string());
}

/// What the user wrote, as it could be written again.
pub(super) fn command_line() -> String {
    let words = std::env::args_os().skip(1);
    let words = words.map(|word| quoted(&word.to_string_lossy()));
    let all: Vec<String> = std::iter::once("host-fit".to_owned())
        .chain(words)
        .collect();
    all.join(" ")
}

/// A word of a command, as a shell takes it.
pub(super) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=./,:+".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}
