//! Results as pages.

use host_fit::curves::Entry;
use host_fit::data::{DataSet, Plant, Record};
use host_fit::discover::{FoundTerm, TRACED, Trace};
use host_fit::indicators::{ErrorKind, Indicators, Scores, score};
use host_fit::model::Model;
use host_fit::picture::{
    BandPoint, Column, CurvePlot, Living, Picture, Report, Stretches, WhereItFails, curve, listed,
};
use host_fit::residual::Failures;
use host_fit::steps::{
    Answer, Comparison, Extension, Finding, Identification, SideBySide, Terms, effect_in_words,
};

use super::drawings::{
    before_and_after_picture, candidates_caption, errors_picture, experiment_picture,
    ladder_picture, margin_picture, proof_picture, ranking_picture, step_by_step,
};
use super::page_parts::{Run, Stretch, card, checks, stretch_picture, worst_stretch};
use super::tried::Tried;
use super::words::{
    PARAMETERS, SIDE_BY_SIDE, TRIALS, Words, describe, dropped_terms, has_envelope, ladder_caption,
    ladder_rows, parameter_rows, ranking_rows, role_name, score_rows, screened_only,
    side_by_side_rows, trial_caption, trial_rows,
};

/// The page of a comparison, made by `command`.
pub(crate) fn comparison(
    model: &Model,
    set: &DataSet,
    found: &Comparison,
    command: &str,
) -> String {
    let mut report = Report::new("Comparison", title(set));
    let records = model.targets(&set.records);
    let runs = [run("model", model, &found.runs)];
    let worst = lead(&mut report, &found.answer, None, &records, &pairs(&runs));
    compared(&mut report, &records, &runs, found, worst);
    every_record(&mut report, model, &found.scores);
    provenance(&mut report, set, model.training.seed, command);
    report.html()
}

/// The page of several models on the same records.
pub(crate) fn side_by_side(
    models: &[(String, &Model)],
    set: &DataSet,
    found: &SideBySide,
    command: &str,
) -> String {
    let mut report = Report::new("Comparison of models", title(set));
    let named = models.iter().zip(&found.models);
    let runs: Vec<Run<'_>> = named
        .map(|((_, model), named)| run(&named.model, model, &named.comparison.runs))
        .collect();
    let records = models
        .first()
        .map(|(_, model)| model.targets(&set.records))
        .unwrap_or_default();
    let picture = errors_of_models(found);
    let worst = lead(
        &mut report,
        &found.answer,
        picture.as_ref(),
        &records,
        &pairs(&runs),
    );
    let [first, rest @ ..] = SIDE_BY_SIDE;
    let columns = std::iter::once(Column::Text(first)).chain(rest.map(Column::Number));
    report.table(
        &format!(
            "Free run against the measurement. RMSE and noise are those of the {}.",
            ErrorKind::on(&records).records()
        ),
        &columns.collect::<Vec<_>>(),
        &side_by_side_rows(found),
    );
    report_runs(&mut report, &records, &pairs(&runs), None, worst);
    checks(&mut report, &records, &runs);
    for ((name, model), named) in models.iter().zip(&found.models) {
        report.section(name);
        report.paragraph(&describe(model));
        report_scores(&mut report, &named.comparison.scores);
    }
    if let Some((_, model)) = models.first() {
        provenance(&mut report, set, model.training.seed, command);
    }
    report.html()
}

/// The errors of the models as bars, if all are on the same records and few enough for one picture.
pub(super) fn errors_of_models(found: &SideBySide) -> Option<Picture> {
    const MOST: usize = 6;
    let scored = found.models.iter();
    let scored: Vec<(&str, &Indicators)> = scored
        .filter_map(|named| Some((named.model.as_str(), named.comparison.scores.held_out()?)))
        .collect();
    let (_, first) = *scored.first()?;
    let bars: Vec<(&str, f64)> = scored.iter().map(|(name, of)| (*name, of.rmse)).collect();
    (bars.len() <= MOST).then(|| errors_picture(ErrorKind::of(first.role), &bars, first.noise_rmse))
}

/// The page of an identification.
pub(crate) fn identification(set: &DataSet, found: &Identification, ran: &Comparison) -> String {
    let model = &found.model;
    let mut report = Report::new("Identification", title(set));
    let records = model.targets(&set.records);
    let runs = [run("model", model, &ran.runs)];
    let worst = lead(&mut report, &found.answer, None, &records, &pairs(&runs));
    report.section("The model");
    report.paragraph(&describe(model));
    if !found.remarks.is_empty() {
        report.list(&found.remarks);
    }
    if !found.excitation.is_empty() {
        report.section("Excitation");
        report.list(&found.excitation);
    }
    compared(&mut report, &records, &runs, ran, worst);
    report.section("Every record");
    report_scores(&mut report, &found.scores);
    provenance(&mut report, set, model.training.seed, &command_line());
    report.html()
}

