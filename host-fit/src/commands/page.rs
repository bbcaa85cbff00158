//! Results as pages.

use host_fit::data::{DataSet, Record};
use host_fit::diagnose::Verdict;
use host_fit::indicators::Scores;
use host_fit::model::Model;
use host_fit::picture::{
    BandPoint, Candidate, Column, CurvePlot, KeyNumber, Ranking, Report, Tone, WhereItFails, curve,
    ranking,
};
use host_fit::residual::Failures;
use host_fit::steps::{Comparison, Finding, Terms};

use super::drawings::{ladder_picture, overlays};
use super::words::{describe, ladder_rows, ranking_rows, score_rows, short};

/// The page of a comparison.
pub(crate) fn comparison(model: &Model, set: &DataSet, found: &Comparison) -> String {
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
    report_failures(&mut report, &found.failures);
    report.section("Record by record");
    report_runs(
        &mut report,
        &model.targets(&set.records),
        &[("model", &found.runs)],
    );
    provenance(&mut report, set);
    report.html()
}

/// The page of a diagnosis of `given`.
pub(crate) fn finding(given: &Model, set: &DataSet, found: &Finding) -> String {
    let mut report = Report::new("Diagnosis", title(set));
    report_finding(&mut report, set, found);
    // A model whose free run diverges has neither scores nor pictures.
    if let (Some(failures), Some(runs)) = (&found.failures, &found.runs) {
        report_failures(&mut report, failures);
        report.section("The model with what was missing");
        report.paragraph(&describe(&found.model));
        report_scores(&mut report, &found.scores);
        let mut all: Vec<(&str, &[Vec<f64>])> = Vec::new();
        if let Some(before) = &found.runs_before {
            all.push(("as given", before));
        }
        all.push(("with what was missing", runs));
        report_runs(&mut report, &given.targets(&set.records), &all);
    }
    provenance(&mut report, set);
    report.html()
}

/// The page of a discovery beside `given`.
pub(crate) fn discovery(given: &Model, set: &DataSet, found: &Terms) -> String {
    let mut report = Report::new("Discovery", title(set));
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
        let plot = CurvePlot {
            title: "",
            x_label: &format!("{} ({})", term.coordinate, term.coordinate_unit),
            y_label: &format!("{} ({})", term.changes, term.unit),
            points: &points,
            ..CurvePlot::default()
        };
        report.figure(
            &curve(&plot),
            "The curve that was fitted with everything else, in straight lines between its points.",
        );
        report.paragraph("The effect file that the term makes:");
        report.code(&term.file);
    }
    report.section("The model with the terms");
    report.paragraph(&describe(&found.model));
    report_scores(&mut report, &found.scores);
    let mut all: Vec<(&str, &[Vec<f64>])> = Vec::new();
    if let Some(before) = &found.runs_before {
        all.push(("as given", before));
    }
    all.push(("with the terms", &found.runs));
    report_runs(&mut report, &given.targets(&set.records), &all);
    provenance(&mut report, set);
    report.html()
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

/// Measurement and free runs, record by record.
pub(crate) fn report_runs(report: &mut Report, records: &[Record], runs: &[(&str, &[Vec<f64>])]) {
    for (_, svg) in overlays(records, runs) {
        report.figure(&svg, "");
    }
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
    let plot = WhereItFails {
        title: "Error of the free run on the held-out records",
        y_label: "rms error, y",
        views: &failures.views(),
    };
    report.figure(
        &host_fit::picture::where_it_fails(&plot),
        "Each panel splits the same error by one coordinate.",
    );
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

/// What a page was made from.
pub(crate) fn provenance(report: &mut Report, set: &DataSet) {
    report.provenance("tool", concat!("host-fit ", env!("CARGO_PKG_VERSION")));
    report.provenance("data", &set.hash);
    report.provenance("records", &set.records.len().to_string());
}
