//! Runs the hidden-terms campaign and prints its tables as Markdown.

use clap::Parser;
use scenarios::campaign::terms::{Row, Sizes, cases, run, table};
use scenarios::campaign::{Case, Group, Ledger};

/// The search for unknown terms on rigs with physics that the catalogue lacks, with effects that were removed from
/// the catalogue, and without a missing effect.
///
/// The result of each rig is one line of a file. A stopped campaign continues there, and parts of it can run one
/// after the other. Results belong to one version of the program: use a new file for a new version.
#[derive(Debug, Parser)]
#[command(name = "hidden-terms")]
struct Arguments {
    #[command(flatten)]
    ledger: Ledger,
    /// Rigs for each physics and each family.
    #[arg(long, default_value_t = 1)]
    draws: u64,
    /// Rigs for each effect that is removed from the catalogue.
    #[arg(long, default_value_t = 1)]
    without: u64,
    /// Rigs with nothing missing, over all families, noises and nuisances.
    #[arg(long, default_value_t = 60)]
    nulls: u64,
    /// Number of terms to search.
    #[arg(long, default_value_t = 1)]
    terms: u32,
    /// Only this group: beyond, single, nothing.
    #[arg(long, value_parser = group)]
    group: Option<Group>,
}

fn group(word: &str) -> Result<Group, String> {
    let all = [Group::Beyond, Group::Single, Group::Nothing];
    let found = all.into_iter().find(|group| group.word() == word);
    found.ok_or_else(|| "one of beyond, single, nothing is needed".to_owned())
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let sizes = Sizes {
        draws: arguments.draws,
        without: arguments.without,
        nulls: arguments.nulls,
    };
    let wanted: Vec<Case> = cases(&sizes, arguments.ledger.seed)
        .into_iter()
        .filter(|case| arguments.group.is_none_or(|group| case.group == group))
        .collect();
    let run = |case: &Case, program: &_| run(case, program, arguments.terms);
    (arguments.ledger).keep("hidden-terms", wanted, run, tell, |rows: &[Row]| {
        table(rows)
    })
}

/// A progress line.
fn tell(row: &Row) {
    let mark = match (row.is_right(), row.has_place_in_set()) {
        (true, _) => "ok   ",
        (false, true) => "place",
        (false, false) => "MISS ",
    };
    let over = |over: Option<f64>| over.map_or("-".to_owned(), |over| format!("{over:.2}"));
    let share = |share: Option<f64>| share.map_or("-".to_owned(), |s| format!("{:.0}", 100.0 * s));
    eprintln!(
        "{mark} {}: {} | {} -> {} -> {} x noise | explained % {} {} true {} | {:.0} + {:.0} s",
        row.key,
        row.said(),
        over(row.given_over_floor),
        over(row.base_over_floor),
        over(row.over_floor),
        share(row.curve_taken),
        share(row.formula_taken),
        share(row.truly_taken),
        row.identify.wall_s,
        row.discover.wall_s,
    );
}
