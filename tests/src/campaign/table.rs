//! The campaign's tables, as Markdown for the docs.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use firmware_sim::family::Family;

use super::case::Group;
use super::counts::{bounded, grouped, item, seconds, share, those};
use super::row::{AT_FLOOR, Row};

/// All results.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let of = |group: Group| -> Vec<&Row> { rows.iter().filter(|r| r.group == group).collect() };
    let mut text = String::new();
    let single = of(Group::Single);
    if !single.is_empty() {
        text += "### One effect of the catalogue, by family\n\n";
        text += &by_family(&single);
        text += "\n### One effect of the catalogue, by noise and command\n\n";
        text += &by(&single, "noise", |row| &row.circumstances);
        text += "\n### One effect of the catalogue, by effect\n\n";
        text += &by(&single, "hidden", |row| &row.label);
    }
    for (group, title) in [
        (
            Group::Altered,
            "One effect in another law than the catalogue's",
        ),
        (Group::Pair, "Two effects"),
        (Group::Outside, "What the catalogue does not have"),
    ] {
        let rows = of(group);
        if !rows.is_empty() {
            let _ = write!(
                text,
                "\n### {title}\n\n{}",
                by(&rows, "hidden", |row| &row.label)
            );
        }
    }
    let nothing = of(Group::Nothing);
    if !nothing.is_empty() {
        text += "\n### Nothing hidden\n\n";
        text += &nulls(&nothing);
    }
    let units = of(Group::Units);
    if !units.is_empty() {
        text += "\n### The same rig in other units\n\n";
        text += &twins(&units);
    }
    text += "\n### Altogether\n\n";
    text += &totals(rows);
    let misses: Vec<&Row> = (rows.iter()).filter(|row| !row.is_right()).collect();
    if !misses.is_empty() {
        text += "\n### Not as it should be\n\n";
        for row in misses {
            let over = row
                .over_floor
                .map_or(String::new(), |o| format!(", {o:.2} x floor"));
            let off: Vec<String> = (row.parameters.iter().filter(|p| !p.is_near()))
                .map(|p| format!(", {} {:.4} instead of {:.4}", p.name, p.found, p.truth))
                .collect();
            let off = off.concat();
            let _ = writeln!(text, "- `{}`: {}{over}{off}", row.key, row.said());
        }
    }
    text
}

fn parameters(rows: &[&Row]) -> String {
    let compared = those(rows, |row| row.parameters_hit().is_some());
    share(&compared, |row| row.parameters_hit() == Some(true))
}

/// Four cells: wall and processor times of both programs.
fn times(rows: &[&Row]) -> String {
    let done = those(rows, |row| row.failure.is_none());
    let cells = [
        seconds(&done, |row| Some(row.identify.wall_s)),
        seconds(&done, |row| row.identify.cpu_s),
        seconds(&done, |row| Some(row.diagnose.wall_s)),
        seconds(&done, |row| row.diagnose.cpu_s),
    ];
    cells.join(" | ")
}

const HEAD: &str = "rigs | first | in its set | at floor | needless | parameters | identify s | CPU s | diagnose s | CPU s |\n";
const RULE: &str = "---|---|---|---|---|---|---|---|---|---|\n";

fn counts(rows: &[&Row]) -> String {
    format!(
        "{} | {} | {} | {} | {} | {} | {} |\n",
        rows.len(),
        share(rows, Row::is_found),
        share(rows, Row::is_in_set),
        share(rows, Row::is_at_floor),
        share(rows, |row| !row.needless().is_empty()),
        parameters(rows),
        times(rows),
    )
}

fn by_family(rows: &[&Row]) -> String {
    let mut text = format!("| family | {HEAD}|---|{RULE}");
    for family in Family::ALL {
        let own = those(rows, |row| row.family == family.name());
        if !own.is_empty() {
            let _ = write!(text, "| {} | {}", family.name(), counts(&own));
        }
    }
    let _ = write!(text, "| all | {}", counts(rows));
    text
}

fn by(rows: &[&Row], what: &str, of: impl Fn(&Row) -> &str) -> String {
    let mut text = format!("| {what} | {HEAD}|---|{RULE}");
    for (name, own) in grouped(rows, of) {
        let _ = write!(text, "| {name} | {}", counts(&own));
    }
    text
}

fn nulls(rows: &[&Row]) -> String {
    let mut groups: BTreeMap<(usize, String), Vec<&Row>> = BTreeMap::new();
    for row in rows {
        let family = format!("family {}", row.family);
        groups.entry((0, family)).or_default().push(row);
        let circumstances = row.circumstances.clone();
        groups.entry((1, circumstances)).or_default().push(row);
    }
    let mut text =
        "| what there is | rigs | something named | at floor | identify s | CPU s | diagnose s | CPU s |\n\
         |---|---|---|---|---|---|---|---|\n"
            .to_owned();
    let mut line = |what: &str, own: &[&Row]| {
        let _ = writeln!(
            text,
            "| {what} | {} | {} | {} | {} |",
            own.len(),
            share(own, |row| !row.named().is_empty()),
            share(own, Row::is_at_floor),
            times(own),
        );
    };
    for ((_, what), own) in &groups {
        line(what, own);
    }
    line("all", rows);
    text
}

