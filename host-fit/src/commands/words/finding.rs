//! A diagnosis in words.

use super::{Words, aligned, lines, short};
use host_fit::diagnose::{ParameterEstimate, Ranked, Rung};
use host_fit::residual::Failures;
use host_fit::steps::{Finding, Terms};

impl Words for Finding {
    fn words(&self) -> String {
        let mut told = vec![self.headline.clone(), self.meaning.clone()];
        told.extend(self.failures.iter().flat_map(Failures::describe));
        told.extend(self.unstable.clone());
        told.extend(self.detectable.iter().map(|d| format!("  {}", d.words)));
        told.push(format!("\n{}", ladder_table(&self.diagnosis.ladder)));
        if !self.diagnosis.ranking.is_empty() {
            told.push(format!("\n{}", ranking_table(&self.diagnosis.ranking)));
        }
        if !self.diagnosis.not_tried.is_empty() {
            told.push("\nnot tried".to_owned());
            let each = self.diagnosis.not_tried.iter();
            told.extend(each.map(|entry| format!("  {}: {}", entry.effect, entry.reason)));
        }
        lines(told)
    }
}

impl Words for Terms {
    fn words(&self) -> String {
        let mut told = vec![self.headline.clone(), self.meaning.clone()];
        told.push(format!("\n{}", ladder_table(&self.discovery.ladder)));
        for term in &self.discovery.terms {
            let head = [
                format!("{} ({})", term.coordinate, term.coordinate_unit),
                format!("{} ({})", term.changes, term.unit),
                "95 % band".to_owned(),
            ];
            let rows = term.curve.iter().map(|point| {
                vec![
                    short(point.x),
                    short(point.value),
                    format!("{} … {}", short(point.low), short(point.high)),
                ]
            });
            let rows: Vec<Vec<String>> = rows.collect();
            told.push(format!(
                "\n{}",
                aligned(&head.each_ref().map(String::as_str), &rows, 0)
            ));
        }
        lines(told)
    }
}

pub(in super::super) fn ladder_rows(ladder: &[Rung]) -> Vec<Vec<String>> {
    let row = |rung: &Rung| {
        vec![
            rung.step.clone(),
            format!("{:.5}", rung.validate_rmse),
            format!("{:.2}", rung.validate_fit_percent),
            rung.noise_rmse
                .map_or_else(|| "–".into(), |noise| format!("{noise:.5}")),
        ]
    };
    ladder.iter().map(row).collect()
}

/// The ladder of held-out errors as an aligned table.
pub(crate) fn ladder_table(ladder: &[Rung]) -> String {
    let head = ["held-out error, step by step", "RMSE", "FIT %", "noise"];
    aligned(&head, &ladder_rows(ladder), 1)
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

pub(in super::super) fn ranking_rows(ranked: &[Ranked]) -> Vec<Vec<String>> {
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
            format!("{:.1} %", r.by_chance_percent),
            format!("{:.3}", r.p_value),
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
