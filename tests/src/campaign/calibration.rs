//! Error rates, coverage and power of the diagnosis, as a page of the docs.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::case::Group;
use super::counts::{bounded, grouped, those};
use super::row::{Found, Row};

/// The page, from the rows of the campaign with this seed.
#[must_use]
pub fn calibration(seed: u64, rows: &[Row]) -> String {
    let mut text = format!(
        "# Calibration: error rates of the diagnosis\n\n\
         Written by `cargo xtask calibrate` from {} simulated rigs of seed {seed} ([rigs.md](rigs.md)). Each rig was \
         identified and diagnosed with the default options. Bounds are Wilson's, with 95 % confidence. \"Altered \
         equations\": the hidden effect obeys another equation than that of the catalogue. The method: \
         [hidden-effects.md](hidden-effects.md).\n\n| | reached | goal |\n|---|---|---|\n",
        rows.len()
    );
    let of = |group: Group| -> Vec<&Row> {
        let done = rows.iter().filter(|row| row.failure.is_none());
        done.filter(|row| row.group == group).collect()
    };
    let (nothing, exact, altered) = (of(Group::Nothing), of(Group::Single), of(Group::Altered));
    let mut line = |what: &str, reached: Option<String>, goal: &str| {
        let reached = reached.unwrap_or_else(|| "not measured".to_owned());
        let _ = writeln!(text, "| {what} | {reached} | {goal} |");
    };
    line(
        "an effect is named although nothing is missing",
        share(&nothing, |row| !row.named().is_empty()),
        "≤ 3 % of ≥ 300",
    );
    line(
        "verdict `unexplained` or `partly-explained` although nothing is missing",
        share(&nothing, |row| {
            matches!(row.verdict.as_str(), "unexplained" | "partly-explained")
        }),
        "–",
    );
    for (what, rows, inside, wrong) in [
        ("exact equations", &exact, "≥ 97 %", "≤ 1 %"),
        ("altered equations", &altered, "≥ 95 %", "≤ 5 %"),
    ] {
        let named = those(rows, |row| !row.missing.is_empty());
        line(
            &format!(
                "the true effect is in a stated equivalence set, where an effect is named, {what}"
            ),
            share(&named, Row::is_in_set),
            inside,
        );
        let sizes = named.iter().flat_map(|row| &row.sets).map(Vec::len);
        line(
            &format!("median size of the equivalence sets, {what}"),
            median(sizes.collect()).map(|size| size.to_string()),
            if what == "exact equations" {
                "1"
            } else {
                "≤ 2"
            },
        );
        line(
            &format!("a wrong effect is named, and the true one is not in its set, {what}"),
            share(rows, |row| !row.wrong_alone().is_empty()),
            wrong,
        );
    }
    line(
        "an effect is missing, and none or only surrogates are reported, exact equations",
        share(&exact, |row| row.missing.is_empty()),
        "–",
    );
    let with_effect: Vec<&Row> = exact.iter().chain(&altered).copied().collect();
    line(
        "a needless additional effect is named",
        share(&with_effect, |row| !row.needless().is_empty()),
        "≤ 5 % of runs",
    );
    let put_in = of(Group::Power);
    let seen = those(&put_in, |row| {
        let put_in = row.put_in.as_ref();
        put_in.is_some_and(|put_in| put_in.amplitude.is_some())
    });
    line(
        "effects of the size stated as detectable with 80 % power: named",
        share(&seen, Row::is_found),
        "70–90 %",
    );
    // Edge-dependent delays or a drift are true effects of the rig; a state-dependent delay belongs to the base. If
    // such a true effect is named, p belongs to it.
    let in_the_base = |row: &&&Row| {
        let mut others = row.also_right.iter();
        let truly_named = !row.missing.is_empty() && row.named().is_empty();
        others.all(|name| name == "state-dependent-delay") && !truly_named
    };
    let bare: Vec<&Row> = nothing.iter().filter(in_the_base).copied().collect();
    line(
        "family-wise p ≤ 0.05 although nothing is missing",
        share(&bare, |row| row.p_value.is_some_and(|p| p <= 0.05)),
        "3–7 %",
    );
    let mut kinds: BTreeMap<&str, Vec<&Found>> = BTreeMap::new();
    let stated = exact.iter().flat_map(|row| &row.parameters);
    for found in stated.filter(|found| found.interval.is_some()) {
        kinds.entry(found.kind()).or_default().push(found);
    }
    for (kind, all) in &kinds {
        let covered = all.iter().filter(|found| found.is_covered() == Some(true));
        line(
            &format!("95 % intervals that contain the true value, {kind}"),
            Some(bounded(covered.count(), all.len())),
            "92–97 %",
        );
    }
    if !seen.is_empty() {
        text += "\n## Effects of the size stated as detectable\n\n| effect | named | otherwise reported |\n|---|---|---|\n";
        for (effect, rows) in &grouped(&seen, |row| &row.label) {
            let named = rows.iter().filter(|row| row.is_found()).count();
            let others = rows
                .iter()
                .filter(|row| !row.is_found())
                .map(|row| row.said());
            let others: Vec<String> = others.collect();
            let _ = writeln!(
                text,
                "| {effect} | {named} of {} | {} |",
                rows.len(),
                others.join("; ")
            );
        }
    }
    let failed = rows.iter().filter(|row| row.failure.is_some());
    let failed: Vec<&Row> = failed.collect();
    if !failed.is_empty() {
        text += "\n## Cases without a verdict\n\n";
        for row in failed {
            let _ = writeln!(text, "- `{}`: {}", row.key, row.said());
        }
    }
    text
}

fn share(rows: &[&Row], test: impl Fn(&Row) -> bool) -> Option<String> {
    let hits = rows.iter().filter(|row| test(row)).count();
    (!rows.is_empty()).then(|| bounded(hits, rows.len()))
}

fn median(mut sizes: Vec<usize>) -> Option<usize> {
    sizes.sort_unstable();
    sizes.get(sizes.len() / 2).copied()
}
