//! The campaign's table, as Markdown for the docs.

use std::fmt::Write as _;

use super::row::Row;
use crate::campaign::counts::{grouped, item, share, those};

/// A model counts as at the noise level up to this ratio.
const AT_THE_NOISE: f64 = 1.05;

/// The results by published model.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let all: Vec<&Row> = rows.iter().collect();
    let models = grouped(&all, |row| &row.model);
    let mut text = "| model | named first | in its set | first surrogate | wrong name | nulls with a wrong name | given / noise | best / noise | at the noise | CPU s |\n\
                    |---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    let lines = models.iter().map(|(name, own)| (*name, own));
    for (name, own) in lines.chain([("all", &all)]) {
        let _ = writeln!(text, "| {name} | {} |", cells(own).join(" | "));
    }
    text += "\nColumns with two numbers: median / largest.\n\n";
    let effects = those(&all, |row| !row.is_null());
    let nulls = those(&all, Row::is_null);
    let mut line = |what: &str, of: &[&Row], test: &dyn Fn(&Row) -> bool| {
        item(&mut text, what, of, test);
    };
    line("named, in the set or first surrogate", &effects, &|row| {
        row.is_named_first() || row.is_in_set() || row.is_first_surrogate()
    });
    line("wrong name", &all, &Row::has_wrong_name);
    line("nulls with a wrong name", &nulls, &Row::has_wrong_name);
    line("without a verdict", &all, &|row| row.failure.is_some());
    let mut explained: Vec<f64> = rows.iter().filter_map(Row::explained).collect();
    explained.sort_by(f64::total_cmp);
    if let Some(last) = explained.len().checked_sub(1) {
        let at = |share: f64| 100.0 * explained[(share * last as f64).round() as usize];
        let _ = writeln!(
            text,
            "- unexplained variance of the given model that is explained: median {:.0} %, nine of ten reach {:.0} %",
            at(0.5),
            at(0.1)
        );
    }
    text += "\n| case | says | given / noise | best / noise | CPU s |\n|---|---|---|---|---|\n";
    for row in rows {
        let over = |over: Option<f64>| over.map_or("-".to_owned(), |over| format!("{over:.3}"));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {:.0} |",
            row.key,
            row.said(),
            over(row.given_over_noise),
            over(row.over_noise),
            row.diagnose.cpu_s.unwrap_or(row.diagnose.wall_s),
        );
    }
    text
}

fn cells(rows: &[&Row]) -> Vec<String> {
    let effects = those(rows, |row| !row.is_null());
    let nulls = those(rows, Row::is_null);
    let spread = |of: &dyn Fn(&Row) -> Option<f64>, digits: usize| {
        let mut all: Vec<f64> = rows.iter().filter_map(|row| of(row)).collect();
        all.sort_by(f64::total_cmp);
        match (all.get(all.len() / 2), all.last()) {
            (Some(median), Some(largest)) => format!("{median:.digits$} / {largest:.digits$}"),
            _ => "-".to_owned(),
        }
    };
    vec![
        share(&effects, Row::is_named_first),
        share(&effects, Row::is_in_set),
        share(&effects, Row::is_first_surrogate),
        share(rows, Row::has_wrong_name),
        share(&nulls, Row::has_wrong_name),
        spread(&|row| row.given_over_noise, 2),
        spread(&|row| row.over_noise, 2),
        share(rows, |row| {
            row.over_noise.is_some_and(|over| over <= AT_THE_NOISE)
        }),
        spread(&|row| row.diagnose.cpu_s, 0),
    ]
}
