//! Indicators as text, as JSON and as pictures: what several commands show.

use std::fmt::Write as _;

use host_fit::data::{Record, Use};
use host_fit::indicators::{Indicators, Scores};
use host_fit::model::{Delay, Model, TransportLaw};
use host_fit::picture::{Column, Overlay, Report, Run, overlay, significant};
use model_core::effect::Unit;

/// `identify` or `validate`.
pub(crate) fn role_name(role: Use) -> &'static str {
    match role {
        Use::Identify => "identify",
        Use::Validate => "validate",
    }
}

/// The model in a few words: its structure, delays and effects.
pub(crate) fn describe(model: &Model) -> String {
    let delay = match &model.delay {
        Delay::Fixed { delays } => format!("fixed delay {delays:?} samples"),
        Delay::Law(law) => format!("delay {}", law_in_words(law)),
    };
    let kind = if model.averaging.averaged_model {
        "averaged model"
    } else {
        "model"
    };
    let mut text = format!(
        "{kind} N1 = {}, N2 = {}, N3 = {}; {delay}",
        model.state_lags.len(),
        model.product_lags.len(),
        model.inputs()
    );
    if !model.effects.is_empty() {
        let names: Vec<&str> = model.effects.iter().map(|e| e.name.as_str()).collect();
        let _ = write!(text, "; with {}", names.join(", "));
    }
    text
}

/// The law with its values: times in ms, everything else in its unit.
fn law_in_words(law: &TransportLaw) -> String {
    let mut words = law
        .spec
        .law
        .map_or(law.spec.name, |card| card.words)
        .to_owned();
    for (parameter, value) in law.spec.parameters.iter().zip(&law.parameters) {
        let value = match parameter.unit {
            Unit::Second => format!("{} ms", significant(1e3 * value, 3)),
            _ => significant(*value, 4),
        };
        words = words.replacen("{}", &value, 1);
    }
    words
}

const HEAD: [&str; 8] = [
    "record", "use", "FIT %", "rho", "RMSE", "noise", "epsilon", "inside",
];

fn row(i: &Indicators) -> [String; 8] {
    // A free run that diverged has no numbers.
    let number = |value: f64, digits: usize| {
        if value.is_finite() {
            format!("{value:.digits$}")
        } else {
            "–".to_owned()
        }
    };
    [
        i.name.clone(),
        role_name(i.role).to_owned(),
        number(i.fit_percent, 2),
        number(i.correlation, 4),
        number(i.rmse, 5),
        i.noise_rmse
            .map_or_else(|| "–".into(), |n| format!("{n:.5}")),
        number(i.epsilon, 4),
        i.inside_envelope
            .map_or_else(|| "–".into(), |f| format!("{:.1} %", 100.0 * f)),
    ]
}

fn rows(scores: &Scores) -> Vec<[String; 8]> {
    let mut all: Vec<[String; 8]> = scores.records.iter().map(row).collect();
    for together in [&scores.identify, &scores.validate].into_iter().flatten() {
        let mut together = row(together);
        together[0] = "together".into();
        all.push(together);
    }
    all
}

/// The indicators as an aligned table.
pub(crate) fn table(scores: &Scores) -> String {
    let rows: Vec<Vec<String>> = rows(scores).into_iter().map(Vec::from).collect();
    aligned(&HEAD, &rows, 2)
}

/// Rows under a head, the first `left` columns left-aligned, the others right-aligned.
pub(crate) fn aligned(head: &[&str], rows: &[Vec<String>], left: usize) -> String {
    let width = |column: usize| {
        rows.iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count())
            .chain(head.get(column).map(|cell| cell.chars().count()))
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let line = |cells: &[String]| {
        let padded = cells.iter().zip(&widths).enumerate();
        let text: Vec<String> = padded
            .map(|(column, (cell, width))| {
                if column < left {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            })
            .collect();
        text.join("  ").trim_end().to_owned()
    };
    let head: Vec<String> = head.iter().map(|cell| (*cell).to_owned()).collect();
    let mut text = line(&head);
    for row in rows {
        text.push('\n');
        text.push_str(&line(row));
    }
    text
}

/// The indicators as a table of a report.
pub(crate) fn report_table(report: &mut Report, scores: &Scores) {
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
        &rows(scores).into_iter().map(Vec::from).collect::<Vec<_>>(),
    );
}

/// One picture per record: measurement and free runs, labelled.
pub(crate) fn overlays(records: &[Record], runs: &[(&str, &[Vec<f64>])]) -> Vec<(String, String)> {
    let picture = |(index, record): (usize, &Record)| {
        let models: Vec<Run<'_>> = runs
            .iter()
            .filter_map(|(label, runs)| {
                let y = runs.get(index)?;
                Some(Run { label, y })
            })
            .collect();
        let title = format!("{} ({})", record.name, role_name(record.role));
        let svg = overlay(&Overlay {
            title: &title,
            y_label: "friction gain y",
            sample_period_s: record.sample_period_s,
            t0_s: record.t0,
            u: &record.u,
            y: &record.y,
            y_sd: record.y_sd.as_deref(),
            y_min: record.y_min.as_deref(),
            y_max: record.y_max.as_deref(),
            models: &models,
            window_s: None,
        });
        (record.name.clone(), svg)
    };
    records.iter().enumerate().map(picture).collect()
}

/// A number with three significant digits, for text.
pub(crate) fn short(value: f64) -> String {
    significant(value, 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_whatever_the_letters() {
        let rows = [
            vec!["ρ-set".to_owned(), "1.0".to_owned()],
            vec!["b".to_owned(), "–".to_owned()],
        ];
        let text = aligned(&["name", "value"], &rows, 1);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines, ["name   value", "ρ-set    1.0", "b          –"]);
    }
}
