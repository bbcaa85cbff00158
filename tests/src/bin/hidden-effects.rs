//! Runs the hidden-effects campaign and prints its tables as Markdown.

use clap::Parser;
use scenarios::campaign::{Case, Given, Group, Ledger, Row, Sizes, calibration, cases, run, table};

/// The diagnosis on rigs that hide something.
///
/// The result of each rig is one line of a file. A stopped campaign continues there, and parts of it can run one
/// after the other. Results belong to one version of the program: use a new file for a new version.
#[derive(Debug, Parser)]
#[command(name = "hidden-effects", args_override_self = true)]
struct Arguments {
    #[command(flatten)]
    ledger: Ledger,
    /// Rigs for each effect and each family.
    #[arg(long, default_value_t = 1)]
    draws: u64,
    /// Rigs for each effect with an altered equation.
    #[arg(long, default_value_t = 1)]
    altered: u64,
    /// Rigs without an effect, over all families, noises and nuisances.
    #[arg(long, default_value_t = 24)]
    nulls: u64,
    /// Rigs with two effects.
    #[arg(long, default_value_t = 8)]
    pairs: u64,
    /// Rigs for each fault outside the catalogue.
    #[arg(long, default_value_t = 1)]
    outside: u64,
    /// Rigs that are recorded in five units each.
    #[arg(long, default_value_t = 2)]
    units: u64,
    /// Rigs for each effect at its detectable size.
    #[arg(long, default_value_t = 0)]
    power: u64,
    /// Multiple of the detectable size.
    #[arg(long, default_value_t = 1.0)]
    power_times: f64,
    /// Prints error rates, coverage and power instead of the tables of findings.
    #[arg(long)]
    calibration: bool,
    /// Given model: default (from `identify`), lean, truth, guess, bad-delays.
    #[arg(long, default_value = "default", value_parser = given)]
    given: Given,
    /// Only this group: single, altered, nothing, pair, outside, units, power.
    #[arg(long, value_parser = group)]
    group: Option<Group>,
}

fn given(word: &str) -> Result<Given, String> {
    Given::of(word)
        .ok_or_else(|| "one of default, lean, truth, guess, bad-delays is needed".to_owned())
}

fn group(word: &str) -> Result<Group, String> {
    let found = Group::ALL.into_iter().find(|group| group.word() == word);
    found.ok_or_else(|| {
        "one of single, altered, nothing, pair, outside, units, power is needed".to_owned()
    })
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let sizes = Sizes {
        draws: arguments.draws,
        altered: arguments.altered,
        nulls: arguments.nulls,
        pairs: arguments.pairs,
        outside: arguments.outside,
        units: arguments.units,
        power: arguments.power,
        power_times: arguments.power_times,
    };
    let wanted: Vec<Case> = cases(&sizes, arguments.given, arguments.ledger.seed)
        .into_iter()
        .filter(|case| arguments.group.is_none_or(|group| case.group == group))
        .collect();
    let told = |rows: &[Row]| match arguments.calibration {
        true => calibration(arguments.ledger.seed, rows),
        false => table(rows),
    };
    (arguments.ledger).keep("hidden-effects", wanted, run, tell, told)
}

/// A progress line.
fn tell(row: &Row) {
    let mark = match (row.is_found(), row.is_right()) {
        (true, true) => "ok   ",
        (true, false) => "extra",
        (false, _) => "MISS ",
    };
    let over = |over: Option<f64>| over.map_or("-".to_owned(), |over| format!("{over:.2}"));
    let parameters: Vec<String> = (row.parameters.iter())
        .map(|p| format!("{} {:.4} -> {:.4}", p.name, p.truth, p.found))
        .collect();
    eprintln!(
        "{mark} {}: {} | {} -> {} x noise, {:.0} + {:.0} s | {}",
        row.key,
        row.said(),
        over(row.given_over_floor),
        over(row.over_floor),
        row.identify.wall_s,
        row.diagnose.wall_s,
        parameters.join(", ")
    );
}