/// Copies of a rig in other units, by the key without the units.
fn rigs<'a>(rows: &[&'a Row]) -> BTreeMap<String, Vec<&'a Row>> {
    let mut rigs: BTreeMap<String, Vec<&Row>> = BTreeMap::new();
    for row in rows {
        let parts = row.key.split('/').filter(|part| !part.starts_with("t*"));
        let rig: Vec<&str> = parts.collect();
        rigs.entry(rig.join("/")).or_default().push(row);
    }
    rigs
}

/// Whether all copies have the same verdict.
fn agree(twins: &[&Row]) -> bool {
    let said: BTreeSet<_> = twins.iter().map(|r| (&r.verdict, &r.missing)).collect();
    said.len() == 1
}

fn twins(rows: &[&Row]) -> String {
    let mut text =
        "| rig | written down | the same said | parameters | what |\n|---|---|---|---|---|\n"
            .to_owned();
    for (rig, twins) in rigs(rows) {
        let said: BTreeSet<String> = twins.iter().map(|row| row.said()).collect();
        let said: Vec<String> = said.into_iter().collect();
        let _ = writeln!(
            text,
            "| `{rig}` | {} | {} | {} | {} |",
            twins.len(),
            if agree(&twins) { "yes" } else { "no" },
            parameters(&twins),
            said.join("; ")
        );
    }
    text
}

fn totals(rows: &[Row]) -> String {
    let of = |groups: &[Group]| -> Vec<&Row> {
        let mine = |row: &&Row| groups.contains(&row.group);
        rows.iter().filter(mine).collect()
    };
    let mut text = String::new();
    let mut line = |what: &str, rows: &[&Row], test: &dyn Fn(&Row) -> bool| {
        item(&mut text, what, rows, test);
    };
    let single = of(&[Group::Single]);
    line("hidden effect first", &single, &Row::is_found);
    line(
        "first, or in the set that is stated",
        &single,
        &Row::is_in_set,
    );
    let floor = format!("validation error at most {AT_FLOOR} x the noise level");
    line(&floor, &single, &Row::is_at_floor);
    line("needless effects named", &single, &|row| {
        !row.needless().is_empty()
    });
    let compared: Vec<&Row> = (single.iter().copied())
        .filter(|row| row.parameters_hit().is_some())
        .collect();
    line("parameters within 20 %", &compared, &|row| {
        row.parameters_hit() == Some(true)
    });
    let altered = of(&[Group::Altered]);
    line(
        "in another law: the nearest effect first",
        &altered,
        &Row::is_found,
    );
    line("in another law: needless effects named", &altered, &|row| {
        !row.needless().is_empty()
    });
    let pairs = of(&[Group::Pair]);
    line("both effects of a pair", &pairs, &Row::is_found);
    line("pairs: needless effects named", &pairs, &|row| {
        !row.needless().is_empty()
    });
    line(
        "named although nothing is hidden",
        &of(&[Group::Nothing]),
        &|row| !row.named().is_empty(),
    );
    line(
        "outside the catalogue: nothing named, something left",
        &of(&[Group::Outside]),
        &Row::is_found,
    );
    let units = of(&[Group::Units]);
    let rigs = rigs(&units);
    if !rigs.is_empty() {
        let same = rigs.values().filter(|twins| agree(twins)).count();
        let same = bounded(same, rigs.len());
        let _ = writeln!(text, "- the same said in all units: {same}");
    }
    let mut line = |what: &str, rows: &[&Row]| {
        let longest = |of: fn(&Row) -> f64| rows.iter().map(|row| of(row)).fold(0.0, f64::max);
        if !rows.is_empty() {
            let _ = writeln!(
                text,
                "- median / longest of identify, its CPU, diagnose, its CPU (s), {what}: {}; both together at most {:.0}",
                times(rows).replace(" | ", ", "),
                longest(|row| row.identify.wall_s + row.diagnose.wall_s)
            );
        }
    };
    line("nothing hidden", &of(&[Group::Nothing]));
    line(
        "one effect",
        &of(&[Group::Single, Group::Altered, Group::Units]),
    );
    line("two effects", &of(&[Group::Pair]));
    let failed = rows.iter().filter(|row| row.failure.is_some()).count();
    if failed > 0 {
        let _ = writeln!(text, "- without a diagnosis: {failed} of {}", rows.len());
    }
    text
}