/// The page of a model before and after effects were added; `before` is `None` if its free run diverges.
pub(crate) fn extension(
    set: &DataSet,
    found: &Extension,
    given: (&Model, Option<&Comparison>),
    after: &Comparison,
) -> String {
    let model = &found.model;
    let (given, before) = given;
    let mut report = Report::new("Extension", title(set));
    let records = model.targets(&set.records);
    let before = before.map(|ran| run("before", given, &ran.runs));
    let runs: Vec<Run<'_>> = before
        .into_iter()
        .chain([run("after", model, &after.runs)])
        .collect();
    let changed = found.before.as_ref().zip(found.after.as_ref());
    let picture = changed.map(|(before, after)| {
        let with = format!("with {}", listed(&found.effects));
        let bars = [
            ("the model as given", before.rmse),
            (with.as_str(), after.rmse),
        ];
        errors_picture(ErrorKind::of(after.role), &bars, after.noise_rmse)
    });
    let worst = lead(
        &mut report,
        &found.answer,
        picture.as_ref(),
        &records,
        &pairs(&runs),
    );
    report.section("The model");
    report.paragraph(&describe(model));
    if let Some(dropped) = dropped_terms(found) {
        report.paragraph(&dropped);
    }
    if !found.parameters.is_empty() {
        let columns = PARAMETERS.map(Column::Text);
        report.table("", &columns, &parameter_rows(&found.parameters));
    }
    compared(&mut report, &records, &runs, after, worst);
    report.section("Every record");
    report_scores(&mut report, &after.scores);
    provenance(&mut report, set, model.training.seed, &command_line());
    report.html()
}

fn run<'a>(label: &'a str, model: &'a Model, runs: &'a [Vec<f64>]) -> Run<'a> {
    Run {
        label,
        model,
        runs,
        colour: None,
    }
}

/// Label and free runs of each model.
fn pairs<'a>(runs: &[Run<'a>]) -> Vec<(&'a str, &'a [Vec<f64>])> {
    runs.iter().map(|run| (run.label, run.runs)).collect()
}

/// The sections of compared models: where the last of `runs` fails (from `found`), all runs record by record, and
/// the residual tests.
fn compared(
    report: &mut Report,
    records: &[Record],
    runs: &[Run<'_>],
    found: &Comparison,
    worst: Option<Stretch>,
) {
    let failures = &found.failures;
    report_failures(report, failures);
    let delay = runs.last().map_or(0, |run| run.model.longest_delay());
    let samples = failures.samples(records, &found.runs, delay);
    let lit = Some((failures, samples.as_slice()));
    report_runs(report, records, &pairs(runs), lit, worst);
    checks(report, records, runs);
}

/// The model and its indicators on every record.
fn every_record(report: &mut Report, model: &Model, scores: &Scores) {
    report.section("Every record");
    report.paragraph(&describe(model));
    report_scores(report, scores);
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
    let worst = finding_lead(&mut report, given, set, found);
    finding_details(&mut report, given, set, found, worst);
    provenance(&mut report, set, seed, command);
    report.html()
}

/// The first screen of a diagnosis: answer, error before and after, the two seconds with the largest error before and
/// after.
pub(crate) fn finding_lead(
    report: &mut Report,
    given: &Model,
    set: &DataSet,
    found: &Finding,
) -> Option<Stretch> {
    let records = given.targets(&set.records);
    let mut runs: Vec<(&str, &[Vec<f64>])> = Vec::new();
    runs.extend(found.runs_before.as_deref().map(|runs| ("as given", runs)));
    runs.extend(found.runs.as_deref().map(|runs| (after_label(found), runs)));
    let ladder = before_and_after_picture(&found.diagnosis);
    let falling = (found.diagnosis.ladder.len() > 1).then_some(&ladder);
    lead(report, &found.answer, falling, &records, &runs)
}

/// The label of a diagnosis' final model.
fn after_label(found: &Finding) -> &'static str {
    match found.diagnosis.missing.is_empty() {
        true => "as diagnosed",
        false => "with the effects",
    }
}

