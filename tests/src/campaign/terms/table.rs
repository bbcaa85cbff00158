//! The campaign's tables, as Markdown for the docs.

use std::fmt::Write as _;

use firmware_sim::family::Family;

use super::row::{ENOUGH, Row};
use crate::campaign::case::Group;
use crate::campaign::counts::{grouped, item, seconds, share, those};

/// All results.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let of = |group: Group| -> Vec<&Row> {
        let mine = |row: &&Row| row.group == Some(group);
        rows.iter().filter(mine).collect()
    };
    let mut text = String::new();
    let (beyond, single) = (of(Group::Beyond), of(Group::Single));
    if !beyond.is_empty() {
        text += "### Physics that the catalogue lacks\n\n";
        text += &by(&beyond, "hidden", |row| &row.label);
        text += "\n### Physics that the catalogue lacks, by family\n\n";
        text += &by(&beyond, "family", |row| &row.family);
        text += "\n### Physics that the catalogue lacks, by noise\n\n";
        text += &by(&beyond, "noise", |row| &row.circumstances);
    }
    if !single.is_empty() {
        text += "\n### Effects that were taken out of the catalogue\n\n";
        text += &by(&single, "hidden", |row| &row.label);
    }
    let nothing = of(Group::Nothing);
    if !nothing.is_empty() {
        text += "\n### Nothing missing\n\n";
        text += &nulls(&nothing);
    }
    text += "\n### Altogether\n\n";
    text += &totals(&beyond, &single, &nothing);
    let misses: Vec<&Row> = (rows.iter()).filter(|row| !row.is_right()).collect();
    if !misses.is_empty() {
        text += "\n### Not as it should be\n\n";
        for row in misses {
            let taken = row
                .curve_taken
                .map_or(String::new(), |t| format!(", {:.0} % taken", 100.0 * t));
            let _ = writeln!(text, "- `{}`: {}{taken}", row.key, row.said());
        }
    }
    text
}

/// A rig without a finding counts with 0.
fn taken(rows: &[&Row], of: impl Fn(&Row) -> Option<f64>) -> Option<[f64; 2]> {
    let done = rows.iter().filter(|row| row.failure.is_none());
    let mut all: Vec<f64> = done.map(|row| of(row).unwrap_or(0.0)).collect();
    all.sort_by(f64::total_cmp);
    let last = all.len().checked_sub(1)?;
    // The 10 % quantile is exceeded or reached by nine of ten rigs.
    let at = |share: f64| all[(share * last as f64).round() as usize];
    Some([at(0.5), at(0.1)])
}

fn percent(pair: Option<[f64; 2]>) -> String {
    pair.map_or("-".to_owned(), |[median, tenth]| {
        format!("{:.0} / {:.0}", 100.0 * median, 100.0 * tenth)
    })
}

const HEAD: &str = "rigs | place | place in set | coordinate | coordinate in set | curve takes % | formula % | truly % | identify s | discover s |\n";
const RULE: &str = "---|---|---|---|---|---|---|---|---|---|\n";

fn counts(rows: &[&Row]) -> String {
    format!(
        "{} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
        rows.len(),
        share(rows, Row::has_place),
        share(rows, Row::has_place_in_set),
        share(rows, Row::has_coordinate),
        share(rows, Row::has_coordinate_in_set),
        percent(taken(rows, |row| row.curve_taken)),
        percent(taken(rows, |row| row.formula_taken)),
        percent(taken(rows, |row| row.truly_taken)),
        times(rows),
    )
}

/// Two cells: median and longest of identification and search.
fn times(rows: &[&Row]) -> String {
    let done = those(rows, |row| row.failure.is_none());
    let cells = [
        seconds(&done, |row| Some(row.identify.wall_s)),
        seconds(&done, |row| Some(row.discover.wall_s)),
    ];
    cells.join(" | ")
}

fn by(rows: &[&Row], what: &str, of: impl Fn(&Row) -> &str) -> String {
    let mut text = format!("| {what} | {HEAD}|---|{RULE}");
    for (name, own) in grouped(rows, of) {
        let _ = write!(text, "| {name} | {}", counts(&own));
    }
    let _ = write!(text, "| all | {}", counts(rows));
    text
}

