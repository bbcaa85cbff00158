//! The results as a Markdown table with the problems below, and as JSON.

use super::Row;
use crate::campaign::bounded;
use serde_json::{Value, json as value};
use std::fmt::Write;

/// A table of all cases, followed by the problems and the skipped cases.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "| set | case | scored | FOPDT % | SOPDT % | ARX % | ours % | model | edges | verdict | s | |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let fit = |fit: Option<f64>| fit.map_or("–".to_owned(), |fit| format!("{fit:.1}"));
        let judged = match (&*row.judged, row.fit_percent) {
            ("identify", Some(fit)) => format!("{fit:.1} (own)"),
            (_, found) => fit(found),
        };
        let scored = match row.samples {
            0 => "–".to_owned(),
            samples => format!("{} of {samples}", row.scored),
        };
        let verdict = match (&row.verdict, row.names.is_empty()) {
            (None, _) => "–".to_owned(),
            (Some(verdict), true) => verdict.clone(),
            (Some(verdict), false) => format!("{verdict}: {}", row.names.join(", ")),
        };
        let mark = match (row.is_right(), &row.skipped) {
            (_, Some(_)) => "skipped",
            (true, _) => "right",
            (false, _) => "**wrong**",
        };
        let edges = row
            .edge_delay_samples
            .map_or("–".to_owned(), |d| format!("{d:.1}"));
        let _ = writeln!(
            text,
            "| {} | {} | {scored} | {} | {} | {} | {judged} | {} | {edges} | {verdict} | {:.1} | {mark} |",
            row.set,
            row.case,
            fit(row.baselines.fopdt),
            fit(row.baselines.sopdt),
            fit(row.baselines.arx),
            row.structure,
            row.seconds,
        );
    }
    let ran = rows.iter().filter(|row| row.skipped.is_none()).count();
    let right = rows.iter().filter(|row| row.is_right()).count();
    let _ = writeln!(text, "\n{right} of {ran} cases are right.");
    for row in rows {
        if let Some(reason) = &row.skipped {
            let _ = writeln!(text, "- {} {}: skipped, {reason}", row.set, row.case);
        }
        for reason in &row.wrong {
            let _ = writeln!(text, "- {} {}: {reason}", row.set, row.case);
        }
    }
    text
}

/// The shares of correct cases by kind, followed by the problems.
#[must_use]
pub fn by_kind(rows: &[Row]) -> String {
    let mut kinds: Vec<(&str, Vec<&Row>)> = Vec::new();
    for row in rows {
        match kinds.iter_mut().find(|(kind, _)| *kind == row.kind) {
            Some((_, own)) => own.push(row),
            None => kinds.push((&row.kind, vec![row])),
        }
    }
    kinds.push(("all", rows.iter().collect()));
    let mut text = String::from("| records | right | longest, s |\n|---|---|---|\n");
    for (kind, own) in kinds.iter().filter(|(_, own)| !own.is_empty()) {
        let right = own.iter().filter(|row| row.is_right()).count();
        let longest = own.iter().map(|row| row.seconds).fold(0.0, f64::max);
        let right = bounded(right, own.len());
        let _ = writeln!(text, "| {kind} | {right} | {longest:.1} |");
    }
    text.push('\n');
    for row in rows {
        let reasons = row.skipped.iter().chain(&row.wrong);
        for reason in reasons {
            let _ = writeln!(text, "- {}: {reason}", row.set);
        }
    }
    text
}

/// All results as one document with the numbers of run and correct cases.
#[must_use]
pub fn json(rows: &[Row]) -> Value {
    value!({
        "rows": rows,
        "ran": rows.iter().filter(|row| row.skipped.is_none()).count(),
        "right": rows.iter().filter(|row| row.is_right()).count(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_says_what_is_wrong() {
        let good = Row {
            set: "a".to_owned(),
            case: "one".to_owned(),
            samples: 100,
            scored: 90,
            judged: "identify".to_owned(),
            fit_percent: Some(98.76),
            ..Row::default()
        };
        let bad = Row {
            wrong: vec!["verdict unexplained".to_owned()],
            case: "two".to_owned(),
            judged: "validate".to_owned(),
            ..good.clone()
        };
        let skipped = Row {
            skipped: Some("x.csv is not there".to_owned()),
            ..Row::default()
        };
        let rows = [good, bad, skipped];
        let text = table(&rows);
        assert!(
            text.contains("| a | one | 90 of 100 | – | – | – | 98.8 (own) |"),
            "{text}"
        );
        assert!(text.contains("1 of 2 cases are right."), "{text}");
        assert!(text.contains("- a two: verdict unexplained"), "{text}");
        assert_eq!(json(&rows)["right"], 1);
    }

    #[test]
    fn kinds_are_counted_in_the_order_of_their_first_case() {
        let row = |set: &str, kind: &str, wrong: &[&str]| Row {
            set: set.to_owned(),
            kind: kind.to_owned(),
            wrong: wrong.iter().map(|reason| (*reason).to_owned()).collect(),
            seconds: 1.25,
            ..Row::default()
        };
        let rows = [
            row("000-b", "b", &[]),
            row("001-a", "a", &["verdict unexplained"]),
            row("002-b", "b", &[]),
        ];
        let text = by_kind(&rows);
        let begins: Vec<&str> = text
            .lines()
            .skip(2)
            .filter_map(|line| line.split(" (").next())
            .collect();
        assert_eq!(
            begins,
            [
                "| b | 2 of 2",
                "| a | 0 of 1",
                "| all | 2 of 3",
                "",
                "- 001-a: verdict unexplained"
            ]
        );
    }
}