/// The remaining sections of a diagnosis.
pub(crate) fn finding_details(
    report: &mut Report,
    given: &Model,
    set: &DataSet,
    found: &Finding,
    worst: Option<Stretch>,
) {
    report_candidates(report, found);
    // A model whose free run diverges has neither scores nor pictures.
    let (Some(failures), Some(runs)) = (&found.failures, &found.runs) else {
        return;
    };
    report_failures(report, failures);
    // The bars belong to the given model.
    let records = given.targets(&set.records);
    let before = found.runs_before.as_deref().unwrap_or(runs);
    let samples = failures.samples(&records, before, given.longest_delay());
    report_climb(
        report,
        &records,
        found,
        Some((failures, samples.as_slice())),
        worst,
    );
    let given_runs = found.runs_before.as_deref();
    let mut tested: Vec<Run<'_>> = given_runs
        .map(|runs| run("as given", given, runs))
        .into_iter()
        .collect();
    if found.model != *given {
        tested.push(run(after_label(found), &found.model, runs));
    }
    checks(report, &records, &tested);
    every_record(report, &found.model, &found.scores);
}

/// The page of a discovery for `given`.
pub(crate) fn discovery(given: &Model, set: &DataSet, found: &Terms, command: &str) -> String {
    let mut report = Report::new("Discovery", title(set));
    let records = given.targets(&set.records);
    let worst = discovery_lead(&mut report, &records, found);
    discovery_details(&mut report, given, &records, found, worst);
    provenance(&mut report, set, 0, command);
    report.html()
}

/// The first screen of a discovery: answer, curve of the first term, the two seconds with the largest error
/// before and after.
pub(crate) fn discovery_lead(
    report: &mut Report,
    records: &[Record],
    found: &Terms,
) -> Option<Stretch> {
    let curve = found.discovery.terms.first().map(term_picture);
    let runs = discovery_runs(found);
    lead(report, &found.answer, curve.as_ref(), records, &runs)
}

fn discovery_runs(found: &Terms) -> Vec<(&str, &[Vec<f64>])> {
    let mut runs: Vec<(&str, &[Vec<f64>])> = Vec::new();
    if let Some(before) = &found.runs_before {
        runs.push(("as given", before));
    }
    let label = match found.discovery.terms.is_empty() {
        true => "unchanged",
        false => "with the terms",
    };
    runs.push((label, &found.runs));
    runs
}

/// The remaining sections of a discovery.
pub(crate) fn discovery_details(
    report: &mut Report,
    given: &Model,
    records: &[Record],
    found: &Terms,
    worst: Option<Stretch>,
) {
    report.section(&step_by_step(found.discovery.held_out_by.compared()));
    report.table(
        ladder_caption(&found.discovery.ladder),
        &LADDER,
        &ladder_rows(&found.discovery.ladder),
    );
    for term in &found.discovery.terms {
        report.section(&format!("{} by {}", term.changes, term.coordinate));
        report.figure(
            &term_picture(term),
            "The curve was fitted together with all other parameters; it is linear between its points.",
        );
        report.fold("The effect file of this term");
        report.code(&term.file);
        report.end_fold();
    }
    if let Some(separation) = &found.discovery.separation {
        report.section("Experiment that distinguishes the models");
        report.figure(&experiment_picture(separation), &separation.words());
    }
    if let Some(trace) = &found.discovery.trace {
        report_trace(report, trace);
    }
    let runs = discovery_runs(found);
    report_runs(report, records, &runs, None, worst);
    let models = [given, &found.model];
    let first = models.len() - runs.len().min(models.len());
    let tested: Vec<Run<'_>> = runs
        .iter()
        .zip(&models[first..])
        .map(|((label, runs), model)| run(label, model, runs))
        .collect();
    checks(report, records, &tested);
    every_record(report, &found.model, &found.scores);
}

/// The first screen of a page: the answer with a picture, and the interval with the largest error of the
/// first of `runs`.
pub(crate) fn lead(
    report: &mut Report,
    answer: &Answer,
    picture: Option<&Picture>,
    records: &[Record],
    runs: &[(&str, &[Vec<f64>])],
) -> Option<Stretch> {
    let worst = runs
        .first()
        .and_then(|(_, runs)| worst_stretch(records, runs));
    report.columns().cell();
    card(report, answer);
    if let Some(picture) = picture {
        report.figure(picture, "");
    }
    report.end_columns();
    if let Some(worst) = worst {
        stretch_picture(report, records, runs, worst);
    }
    report.end_columns();
    worst
}