fn nulls(rows: &[&Row]) -> String {
    let mut text = "| physics | rigs | a term reported | true anyway | identify s | discover s |\n\
         |---|---|---|---|---|---|\n"
        .to_owned();
    let mut line = |what: &str, own: &[&Row]| {
        let true_ = |row: &Row| !row.terms.is_empty() && !row.is_needless();
        let _ = writeln!(
            text,
            "| {what} | {} | {} | {} | {} |",
            own.len(),
            share(own, |row| row.is_needless()),
            share(own, true_),
            times(own),
        );
    };
    for family in Family::ALL {
        let own = those(rows, |row| row.family == family.name());
        if !own.is_empty() {
            line(&format!("family {}", family.name()), &own);
        }
    }
    for (what, own) in grouped(rows, |row| &row.circumstances) {
        line(what, &own);
    }
    line("all", rows);
    text
}

/// The goals, with Wilson's bounds.
fn totals(beyond: &[&Row], single: &[&Row], nothing: &[&Row]) -> String {
    let mut text = String::new();
    let mut line = |what: &str, rows: &[&Row], test: &dyn Fn(&Row) -> bool| {
        item(&mut text, what, rows, test);
    };
    line("place", beyond, &Row::has_place);
    line("place, or in its set", beyond, &Row::has_place_in_set);
    line("coordinate", beyond, &Row::has_coordinate);
    line(
        "coordinate, or in its set",
        beyond,
        &Row::has_coordinate_in_set,
    );
    let regional = those(beyond, |row| row.regional);
    line("region with F1 of 0.85", &regional, &|row| {
        row.region_f1.is_some_and(|f1| f1 >= 0.85)
    });
    let told = those(&regional, |row| row.base_bias.is_some());
    line("base within 2 % beside a region", &told, &|row| {
        row.base_bias.is_some_and(|bias| bias <= 0.02)
    });
    let enough = format!(
        "taken out of the catalogue: place in its set, and {:.0} % taken",
        100.0 * ENOUGH
    );
    line(&enough, single, &|row| {
        row.has_place_in_set() && row.takes_enough()
    });
    line(
        "taken out of the catalogue: coordinate in its set",
        single,
        &Row::has_coordinate_in_set,
    );
    line(
        "a term reported although nothing is missing",
        nothing,
        &Row::is_needless,
    );
    for (what, of) in [
        ("curve", (|row| row.curve_taken) as fn(&Row) -> Option<f64>),
        ("formula", |row| row.formula_taken),
        ("truly", |row| row.truly_taken),
        ("region, F1", |row| row.region_f1),
    ] {
        let rows = if what.starts_with("region") {
            &regional[..]
        } else {
            beyond
        };
        if let Some(pair) = taken(rows, of) {
            let pair = percent(Some(pair));
            let _ = writeln!(text, "- {what}: median / nine of ten reach, %: {pair}");
        }
    }
    for (what, rows) in [
        ("physics beyond the catalogue", beyond),
        ("taken out of the catalogue", single),
        ("nothing missing", nothing),
    ] {
        if !rows.is_empty() {
            let times = times(rows).replace(" | ", ", ");
            let _ = writeln!(
                text,
                "- median / longest of identify, discover (s), {what}: {times}"
            );
        }
        let failed = rows.iter().filter(|row| row.failure.is_some()).count();
        if failed > 0 {
            let _ = writeln!(text, "- {what}, without an outcome: {failed}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_found_takes_nothing() {
        let row = |taken: Option<f64>| Row {
            curve_taken: taken,
            ..Row::default()
        };
        let mut all: Vec<Row> = (1..=9).map(|i| row(Some(f64::from(i) / 10.0))).collect();
        all.push(row(None));
        all.push(Row {
            failure: Some("stopped".to_owned()),
            ..row(None)
        });
        let rows: Vec<&Row> = all.iter().collect();
        let [median, tenth] = taken(&rows, |row| row.curve_taken).unwrap();
        assert!((median - 0.5).abs() < 1e-12 && (tenth - 0.1).abs() < 1e-12);
    }
}