/// The page of a law for `model` with its trials.
pub(super) fn law(model: &Model, tried: &Tried, tracks: bool, command: &str) -> String {
    let mut report = Report::new("Control law", &describe(model));
    report.columns();
    card(&mut report, &tried.answer);
    report.figure(
        &proof_picture(&tried.proof, tracks),
        "In the loop with the model as the plant and a noisy sensor.",
    );
    report.end_columns();
    report.section("The law");
    for line in tried.design.words().lines() {
        report.paragraph(line);
    }
    if let Some(margin) = &tried.margin {
        report.section("Robustness margin");
        report.figure(
            &margin_picture(margin),
            "Inside each contour attachment is kept, and the rms error is at most twice that on the model.",
        );
        report.paragraph(&margin.words());
        report.paragraph(
            "The region was found by simulations with fixed seeds, not with a Lyapunov function; \
             it does not prove stability.",
        );
    }
    report.section("Every trial");
    report.table(
        &trial_caption(&tried.proof),
        &TRIALS.map(|(name, is_number)| match is_number {
            true => Column::Number(name),
            false => Column::Text(name),
        }),
        &trial_rows(&tried.proof),
    );
    report.provenance("tool", concat!("host-fit ", env!("CARGO_PKG_VERSION")));
    report.provenance("command", command);
    report.provenance("data", &model.training.data_hash);
    report.html()
}

/// Number of records whose trace is drawn.
const TRACED_RECORDS: usize = 3;

/// The reconstructed signal at the most probable place, record by record.
fn report_trace(report: &mut Report, trace: &Trace) {
    let likeliest = TRACED.iter().enumerate().max_by(|a, b| {
        let odds = |entry: &Entry| trace.odds.get(entry.place().word()).copied().unwrap_or(0.0);
        odds(a.1).total_cmp(&odds(b.1))
    });
    let Some((index, entry)) = likeliest else {
        return;
    };
    report.section("Trace of the unexplained error");
    report.paragraph(&format!(
        "The signal at the {} that would explain the error of the base model. The estimate does not assume on which \
         quantity the signal depends. Compare the signal with others measured on the same day; `--trace trace.csv` \
         writes the signals of all places.",
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
            title: "",
            x_label: "time in record (s)",
            y_label: &format!(
                "{} ({})",
                entry.words().split(" of ").next().unwrap_or_default(),
                entry.unit().symbol()
            ),
            points: &points,
        });
        report.figure(&picture, &format!("{}: {}.", record.name, entry.words()));
    }
}

/// The curve of a term.
pub(super) fn term_picture(term: &FoundTerm) -> Picture {
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
        // The label is shortened, because the axis is short and the heading has the full name.
        y_label: &format!(
            "{} ({})",
            term.changes.split(" of ").next().unwrap_or_default(),
            term.unit
        ),
        points: &points,
    })
}

/// Columns of a ladder's table.
const LADDER: [Column<'_>; 4] = [
    Column::Text("step"),
    Column::Number("RMSE"),
    Column::Number("FIT, %"),
    Column::Number("noise"),
];

fn title(set: &DataSet) -> &str {
    set.title.as_deref().unwrap_or("data set")
}

/// Measurement and free runs, record by record; with `lit`, a click on a bar of [`report_failures`] marks its
/// samples.
pub(crate) fn report_runs(
    report: &mut Report,
    records: &[Record],
    runs: &[(&str, &[Vec<f64>])],
    lit: Option<(&Failures, &[Vec<Stretches>])>,
    view: Option<Stretch>,
) {
    report.section("Record by record");
    let mut living = living(records, runs, lit);
    if let Some(view) = view {
        living.view(view.from, view.to);
    }
    report.living(&living);
}

/// Measurement and free runs of a diagnosis, record by record: the given model, the final one and, switched
/// off at first, the steps between them.
pub(crate) fn report_climb(
    report: &mut Report,
    records: &[Record],
    found: &Finding,
    lit: Option<(&Failures, &[Vec<Stretches>])>,
    view: Option<Stretch>,
) {
    report.section("Record by record");
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
    // The final model is added before the intermediate steps, so that a model has the same colour
    // in every picture.
    let after = found.runs.as_deref();
    runs.extend(after.map(|after| (after_label(found), after)));
    let first = runs.len();
    let shown = steps[skipped..].iter();
    runs.extend(shown.map(|(step, runs)| (*step, runs.as_slice())));
    let between = first..runs.len();
    let mut living = living(records, &runs, lit);
    living.off(between);
    if let Some(view) = view {
        living.view(view.from, view.to);
    }
    report.living(&living);
}

/// Largest number of intermediate steps on a page: at most 5 MB, and six distinguishable lines.
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
    let mut living = Living::new("y", records, runs, role);
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
    let mut columns = vec![
        Column::Text("record"),
        Column::Text("use"),
        Column::Number("FIT, %"),
        Column::Number("ρ"),
        Column::Number("RMSE"),
        Column::Number("noise"),
        Column::Number("ε"),
    ];
    columns.extend(has_envelope(scores).then_some(Column::Number("inside")));
    report.table(
        &format!(
            "Free run against the measurement. FIT, ρ and ε are eqs. (10), (11) and (9) of the paper. ε is the root of a sum \
             over samples, so it is larger for all records together. Noise is the standard error of the measurement.{}",
            match has_envelope(scores) {
                true => " “Inside” is the share of samples that lie within the measurement's envelope, from y_min to y_max.",
                false => "",
            }
        ),
        &columns,
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
        "Each panel splits the same error by one coordinate. The bins have unequal widths (the numbers are their limits), but the \
         bars are drawn equally wide. Click a bar to mark its samples in the records below.",
    );
}

pub(super) fn failures_picture(failures: &Failures) -> Picture {
    host_fit::picture::where_it_fails(&WhereItFails {
        title: &format!("Error of the free run on the {}", failures.kind.records()),
        y_label: "rms error, y",
        views: &failures.views(),
    })
}

/// The sections of a diagnosis that list its steps and candidates.
fn report_candidates(report: &mut Report, found: &Finding) {
    let diagnosis = &found.diagnosis;
    report.section(&step_by_step(diagnosis.held_out_by.compared()));
    report.columns();
    if diagnosis.ladder.len() > 2 {
        report.figure(&ladder_picture(diagnosis), "");
    }
    report.cell().table(
        ladder_caption(&diagnosis.ladder),
        &LADDER,
        &ladder_rows(&diagnosis.ladder),
    );
    report.end_columns().end_columns();
    if !diagnosis.ranking.is_empty() {
        report.section("Candidates");
        let rows = ranking_rows(diagnosis, found.plant);
        if !rows.is_empty() {
            report.figure(
                &ranking_picture(diagnosis, found.plant),
                &candidates_caption(diagnosis),
            );
            report.table(
                "Nats: ln of the Bayes factor of the model with the effect against the model without it. p is \
                 family-wise: it is corrected for all models that were tried. Each candidate is added alone; \
                 for effects of the final model, the fall of the error, and beside others nats and p, are those of the step \
                 that adds them.",
                &[
                    Column::Text("effect"),
                    Column::Text("outcome"),
                    Column::Number("error falls"),
                    Column::Number("nats"),
                    Column::Number("p"),
                    Column::Text("parameters (95 % interval)"),
                ],
                &rows,
            );
        }
        if let Some(screened) = screened_only(diagnosis, found.plant) {
            report.paragraph(&screened);
        }
    }
    if !found.detectable.is_empty() {
        report.section("Detectable effects");
        let lines: Vec<&str> = found.detectable.iter().map(|d| d.words.as_str()).collect();
        report.list(&lines);
    }
    if !diagnosis.not_tried.is_empty() {
        report.section("Not tried");
        let lines: Vec<String> = diagnosis
            .not_tried
            .iter()
            .map(|n| match found.plant {
                Plant::Flow => format!("`{}`: {}", n.effect, n.reason),
                plant => format!("{}: {}", effect_in_words(&n.effect, plant), n.reason),
            })
            .collect();
        report.list(&lines);
    }
}

/// The section with tool, data and command.
pub(crate) fn provenance(report: &mut Report, set: &DataSet, seed: u64, command: &str) {
    report.provenance("tool", concat!("host-fit ", env!("CARGO_PKG_VERSION")));
    report.provenance("command", command);
    report.provenance("seed", &seed.to_string());
    report.provenance("data", &set.hash);
    report.provenance("records", &set.records.len().to_string());
}

/// The user's command line, quoted for a shell.
pub(super) fn command_line() -> String {
    command(&arguments())
}

/// The words of the user's command line after the program.
pub(super) fn arguments() -> Vec<String> {
    let words = std::env::args_os().skip(1);
    words
        .map(|word| word.to_string_lossy().into_owned())
        .collect()
}

/// A command of this program, quoted for a shell.
pub(super) fn command(words: &[String]) -> String {
    let words = words.iter().map(|word| quoted(word));
    let all: Vec<String> = std::iter::once("host-fit".to_owned())
        .chain(words)
        .collect();
    all.join(" ")
}

/// A word of a command, as a shell accepts it.
pub(super) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=./,:+".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}
